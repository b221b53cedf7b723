"""Poses against colour alone: matched features must lie on each other's epipolar lines.

For logs without depth. The length of the translations cannot be seen in this way, only their direction.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest.preflight.fits import Fit, as_fit, relative_pose
from scenewright.stages.ingest.preflight.looking import Look

FEATURES = 800
"""Most SIFT features of a picture; by eye."""
MOST_PAIRS, MOST_MATCHES = 12, 400
"""Matching is the dear part of the pre-flight: more of either changes no verdict."""
ITERATIONS = 200
"""Most iterations of the robust fit of the fundamental matrix; by eye."""
MATCH_RATIO = 0.8
"""Largest ratio of the best to the second best distance of descriptors (Lowe 2004)."""
INLIER_DISTANCE = 1.5
"""Pixels from the epipolar line that a match may have to count as one."""
LEAST_INLIERS = 30
"""Fewest matches of a pair that is used; by eye."""
TRUNCATION_PIXELS = 4.0
"""Distance from the epipolar line at which the cost stops to grow [px]; by eye."""
STILL_PIXELS = 1.5
"""Median shift of matches under which two pictures count as taken from the same place."""


@dataclass(frozen=True)
class Matches:
    """Matches of two frames that some essential matrix explains."""

    first: np.ndarray
    """(M, 2) pixels."""
    second: np.ndarray

    @property
    def shift(self) -> float:
        """Median length of the shifts [pixels]."""
        return float(np.median(np.linalg.norm(self.second - self.first, axis=1)))


class FeaturePairs:
    """Matched pairs of frames of one camera, prepared once for many hypotheses about their poses."""

    def __init__(self, looks: Mapping[int, Look], pairs: Sequence[tuple[int, int]]) -> None:
        if len(pairs) > MOST_PAIRS:
            pairs = [pairs[k] for k in np.unique(np.linspace(0, len(pairs) - 1, MOST_PAIRS).astype(int))]
        features = {}
        for index in sorted({index for pair in pairs for index in pair}):
            look = looks.get(index)
            if look is not None and look.gray is not None:
                features[index] = features_of(look.gray)
        self.pairs: list[tuple[int, int]] = []
        self.matches: list[Matches] = []
        self._cameras: list[Camera] = []
        for i, j in pairs:
            if i in features and j in features:
                pair_matches = _consistent(*matched(features[i], features[j]), looks[i].camera)
                if pair_matches is not None and pair_matches.shift > STILL_PIXELS:
                    self.pairs.append((i, j))
                    self.matches.append(pair_matches)
                    self._cameras.append(looks[i].camera)

    def __len__(self) -> int:
        return len(self.pairs)

    def fit(self, poses: np.ndarray, focal_factor: float = 1.0) -> Fit:
        """Compare the pairs with world_from_camera (N, 4, 4) of all frames. Residuals are pixels.

        `focal_factor` multiplies the focal lengths.
        """
        rows = []
        for (i, j), pair_matches, camera_of_pair in zip(self.pairs, self.matches, self._cameras, strict=True):
            camera = camera_of_pair.model_copy(
                update={"fx": focal_factor * camera_of_pair.fx, "fy": focal_factor * camera_of_pair.fy}
            )
            distances = epipolar_distances(pair_matches, relative_pose(poses[j], poses[i]), camera)
            cost = float(np.minimum(distances / TRUNCATION_PIXELS, 1.0).mean())
            rows.append((float(np.median(distances)), cost, 1.0))
        return as_fit(rows)

    def fit_motionless(self) -> Fit:
        """Compare the pairs as if the camera had not moved."""
        rows = []
        for pair_matches in self.matches:
            distances = np.linalg.norm(pair_matches.second - pair_matches.first, axis=1)
            cost = float(np.minimum(distances / TRUNCATION_PIXELS, 1.0).mean())
            rows.append((float(np.median(distances)), cost, 1.0))
        return as_fit(rows)


def features_of(gray: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return SIFT positions (N, 2) [pixels] and descriptors (N, 128) of a picture (H, W) uint8."""
    points, descriptors = cv2.SIFT.create(nfeatures=FEATURES).detectAndCompute(gray, None)
    if descriptors is None:
        return np.zeros((0, 2)), np.zeros((0, 128), np.float32)
    return np.array([point.pt for point in points]).reshape(-1, 2), descriptors


def matched(
    first: tuple[np.ndarray, np.ndarray], second: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Return positions (M, 2) and (M, 2) of features that are each other's nearest, and much nearer than the next."""
    if min(len(first[0]), len(second[0])) < 2:
        return np.zeros((0, 2)), np.zeros((0, 2))
    matcher = cv2.BFMatcher(cv2.NORM_L2)
    forward = matcher.knnMatch(first[1], second[1], k=2)
    back = {m.queryIdx: m.trainIdx for m in matcher.match(second[1], first[1])}
    good = [
        (best.queryIdx, best.trainIdx)
        for best, second_best in forward
        if best.distance < MATCH_RATIO * second_best.distance and back.get(best.trainIdx) == best.queryIdx
    ]
    if not good:
        return np.zeros((0, 2)), np.zeros((0, 2))
    first_indices, right = np.array(good).T
    return first[0][first_indices], second[0][right]


def _consistent(first: np.ndarray, second: np.ndarray, camera: Camera) -> Matches | None:
    """Keep the matches that one essential matrix explains; None when too few are left."""
    if len(first) < LEAST_INLIERS:
        return None
    if len(first) > MOST_MATCHES:
        chosen = np.linspace(0, len(first) - 1, MOST_MATCHES).astype(int)
        first, second = first[chosen], second[chosen]
    rays = [_normalised(points, camera) for points in (first, second)]
    cv2.setRNGSeed(0)
    focal = (camera.fx + camera.fy) / 2
    essential, mask = cv2.findEssentialMat(
        rays[0],
        rays[1],
        np.eye(3),
        method=cv2.RANSAC,
        prob=0.999,
        threshold=INLIER_DISTANCE / focal,
        maxIters=ITERATIONS,
    )
    if essential is None or mask is None:
        return None
    is_inlier = mask.ravel().astype(bool)
    if is_inlier.sum() < max(LEAST_INLIERS, 0.3 * len(first)):
        return None
    return Matches(first[is_inlier], second[is_inlier])


def _normalised(points: np.ndarray, camera: Camera) -> np.ndarray:
    return (points - [camera.cx, camera.cy]) / [camera.fx, camera.fy]


def epipolar_distances(found: Matches, second_from_first: np.ndarray, camera: Camera) -> np.ndarray:
    """Return the Sampson distance [pixels] of each match under a relative pose (4, 4).

    A pose that does not move has no epipolar lines; the distance is then that to where the rotation takes the point.
    """
    focal = (camera.fx + camera.fy) / 2
    first = np.column_stack([_normalised(found.first, camera), np.ones(len(found.first))])
    second = np.column_stack([_normalised(found.second, camera), np.ones(len(found.second))])
    rotation, translation = second_from_first[:3, :3], second_from_first[:3, 3]
    length = float(np.linalg.norm(translation))
    if length < 1e-9:
        turned = first @ rotation.T
        z = np.where(turned[:, 2] > 1e-6, turned[:, 2], np.inf)
        expected = np.where(np.isfinite(z)[:, None], turned[:, :2] / z[:, None], 1e6)
        return focal * np.linalg.norm(second[:, :2] - expected, axis=1)
    x, y, z_axis = translation / length
    essential = np.array([[0, -z_axis, y], [z_axis, 0, -x], [-y, x, 0]]) @ rotation
    lines, back = first @ essential.T, second @ essential
    error = np.einsum("ij,ij->i", second, lines)
    gradient = lines[:, 0] ** 2 + lines[:, 1] ** 2 + back[:, 0] ** 2 + back[:, 1] ** 2
    return focal * np.abs(error) / np.sqrt(np.maximum(gradient, 1e-18))
