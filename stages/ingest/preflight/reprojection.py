"""Poses against depth: back-project one frame, carry it into another, compare with what that one measured.

This needs no texture and no features. Depth that the other camera cannot see (behind something nearer) disagrees
whatever the poses are, which is why medians and truncated means are compared, never sums of squares.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest.preflight.fits import Fit, as_fit, relative_pose
from scenewright.stages.ingest.preflight.looking import Look
from scenewright.stages.kit.geometry.cameras import back_project

SAMPLES_ACROSS = 40
"""Sampled columns of a picture; rows at the same spacing."""
TRUNCATION = 0.05
"""Relative depth residual from which a pixel counts as wrong altogether."""
LEAST_SAMPLES = 60
"""Pixels that must fall on measured depth for a pair to say anything; its cost is drawn towards 1 up to twice that."""
NEAREST = 0.02
"""Points nearer to the other camera than this share of their own depth are behind it, or as good as."""


class DepthPairs:
    """The pairs of frames of one camera, prepared once for many hypotheses about their poses."""

    def __init__(self, looks: Mapping[int, Look], pairs: Sequence[tuple[int, int]]) -> None:
        usable = {index: look for index, look in looks.items() if look.depth is not None}
        self.pairs = [(i, j) for i, j in pairs if i in usable and j in usable]
        """Index pairs, first before second."""
        indices = {index for pair in self.pairs for index in pair}
        self._depths = {i: usable[i].depth for i in indices}
        self._cameras = {i: usable[i].depth_camera for i in indices}
        self._points = {i: _samples(usable[i]) for i in indices}

    def __len__(self) -> int:
        return len(self.pairs)

    def fit(self, poses: np.ndarray, focal_factor: float = 1.0) -> Fit:
        """Compare the pairs with world_from_camera (N, 4, 4) of all frames.

        `focal_factor` multiplies the focal lengths.
        """
        rows = []
        for i, j in self.pairs:
            j_from_i = relative_pose(poses[j], poses[i])
            rows.append(self._fit_pair(i, j, j_from_i, relative_pose(poses[i], poses[j]), focal_factor))
        return as_fit(rows)

    def fit_motionless(self) -> Fit:
        """Compare the pairs as if the camera had not moved."""
        return as_fit([self._fit_pair(i, j, np.eye(4), np.eye(4), 1.0) for i, j in self.pairs])

    def _fit_pair(
        self, i: int, j: int, j_from_i: np.ndarray, i_from_j: np.ndarray, focal_factor: float
    ) -> tuple[float, float, float]:
        forward = self.residuals(i, j, j_from_i, focal_factor)
        back = self.residuals(j, i, i_from_j, focal_factor)
        sample_count = len(self._points[i]) + len(self._points[j])
        residuals = np.abs(np.concatenate([forward, back]))
        overlap = len(residuals) / max(sample_count, 1)
        if not len(residuals):
            return 1.0, 1.0, 0.0
        trust = min(1.0, len(residuals) / (2 * min(LEAST_SAMPLES, max(sample_count // 2, 1))))
        residual = min(float(np.median(residuals)), 1.0) if trust >= 0.5 else 1.0
        cost = trust * float(np.minimum(residuals / TRUNCATION, 1.0).mean()) + (1 - trust)
        return residual, cost, overlap

    def residuals(self, source: int, target: int, target_from_source: np.ndarray, focal: float = 1.0) -> np.ndarray:
        """Return (predicted - measured) / measured depth of the samples of frame `source` that frame `target` has
        depth for."""
        camera = self._cameras[target]
        points = self._points[source] * np.array([1 / focal, 1 / focal, 1.0])
        u, v, z, inside = projected(points @ target_from_source[:3, :3].T + target_from_source[:3, 3], camera, focal)
        inside &= z > NEAREST * self._points[source][:, 2]
        depth = self._depths[target]
        assert depth is not None
        measured = depth[v[inside], u[inside]] * 1e-3
        predicted = z[inside]
        is_measured = measured > 0
        return (predicted[is_measured] - measured[is_measured]) / measured[is_measured]


def projected(
    points: np.ndarray, camera: Camera, focal: float = 1.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return whole pixels u, v (N,), z-depth (N,) and whether points (N, 3) fall into the picture of a camera."""
    z = points[:, 2]
    ahead = z > 1e-6
    safe = np.where(ahead, z, 1.0)
    u = np.rint(np.clip(focal * camera.fx * points[:, 0] / safe + camera.cx, -1e6, 1e6)).astype(np.int64)
    v = np.rint(np.clip(focal * camera.fy * points[:, 1] / safe + camera.cy, -1e6, 1e6)).astype(np.int64)
    inside = ahead & (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    return u, v, z, inside


def _samples(look: Look) -> np.ndarray:
    """Return points (N, 3) float64 [m] of a grid of pixels with depth, in the camera."""
    assert look.depth is not None
    step = max(1, round(look.depth.shape[1] / SAMPLES_ACROSS))
    points = back_project(look.depth * np.float32(1e-3), look.depth_camera)[step // 2 :: step, step // 2 :: step]
    points = points.reshape(-1, 3).astype(np.float64)
    return points[points[:, 2] > 0]
