"""Stray Scanner's odometry.csv and camera_matrix.csv, as its app writes them (strayrobots/scanner, page on the format).

The first line names the columns. Recent versions add intrinsics of each picture; the first ones had neither time nor
frame. Poses are world_from_camera with OpenCV axes: the app turns ARKit's about x (OdometryEncoder.swift).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import opened
from scenewright.stages.kit.formats.stamps import exact_stamps
from scenewright.stages.kit.formats.trajectories import read_text, transform_from_numbers

POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
INTRINSICS = ("fx", "fy", "cx", "cy")
HEADER = 4096
"""Bytes within which the first line ends."""


@dataclass(frozen=True)
class Odometry:
    """One row: where the camera was when a picture was taken."""

    frame: int
    stamp: int | None
    """[ns], None where the file has no times."""
    pose: np.ndarray | None
    """(4, 4) world_from_camera."""
    problem: str | None
    intrinsics: tuple[float, ...] | None
    """fx fy cx cy, where the file states them."""


def read_odometry(path: Path) -> tuple[list[Odometry], tuple[str, ...]]:
    """Return the rows, and a line on those that are damaged. Raises BadInput for a file of another kind."""
    lines = [line for line in read_text(path).splitlines() if line.strip()]
    names = [field.strip() for field in lines[0].split(",")] if lines else []
    absent = [name for name in POSE if name not in names]
    if absent:
        raise BadInput(
            f"{path}: its first line names no column {', '.join(absent)}", hint=f"columns are {', '.join(POSE)}"
        )
    if len(set(names) - {""}) < len([name for name in names if name]):
        raise BadInput(f"{path}: its first line names a column twice")
    rows: list[Odometry] = []
    damaged: list[int] = []
    for number, line in enumerate(lines[1:], start=2):
        fields = dict(zip(names, (field.strip() for field in line.split(",")), strict=False))
        row = _row(fields, len(rows), f"{path}: line {number}")
        damaged += [number] if row is None else []
        rows += [] if row is None else [row]
    if not rows:
        raise BadInput(f"{path}: has no poses", hint="the recording holds none: copy it off the phone again")
    if "timestamp" in names:
        texts = [line.split(",")[names.index("timestamp")].strip() for line in lines[1:]]
        kept = [k for k in range(len(texts)) if k + 2 not in damaged]
        column = exact_stamps([texts[k] for k in kept], [f"{path}: line {k + 2}" for k in kept])
        rows = [
            Odometry(row.frame, stamp, row.pose, row.problem, row.intrinsics)
            for row, stamp in zip(rows, column.stamps, strict=True)
        ]
    listed = f"line {damaged[0]}" if len(damaged) == 1 else f"{len(damaged)} lines"
    return rows, ((f"{path.name}: {listed} cannot be read",) if damaged else ())


def read_camera_matrix(path: Path) -> tuple[float, float, float, float]:
    """Return fx fy cx cy of the full picture. Raises BadInput."""
    try:
        numbers = [float(field) for field in read_text(path).replace(",", " ").split()]
    except ValueError:
        raise BadInput(f"{path}: holds a value that is not a number") from None
    if len(numbers) != 9 or numbers[6:] != [0, 0, 1]:
        raise BadInput(f"{path}: is not a 3x3 camera matrix", hint="three lines of three numbers, the last 0, 0, 1")
    return numbers[0], numbers[4], numbers[2], numbers[5]


def has_intrinsics(path: Path) -> bool:
    """Whether the first line names poses and intrinsics."""
    with opened(path) as file:
        names = {field.strip() for field in file.readline(HEADER).decode("utf-8", "replace").split(",")}
    return names.issuperset((*POSE, *INTRINSICS))


def usual_intrinsics(rows: list[Odometry]) -> tuple[float, ...]:
    """Return those of the first row that has them, zeros where none has."""
    return next((row.intrinsics for row in rows if row.intrinsics is not None), (0.0, 0.0, 0.0, 0.0))


def _row(fields: dict[str, str], index: int, where: str) -> Odometry | None:
    """Return a row, None where a number of it is missing, as in a line that was cut. Without a column `frame` rows are
    counted."""
    try:
        numbers = np.array([float(fields[name]) for name in POSE])
        frame = int(fields["frame"]) if "frame" in fields else index
        stamp = fields.get("timestamp", "0")
        float(stamp)
        present = all(fields.get(name) for name in INTRINSICS)
        intrinsics = tuple(float(fields[name]) for name in INTRINSICS) if present else None
    except (KeyError, ValueError):
        return None
    if not 0 <= frame < 10**9:
        return None
    if not np.isfinite(numbers).all():
        return Odometry(frame, None, None, "non_finite_pose", intrinsics)
    try:
        return Odometry(frame, None, transform_from_numbers(numbers, where), None, intrinsics)
    except BadInput:
        return Odometry(frame, None, None, "non_rigid_pose", intrinsics)
