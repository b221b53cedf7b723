"""Input frames with their depth and their segments."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.segments import FrameSegment, Segments
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.drawing.palette import entity_color, hex_color, instance_color
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.formats.masks import PanopticReader
from scenewright.stages.report.images import Picture, jpeg


@dataclass(frozen=True)
class FrameView:
    """One frame: colour, depth, colour under its segments."""

    index: int
    time: float
    color: Picture | None
    depth: Picture | None
    segments: Picture | None


@dataclass(frozen=True)
class Chip:
    """An entry of a colour legend."""

    name: str
    color: str


def choose_frames(count: int, wanted: int) -> list[int]:
    """Indices of at most `wanted` frames, evenly spread, away from both ends."""
    wanted = min(wanted, count)
    return [int((k + 0.5) * count / wanted) for k in range(wanted)] if wanted else []


def frame_views(
    sequence: Sequence, segments: Segments | None, wanted: int, width: int
) -> tuple[list[FrameView], list[Chip]]:
    """Return pictures of chosen frames and the legend of their segment colours."""
    views: list[FrameView] = []
    seen_classes: set[int] = set()
    listed = segments.info.frames if segments is not None else ()
    by_frame = {entry.frame: entry.segments for entry in listed if entry.segments}
    with FrameReader(sequence.path("frames.mcap")) as reader:
        for index in choose_frames(len(reader), wanted):
            frame = reader.read(index)
            overlay = None
            if segments is not None and frame.color is not None and index in by_frame:
                with PanopticReader(segments.path("panoptic.zip")) as masks:
                    ids = masks.read(index)
                if ids.shape != frame.color.shape[:2]:
                    raise BadInput(
                        f"{segments.root}: segments are of another sequence: {ids.shape[1]}x{ids.shape[0]} pixels, "
                        f"its frames have {frame.color.shape[1]}x{frame.color.shape[0]}",
                        hint="give the --segments that were made from --sequence",
                    )
                colors, classes = segment_colors(by_frame[index])
                seen_classes |= classes
                overlay = jpeg(blend_segments(frame.color, ids, colors), f"segments of frame {index}", width)
            views.append(
                FrameView(
                    index,
                    frame.time,
                    jpeg(frame.color, f"frame {index}", width) if frame.color is not None else None,
                    jpeg(depth_colors(frame.depth), f"depth of frame {index}", width)
                    if frame.depth is not None
                    else None,
                    overlay,
                )
            )
    names = class_names()
    legend = [
        Chip(spaced(names.get(c, f"class {c}")), hex_color(entity_color(c, names.get(c)))) for c in sorted(seen_classes)
    ]
    return views, legend


def class_names() -> dict[int, str]:
    """Class id -> name."""
    return {entry.id: entry.name for entry in load_vocabulary().classes}


def spaced(name: str) -> str:
    """A class name for people."""
    return name.replace("_", " ")


def segment_colors(segments: tuple[FrameSegment, ...]) -> tuple[dict[int, tuple[float, float, float]], set[int]]:
    """Colour of each segment id and the class ids for the legend.

    By class; where everything has one class (class-agnostic masks) by instance, and then there is no legend.
    """
    classes = {s.class_id for s in segments if s.class_id > 0}
    if len(classes) > 1:
        names = class_names()
        return {s.id: entity_color(s.class_id, names.get(s.class_id)) for s in segments}, classes
    return {s.id: instance_color(s.instance) for s in segments}, set()


def blend_segments(
    color: np.ndarray, ids: np.ndarray, colors: dict[int, tuple[float, float, float]], strength: float = 0.55
) -> np.ndarray:
    """Tint (H, W, 3) uint8 by segment; borders between segments are white; void (no depth, say) is dimmed."""
    values, inverse = np.unique(ids, return_inverse=True)
    table = np.array([colors.get(int(v), (0.25, 0.25, 0.25)) for v in values])
    tint = table[inverse.reshape(ids.shape)] * 255.0
    grey = color.mean(axis=2, keepdims=True)
    result = (1.0 - strength) * (0.5 * color + 0.5 * grey) + strength * tint
    border = np.zeros(ids.shape, dtype=bool)
    border[:, 1:] |= (ids[:, 1:] != ids[:, :-1]) & (ids[:, 1:] > 0) & (ids[:, :-1] > 0)
    border[1:] |= (ids[1:] != ids[:-1]) & (ids[1:] > 0) & (ids[:-1] > 0)
    void = ids == 0
    result[void] = 0.7 * color[void]
    result[border] = 0.25 * result[border] + 0.75 * 255.0
    return np.clip(np.round(result), 0, 255).astype(np.uint8)


def depth_colors(depth: np.ndarray, near: float = 0.4, far: float = 5.0) -> np.ndarray:
    """Colour (H, W) depth [m] from yellow (near) to dark blue (far); pixels without depth are black."""
    stops = np.array([[253, 231, 76], [244, 142, 65], [193, 64, 104], [98, 40, 128], [28, 22, 74]], dtype=float)
    stop = np.clip((depth - near) / (far - near), 0.0, 1.0) * (len(stops) - 1)
    low = np.minimum(stop.astype(int), len(stops) - 2)
    share = (stop - low)[..., None]
    result = (1 - share) * stops[low] + share * stops[low + 1]
    result[depth <= 0] = 0.0
    return np.round(result).astype(np.uint8)
