"""What every format gets: the frames, with encoded pictures and millimetres, one at a time, and what goes with them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.sequence import SequenceFile
from scenewright.stages.kit.formats.foxglove import depth_to_millimetres
from scenewright.stages.kit.formats.frames import Frame, FrameReader


@dataclass(frozen=True)
class ExportMask:
    """What a mask is of."""

    class_id: int
    """Of data/vocabulary.toml."""
    is_thing: bool
    score: float
    """0..1; 1 where nothing was said."""


@dataclass(frozen=True)
class FrameMasks:
    """The masks of one frame."""

    ids: np.ndarray
    """(H, W) int32, 0 = void."""
    masks: Mapping[int, ExportMask]
    """Id -> mask."""


@dataclass(frozen=True)
class ExportFrame:
    """One frame. Streams that it lacks, or that were not asked for, are None."""

    index: int
    """Its place in the sequence."""
    stamp: int
    """Time [ns]."""
    camera_name: str
    color: bytes | None
    """The sequence's own JPEG or PNG."""
    depth: np.ndarray | None
    """(H, W) uint16 [mm], 0 = invalid."""
    labels: np.ndarray | None
    """(H, W) uint16 instance ids."""
    right: bytes | None
    """Right eye of a rectified stereo pair, like `color`."""
    world_from_camera: np.ndarray | None
    """(4, 4), OpenCV camera."""
    masks: FrameMasks | None = None
    """For layouts that hold masks."""


@dataclass
class Tally:
    """What a layout wrote."""

    frames: int = 0
    streams: set[str] = field(default_factory=set)
    left_out: Counter[str] = field(default_factory=Counter)
    """Reason -> frames."""
    depth_pixels_zeroed: int = 0
    masks: int = 0


@dataclass(frozen=True)
class ExportJob:
    """What a format writes."""

    root: Path
    """The folder to write into; it is there and empty."""
    frames: Iterable[ExportFrame]
    """Read once, in time order."""
    cameras: Mapping[str, Camera]
    """Name -> camera of those to write."""
    info: SequenceFile
    world_up: str
    """`z`, or what the sequence says of its world."""
    tally: Tally
    """Grows as the frames are written."""


def export_frames(
    reader: FrameReader,
    numbers: Iterable[int],
    every: int,
    streams: Collection[str],
    cameras: Collection[str],
    tally: Tally,
    masks: Callable[[Frame], FrameMasks | None] | None = None,
) -> Iterator[ExportFrame]:
    """Yield every `every`-th of the numbered frames with the streams asked for, if it is of one of the cameras.

    The others are counted in `tally`. `masks` gives the masks of a frame.
    """
    pixels = tuple(stream for stream in ("depth", "labels") if stream in streams or (masks and stream == "labels"))
    stamps = reader.stamps
    for index in numbers:
        if index % every:
            tally.left_out["not_selected"] += 1
            continue
        frame = reader.read(index, pixels)
        if frame.camera_name not in cameras:
            tally.left_out["other_camera"] += 1
            continue
        yield ExportFrame(
            index=index,
            stamp=int(stamps[index]),
            camera_name=frame.camera_name,
            color=reader.encoded(index, "color") if "color" in streams else None,
            depth=None if frame.depth is None else depth_to_millimetres(frame.depth),
            labels=frame.labels,
            right=reader.encoded(index, "right") if "right" in streams else None,
            world_from_camera=frame.world_from_camera if "pose" in streams else None,
            masks=None if masks is None else masks(frame),
        )
