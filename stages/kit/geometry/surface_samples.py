"""A sparse sample of the surface that a posed depth sequence saw: points with normals in the log's world."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.kit.geometry.transforms import apply

STRIDE_ANGLE = 0.014
"""Angle between neighbouring samples [rad]: 8 pixels of a Kinect at 640x480."""
SMALLEST_DEPTH, LARGEST_DEPTH = 0.3, 5.0
"""Depths between which samples are taken [m]; by eye."""


def surface_samples(depth: np.ndarray, camera: Camera, world_from_camera: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return points (N, 3) [m] and unit normals (N, 3) that face the camera, both in the world.

    `depth` is (H, W) float32 [m], 0 = invalid. Normals come from differences over two strides, so that
    quantisation and noise of the depth do not dominate; pixels at depth edges are left out.
    """
    stride = max(1, round(STRIDE_ANGLE * camera.fx))
    points = back_project(depth, camera, stride).astype(np.float64)
    valid = (points[..., 2] > SMALLEST_DEPTH) & (points[..., 2] < LARGEST_DEPTH)
    if min(points.shape[:2]) < 3:
        return np.zeros((0, 3)), np.zeros((0, 3))
    across = points[1:-1, 2:] - points[1:-1, :-2]
    along = points[2:, 1:-1] - points[:-2, 1:-1]
    center = points[1:-1, 1:-1]
    jump = 0.06 * center[..., 2] + 0.05
    good = valid[1:-1, 1:-1] & valid[1:-1, 2:] & valid[1:-1, :-2] & valid[2:, 1:-1] & valid[:-2, 1:-1]
    good &= (np.abs(across[..., 2]) < 2 * jump) & (np.abs(along[..., 2]) < 2 * jump)
    normals = np.cross(across, along)
    length = np.linalg.norm(normals, axis=-1)
    good &= length > 0
    normals = normals[good] / length[good][:, None]
    center = center[good]
    normals[np.einsum("ij,ij->i", normals, center) > 0] *= -1
    return apply(world_from_camera, center), normals @ world_from_camera[:3, :3].T
