"""Record3D's recordings: `.r3d`, the same unpacked, or the export as EXR and JPG. A frame's number is its file's name,
and the place of its pose in the metadata, whichever frames are there."""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import partial
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.folders.exr_depth import exr_depth, require_exr
from scenewright.stages.ingest.folders.files import color_image_size, depth_image_size
from scenewright.stages.ingest.folders.frame_loading import FrameReads, Size
from scenewright.stages.ingest.folders.lzfse_blocks import declared_size, require_lzfse, unpacked
from scenewright.stages.ingest.folders.phone_frames import PhoneFrame, PhoneLog, phone_source
from scenewright.stages.ingest.layouts.record3d.metadata import Metadata, read_metadata
from scenewright.stages.ingest.layouts.record3d.recording import AGAIN, Recording, open_recording, recording_at
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.source import FrameFiles, LogSource, StreamInfo, Unusable
from scenewright.stages.kit.formats.image_headers import image_size

SELFIE = "the recording is of the selfie camera, which the app does not track"


def matches(path: Path) -> str | None:
    """Return the rule that matched, or None."""
    found = recording_at(path)
    return found[0] if found else None


def open_source(path: Path, parameters: IngestParameters, rule: str) -> LogSource:
    """List the frames of a recording. Raises BadInput for a broken archive or metadata, MissingDependency where a
    library for its depth is not there."""
    found = recording_at(path)
    recording = open_recording(path if found is None else found[1])
    try:
        metadata = read_metadata(recording.metadata(), f"{recording.root}: metadata")
        return phone_source("record3d", rule, _log(recording, metadata, parameters), parameters)
    except BaseException:
        recording.close()
        raise


def _log(recording: Recording, metadata: Metadata, parameters: IngestParameters) -> PhoneLog:
    colors = (
        recording.numbered("rgbd", ".jpg") or recording.numbered("rgb", ".jpg") or recording.numbered("rgb", ".png")
    )
    packed, exported = recording.numbered("rgbd", ".depth"), recording.numbered("depth", ".exr")
    levels = recording.numbered("rgbd", ".conf")
    require_exr(exported.values())
    if packed:
        require_lzfse()
    picture_size = _picture_size(recording, colors.values())
    depth_size = _depth_size(recording, packed, exported, metadata, picture_size)
    full_size = metadata.picture_size or picture_size
    if full_size is None:
        raise BadInput(f"{recording.root}: has no images, and its metadata states no w and h", hint=AGAIN)
    frames = []
    numbers = sorted({*colors, *packed, *exported})
    for number in numbers:
        pose, problem = metadata.pose(number)
        stamp = metadata.stamps[number] if number < len(metadata.stamps) else None
        rate = metadata.rate or parameters.frame_rate
        frames.append(
            PhoneFrame(
                name=f"frame {number}",
                time=number / rate if stamp is None else stamp * 1e-9,
                intrinsics=metadata.intrinsics_of(number),
                pose=pose,
                reads=FrameReads(
                    color=partial(recording.content, colors[number], "color") if number in colors else None,
                    depth=partial(_packed_depth, recording, packed[number], depth_size)
                    if number in packed
                    else partial(_exported_depth, recording, exported[number])
                    if number in exported
                    else None,
                    levels=partial(_levels, recording, levels[number], depth_size) if number in levels else None,
                ),
                problem=problem,
                files=_files(recording, colors.get(number), exported.get(number)),
                stamp=stamp,
            )
        )
    return PhoneLog(
        where=str(recording.root),
        frames=frames,
        full_size=full_size,
        picture_size=picture_size,
        depth_size=depth_size,
        units_per_metre=1.0,
        notes=(
            "intrinsics read from metadata",
            "times from metadata, frameTimestamps"
            if metadata.stamps
            else f"times assumed: frame number / {metadata.rate or parameters.frame_rate:g} per second",
            *_missing_note(len(numbers), len(metadata.poses)),
        ),
        streams=(
            *((StreamInfo("images", "color", "files", count=len(colors)),) if colors else ()),
            *((StreamInfo("depth", "depth", "files", count=len(packed or exported)),) if packed or exported else ()),
            *((StreamInfo("confidence", "other", "files", count=len(levels)),) if levels else ()),
            StreamInfo("poses", "pose", "metadata", count=len(metadata.poses)),
        ),
        missing={} if metadata.tracked or not metadata.poses else {"pose": SELFIE},
        close=recording.close,
    )


def _missing_note(frames: int, poses: int) -> tuple[str, ...]:
    return (
        ()
        if frames == poses
        else (f"metadata has {poses} poses for {frames} frames: the number in a name is its pose's",)
    )


def _picture_size(recording: Recording, names: Iterable[str]) -> Size | None:
    """Return the size of the first picture that has one."""
    for name in names:
        path = recording.path(name)
        try:
            size = color_image_size([path]) if path is not None else image_size(recording.content(name, "color"))
        except Unusable:
            continue
        if size is not None:
            return size
    return None


def _depth_size(
    recording: Recording, packed: dict[int, str], exported: dict[int, str], metadata: Metadata, picture: Size | None
) -> Size | None:
    """Return the size of depth; where the metadata has none, that of the picture's shape that holds so many floats."""
    if exported and not packed:
        return depth_image_size(path for name in exported.values() if (path := recording.path(name)) is not None)
    if not packed or metadata.depth_size is not None:
        return metadata.depth_size if packed else None
    shape = metadata.picture_size or picture
    for name in packed.values():
        try:
            size = declared_size(recording.content(name, "depth"))
        except Unusable:
            continue
        if size is not None and shape is not None:
            width = round(math.sqrt(size / 4 * shape[0] / shape[1]))
            return (width, size // 4 // width) if width and width * (size // 4 // width) * 4 == size else None
    return None


def _packed_depth(recording: Recording, name: str, size: Size | None) -> np.ndarray:
    width, height = size or (0, 0)
    data = unpacked(recording.content(name, "depth"), 4 * width * height, "depth")
    return np.frombuffer(data, "<f4").reshape(height, width)


def _exported_depth(recording: Recording, name: str) -> np.ndarray:
    return exr_depth(recording.content(name, "depth"))


def _levels(recording: Recording, name: str, size: Size | None) -> np.ndarray:
    width, height = size or (0, 0)
    data = unpacked(recording.content(name, "confidence"), width * height, "confidence")
    return np.frombuffer(data, np.uint8).reshape(height, width)


def _files(recording: Recording, color: str | None, depth: str | None) -> FrameFiles:
    return FrameFiles(
        None if color is None else recording.path(color), None if depth is None else recording.path(depth)
    )
