"""nerfstudio's transforms.json: OpenGL cameras (y up, z back), camera-to-world, intrinsics for all or for each frame.

Pixel coordinates in the file put the centre of the first pixel at (0.5, 0.5); ours are half a pixel less.
`applied_transform` and `applied_scale` (saved = scale * transform * original) are undone, so that poses are in the
world and the unit of the original data again. Folders of the Replica rendering (traj.txt, results/) are in replica.py.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import opened
from scenewright.stages.ingest.folders.camera_groups import grouped
from scenewright.stages.ingest.folders.exr_depth import require_exr
from scenewright.stages.ingest.folders.files import (
    COLOR_SUFFIXES,
    all_intrinsics_given,
    chosen_cameras,
    color_image_size,
    depth_form,
    depth_image_size,
    named_file,
    natural_key,
    pinhole,
    read_json,
    stream,
    text_stream,
)
from scenewright.stages.ingest.folders.frame_loading import FrameFormat, frame_loader, kept_pictures, picture_camera
from scenewright.stages.ingest.folders.undistortion import PINHOLE, Lens, RecordedCamera, lens_of, overridden_recording
from scenewright.stages.ingest.layouts.nerfstudio import replica
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.source import Entry, FrameFiles, LogSource, SourceCamera
from scenewright.stages.kit.formats.stamps import exact_stamps
from scenewright.stages.kit.geometry.transforms import inverse, is_rigid

NAMES = ("transforms.json", "transforms_train.json")
OPENGL_FROM_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])
"""Turns the camera axes of OpenCV into those of OpenGL: y and z change sign."""
DEFAULT_UNIT = 0.001
"""Metres per unit of depth when the file does not say: millimetres."""
UNIT_KEYS = ("depth_unit_scale_factor", "integer_depth_scale")
"""Metres per unit: nerfstudio's word, and that of instant-ngp and NeRFCapture, who call the file `depth_path`."""
PERSPECTIVE = ("OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "PERSPECTIVE", "SIMPLE_RADIAL", "RADIAL")
LARGEST_SIZE = 100_000
"""Largest width or height of a camera [px]; a bound against damaged files."""


@dataclass(frozen=True)
class _Frame:
    where: str
    name: str
    color: Path | None
    depth: Path | None
    pose: np.ndarray | None
    problem: str | None
    time: float | None
    """`timestamp` of the frame [s], which our own exports have; in any unit until all frames are known."""
    fields: dict[str, Any]
    """Intrinsics of the frame over those of the file."""


@dataclass(frozen=True)
class _Stated:
    """Intrinsics as a frame states them, for images of `size`."""

    size: tuple[int, int] | None
    focal_x: float | None
    focal_y: float | None
    center_x: float | None
    center_y: float | None
    angle: float | None
    """Horizontal field of view [rad]."""
    lens: Lens


def matches(path: Path) -> str | None:
    """Return the rule that matched, or None."""
    file = _transforms(path)
    if file is not None:
        return f"{'file' if path.is_file() else f'folder with {file.name}'}: nerfstudio transforms"
    return replica.matches(path)


def open_source(path: Path, parameters: IngestParameters, rule: str) -> LogSource:
    """List the frames of a transforms.json. Raises BadInput for what is none, names outside of its folder, cameras
    that cannot be undistorted."""
    file = _transforms(path)
    if file is None:
        return replica.open_source(path, parameters, rule)
    document = read_json(file)
    if not isinstance(document, dict) or not isinstance(document.get("frames"), list):
        raise BadInput(f"{file}: has no list of frames")
    frames = sorted(_frames(document, file), key=lambda frame: natural_key(frame.name))
    stamped = all(frame.time is not None for frame in frames)
    column = None
    if stamped:
        column = exact_stamps([repr(frame.time) for frame in frames], [frame.where for frame in frames])
        timed = zip(frames, column.stamps, strict=True)
        frames = [replace(frame, time=(stamp or 0) * 1e-9) for frame, stamp in timed]
        frames.sort(key=lambda frame: frame.time or 0.0)
    has_depth = any(frame.depth is not None for frame in frames)
    has_color = not has_depth or any(frame.color is not None and frame.color.is_file() for frame in frames)
    require_exr(frame.depth.name for frame in frames if frame.depth is not None)
    unit_key = next((key for key in UNIT_KEYS if key in document), UNIT_KEYS[0])
    default_unit = _number(document, unit_key, str(file), DEFAULT_UNIT)
    if not default_unit > 0:
        raise BadInput(f"{file}: {unit_key} {default_unit:g} is not positive")
    unstated = [] if unit_key in document else [frame.depth for frame in frames]
    stored, unit_note = depth_form(parameters, 1 / default_unit, unstated)
    recorded, notes_of_options = _recorded_cameras(frames, has_depth, parameters)
    groups, group_notes = grouped(recorded, _labels(frames, recorded))
    counts = {group.name: len(group.members) for group in groups}
    chosen = chosen_cameras(counts, parameters, str(file)) if counts else ()
    world, world_notes = _world_from_saved(document, file, has_depth)
    group_of = {index: group for group in groups for index in group.members}
    pictures = {
        group.name: kept_pictures((frames[k].color for k in group.members), group.camera) if has_depth else None
        for group in groups
    }
    entries = []
    for index, frame in enumerate(frames):
        group = group_of[index]
        if group.name not in chosen:
            continue
        form = FrameFormat(recorded[index], group.camera, has_color, has_depth, stored, pictures[group.name])
        files = FrameFiles(frame.color, frame.depth)
        pose = None if frame.pose is None else world(frame.pose)
        time = index / parameters.frame_rate if frame.time is None or not stamped else frame.time
        stamp = None if frame.time is None else round(frame.time * 1e9)
        entries.append(
            Entry(frame.name, time, pose, frame_loader(files, form), frame.problem, group.name, files, stamp)
        )
    cameras = [
        SourceCamera(group.name, group.camera, picture=picture_camera(group.camera, pictures[group.name]))
        for group in groups
        if group.name in chosen
    ]
    if not cameras:
        raise BadInput(f"{file}: has no frames")
    lenses = sorted({recording.lens.words for recording in recorded if not recording.lens.is_pinhole})
    notes = (
        f"intrinsics read from {file.name}",
        *notes_of_options,
        *group_notes,
        *(
            (f"lens distortion undone ({lenses[0] if len(lenses) == 1 else f'{len(lenses)} lenses'})",)
            if lenses
            else ()
        ),
        *((unit_note,) if has_depth else ()),
        *world_notes,
        f"times from timestamp{f', {column.note}' if column.note else ''}"
        if column is not None
        else f"times assumed: order of the names / {parameters.frame_rate:g} per second",
    )
    stamps = np.array([round((frame.time or 0.0) * 1e9) for frame in frames if stamped], np.int64)
    streams = []
    if has_color:
        streams.append(stream("file_path", "color", [frame.color for frame in frames if frame.color], stamps))
    if has_depth:
        streams.append(stream("depth_file_path", "depth", [frame.depth for frame in frames if frame.depth]))
    streams.append(text_stream("transform_matrix", "pose", sum(frame.pose is not None for frame in frames)))
    others = tuple(name for name in counts if name not in chosen)
    return LogSource(
        "nerfstudio", rule, tuple(cameras), tuple(entries), notes, streams=tuple(streams), other_cameras=others
    )


def _transforms(path: Path) -> Path | None:
    if path.is_dir():
        return next((path / name for name in NAMES if (path / name).is_file()), None)
    if path.suffix.lower() == ".json" and path.is_file():
        with opened(path) as file:
            start = file.read(1_000_000)
        return path if b'"frames"' in start and b'"transform_matrix"' in start else None
    return None


def _frames(document: dict[str, Any], file: Path) -> list[_Frame]:
    root, frames = file.parent, []
    shared = {key: value for key, value in document.items() if key != "frames"}
    for index, fields in enumerate(document["frames"]):
        where = f"{file}: frame {index}"
        if not isinstance(fields, dict):
            raise BadInput(f"{where}: is not an object")
        depth = fields.get("depth_file_path")
        if depth is None and (root / str(fields.get("depth_path"))).is_file():  # NeRFCapture names files it never wrote
            depth = fields["depth_path"]
        named_path = fields.get("file_path")
        color = None if named_path is None and depth is not None else _with_suffix(named_file(root, named_path, where))
        pose, problem = _pose(fields.get("transform_matrix"))
        frames.append(
            _Frame(
                where,
                str(depth if named_path is None else named_path),
                color,
                None if depth is None else named_file(root, depth, where),
                pose,
                problem,
                None if fields.get("timestamp") is None else _number(fields, "timestamp", where, largest=9e18),
                {**shared, **fields},
            )
        )
    return frames


def _with_suffix(path: Path) -> Path:
    """Return the image itself where the file leaves the ending away, as Blender's do."""
    if path.suffix.lower() in COLOR_SUFFIXES:
        return path
    candidates = (path.with_name(path.name + suffix) for suffix in COLOR_SUFFIXES)
    return next((candidate for candidate in candidates if candidate.is_file()), path)


def _pose(value: Any) -> tuple[np.ndarray | None, str | None]:
    try:
        matrix = np.array(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        return None, "unreadable_pose"
    if matrix.shape == (3, 4):
        matrix = np.vstack([matrix, [0, 0, 0, 1]])
    return (matrix, None) if matrix.shape == (4, 4) else (None, "unreadable_pose")


def _number(fields: dict[str, Any], name: str, where: str, default: float | None = None, largest: float = 1e9) -> float:
    value = fields.get(name, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= largest:
        raise BadInput(f"{where}: {name} = {value!r:.40} is not a number")
    return float(value)


def _recorded_cameras(
    frames: list[_Frame], has_depth: bool, parameters: IngestParameters
) -> tuple[list[RecordedCamera], tuple[str, ...]]:
    """Return each frame's camera at the size of its images. Sizes are looked up once for each kind of intrinsics."""
    alike: dict[_Stated, list[_Frame]] = {}
    stated = [_read_stated(frame) for frame in frames]
    for stated_camera, frame in zip(stated, frames, strict=True):
        alike.setdefault(stated_camera, []).append(frame)
    recorded: dict[_Stated, RecordedCamera] = {}
    notes: tuple[str, ...] = ()
    for stated_camera, same in alike.items():
        where = same[0].where
        color_size = (
            color_image_size((frame.color for frame in same if frame.color), stated_camera.size or (0, 0))
            if stated_camera.size is None or not has_depth
            else None
        )
        depth_size = depth_image_size(frame.depth for frame in same if frame.depth is not None) if has_depth else None
        camera = _camera(
            stated_camera, stated_camera.size or color_size or depth_size, all_intrinsics_given(parameters), where
        )
        recorded[stated_camera], notes = overridden_recording(camera.at(depth_size or color_size, where), parameters)
    return [recorded[stated_camera] for stated_camera in stated], notes


def _read_stated(frame: _Frame) -> _Stated:
    fields, where = frame.fields, frame.where

    def optional(name: str) -> float | None:
        return None if fields.get(name) is None else _number(fields, name, where)

    size = None
    if fields.get("w") is not None and fields.get("h") is not None:
        width, height = _number(fields, "w", where), _number(fields, "h", where)
        if not (1 <= width <= LARGEST_SIZE and 1 <= height <= LARGEST_SIZE):
            raise BadInput(f"{where}: images of {width:g}x{height:g} pixels")
        size = (round(width), round(height))
    return _Stated(
        size,
        optional("fl_x"),
        optional("fl_y"),
        optional("cx"),
        optional("cy"),
        optional("camera_angle_x"),
        _lens(fields, where),
    )


def _camera(stated: _Stated, size: tuple[int, int] | None, replaced: bool, where: str) -> RecordedCamera:
    """Return the camera of a frame whose intrinsics are for images of `size`, or will be `replaced` by options."""
    width, height = size or (0, 0)
    focal_x, focal_y = stated.focal_x, stated.focal_y
    if focal_x is None and (size is None or replaced):
        focal_x = 1.0  # without any image that can be decoded there will be no frame; the log is described all the same
    if focal_x is None:
        if stated.angle is None or not 0 < stated.angle < math.pi:
            raise BadInput(f"{where}: there is neither fl_x nor a camera_angle_x", hint="give --fx --fy --cx --cy")
        focal_x = 0.5 * width / math.tan(0.5 * stated.angle)
    center_x = width / 2 if stated.center_x is None else stated.center_x
    center_y = height / 2 if stated.center_y is None else stated.center_y
    numbers = (focal_x, focal_x if focal_y is None else focal_y, center_x - 0.5, center_y - 0.5)
    return RecordedCamera(pinhole(numbers, size, where), stated.lens)


def _lens(fields: dict[str, Any], where: str) -> Lens:
    model = fields.get("camera_model", "OPENCV")
    k1, k2, k3, k4, p1, p2 = (_number(fields, name, where, 0.0) for name in ("k1", "k2", "k3", "k4", "p1", "p2"))
    if model == "OPENCV_FISHEYE" or fields.get("is_fisheye") is True:
        return lens_of((k1, k2, k3, k4), where, fisheye=True)
    if model not in PERSPECTIVE:
        raise BadInput(f"{where}: cameras of model {model!r:.40} are not read", hint="undistort the images first")
    lens = lens_of((k1, k2, p1, p2, k3), where)
    return PINHOLE if lens.is_pinhole else lens


def _labels(frames: list[_Frame], recorded: list[RecordedCamera]) -> list[str]:
    """Return the name of each frame's camera: `camera_name`, else the number of its kind in order of appearance."""
    numbers: dict[RecordedCamera, int] = {}
    labels = []
    for frame, recording in zip(frames, recorded, strict=True):
        name = frame.fields.get("camera_name")
        number = numbers.setdefault(recording, len(numbers) + 1)
        labels.append(name if isinstance(name, str) and name else str(number))
    return labels


def _world_from_saved(
    document: dict[str, Any], file: Path, has_depth: bool
) -> tuple[Callable[[np.ndarray], np.ndarray], tuple[str, ...]]:
    """Return a function from a pose in the file to world_from_camera in the original world, and notes."""
    scale = _number(document, "applied_scale", str(file), 1.0)
    if not scale > 0:
        raise BadInput(f"{file}: applied_scale {scale:g} is not positive")
    applied = np.eye(4)
    if document.get("applied_transform") is not None:
        matrix, problem = _pose(document["applied_transform"])
        if matrix is None or not is_rigid(matrix, 1e-2):
            raise BadInput(
                f"{file}: applied_transform is not a rigid transform", hint=problem or "3x4, rotation and shift"
            )
        applied = matrix
    original_from_saved = inverse(applied)
    notes = []
    if not np.array_equal(applied, np.eye(4)):
        notes.append("applied_transform undone: poses are in the world of the original data")
    if scale != 1:
        notes.append(f"applied_scale {scale:g} undone: lengths are those of the original data")
    if not has_depth:
        notes.append("WARNING: scale unknown: without depth nothing says that lengths in transforms.json are metres")

    def world(pose: np.ndarray) -> np.ndarray:
        with np.errstate(invalid="ignore", over="ignore"):  # poses that are not finite are counted later
            metric = pose @ OPENGL_FROM_OPENCV
            metric[:3, 3] /= scale
            return original_from_saved @ metric

    return world, tuple(notes)
