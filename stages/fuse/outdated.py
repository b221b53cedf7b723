"""Frames of before somebody opened a drawer show what is there no more: that part of them is left out of the map."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scenewright.schemas.articulations import Articulations
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.kit.formats.numpy_files import read_arrays

HIDDEN = 0.06
"""A voxel that lies so far behind the measured depth is hidden, and says nothing of that pixel [m]."""


class Outdated:
    """Voxels that changed, and until which frame the log shows what they were."""

    def __init__(self, articulations: Articulations) -> None:
        """Raises BadInput for a damaged file."""
        file: Path = articulations.path("changes.npz")
        points, until = read_arrays(file, "points", "until", shapes=("N 3", "N"), hint="run `articulate` again")
        self.points, self.until = points.astype(np.float64), until.astype(np.int64)
        self.edge = articulations.info.voxel_size

    def without(self, depth: np.ndarray, camera: Camera, world_from_camera: np.ndarray, frame: int) -> np.ndarray:
        """Return the depth (H, W) [m] of a frame with 0 where its ray meets a voxel that has changed since."""
        old = self.points[self.until >= frame]
        if not len(old):
            return depth
        local = (old - world_from_camera[:3, 3]) @ world_from_camera[:3, :3]
        current = depth.copy()
        _blank(current, local, np.array([camera.fx, camera.fy, camera.cx, camera.cy]), self.edge)
        return current


@compiled
def _blank(depth: np.ndarray, points: np.ndarray, intrinsics: np.ndarray, edge: float) -> None:
    """Set depth (H, W) to 0 over the outline of the ball around each voxel at points (N, 3), camera frame."""
    fx, fy, cx, cy = intrinsics
    height, width = depth.shape
    radius = 0.87 * edge
    for n in range(len(points)):
        x, y, z = points[n]
        if z < 0.2:
            continue
        u_low, u_high = int(np.ceil((x - radius) / z * fx + cx)), int(np.floor((x + radius) / z * fx + cx))
        v_low, v_high = int(np.ceil((y - radius) / z * fy + cy)), int(np.floor((y + radius) / z * fy + cy))
        for v in range(max(v_low, 0), min(v_high, height - 1) + 1):
            for u in range(max(u_low, 0), min(u_high, width - 1) + 1):
                if depth[v, u] > z - HIDDEN:
                    depth[v, u] = 0.0
