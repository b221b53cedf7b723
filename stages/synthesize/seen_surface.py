"""Which true surface the camera saw: one exact point for every cell of a 1 cm grid and instance."""

from __future__ import annotations

import numpy as np
from numba import njit

from schemas.scene_parts import Camera

GRID = 0.01
"""[m]"""
_BITS = 16
_OFFSET = 1 << (_BITS - 1)


@njit(cache=True)
def _insert(
    keys: np.ndarray,
    rows: np.ndarray,
    points: np.ndarray,
    labels: np.ndarray,
    count: int,
    depth: np.ndarray,
    instance: np.ndarray,
    pose: np.ndarray,
    fx: float,
    fy: float,
    cx: float,
    cy: float,
    nearest: float,
    farthest: float,
) -> int:
    """Add the points of a frame to an open-addressing table; returns the new count."""
    mask = np.uint64(len(keys) - 1)
    height, width = depth.shape
    for v in range(height):
        for u in range(width):
            z = float(depth[v, u])
            label = instance[v, u]
            if label <= 0 or z < nearest or z > farthest:
                continue
            x, y = (u - cx) / fx * z, (v - cy) / fy * z
            px = pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z + pose[0, 3]
            py = pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z + pose[1, 3]
            pz = pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z + pose[2, 3]
            i = np.uint64(int(np.floor(px / GRID)) + _OFFSET)
            j = np.uint64(int(np.floor(py / GRID)) + _OFFSET)
            k = np.uint64(int(np.floor(pz / GRID)) + _OFFSET)
            key = (np.uint64(label) << np.uint64(48)) | (i << np.uint64(32)) | (j << np.uint64(16)) | k
            slot = ((key * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(20)) & mask
            while keys[slot] != key and keys[slot] != np.uint64(0):
                slot = (slot + np.uint64(1)) & mask
            if keys[slot] == key:
                continue
            keys[slot] = key
            rows[slot] = count
            points[count, 0], points[count, 1], points[count, 2] = px, py, pz
            labels[count] = label
            count += 1
    return count


class SeenSurface:
    """Collects the true surface that frames show, between two depths [m]. Coordinates within +-327 m."""

    def __init__(self, nearest: float, farthest: float) -> None:
        self.nearest, self.farthest = nearest, farthest
        self.count = 0
        self._allocate(1 << 18)

    def _allocate(self, capacity: int) -> None:
        self._keys = np.zeros(4 * capacity, dtype=np.uint64)
        self._rows = np.zeros(4 * capacity, dtype=np.int32)
        self._points = np.zeros((capacity, 3), dtype=np.float32)
        self._labels = np.zeros(capacity, dtype=np.int32)

    def _grow(self) -> None:
        old_points, old_keys, old_rows, old_labels = self._points, self._keys, self._rows, self._labels
        filled = self.count
        self._allocate(2 * len(old_points))
        self._points[:filled], self._labels[:filled] = old_points[:filled], old_labels[:filled]
        _rehash(self._keys, self._rows, old_keys, old_rows)

    def add(self, depth: np.ndarray, instance: np.ndarray, world_from_camera: np.ndarray, camera: Camera) -> None:
        """Add a frame: exact `depth` (H, W) [m], `instance` (H, W) int32, pose (4, 4)."""
        # A frame can bring a new point with every pixel: make room before.
        while self.count + depth.size > len(self._points):
            self._grow()
        self.count = _insert(
            self._keys,
            self._rows,
            self._points,
            self._labels,
            self.count,
            depth,
            instance,
            np.ascontiguousarray(world_from_camera, dtype=np.float64),
            camera.fx,
            camera.fy,
            camera.cx,
            camera.cy,
            self.nearest,
            self.farthest,
        )

    def result(self) -> tuple[np.ndarray, np.ndarray]:
        """Return points (N, 3) float32 [m] and instance (N,) int32, sorted by instance and cell."""
        used = self._keys != 0
        order = np.argsort(self._keys[used], kind="stable")
        rows = self._rows[used][order]
        return self._points[rows], self._labels[rows]


@njit(cache=True)
def _rehash(keys: np.ndarray, rows: np.ndarray, old_keys: np.ndarray, old_rows: np.ndarray) -> None:
    mask = np.uint64(len(keys) - 1)
    for k in range(len(old_keys)):
        key = old_keys[k]
        if key == np.uint64(0):
            continue
        slot = ((key * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(20)) & mask
        while keys[slot] != np.uint64(0):
            slot = (slot + np.uint64(1)) & mask
        keys[slot] = key
        rows[slot] = old_rows[k]
