"""Depth images of planes, boxes and spheres by analytic ray casting: exact, and independent of the renderer."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.scene_parts import Camera

CAMERA = Camera(width=160, height=120, fx=140.0, fy=140.0, cx=79.5, cy=59.5)


def rays(camera: Camera) -> np.ndarray:
    """Directions (H, W, 3) with z = 1, so that the ray parameter is the z-depth."""
    v, u = np.mgrid[0 : camera.height, 0 : camera.width].astype(float)
    return np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones_like(u)], axis=-1)


def plane_depth(directions: np.ndarray, normal: tuple[float, float, float], offset: float) -> np.ndarray:
    """z-depth of the plane n.x = offset; infinite where the ray misses."""
    slope = directions @ np.asarray(normal, dtype=float)
    with np.errstate(divide="ignore"):
        depth = offset / slope
    return np.where(depth > 1e-6, depth, np.inf)


def box_depth(directions: np.ndarray, center: tuple[float, ...], size: tuple[float, ...], yaw: float) -> np.ndarray:
    """z-depth of a box turned by `yaw` about the camera's y axis (slab method)."""
    cosine, sine = np.cos(yaw), np.sin(yaw)
    box_from_camera = np.array([[cosine, 0, -sine], [0, 1, 0], [sine, 0, cosine]])
    origin = -box_from_camera @ np.asarray(center, dtype=float)
    turned = directions @ box_from_camera.T
    with np.errstate(divide="ignore", invalid="ignore"):
        near = (-np.asarray(size) / 2 - origin) / turned
        far = (np.asarray(size) / 2 - origin) / turned
    enter, leave = np.minimum(near, far).max(axis=-1), np.maximum(near, far).min(axis=-1)
    return np.where((enter <= leave) & (enter > 0), enter, np.inf)


def sphere_depth(directions: np.ndarray, center: tuple[float, ...], radius: float) -> np.ndarray:
    """z-depth of a sphere."""
    middle = np.asarray(center, dtype=float)
    a = (directions**2).sum(axis=-1)
    b = directions @ middle
    discriminant = b**2 - a * (middle @ middle - radius**2)
    return np.where(discriminant > 0, (b - np.sqrt(np.maximum(discriminant, 0))) / a, np.inf)


def combine(*depths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Nearest depth (H, W) float32 with 0 where nothing is hit, and which surface (1..n) it is, 0 = none."""
    stacked = np.stack(depths)
    nearest = stacked.min(axis=0)
    which = np.where(np.isfinite(nearest), stacked.argmin(axis=0) + 1, 0)
    return np.where(np.isfinite(nearest), nearest, 0).astype(np.float32), which.astype(np.int32)


def best_overlap(labels: np.ndarray, mask: np.ndarray) -> tuple[int, float]:
    """The label with the largest intersection over union with a mask, and that value."""
    best = (0, 0.0)
    for label in np.unique(labels[mask]).tolist():
        if label:
            region = labels == label
            value = float((region & mask).sum() / (region | mask).sum())
            best = max(best, (label, value), key=lambda pair: pair[1])
    return best
