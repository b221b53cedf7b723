"""Stray Scanner's folders: rgb.mp4, odometry.csv, camera_matrix.csv, depth/NNNNNN.png (mm), confidence/NNNNNN.png."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.folders.files import (
    all_intrinsics_given,
    depth_image_size,
    images_by_number,
    raw_depth,
    stream,
    text_stream,
)
from scenewright.stages.ingest.folders.frame_loading import FrameReads, Size
from scenewright.stages.ingest.folders.phone_frames import (
    GRAVITY_ALIGNED,
    PhoneFrame,
    PhoneLog,
    full_picture_size,
    level_image,
    phone_source,
    size_words,
)
from scenewright.stages.ingest.folders.video_frames import VideoFrames
from scenewright.stages.ingest.layouts.stray_scanner.odometry import (
    Odometry,
    has_intrinsics,
    read_camera_matrix,
    read_odometry,
    usual_intrinsics,
)
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.source import FrameFiles, LogSource, StreamInfo

ODOMETRY, MATRIX, VIDEO = "odometry.csv", "camera_matrix.csv", "rgb.mp4"
RECORDED: Size = (1920, 1440)
"""Pictures of ARKit, of which the intrinsics are where there is no video."""


def matches(root: Path) -> str | None:
    """Return the rule that matched, or None."""
    if not (root / ODOMETRY).is_file():
        return None
    if (root / MATRIX).is_file():
        return f"folder with {ODOMETRY} and {MATRIX}: Stray Scanner"
    return f"folder with {ODOMETRY} that states intrinsics: Stray Scanner" if has_intrinsics(root / ODOMETRY) else None


def open_source(root: Path, parameters: IngestParameters, rule: str) -> LogSource:
    """List the frames of a recording. Raises BadInput for a video that cannot be opened, a damaged table, or intrinsics
    of other pictures."""
    rows, damage = read_odometry(root / ODOMETRY)
    matrix = read_camera_matrix(root / MATRIX) if (root / MATRIX).is_file() else usual_intrinsics(rows)
    depths, levels = _numbered(root / "depth", (".png", ".npy")), _numbered(root / "confidence", (".png",))
    video = _video(root / VIDEO)
    try:
        depth_size = depth_image_size(depths.values())
        picture_size = video.size if video is not None else None
        full_size = full_picture_size(matrix, (picture_size, _turned(picture_size), RECORDED))
        if full_size is None and all_intrinsics_given(parameters):
            full_size = depth_size or picture_size
        if full_size is None:
            source = MATRIX if (root / MATRIX).is_file() else ODOMETRY
            raise BadInput(
                f"{root / source}: centre {matrix[2]:g}, {matrix[3]:g} is not that of images of "
                f"{size_words(picture_size or RECORDED)} pixels",
                hint="give --fx --fy --cx --cy of the depth, or put the app's own camera_matrix.csv there",
            )
        frames = _frames(rows, depths, levels, video, matrix, parameters)
        has_times = rows[0].stamp is not None
        log = PhoneLog(
            where=str(root),
            frames=frames,
            full_size=full_size,
            picture_size=picture_size,
            depth_size=depth_size,
            units_per_metre=1000.0,
            notes=(
                f"intrinsics read from {ODOMETRY if rows[0].intrinsics else MATRIX}, for {size_words(full_size)}",
                f"times from {ODOMETRY}"
                if has_times
                else f"times assumed: frame number / {parameters.frame_rate:g} per second",
                *_count_notes(rows, video),
            ),
            streams=_streams(rows, depths, levels, video),
            up_in_log=GRAVITY_ALIGNED,
            damage=damage,
            close=video.close if video is not None else lambda: None,
        )
        return phone_source("stray-scanner", rule, log, parameters)
    except BaseException:
        if video is not None:
            video.close()
        raise


def _numbered(folder: Path, suffixes: tuple[str, ...]) -> dict[int, Path]:
    return images_by_number(folder, suffixes) if folder.is_dir() else {}


def _turned(size: Size | None) -> Size | None:
    return None if size is None else (size[1], size[0])


def _video(path: Path) -> VideoFrames | None:
    if not path.is_file():
        return None
    try:
        return VideoFrames(path, as_stored=True)
    except BadInput as error:
        raise BadInput(
            f"{error.message}: it was cut before its end was written, or copied in part",
            hint="copy the recording off the phone again; without rgb.mp4 in the folder its depth alone is read",
        ) from None


def _frames(
    rows: list[Odometry],
    depths: dict[int, Path],
    levels: dict[int, Path],
    video: VideoFrames | None,
    matrix: tuple[float, ...],
    parameters: IngestParameters,
) -> list[PhoneFrame]:
    """Return a frame for every number that the table, the depth or the video has."""
    row_of = {row.frame: row for row in rows}
    first = min(row_of.keys() | depths.keys())
    shown = range(first, first + (video.count if video is not None else 0))
    frames = []
    for number in sorted({*row_of, *depths, *shown}):
        row = row_of.get(number)
        depth, level = depths.get(number), levels.get(number)
        stamp = None if row is None else row.stamp
        problem = row.problem if row is not None else "missing_time" if rows[0].stamp is not None else None
        frames.append(
            PhoneFrame(
                name=f"frame {number:06d}",
                time=number / parameters.frame_rate if stamp is None else stamp * 1e-9,
                intrinsics=matrix if row is None or row.intrinsics is None else row.intrinsics,
                pose=None if row is None else row.pose,
                reads=FrameReads(
                    color=partial(video.frame, number - first) if video is not None and number in shown else None,
                    depth=None if depth is None else partial(raw_depth, depth),
                    levels=None if level is None else partial(level_image, level),
                ),
                problem=problem,
                files=FrameFiles(depth=depth),
                stamp=stamp,
            )
        )
    return frames


def _count_notes(rows: list[Odometry], video: VideoFrames | None) -> tuple[str, ...]:
    if video is None:
        return (f"there is no {VIDEO}: depth alone is read",)
    if video.count == len(rows):
        return video.notes
    return (
        *video.notes,
        f"WARNING: {ODOMETRY} has {len(rows)} poses and {VIDEO} {video.count} frames: "
        "frames that have not both are left out",
    )


def _streams(
    rows: list[Odometry], depths: dict[int, Path], levels: dict[int, Path], video: VideoFrames | None
) -> tuple[StreamInfo, ...]:
    stamps = np.array([row.stamp for row in rows if row.stamp is not None], np.int64)
    streams = [] if video is None else [StreamInfo(VIDEO, "color", "frames of a video", count=video.count)]
    if depths:
        streams.append(stream("depth", "depth", depths.values()))
    if levels:
        streams.append(stream("confidence", "other", levels.values()))
    return (*streams, text_stream(ODOMETRY, "pose", len(rows), stamps))
