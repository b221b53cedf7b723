"""What matching makes of a rectified pair, and the depth that follows from it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.schemas.scene_parts import Camera


@dataclass(frozen=True)
class DisparityMap:
    """Disparity of every pixel of the left image: a point seen at column x is seen at x - disparity in the right."""

    disparity: np.ndarray
    """(H, W) float32 [px], positive; NaN where it is not known."""
    confidence: np.ndarray
    """(H, W) float32, 0 (not known) to 1."""

    @property
    def known(self) -> np.ndarray:
        """(H, W) bool."""
        return np.isfinite(self.disparity)


def depth_of(disparity: np.ndarray, camera: Camera, baseline: float) -> np.ndarray:
    """Return depth (H, W) float32 [m], z = fx * baseline / disparity; 0 where the disparity is not positive and finite.

    `disparity` (H, W) [px] is of a rectified pair whose eyes share a principal point; `baseline` [m].
    """
    positive = np.isfinite(disparity) & (disparity > 0)
    depth = np.zeros(disparity.shape, np.float32)
    depth[positive] = camera.fx * baseline / disparity[positive]
    return depth


def depth_deviation(depth: np.ndarray, deviation: np.ndarray, camera: Camera, baseline: float) -> np.ndarray:
    """Return the standard deviation (H, W) float32 [m] of depth (H, W) [m] from disparities that have the standard
    deviation `deviation` (H, W) [px]: dz = z^2 / (fx * baseline) dd. It is 0 where depth is."""
    return (depth * depth * deviation / (camera.fx * baseline)).astype(np.float32)
