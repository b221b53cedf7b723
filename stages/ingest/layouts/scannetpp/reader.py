"""ScanNet++'s iPhone recordings: pose_intrinsic_imu.json (aligned_pose, intrinsic, timestamp by frame), rgb.mkv or
rgb/frame_NNNNNN.jpg, depth/frame_NNNNNN.png (mm) as the data set's own tool takes them out of depth.bin.

Poses are world_from_camera with OpenCV axes (scannetpp/scannetpp, iphone/arkit_pcl.py).
"""

from __future__ import annotations

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
    read_json,
    stream,
)
from scenewright.stages.ingest.folders.frame_loading import FrameReads
from scenewright.stages.ingest.folders.phone_frames import PhoneFrame, PhoneLog, numbers_of, phone_source
from scenewright.stages.ingest.folders.video_frames import VideoFrames
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.source import FrameFiles, LogSource, StreamInfo

POSES, VIDEO, PACKED = "pose_intrinsic_imu.json", "rgb.mkv", "depth.bin"
TAKE_OUT = "take the depth out with the data set's tool: python -m iphone.prepare_iphone_data (scannetpp/scannetpp)"


def matches(path: Path) -> str | None:
    """Return the rule that matched, or None."""
    return f"folder with {POSES}: ScanNet++" if _root(path) is not None else None


def _root(path: Path) -> Path | None:
    return next((root for root in (path, path / "iphone") if (root / POSES).is_file()), None)


def open_source(path: Path, parameters: IngestParameters, rule: str) -> LogSource:
    """List the frames of a scene. Raises BadInput for depth that is still packed, and for damaged poses."""
    root = _root(path)
    assert root is not None
    if (root / PACKED).is_file() and not (root / "depth").is_dir():
        raise BadInput(f"{root}: its depth is packed in {PACKED}", hint=TAKE_OUT)
    documents = read_json(root / POSES)
    numbered = {int(name[6:]): fields for name, fields in _frames(documents) if name[6:].isdecimal()}
    if not numbered:
        raise BadInput(
            f"{root / POSES}: has no frames called frame_000000 and so on", hint=f"download {POSES} of the scene again"
        )
    depths = images_by_number(root / "depth", (".png",)) if (root / "depth").is_dir() else {}
    colors = images_by_number(root / "rgb", (".jpg", ".png")) if (root / "rgb").is_dir() else {}
    video = VideoFrames(root / VIDEO, as_stored=True) if not colors and (root / VIDEO).is_file() else None
    try:
        picture_size = video.size if video is not None else color_image_size(colors.values())
        frames = []
        for number in sorted({*colors, *depths} or numbered):
            fields = numbered.get(number, {})
            matrix, pose = numbers_of(fields.get("intrinsic"), 9), numbers_of(fields.get("aligned_pose"), 16)
            time = numbers_of([fields.get("timestamp")], 1)
            color = partial(file_bytes, colors[number], "color") if number in colors else None
            shown = video is not None and number < video.count
            frames.append(
                PhoneFrame(
                    name=f"frame {number:06d}",
                    time=number / parameters.frame_rate if time is None else time[0],
                    intrinsics=_usual(numbered) if matrix is None else (matrix[0], matrix[4], matrix[2], matrix[5]),
                    pose=None if pose is None else np.reshape(pose, (4, 4)),
                    reads=FrameReads(
                        partial(video.frame, number) if video is not None and shown else color,
                        partial(raw_depth, depths[number]) if number in depths else None,
                    ),
                    problem="missing_pose" if pose is None else None,
                    files=FrameFiles(colors.get(number), depths.get(number)),
                    stamp=None if time is None else round(time[0] * 1e9),
                )
            )
        depth_size = depth_image_size(depths.values())
        full_size = picture_size or depth_size
        if full_size is None:
            raise BadInput(
                f"{root}: has neither {VIDEO} nor rgb/ nor depth/", hint="give the folder `iphone` of a scene"
            )
        picture_streams = (
            (StreamInfo(VIDEO, "color", "frames of a video", count=video.count),)
            if video is not None
            else (stream("rgb", "color", colors.values()),)
            if colors
            else ()
        )
        log = PhoneLog(
            where=str(root),
            frames=frames,
            full_size=full_size,
            picture_size=picture_size,
            depth_size=depth_size,
            units_per_metre=1000.0,
            notes=(f"intrinsics and aligned_pose read from {POSES}",),
            streams=(*picture_streams, *((stream("depth", "depth", depths.values()),) if depths else ())),
            close=video.close if video is not None else lambda: None,
        )
        return phone_source("scannetpp", rule, log, parameters)
    except BaseException:
        if video is not None:
            video.close()
        raise


def _frames(documents: object) -> list[tuple[str, dict[str, object]]]:
    if not isinstance(documents, dict):
        return []
    return [(str(name), fields) for name, fields in documents.items() if isinstance(fields, dict)]


def _usual(numbered: dict[int, dict[str, object]]) -> tuple[float, ...]:
    """Return the intrinsics of the first frame that has them. Raises BadInput where none has."""
    for fields in numbered.values():
        matrix = numbers_of(fields.get("intrinsic"), 9)
        if matrix is not None:
            return matrix[0], matrix[4], matrix[2], matrix[5]
    raise BadInput(f"{POSES}: no frame states an intrinsic matrix", hint=f"download {POSES} of the scene again")
