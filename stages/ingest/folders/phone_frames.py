"""Recordings of phones: depth smaller than the pictures, intrinsics of the full picture, confidence beside depth.

Frames are those of the depth. Intrinsics change a little from picture to picture, as the lens focuses and is held
still: then all are brought to the median ones. ARKit puts the origin of pixels at the centre of the first (ARCamera.h).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.folders.camera_groups import median_camera
from scenewright.stages.ingest.folders.files import depth_form, file_bytes, pinhole, read_json
from scenewright.stages.ingest.folders.frame_loading import (
    FrameFormat,
    FrameReads,
    Size,
    larger,
    loader_of,
    picture_camera,
)
from scenewright.stages.ingest.folders.quarter_turns import (
    WORDS,
    quarters_to_upright,
    turned_camera,
    turned_loader,
    turned_pose,
)
from scenewright.stages.ingest.folders.undistortion import RecordedCamera, overridden_recording
from scenewright.stages.ingest.images import decode_image, same_shape
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.source import Entry, FrameFiles, LogSource, SourceCamera, StreamInfo, Unusable

GRAVITY_ALIGNED = np.array([0.0, 1.0, 0.0])
"""Up in ARKit's world, which it aligns with gravity (ARConfiguration.WorldAlignment.gravity)."""
OPENGL_FROM_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])
"""Turns the camera axes of OpenCV into those of ARKit and OpenGL: y and z change sign."""
CENTERED = 0.1
"""Share of a picture's size within which the principal point of a phone lies from its middle; by eye."""


@dataclass(frozen=True)
class PhoneFrame:
    """One frame as the recorder wrote it."""

    name: str
    time: float
    intrinsics: Sequence[float]
    """fx fy cx cy of the full picture."""
    pose: np.ndarray | None
    """(4, 4) world_from_camera, OpenCV axes."""
    reads: FrameReads
    problem: str | None = None
    files: FrameFiles = FrameFiles()
    stamp: int | None = None


@dataclass(frozen=True)
class PhoneLog:
    """All frames of a recording."""

    where: str
    frames: Sequence[PhoneFrame]
    full_size: Size
    """Of the pictures that the intrinsics are of."""
    picture_size: Size | None
    """Of the pictures as they are stored; None without any."""
    depth_size: Size | None
    units_per_metre: float
    notes: tuple[str, ...]
    streams: tuple[StreamInfo, ...]
    up_in_log: np.ndarray | None = None
    damage: tuple[str, ...] = ()
    missing: dict[str, str] = field(default_factory=dict)
    close: Callable[[], None] = field(default=lambda: None)


def phone_source(name: str, rule: str, log: PhoneLog, parameters: IngestParameters) -> LogSource:
    """Return the recording as a source of the format `name`. Raises BadInput where pictures, depth and intrinsics have
    not one shape."""
    size = log.depth_size or log.picture_size
    _check_shapes(log)
    has_color, has_depth = log.picture_size is not None, log.depth_size is not None
    kinds = {tuple(frame.intrinsics): _recorded(frame.intrinsics, log, size, parameters) for frame in log.frames}
    recorded = [kinds[tuple(frame.intrinsics)] for frame in log.frames]
    if not recorded:
        raise BadInput(f"{log.where}: has no frames", hint="export the recording from the app again")
    cameras = [each.camera for each in recorded]
    camera = cameras[0] if len(set(cameras)) == 1 else median_camera(cameras)
    form, unit_note = depth_form(parameters, log.units_per_metre)
    kept = larger(log.picture_size, size)
    turns = _quarters(log) if parameters.turn else 0
    entries = tuple(
        Entry(
            frame.name,
            frame.time,
            turned_pose(frame.pose, turns),
            turned_loader(load, turns) if turns else load,
            frame.problem or _absence(frame.reads, has_color, has_depth),
            files=frame.files,
            stamp=frame.stamp,
        )
        for frame, own in zip(log.frames, recorded, strict=True)
        for load in (loader_of(frame.reads, FrameFormat(own, camera, has_color, has_depth, form, kept)),)
    )
    notes = [*log.notes, *_intrinsics_notes(parameters, recorded[0])]
    if len(set(cameras)) > 1:
        notes.append(f"{len(set(cameras))} different intrinsics: images are resampled to the median ones")
    if kept is not None:
        notes.append(f"colour brought to the depth's {size_words(size)}; images of {size_words(kept)} are kept")
    if turns:
        notes.append(f"images and depth turned {WORDS[turns]}, so that they stand upright (--no-turn leaves them)")
    with_levels = sum(frame.reads.levels is not None for frame in log.frames)
    if has_depth:
        notes.append(unit_note)
        notes.append(_levels_note(with_levels, len(log.frames)))
    picture = picture_camera(camera, kept)
    full = None if picture is None else turned_camera(picture, turns)
    return LogSource(
        name,
        rule,
        (SourceCamera("camera", turned_camera(camera, turns), picture=full),),
        entries,
        tuple(notes),
        up_in_log=log.up_in_log,
        has_deviation=with_levels > 0,
        damage=log.damage,
        streams=log.streams,
        missing=log.missing,
        close=log.close,
    )


def level_image(path: Path, table: dict[int, int] | None = None) -> np.ndarray:
    """Return the confidence (H, W) uint8 0..2 in a grey picture; `table` says the level of each value it may have.
    Raises Unusable."""
    image = decode_image(file_bytes(path, "confidence"))
    if image is not None and image.ndim == 3:
        image = image[..., 0]  # grey, written as colour
    if image is None or image.dtype != np.uint8:
        raise Unusable("undecodable_confidence", path.name)
    if table is None:
        return image
    levels = np.full(256, 255, np.uint8)
    levels[list(table)] = list(table.values())
    return levels[image]


def json_object(path: Path) -> dict[str, Any]:
    """Return the object in a JSON file, an empty one for what is none: its frame is left out, and counted."""
    try:
        document = read_json(path)
    except BadInput:
        return {}
    return document if isinstance(document, dict) else {}


def numbers_of(values: object, count: int) -> tuple[float, ...] | None:
    """Return `count` finite numbers of a list, flat or of rows, None for anything else."""
    if isinstance(values, list) and values and all(isinstance(row, list) for row in values):
        values = [value for row in values for value in row]
    if not isinstance(values, list) or len(values) != count:
        return None
    plain = all(isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e9 for value in values)
    return tuple(float(value) for value in values) if plain else None


def full_picture_size(intrinsics: Sequence[float], candidates: Sequence[Size | None]) -> Size | None:
    """Return the first size in whose middle the principal point of fx fy cx cy lies, None where it is in none's."""
    for size in candidates:
        if size is not None and all(
            abs(center / extent - 0.5) <= CENTERED for center, extent in zip(intrinsics[2:], size, strict=True)
        ):
            return size
    return None


def size_words(size: Size | None) -> str:
    """Return a size for people."""
    return "no size" if size is None else f"{size[0]}x{size[1]}"


def _quarters(log: PhoneLog) -> int:
    if log.up_in_log is None:
        return 0
    return quarters_to_upright([frame.pose for frame in log.frames if frame.pose is not None], log.up_in_log)


def _recorded(
    intrinsics: Sequence[float], log: PhoneLog, size: Size | None, parameters: IngestParameters
) -> RecordedCamera:
    full = RecordedCamera(pinhole(intrinsics, log.full_size, log.where)).at(size, log.where)
    return overridden_recording(full, parameters)[0]


def _intrinsics_notes(parameters: IngestParameters, recorded: RecordedCamera) -> tuple[str, ...]:
    return overridden_recording(recorded, parameters)[1]


def _absence(reads: FrameReads, has_color: bool, has_depth: bool) -> str | None:
    if has_color and reads.color is None:
        return "missing_color"
    return "missing_depth" if has_depth and reads.depth is None else None


def _levels_note(count: int, frames: int) -> str:
    if not count:
        return "no confidence beside depth: every pixel of depth counts the same"
    some = "" if count == frames else f", of {count} of {frames} frames"
    return f"confidence levels read as a standard deviation of depth{some} (stages/ingest/confidence_levels.py)"


def _check_shapes(log: PhoneLog) -> None:
    """A phone turns pictures, depth and intrinsics together; whoever converts one of them alone turns it alone."""
    for what, size in (("images", log.picture_size), ("depth", log.depth_size)):
        if size is None or same_shape(size, log.full_size):
            continue
        words = f"{log.where}: {what} of {size_words(size)} do not have the shape of {size_words(log.full_size)}"
        if same_shape((size[1], size[0]), log.full_size):
            raise BadInput(
                f"{words}, of which the intrinsics are: they were turned by a quarter",
                hint="give the files as the app wrote them; programs that convert a video turn it",
            )
        raise BadInput(
            f"{words}, of which the intrinsics are, and nothing says what was cut off",
            hint="record with the app's 4:3 setting, in which depth and images are of one shape",
        )
