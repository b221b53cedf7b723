"""ScanNet's exported frames: color/, depth/ (mm), pose/ (4x4 camera-to-world), intrinsic/ or _info.txt.

Depth is smaller than colour and has intrinsics of its own. Frames are those of the depth camera; colour is resampled
into it. A `.sens` container is refused: the data set's own exporter writes this layout.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest.color_registration import registered_loader
from scenewright.stages.ingest.folders.files import (
    COLOR_SUFFIXES,
    DEPTH_SUFFIXES,
    color_image_size,
    depth_form,
    depth_image_size,
    file_bytes,
    images_by_number,
    overridden,
    pinhole,
    resized_camera,
    stream,
    text_stream,
)
from scenewright.stages.ingest.images import DepthForm, usable_color, usable_depth
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.source import Entry, FrameFiles, LoadedFrame, LogSource, SourceCamera, Unusable
from scenewright.stages.kit.formats.trajectories import read_matrix, read_text

INTRINSIC_FILES = ("intrinsic/intrinsic_depth.txt", "intrinsic_depth.txt")
INFO = "_info.txt"
AGAIN = "export the intrinsics with the SensReader"
INFO_LINE = re.compile(r"\s*(m_\w+)\s*=\s*(.*\S)")


@dataclass(frozen=True)
class _Calibration:
    depth: Camera
    color: Camera
    units_per_metre: float
    identity: bool
    """Whether colour and depth camera stand at one place, as the files say."""
    notes: tuple[str, ...]


def matches(path: Path) -> str | None:
    """Return the rule that matched, or None."""
    if path.is_file():
        return "file with the ending .sens: ScanNet container" if path.suffix.lower() == ".sens" else None
    if all((path / name).is_dir() for name in ("depth", "pose")):
        intrinsics = next((name for name in (*INTRINSIC_FILES, INFO) if (path / name).is_file()), None)
        if intrinsics or (path / "intrinsic").is_dir():
            color_folder = "color/, " if (path / "color").is_dir() else ""
            return f"folder with {color_folder}depth/, pose/ and {intrinsics or 'intrinsic/'}: ScanNet export"
    if any(path.glob("*.sens")) and not (path / "depth").is_dir():
        return "folder with a .sens file: ScanNet container"
    return None


def open_source(path: Path, parameters: IngestParameters, rule: str) -> LogSource:
    """List the frames of a ScanNet export. Raises BadInput for a .sens container and for damaged intrinsics."""
    if not (path / "depth").is_dir():
        raise BadInput(
            f"{path}: ScanNet's .sens containers are not read",
            hint="export color/, depth/, pose/ and intrinsic/ with the data set's SensReader, then give that folder",
        )
    colors = images_by_number(path / "color", COLOR_SUFFIXES) if (path / "color").is_dir() else {}
    depths = images_by_number(path / "depth", DEPTH_SUFFIXES)
    poses = images_by_number(path / "pose", (".txt",))
    calibration = _calibration(path, depth_image_size(depths.values()), color_image_size(colors.values()))
    camera, notes_of_options = overridden(calibration.depth, parameters)
    form, unit_note = depth_form(parameters, calibration.units_per_metre)
    kept = calibration.color if colors and calibration.identity and calibration.color.width > camera.width else None
    entries = []
    for number in sorted(colors.keys() | depths.keys()):
        pose, problem = _pose(poses.get(number))
        color_camera = calibration.color if colors else None
        load = _loader(colors.get(number), depths.get(number), color_camera, camera, form)
        if color_camera is not None and calibration.color != camera:
            load = registered_loader(load, camera, calibration.color, np.eye(4), keep=kept is not None)
        files = FrameFiles(colors.get(number), depths.get(number))
        entries.append(Entry(f"frame {number}", number / parameters.frame_rate, pose, load, problem, files=files))
    stray = len(poses.keys() - colors.keys() - depths.keys())
    notes = (
        *calibration.notes,
        *notes_of_options,
        unit_note,
        f"times assumed: frame number / {parameters.frame_rate:g} per second",
        *((f"{stray} poses belong to no image",) if stray else ()),
    )
    streams = (
        *((stream("color", "color", colors.values()),) if colors else ()),
        stream("depth", "depth", depths.values()),
        text_stream("pose", "pose", len(poses)),
    )
    cameras = (SourceCamera("camera", camera, registered=calibration.identity, picture=kept),)
    return LogSource("scannet", rule, cameras, tuple(entries), notes, streams=streams)


def _loader(
    color: Path | None, depth: Path | None, color_camera: Camera | None, depth_camera: Camera, form: DepthForm
) -> Callable[[], LoadedFrame]:
    """Return a function that reads a frame's images; without a colour camera the log has no colour."""

    def load() -> LoadedFrame:
        if color is None and color_camera is not None:
            raise Unusable("missing_color")
        if depth is None:
            raise Unusable("missing_depth")
        return LoadedFrame(
            None if color is None or color_camera is None else usable_color(file_bytes(color, "color"), color_camera),
            usable_depth(file_bytes(depth, "depth"), depth_camera, form),
        )

    return load


def _pose(path: Path | None) -> tuple[np.ndarray | None, str | None]:
    if path is None:
        return None, None
    try:
        return read_matrix(path), None
    except BadInput:
        return None, "unreadable_pose"


def _calibration(root: Path, depth_size: tuple[int, int] | None, color_size: tuple[int, int] | None) -> _Calibration:
    """Return both cameras, scaled to their images."""
    source = next((root / name for name in INTRINSIC_FILES if (root / name).is_file()), None)
    units, where = 1000.0, root / INFO
    if source is not None:
        where, folder = source, source.parent
        matrices = {
            "depth": read_matrix(source),
            "color": _matrix_of(folder / "intrinsic_color.txt", read_matrix(source)),
        }
        extrinsics = [_matrix_of(folder / f"extrinsic_{name}.txt", np.eye(4)) for name in ("color", "depth")]
        # Without a file for colour its intrinsics are those of depth, in a picture of the same shape.
        sizes = {"depth": None, "color": None if (folder / "intrinsic_color.txt").is_file() else depth_size}
    elif where.is_file():
        fields = _info(where)
        matrices = {
            name: _info_matrix(fields, f"m_calibration{name.title()}Intrinsic", where) for name in ("depth", "color")
        }
        extrinsics = [_info_matrix(fields, f"m_calibration{name}Extrinsic", where) for name in ("Color", "Depth")]
        units = _info_number(fields, "m_depthShift", where)
        sizes = {name: _info_size(fields, name, where) for name in ("depth", "color")}
    else:
        raise BadInput(f"{root}: there is no {INTRINSIC_FILES[0]} and no {INFO}", hint=AGAIN)
    cameras = {}
    for name, size in (("depth", depth_size), ("color", color_size)):
        matrix = matrices[name]
        numbers = (matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2])
        stated = pinhole(numbers, sizes[name], f"{where}: {name}")
        cameras[name] = resized_camera(stated, size, f"{where}: {name}")
    identity = all(np.isfinite(matrix).all() and np.allclose(matrix, np.eye(4), atol=1e-6) for matrix in extrinsics)
    notes = [f"intrinsics read from {where.relative_to(root)}"]
    if color_size is not None and cameras["color"] != cameras["depth"]:
        notes.append(
            f"colour {cameras['color'].width}x{cameras['color'].height} resampled into the depth camera "
            f"{cameras['depth'].width}x{cameras['depth'].height}"
        )
    if not identity:
        notes.append(
            "WARNING: the extrinsics of colour and depth are no identity, and which way they map is not documented; "
            "they are not used, so colour is shifted against depth"
        )
    return _Calibration(cameras["depth"], cameras["color"], units, identity, tuple(notes))


def _matrix_of(path: Path, default: np.ndarray) -> np.ndarray:
    return read_matrix(path) if path.is_file() else default


def _info(path: Path) -> dict[str, str]:
    matches = (INFO_LINE.match(line) for line in read_text(path).splitlines())
    return {match[1]: match[2] for match in matches if match}


def _info_numbers(fields: dict[str, str], name: str, path: Path, count: int) -> np.ndarray:
    try:
        numbers = np.array([float(field) for field in fields[name].split()])
    except (KeyError, ValueError):
        raise BadInput(f"{path}: {name} is missing or no number", hint=AGAIN) from None
    if len(numbers) != count:
        raise BadInput(f"{path}: {name} has {len(numbers)} numbers, expected {count}", hint=AGAIN)
    return numbers


def _info_matrix(fields: dict[str, str], name: str, path: Path) -> np.ndarray:
    return _info_numbers(fields, name, path, 16).reshape(4, 4)


def _info_number(fields: dict[str, str], name: str, path: Path) -> float:
    number = float(_info_numbers(fields, name, path, 1)[0])
    if not 0 < number < 1e9:
        raise BadInput(f"{path}: {name} = {number:g} is no depth unit", hint=AGAIN)
    return number


def _info_size(fields: dict[str, str], name: str, path: Path) -> tuple[int, int] | None:
    names = (f"m_{name}Width", f"m_{name}Height")
    if not all(field in fields for field in names):
        return None
    width, height = (float(_info_numbers(fields, field, path, 1)[0]) for field in names)
    if not (1 <= width <= 1e5 and 1 <= height <= 1e5):
        raise BadInput(f"{path}: images of {width:g}x{height:g} pixels", hint=AGAIN)
    return round(width), round(height)
