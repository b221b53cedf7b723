"""Readers and writers of camera trajectories: TUM lines, Open3D logs, 4x4 matrices. Garbage raises BadInput."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import file_text
from scenewright.stages.kit.formats.stamps import read_column
from scenewright.stages.kit.geometry.transforms import is_rigid
from scipy.spatial.transform import Rotation

INTEGER = re.compile(r"[+-]?[0-9]{1,18}")
LARGEST_TEXT = 200_000_000
"""Bytes of a text file that are read: trajectories of days stay far below."""
QUATERNION_TOLERANCE = 0.02
"""How far the norm of a quaternion may be from 1: files that print four decimals stay well within."""


def write_tum(path: Path, times: np.ndarray, world_from_camera: np.ndarray) -> None:
    """Write `t tx ty tz qx qy qz qw` lines (TUM RGB-D format; seconds, metres, w >= 0).

    `times` is (N,) and strictly increasing, `world_from_camera` is (N, 4, 4) and rigid. Raises ValueError otherwise.
    """
    times = np.asarray(times, dtype=float).reshape(-1)
    poses = np.asarray(world_from_camera, dtype=float).reshape(-1, 4, 4)
    if len(times) != len(poses):
        raise ValueError(f"{len(times)} times for {len(poses)} poses")
    if not np.isfinite(times).all() or (np.diff(times) <= 0).any():
        raise ValueError("times are not finite and strictly increasing")
    lines = ["# timestamp tx ty tz qx qy qz qw (world_from_camera, seconds, metres)"]
    for time, pose in zip(times, poses, strict=True):
        if not is_rigid(pose):
            raise ValueError(f"pose at {time} s is not rigid")
        quaternion = Rotation.from_matrix(pose[:3, :3]).as_quat(canonical=True)
        numbers = [f"{value:.9f}" for value in pose[:3, 3]] + [f"{value:.12f}" for value in quaternion]
        lines.append(" ".join([f"{time:.9f}", *numbers]))
    Path(path).write_text("\n".join(lines) + "\n", encoding="ascii")


def read_tum(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Read a TUM trajectory: times (N,) [s], strictly increasing, and world_from_camera (N, 4, 4) [m].

    Raises BadInput naming the line for anything but eight finite numbers with a unit quaternion.
    """
    rows = number_rows(path, 8)
    times = np.array([row[0] for _, row in rows])
    poses = [transform_from_numbers(row[1:], f"{path}: line {line}") for line, row in rows]
    endless = np.flatnonzero(~np.isfinite(times))
    if len(endless):
        raise BadInput(f"{path}: line {rows[int(endless[0])][0]}: time is not finite")
    backward = np.flatnonzero(np.diff(times) <= 0)
    if len(backward):
        line = rows[int(backward[0]) + 1][0]
        raise BadInput(
            f"{path}: line {line}: time {times[backward[0] + 1]} s is not after the one before",
            hint="sort the trajectory by time and remove duplicates",
        )
    return times, np.array(poses).reshape(-1, 4, 4)


class StampedRows(NamedTuple):
    """The usable lines of somebody's trajectory."""

    stamps: np.ndarray
    """(N,) int64 [ns], in file order."""
    poses: np.ndarray
    """(N, 4, 4) world_from_camera."""
    notes: tuple[str, ...]
    """Unit of the stamps where it is not seconds, and lines that are no poses."""


def read_stamped_rows(path: Path) -> StampedRows:
    """Read `t tx ty tz qx qy qz qw` lines that nobody vouches for; t in seconds to nanoseconds.

    Lines that are no pose are left out and counted in the notes. Raises BadInput for a wrong number of columns, or what
    is no number.
    """
    stamps, poses, problems = [], [], Counter[str]()
    rows = number_rows(path, 8)
    # Stamps since 1970 do not fit float64 to the nanosecond, so they are taken from the text.
    texts = [line.split(None, 1)[0] for line in read_text(path).splitlines() if line.split("#", 1)[0].split()]
    column = read_column(texts)
    for (line, row), stamp in zip(rows, column.stamps, strict=True):
        if stamp is None:
            problems["no time"] += 1
            continue
        if not np.isfinite(row).all():
            problems["not finite"] += 1
            continue
        try:
            poses.append(transform_from_numbers(row[1:], f"{path}: line {line}"))
        except BadInput:
            problems["quaternion not of length 1"] += 1
            continue
        stamps.append(stamp)
    notes = (f"{path.name}: {column.note}",) if column.note else ()
    if problems:
        listed = ", ".join(f"{reason}: {count}" for reason, count in sorted(problems.items()))
        bad_lines = f"WARNING: {sum(problems.values())} of {len(rows)} lines of {path.name} are not poses ({listed})"
        notes = (*notes, bad_lines)
    return StampedRows(np.array(stamps, np.int64), np.array(poses).reshape(-1, 4, 4), notes)


def transform_from_numbers(numbers: np.ndarray, where: str) -> np.ndarray:
    """Return the (4, 4) transform of `tx ty tz qx qy qz qw` [m]. Raises BadInput, beginning with `where`."""
    quaternion = np.asarray(numbers[3:7], dtype=float)
    norm = float(np.linalg.norm(quaternion))
    if not np.isfinite(numbers).all():
        raise BadInput(f"{where}: pose is not finite")
    if abs(norm - 1) > QUATERNION_TOLERANCE:
        raise BadInput(f"{where}: quaternion has norm {norm:.4g}, expected 1", hint="the order is x y z w")
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_quat(quaternion / norm).as_matrix()
    matrix[:3, 3] = numbers[:3]
    return matrix


def number_rows(path: Path, columns: int) -> list[tuple[int, np.ndarray]]:
    """Return (line number, (columns,) numbers) of every line of a text table; blank lines and # comments are skipped.

    NaN and infinities are read as such. Raises BadInput for a wrong number of columns or what is no number.
    """
    rows = []
    for line, text in enumerate(read_text(path).splitlines(), start=1):
        fields = text.split("#", 1)[0].split()
        if not fields:
            continue
        if len(fields) != columns:
            raise BadInput(f"{path}: line {line}: {len(fields)} columns, expected {columns}")
        rows.append((line, _numbers(fields, f"{path}: line {line}")))
    return rows


def named_rows(path: Path, columns: int) -> list[tuple[int, str, np.ndarray]]:
    """Return (line number, name, (columns - 1,) numbers) of every line of a table whose first column holds names.

    Blank lines and # comments are skipped. Raises BadInput as `number_rows` does.
    """
    rows = []
    for line, text in enumerate(read_text(path).splitlines(), start=1):
        fields = text.split("#", 1)[0].split()
        if fields and len(fields) != columns:
            raise BadInput(f"{path}: line {line}: {len(fields)} columns, expected {columns}")
        if fields:
            rows.append((line, fields[0], _numbers(fields[1:], f"{path}: line {line}")))
    return rows


def read_matrix(path: Path, rows: int = 4, columns: int = 4) -> np.ndarray:
    """Return the (rows, columns) matrix in a text file, whatever the line breaks. Raises BadInput."""
    fields = read_text(path).split()
    if len(fields) != rows * columns:
        raise BadInput(f"{path}: {len(fields)} numbers, expected {rows}x{columns}")
    return _numbers(fields, str(path)).reshape(rows, columns)


def read_open3d_log(path: Path) -> list[np.ndarray]:
    """Return the (4, 4) world_from_camera matrices of an Open3D / Redwood `trajectory.log`, in file order.

    Raises BadInput naming the line.
    """
    return [pose for _, pose in read_numbered_open3d_log(path)]


def read_numbered_open3d_log(path: Path) -> list[tuple[int, np.ndarray]]:
    """Return (first integer of the header, (4, 4) world_from_camera) of the entries of a `trajectory.log`.

    Each entry is a line of three integers followed by four lines of four numbers
    (open3d.io.write_pinhole_camera_trajectory). Raises BadInput naming the line.
    """
    lines = [line for line in read_text(path).splitlines() if line.strip()]
    if len(lines) % 5:
        raise BadInput(f"{path}: {len(lines)} lines, expected a multiple of 5 (header and 4 matrix rows)")
    poses = []
    for start in range(0, len(lines), 5):
        header = lines[start].split()
        if len(header) != 3 or not all(INTEGER.fullmatch(field) for field in header):
            raise BadInput(f"{path}: entry {start // 5}: header {lines[start]!r:.60} is not three integers")
        rows = [line.split() for line in lines[start + 1 : start + 5]]
        if any(len(row) != 4 for row in rows):
            raise BadInput(f"{path}: entry {start // 5}: matrix is not 4x4")
        matrix = _numbers([field for row in rows for field in row], f"{path}: entry {start // 5}").reshape(4, 4)
        poses.append((int(header[0]), matrix))
    return poses


def write_open3d_log(path: Path, world_from_camera: np.ndarray) -> None:
    """Write (N, 4, 4) poses as an Open3D `trajectory.log`."""
    lines = []
    for index, pose in enumerate(np.asarray(world_from_camera, dtype=float).reshape(-1, 4, 4)):
        lines.append(f"{index} {index} {index + 1}")
        lines.extend(" ".join(repr(float(value)) for value in row) for row in pose)
    Path(path).write_text("\n".join(lines) + "\n", encoding="ascii")


def read_text(path: Path) -> str:
    """Return the text of a file. Raises BadInput when it is missing, no text, or larger than LARGEST_TEXT bytes."""
    return file_text(path, LARGEST_TEXT)


def _numbers(fields: list[str], where: str) -> np.ndarray:
    try:
        return np.array([float(field) for field in fields])
    except ValueError:
        bad = next(field for field in fields if not _is_number(field))
        raise BadInput(f"{where}: {bad!r:.40} is not a number") from None


def _is_number(field: str) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return True


def poses_at(times: np.ndarray, pose_times: np.ndarray, poses: np.ndarray, tolerance: float) -> list[np.ndarray | None]:
    """Return for each time (N,) [s] the nearest of poses (M, 4, 4) at pose_times (M,) ascending, or None.

    Poses farther than `tolerance` [s] from a frame do not belong to it; the earlier of two equally near ones is taken.
    """
    result: list[np.ndarray | None] = []
    for time in times:
        index = int(np.searchsorted(pose_times, time))
        around = [k for k in (index - 1, index) if 0 <= k < len(pose_times)]
        nearest = min(around, key=lambda k: abs(pose_times[k] - time), default=None)
        near_enough = nearest is not None and abs(pose_times[nearest] - time) <= tolerance + 1e-9
        result.append(poses[nearest] if near_enough and nearest is not None else None)
    return result
