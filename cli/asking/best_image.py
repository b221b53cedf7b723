"""The image of a log that shows a thing best: most of it seen, and large."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.schemas.sequence import Sequence
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.geometry.transforms import inverse

POINTS = 300
"""Most points of a thing that are looked for; by eye."""
BEHIND = 0.05
"""A point is seen when it lies no farther behind the measured depth [m]."""
LEAST_SEEN = 0.2
"""A best image shows at least this share of the points."""


@dataclass(frozen=True)
class BestImage:
    """Which image, and where in it."""

    frame: int
    time: float
    """[s] in the log."""
    share: float
    """Of the thing's surface that it shows."""
    low: tuple[int, int]
    high: tuple[int, int]
    """Column and row of the corners about it [px]."""


def best_image(sequence: Sequence, points: np.ndarray) -> BestImage | None:
    """Return the image that shows points (N, 3) [m, world] best; None where none with a pose shows enough of them."""
    points = points[:: max(1, len(points) // POINTS)]
    best, best_score = None, 0.0
    with FrameReader(sequence.path("frames.mcap")) as reader:
        frames, poses = reader.poses()
        for index, pose in zip(frames.tolist(), poses, strict=True):
            camera = reader.cameras[reader.camera_names[index]]
            local = points @ inverse(pose)[:3, :3].T + inverse(pose)[:3, 3]
            z = np.maximum(local[:, 2], 1e-6)
            columns = np.rint(camera.fx * local[:, 0] / z + camera.cx).astype(int)
            rows = np.rint(camera.fy * local[:, 1] / z + camera.cy).astype(int)
            inside = (
                (local[:, 2] > 0.1) & (columns >= 0) & (columns < camera.width) & (rows >= 0) & (rows < camera.height)
            )
            if inside.mean() < LEAST_SEEN or _score(columns, rows, inside) <= best_score:
                continue
            depth = reader.read(index, ("depth",)).depth
            seen = inside.copy()
            if depth is not None:
                there = depth[rows[inside], columns[inside]]
                seen[inside] = (there == 0) | (z[inside] < there + BEHIND)
            score = _score(columns, rows, seen)
            if seen.mean() >= LEAST_SEEN and score > best_score:
                best_score = score
                low = int(columns[seen].min()), int(rows[seen].min())
                high = int(columns[seen].max()), int(rows[seen].max())
                time = float(reader.times[index])
                best = BestImage(index, round(time, 3), round(float(seen.mean()), 2), low, high)
    return best


def _score(columns: np.ndarray, rows: np.ndarray, seen: np.ndarray) -> float:
    """Return the share that is seen times the root of the area about it."""
    if not seen.any():
        return 0.0
    return float(seen.mean() * np.sqrt((1 + np.ptp(columns[seen])) * (1 + np.ptp(rows[seen]))))
