"""All data of the 3D Scanner App: frame_NNNNN.json (intrinsics and cameraPoseARFrame, row by row), frame_NNNNN.jpg,
depth_NNNNN.png (mm), conf_NNNNN.png (0, 1, 2). Pictures are written more rarely than the rest."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.folders.files import (
    color_image_size,
    depth_image_size,
    file_bytes,
    images_by_number,
    raw_depth,
    stream,
)
from scenewright.stages.ingest.folders.frame_loading import FrameReads, Size
from scenewright.stages.ingest.folders.phone_frames import (
    GRAVITY_ALIGNED,
    OPENGL_FROM_OPENCV,
    PhoneFrame,
    PhoneLog,
    full_picture_size,
    json_object,
    level_image,
    numbers_of,
    phone_source,
    size_words,
)
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.source import FrameFiles, LogSource

FRAME = re.compile(r"frame_(\d{5,8})\.json")
RECORDED: Size = (1920, 1440)
"""Pictures of ARKit, of which the intrinsics are where there is no picture."""


def matches(root: Path) -> str | None:
    """Return the rule that matched, or None."""
    first = min(root.glob("frame_*.json"), default=None) if root.is_dir() else None
    if first is None or FRAME.fullmatch(first.name) is None or "cameraPoseARFrame" not in json_object(first):
        return None
    return "folder with frame_00000.json of a camera: 3D Scanner App"


def open_source(root: Path, parameters: IngestParameters, rule: str) -> LogSource:
    """List the frames of an export. Raises BadInput where none has intrinsics."""
    documents = {
        int(match[1]): json_object(path)
        for path in sorted(root.glob("frame_*.json"))
        if (match := FRAME.fullmatch(path.name))
    }
    colors = images_by_number(root, (".jpg", ".jpeg"), "frame_")
    depths, levels = images_by_number(root, (".png",), "depth_"), images_by_number(root, (".png",), "conf_")
    stated = {number: _intrinsics(document) for number, document in documents.items()}
    usual = next((numbers for numbers in stated.values() if numbers is not None), None)
    if usual is None:
        raise BadInput(f"{root}: no frame_*.json states intrinsics", hint="export `All Data` from the app again")
    picture_size = color_image_size(colors.values())
    full_size = full_picture_size(usual, (picture_size, RECORDED))
    if full_size is None:
        raise BadInput(
            f"{root}: the intrinsics are not those of images of {size_words(picture_size or RECORDED)}",
            hint="export `All Data` from the app again",
        )
    shown = sorted(colors) if colors else sorted(documents)
    frames = []
    for number in shown:
        document = documents.get(number, {})
        pose, problem = _pose(document)
        time = numbers_of([document.get("time")], 1)
        frames.append(
            PhoneFrame(
                name=f"frame {number:05d}",
                time=number / parameters.frame_rate if time is None else time[0],
                intrinsics=stated.get(number) or usual,
                pose=pose,
                reads=FrameReads(
                    partial(file_bytes, colors[number], "color") if number in colors else None,
                    partial(raw_depth, depths[number]) if number in depths else None,
                    partial(level_image, levels[number]) if number in levels else None,
                ),
                problem=problem,
                files=FrameFiles(colors.get(number), depths.get(number)),
                stamp=None if time is None else round(time[0] * 1e9),
            )
        )
    rare = (f"{len(documents)} frames were recorded, those with an image are read",) if colors else ()
    log = PhoneLog(
        where=str(root),
        frames=frames,
        full_size=full_size,
        picture_size=picture_size,
        depth_size=depth_image_size(depths.values()),
        units_per_metre=1000.0,
        notes=("intrinsics, poses and times read from frame_*.json", *rare),
        streams=(
            *((stream("frame_*.jpg", "color", colors.values()),) if colors else ()),
            *((stream("depth_*.png", "depth", depths.values()),) if depths else ()),
            *((stream("conf_*.png", "other", levels.values()),) if levels else ()),
            stream("frame_*.json", "pose", sorted(root.glob("frame_*.json"))),
        ),
        up_in_log=GRAVITY_ALIGNED,
    )
    return phone_source("scanner-app", rule, log, parameters)


def _intrinsics(document: dict[str, object]) -> tuple[float, ...] | None:
    matrix = numbers_of(document.get("intrinsics"), 9)
    return None if matrix is None else (matrix[0], matrix[4], matrix[2], matrix[5])


def _pose(document: dict[str, object]) -> tuple[np.ndarray | None, str | None]:
    numbers = numbers_of(document.get("cameraPoseARFrame"), 16)
    if numbers is None:
        return None, "unreadable_pose"
    return np.reshape(numbers, (4, 4)) @ OPENGL_FROM_OPENCV, None
