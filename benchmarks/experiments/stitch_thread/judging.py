"""A reconstructed thread against the true one of its scene."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.suture import NeedleScene, StereoRig, ThreadCurve
from scipy.spatial import cKDTree

FINE = 0.0001
"""The true curve is taken in steps of this [m]."""
NEAR = 0.002


@dataclass(frozen=True)
class ThreadRecord:
    """What an arm made of one view, and how far off it was; lengths and distances in mm, -1 where there is no curve.

    `distance`: from the curve's points to the true curve; `missed`: from the true points that both eyes see to the
    curve. `followed`: the share of those true points within 2 mm of the curve; `backward`: the share of the curve near
    the truth along which it runs against it. `inside_2sd`: the share of the curve's points whose distance to the truth
    is less than two of their standard deviations.
    """

    holder: str
    crossed: bool
    status: str
    remarks: tuple[str, ...]
    true_length: float
    seen_length: float
    seconds: float
    distance_mean: float = -1.0
    distance_p95: float = -1.0
    missed_mean: float = -1.0
    missed_p95: float = -1.0
    followed: float = 0.0
    backward: float = -1.0
    inside_2sd: float = -1.0
    length: float = -1.0

    @property
    def answered(self) -> bool:
        """There is a curve."""
        return self.status != "none"

    @property
    def whole(self) -> bool:
        """At least 95 % of the thread's true length is seen by both eyes."""
        return self.seen_length >= 0.95 * self.true_length

    @property
    def good(self) -> bool:
        """95 % of the curve lies within 2 mm of the truth, and 90 % of what both eyes see lies within 2 mm of it."""
        return self.answered and self.distance_p95 <= 2.0 and self.followed >= 0.9

    @property
    def length_error(self) -> float:
        """Relative."""
        return abs(self.length / self.true_length - 1.0)


def finely(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the polyline (N, 3) [m] in FINE steps (M, 3), and each one's length from the beginning (M,) [m]."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    at = np.arange(0.0, along[-1], FINE)
    return np.stack([np.interp(at, along, points[:, axis]) for axis in range(3)], axis=1), at


def seen_by_both(points: np.ndarray, masks: list[np.ndarray], rig: StereoRig) -> np.ndarray:
    """Return which (N,) of the true points (N, 3) fall, give or take a pixel, on thread in both eyes' true masks."""
    both = np.ones(len(points), dtype=bool)
    for mask, pixels in zip(masks, (rig.left(points), rig.right(points)), strict=True):
        wide = cv2.dilate(mask.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        columns, rows = np.round(pixels).astype(int).T
        inside = (columns >= 0) & (rows >= 0) & (columns < rig.width) & (rows < rig.height)
        both &= inside & wide[np.clip(rows, 0, rig.height - 1), np.clip(columns, 0, rig.width - 1)]
    return both


def judged(scene: NeedleScene, true_masks: list[np.ndarray], curve: ThreadCurve, seconds: float) -> ThreadRecord:
    """Return the record of one curve."""
    truth, along = finely(apply(scene.camera_from_world, scene.thread))
    seen = seen_by_both(truth, true_masks, scene.rig)
    none = ThreadRecord(
        scene.holder,
        scene.crossing is not None,
        curve.status,
        tuple(curve.remarks),
        true_length=1000.0 * float(along[-1]),
        seen_length=1000.0 * FINE * float(seen.sum()),
        seconds=seconds,
    )
    if curve.status == "none":
        return none
    distance, nearest = cKDTree(truth).query(curve.points)
    missed = cKDTree(curve.points).query(truth[seen])[0] if seen.any() else np.zeros(1)
    steps = np.diff(along[nearest])
    ordinary = (distance[1:] < NEAR) & (np.abs(steps) < 0.005) & (steps != 0)
    return replace(
        none,
        distance_mean=1000.0 * float(distance.mean()),
        distance_p95=1000.0 * float(np.quantile(distance, 0.95)),
        missed_mean=1000.0 * float(missed.mean()),
        missed_p95=1000.0 * float(np.quantile(missed, 0.95)),
        followed=float((missed < NEAR).mean()),
        backward=float((steps[ordinary] < 0).mean()) if ordinary.any() else 0.0,
        inside_2sd=float((distance < 2.0 * curve.standard_deviation).mean()),
        length=1000.0 * curve.length_m,
    )
