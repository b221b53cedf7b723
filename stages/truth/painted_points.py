"""Which thing each point of a surface is of, by the outlines of the frames that see it."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.sequence import Sequence
from scenewright.stages.kit.formats.frames import Frame, FrameReader
from scenewright.stages.kit.geometry.cameras import project
from scenewright.stages.kit.geometry.transforms import apply, inverse
from scenewright.stages.truth.outlines import OutlinesFile, PaintedFrame, painted_labels
from scipy.ndimage import minimum_filter

SAME_TIME = 1e-3
"""A frame is the painted one when their times differ by less [s]."""
NEIGHBOURHOOD = 3
"""A pixel without depth has the nearest depth of a square of so many pixels: depth that was brought into the view of
another camera has seams."""


def painted_owners(
    sequence: Sequence, outlines: OutlinesFile, nodes: dict[str, int], points: np.ndarray, reach: float
) -> tuple[np.ndarray, list[float]]:
    """Return the node (N,) that most painted frames say of each point (N, 3) [m] in the sequence's world, and the
    times [s] of painted frames that the sequence lacks.

    A frame tells of a point what its outlines hold where the point falls, if its depth there is at most `reach` [m]
    from the point's. 0 where no frame tells anything; of nodes told as often the first. nodes: name -> number, from 1.
    Raises BadInput when no painted frame with depth and a pose is in the sequence, and for a broken outline.
    """
    left = {frame.time: frame for frame in outlines.frames}
    votes = np.zeros((len(points), max(nodes.values(), default=0) + 1), dtype=np.uint16)
    with FrameReader(sequence.path("frames.mcap")) as reader:
        for frame in reader.frames(streams=("depth",)):
            painted = next((each for time, each in left.items() if abs(time - frame.time) < SAME_TIME), None)
            if painted is None or frame.depth is None or frame.world_from_camera is None:
                continue
            del left[painted.time]
            seen, told = _told(frame, painted, nodes, points, reach, reader)
            votes[seen, told] += 1
    if len(left) == len(outlines.frames):
        raise BadInput(
            f"{sequence.root}: no frame with depth and a pose has the time of a painted one",
            hint=f"take the painted frames from the log: {min(left):g} to {max(left):g} s",
        )
    votes[:, 0] = 0
    return votes.argmax(axis=1), sorted(left)


def _told(
    frame: Frame, painted: PaintedFrame, nodes: dict[str, int], points: np.ndarray, reach: float, reader: FrameReader
) -> tuple[np.ndarray, np.ndarray]:
    """Return which points (K,) a painted frame sees, by index, and the label (K,) of each."""
    assert frame.depth is not None and frame.world_from_camera is not None
    pixels, z = project(apply(inverse(frame.world_from_camera), points), reader.cameras[frame.camera_name])
    height, width = frame.depth.shape
    inside = (z > 0) & (pixels > -0.5).all(axis=1) & (pixels[:, 0] < width - 0.5) & (pixels[:, 1] < height - 0.5)
    index = np.flatnonzero(inside)
    column, row = np.rint(pixels[index]).astype(np.int64).T
    depth = without_seams(frame.depth)
    close = np.abs(depth[row, column] - z[index]) <= reach
    labels = painted_labels(painted, nodes, depth)
    return index[close], labels[row[close], column[close]]


def without_seams(depth: np.ndarray) -> np.ndarray:
    """Return depth (H, W) [m] in which a pixel without any (0) has the nearest of its NEIGHBOURHOOD; else 0."""
    known = np.where(depth > 0, depth, np.inf)
    near = minimum_filter(known, NEIGHBOURHOOD, mode="nearest")
    return np.where(np.isfinite(known), depth, np.where(np.isfinite(near), near, 0.0))
