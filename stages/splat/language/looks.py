"""What pictures say of a region of the room: squares about it where it is seen best, each with an encoder's vector."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.formats.frames import Frame, FrameReader
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.kit.open_words.encoder import Encoder, unit
from scenewright.stages.splat.views import sharpest

MOST_LOOKS = 5
"""Squares of a region, those of most pixels."""
WIDEST = 960
"""Width of full pictures that are looked in [pixel]: those of the frames are taken as they are."""
LEAST_SIDE = 12
"""Pixels of a square."""
MARGIN = 1.25
"""Side of a square over that of what is seen of the region."""
MOST_POINTS = 200
"""Most points of a region that are looked for; by eye."""
LEAST_SEEN = 0.25
"""Share of the points that a look shows, at least."""
BEHIND = (0.03, 0.02)
"""A point is seen when it lies no farther behind the measured depth than this [m], and this share of it."""


@dataclass(frozen=True)
class Sight:
    """A picture to look in."""

    color: np.ndarray
    """(H, W, 3) uint8."""
    depth: np.ndarray
    """(H, W) float32 [m], 0 unknown."""
    camera: Camera
    camera_from_world: np.ndarray


def sight_of(reader: FrameReader, frame: Frame, depth: np.ndarray, camera_from_world: np.ndarray) -> Sight:
    """Return a frame that has colour as a picture to look in, its full picture where it has one. `depth` (H, W) [m] is
    of the frame."""
    width = max(WIDEST, reader.cameras[frame.camera_name].width)
    color, seen, camera = sharpest(reader, replace(frame, depth=depth), width)
    assert seen is not None
    return Sight(color, seen, camera, camera_from_world)


@dataclass
class _Kept:
    scores: list[float] = field(default_factory=list)
    crops: list[np.ndarray] = field(default_factory=list)

    def offer(self, score: float, crop: np.ndarray) -> None:
        self.scores.append(score)
        self.crops.append(crop)
        if len(self.scores) > MOST_LOOKS:
            worst = int(np.argmin(self.scores))
            del self.scores[worst], self.crops[worst]


def looks(regions: Sequence[np.ndarray], sights: Iterable[Sight], encoder: Encoder) -> tuple[np.ndarray, np.ndarray]:
    """Return (R, width) unit vectors of regions, points (P, 3) [m, world] each, and (R,) how many looks each had.

    A region that no picture shows has zeros.
    """
    thinned = [points[:: -(-len(points) // MOST_POINTS)] if len(points) > MOST_POINTS else points for points in regions]
    owner = np.repeat(np.arange(len(regions)), [len(points) for points in thinned])
    points = np.concatenate(thinned) if thinned else np.zeros((0, 3))
    sizes = np.bincount(owner, minlength=len(regions))
    kept = [_Kept() for _ in regions]
    for sight in sights:
        _look(sight, points, owner, sizes, kept, encoder.side)
    counts = np.array([len(each.crops) for each in kept], int)
    vectors = np.zeros((len(regions), encoder.width), np.float32)
    if counts.any():
        crops = np.stack([crop for each in kept for crop in each.crops])
        scores = np.array([score for each in kept for score in each.scores])
        np.add.at(
            vectors, np.repeat(np.arange(len(regions)), counts), encoder.pictures(crops) * np.sqrt(scores)[:, None]
        )
    return unit(vectors), counts


def _look(sight: Sight, points: np.ndarray, owner: np.ndarray, sizes: np.ndarray, kept: list[_Kept], side: int) -> None:
    camera = sight.camera
    local = apply(sight.camera_from_world, points)
    z = np.maximum(local[:, 2], 1e-6)
    columns = np.rint(camera.fx * local[:, 0] / z + camera.cx)
    rows = np.rint(camera.fy * local[:, 1] / z + camera.cy)
    inside = (local[:, 2] > 0.1) & (columns >= 0) & (columns < camera.width) & (rows >= 0) & (rows < camera.height)
    at = np.flatnonzero(inside)
    r, c = rows[at].astype(int), columns[at].astype(int)
    depth_there = sight.depth[r, c]
    visible = (depth_there == 0) | (z[at] < depth_there + BEHIND[0] + BEHIND[1] * depth_there)
    at, r, c = at[visible], r[visible], c[visible]
    counts = np.bincount(owner[at], minlength=len(sizes))
    order = np.argsort(owner[at], kind="stable")
    starts = np.concatenate([[0], np.cumsum(counts)])
    for which in np.flatnonzero((counts >= 3) & (counts >= LEAST_SEEN * sizes)):
        of_region = order[starts[which] : starts[which + 1]]
        low, high = (
            (int(r[of_region].min()), int(c[of_region].min())),
            (int(r[of_region].max()), int(c[of_region].max())),
        )
        extent = max(high[0] - low[0], high[1] - low[1]) + 1
        score = float(extent) * counts[which] / sizes[which]
        length = int(min(max(MARGIN * extent, LEAST_SIDE), camera.height, camera.width))
        top = int(np.clip((low[0] + high[0] - length) // 2 + 1, 0, camera.height - length))
        left = int(np.clip((low[1] + high[1] - length) // 2 + 1, 0, camera.width - length))
        if len(kept[which].scores) == MOST_LOOKS and score <= min(kept[which].scores):
            continue
        crop = sight.color[top : top + length, left : left + length]
        kept[which].offer(score, cv2.resize(crop, (side, side), interpolation=cv2.INTER_AREA))
