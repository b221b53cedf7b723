"""Polycam's raw export: key frames whose names are times [us], with a JSON file of intrinsics and pose for each, depth
(mm) and confidence (0, 127, 255). Poses are ARKit's, row by row (PolyCam/polyform, README).

The app corrects pictures and cameras of recordings up to some hundred key frames: lens undone, loops closed.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.folders.files import (
    COLOR_SUFFIXES,
    color_image_size,
    depth_image_size,
    file_bytes,
    images_of_subfolder,
    natural_key,
    raw_depth,
    stream,
)
from scenewright.stages.ingest.folders.frame_loading import FrameReads, Size
from scenewright.stages.ingest.folders.phone_frames import (
    GRAVITY_ALIGNED,
    OPENGL_FROM_OPENCV,
    PhoneFrame,
    PhoneLog,
    json_object,
    level_image,
    numbers_of,
    phone_source,
)
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.source import FrameFiles, LogSource

LEVELS = {0: 0, 1: 1, 2: 2, 127: 1, 128: 1, 255: 2}
"""Value of a confidence picture -> level; the app writes 0, 127 and 255."""
CORRECTED, ORIGINAL = ("corrected_images", "corrected_cameras"), ("images", "cameras")
LARGEST_SIZE = 100_000
"""Largest width or height [px]; a bound against damaged files."""


def matches(path: Path) -> str | None:
    """Return the rule that matched, or None."""
    root = _root(path)
    return None if root is None else "folder with key frames and a JSON file for each: Polycam"


def _root(path: Path) -> Path | None:
    """Return the folder of the key frames: `path`, or `keyframes` in it."""
    for root in (path / "keyframes", path):
        for _, cameras in (CORRECTED, ORIGINAL):
            first = min((root / cameras).glob("*.json"), default=None)
            if first is not None and "t_00" in json_object(first):
                return root
    return None


def open_source(path: Path, parameters: IngestParameters, rule: str) -> LogSource:
    """List the key frames. Raises BadInput where none has intrinsics."""
    root = _root(path)
    assert root is not None
    corrected = all((root / name).is_dir() and any((root / name).iterdir()) for name in CORRECTED)
    image_folder, camera_folder = CORRECTED if corrected else ORIGINAL
    colors = _images(root / image_folder, COLOR_SUFFIXES)
    depths, levels = _images(root / "depth", (".png",)), _images(root / "confidence", (".png",))
    cameras = {file.stem: json_object(file) for file in sorted((root / camera_folder).glob("*.json"))}
    stated = {stem: camera for stem, camera in cameras.items() if _intrinsics(camera) is not None}
    if not stated:
        raise BadInput(f"{root / camera_folder}: no file states fx, fy, cx, cy", hint="export the raw data again")
    names = sorted({*colors, *cameras, *_images(root / "images", COLOR_SUFFIXES)}, key=natural_key)
    timed = all(name.isdecimal() and len(name) < 19 for name in names)
    full_size = _full_size(next(iter(stated.values())), root / camera_folder)
    frames = []
    for index, name in enumerate(names):
        camera = cameras.get(name, {})
        intrinsics = _intrinsics(camera)
        pose, problem = _pose(camera)
        stamp = int(name) * 1000 if timed else None
        color, depth, level = colors.get(name), depths.get(name), levels.get(name)
        frames.append(
            PhoneFrame(
                name=name,
                time=index / parameters.frame_rate if stamp is None else stamp * 1e-9,
                intrinsics=_intrinsics(next(iter(stated.values()))) or () if intrinsics is None else intrinsics,
                pose=pose,
                reads=FrameReads(
                    None if color is None else partial(file_bytes, color, "color"),
                    None if depth is None else partial(raw_depth, depth),
                    None if level is None else partial(level_image, level, LEVELS),
                ),
                problem=problem if camera else "missing_pose",
                files=FrameFiles(color, depth),
                stamp=stamp,
            )
        )
    log = PhoneLog(
        where=str(root),
        frames=frames,
        full_size=full_size,
        picture_size=color_image_size(colors.values(), full_size),
        depth_size=depth_image_size(depths.values()),
        units_per_metre=1000.0,
        notes=(
            f"intrinsics read from {camera_folder}/*.json",
            *_correction_notes(root, corrected, len(names) - len(cameras)),
            "times from the names [us]" if timed else f"times assumed: order / {parameters.frame_rate:g} per second",
        ),
        streams=(
            stream(image_folder, "color", colors.values()),
            *((stream("depth", "depth", depths.values()),) if depths else ()),
            *((stream("confidence", "other", levels.values()),) if levels else ()),
            stream(camera_folder, "pose", sorted((root / camera_folder).glob("*.json"))),
        ),
        up_in_log=GRAVITY_ALIGNED,
    )
    return phone_source("polycam", rule, log, parameters)


def _images(folder: Path, suffixes: tuple[str, ...]) -> dict[str, Path]:
    return images_of_subfolder(folder if folder.is_dir() else None, suffixes)


def _intrinsics(camera: dict[str, Any]) -> tuple[float, ...] | None:
    return numbers_of([camera.get(name) for name in ("fx", "fy", "cx", "cy")], 4)


def _pose(camera: dict[str, Any]) -> tuple[np.ndarray | None, str | None]:
    numbers = numbers_of([camera.get(f"t_{row}{column}") for row in range(3) for column in range(4)], 12)
    if numbers is None:
        return None, "unreadable_pose"
    return np.vstack([np.reshape(numbers, (3, 4)), [0, 0, 0, 1]]) @ OPENGL_FROM_OPENCV, None


def _full_size(camera: dict[str, Any], where: Path) -> Size:
    size = numbers_of([camera.get("width"), camera.get("height")], 2)
    if size is None or not all(1 <= value <= LARGEST_SIZE for value in size):
        raise BadInput(f"{where}: width and height state no size", hint="export the raw data again")
    return round(size[0]), round(size[1])


def _correction_notes(root: Path, corrected: bool, without: int) -> tuple[str, ...]:
    if not corrected:
        return (
            "WARNING: images/ and cameras/ are taken, as the app has not corrected them: their lens is not undone and "
            "their path drifts (open the scan in the app, process it with loop closure, export it again)",
        )
    other = " in the place of images/ and cameras/" if (root / "images").is_dir() else ""
    lost = (f"{without} key frames have no corrected camera and are left out",) if without else ()
    return (f"corrected_images/ and corrected_cameras/ are taken{other}", *lost)
