"""Point features with depth: found, matched, and the rigid motion that most matches agree on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import cv2
import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.geometry.transforms import apply, transform_from

FEATURES = 600
"""Corners that are described per frame."""
RATIO = 0.85
"""A match must be better than the second best by this factor (Lowe 2004)."""
LARGEST_DISTANCE = 70
"""Descriptors that differ in more of their 256 bits are no match."""
LEAST_COSINE = 0.82
"""Learned descriptors whose cosine is less are no match; published for XFeat."""
SMALLEST_SIDE = 32
"""Images of fewer pixels a side have no corner: a descriptor reaches 15 pixels around it."""
TRIALS = 400
"""Triples of matches that are tried."""


@dataclass(frozen=True)
class Features:
    """Corners of one frame that have depth: some tens of kilobytes."""

    pixels: np.ndarray
    """(N, 2) float32, u and v."""
    points: np.ndarray
    """(N, 3) float32 in the camera [m]."""
    descriptors: np.ndarray
    """(N, 32) uint8, 256 bits, or (N, C) float32 of length 1."""


@dataclass(frozen=True)
class RigidMatch:
    """A motion and the matches that agree with it."""

    target_from_source: np.ndarray
    inliers: int
    pairs: np.ndarray
    """(K, 2) rows of the agreeing features: target, source."""


@cache
def _detector() -> Any:
    return cv2.ORB.create(nfeatures=FEATURES, scaleFactor=1.3, nlevels=6, fastThreshold=12)


Corners = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Picture (H, W, 3) uint8 RGB -> pixels (N, 2) float32 and descriptors (N, ...)."""


def orb_corners(color: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return pixels (N, 2) and descriptors (N, 32) uint8 of the ORB corners (Rublee 2011) of a picture."""
    corners, descriptors = _detector().detectAndCompute(cv2.cvtColor(color, cv2.COLOR_RGB2GRAY), None)
    if descriptors is None:
        descriptors = np.zeros((0, 32), np.uint8)
    return np.array([corner.pt for corner in corners], dtype=np.float32).reshape(-1, 2), descriptors


def find_features(
    color: np.ndarray | None, depth: np.ndarray, camera: Camera, maximum_depth: float, corners: Corners = orb_corners
) -> Features:
    """Return the corners of a frame that have depth below `maximum_depth` [m].

    `color` is (H, W, 3) uint8 RGB or None, which gives no features, as does an image too small for one; `depth` is
    (H, W) float32 [m], 0 invalid.
    """
    empty = Features(np.zeros((0, 2), np.float32), np.zeros((0, 3), np.float32), np.zeros((0, 32), np.uint8))
    if color is None or min(color.shape[:2]) < SMALLEST_SIDE:
        return empty
    pixels, descriptors = corners(color)
    if not len(pixels):
        return empty
    columns = np.clip(np.rint(pixels[:, 0]).astype(int), 0, depth.shape[1] - 1)
    rows = np.clip(np.rint(pixels[:, 1]).astype(int), 0, depth.shape[0] - 1)
    z = depth[rows, columns]
    has_depth = (z > 0) & (z <= maximum_depth)
    pixels, z = pixels[has_depth], z[has_depth]
    points = np.column_stack(
        [(pixels[:, 0] - camera.cx) / camera.fx * z, (pixels[:, 1] - camera.cy) / camera.fy * z, z]
    )
    return Features(pixels, points.astype(np.float32), descriptors[has_depth])


def match_features(target: Features, source: Features) -> np.ndarray:
    """Return rows (K, 2), target and source, of descriptors that choose each other and are clear about it."""
    if len(target.descriptors) < 3 or len(source.descriptors) < 3:
        return np.zeros((0, 2), dtype=int)
    if target.descriptors.dtype != np.uint8:
        cosines = source.descriptors @ target.descriptors.T
        own, best = np.arange(len(cosines)), cosines.argmax(axis=1)
        chosen = (cosines.argmax(axis=0)[best] == own) & (cosines[own, best] > LEAST_COSINE)
        return np.stack([best[chosen], own[chosen]], axis=1)
    matcher = cv2.BFMatcher(cv2.NORM_HAMMING)
    back = {m.queryIdx: m.trainIdx for m in matcher.match(target.descriptors, source.descriptors)}
    rows = [
        (best.trainIdx, best.queryIdx)
        for best, second in matcher.knnMatch(source.descriptors, target.descriptors, k=2)
        if best.distance <= LARGEST_DISTANCE
        and best.distance < RATIO * second.distance
        and back[best.trainIdx] == best.queryIdx
    ]
    return np.array(rows, dtype=int).reshape(-1, 2)


def rigid_motions(target: np.ndarray, source: np.ndarray) -> np.ndarray:
    """Return the least-squares target_from_source (B, 4, 4) of B sets of points (B, K, 3) (Kabsch 1976)."""
    target_mean, source_mean = target.mean(axis=1), source.mean(axis=1)
    u, _, vt = np.linalg.svd(np.swapaxes(target - target_mean[:, None], 1, 2) @ (source - source_mean[:, None]))
    flip = np.ones((len(target), 3))
    flip[:, 2] = np.sign(np.linalg.det(u @ vt))
    rotations = (u * flip[:, None, :]) @ vt
    result = np.tile(np.eye(4), (len(target), 1, 1))
    result[:, :3, :3] = rotations
    result[:, :3, 3] = target_mean - np.einsum("bij,bj->bi", rotations, source_mean)
    return result


def ransac_motion(target: Features, source: Features, random: np.random.Generator) -> RigidMatch | None:
    """Return the motion that most matches of two frames agree on, or None when fewer than six do."""
    pairs = match_features(target, source)
    if len(pairs) < 6:
        return None
    target_points = target.points[pairs[:, 0]].astype(float)
    source_points = source.points[pairs[:, 1]].astype(float)
    tolerance = 0.03 + 0.01 * np.maximum(target_points[:, 2], source_points[:, 2]) ** 2
    triples = random.integers(0, len(pairs), (TRIALS, 3))
    triples = triples[(triples[:, [0, 1, 2]] != triples[:, [1, 2, 0]]).all(axis=1)]
    motions = rigid_motions(target_points[triples], source_points[triples])
    moved = np.einsum("bij,nj->bni", motions[:, :3, :3], source_points) + motions[:, None, :3, 3]
    agreeing = np.linalg.norm(moved - target_points, axis=2) < tolerance
    best = int(np.argmax(agreeing.sum(axis=1)))
    inliers, motion = agreeing[best], motions[best]
    for _ in range(3):
        if inliers.sum() < 6:
            return None
        motion = rigid_motions(target_points[inliers][None], source_points[inliers][None])[0]
        inliers = np.linalg.norm(apply(motion, source_points) - target_points, axis=1) < tolerance
    if (
        inliers.sum() < 6
        or np.linalg.matrix_rank(source_points[inliers] - source_points[inliers].mean(axis=0), tol=0.1) < 2
    ):
        return None
    return RigidMatch(transform_from(motion[:3, :3], motion[:3, 3]), int(inliers.sum()), pairs[inliers])
