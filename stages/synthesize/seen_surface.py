"""Which true surface the camera saw: one exact point for every cell of a 1 cm grid and instance."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.compiled import compiled

GRID = 0.01
"""Edge of the cells, one point each [m]."""
_BITS = 16
"""Bits of a coordinate in the number of a cell."""
_OFFSET = 1 << (_BITS - 1)
"""Added to the coordinates of cells, so that none is negative."""


class _Table(NamedTuple):
    """An open-addressing table of cells (key 0: free), and the points that its rows name."""

    keys: np.ndarray
    """(4 P,) uint64"""
    rows: np.ndarray
    """(4 P,) int32"""
    points: np.ndarray
    """(P, 3) float32 [m]"""
    labels: np.ndarray
    """(P,) int32"""


class _View(NamedTuple):
    """Camera [px] of a frame, its pose (4, 4), and the depths between which it counts [m]."""

    fx: float
    fy: float
    cx: float
    cy: float
    world_from_camera: np.ndarray
    nearest: float
    farthest: float


@compiled
def _insert(table: _Table, count: int, depth: np.ndarray, instance: np.ndarray, view: _View) -> int:
    """Add the points of a frame to a table that holds `count`; returns the new count."""
    keys, rows, points, labels = table
    fx, fy, cx, cy, pose, nearest, farthest = view
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
        self._table = _Table(
            keys=np.zeros(4 * capacity, dtype=np.uint64),
            rows=np.zeros(4 * capacity, dtype=np.int32),
            points=np.zeros((capacity, 3), dtype=np.float32),
            labels=np.zeros(capacity, dtype=np.int32),
        )

    def _grow(self) -> None:
        old, filled = self._table, self.count
        self._allocate(2 * len(old.points))
        self._table.points[:filled], self._table.labels[:filled] = old.points[:filled], old.labels[:filled]
        _rehash(self._table.keys, self._table.rows, old.keys, old.rows)

    def add(self, depth: np.ndarray, instance: np.ndarray, world_from_camera: np.ndarray, camera: Camera) -> None:
        """Add a frame: exact `depth` (H, W) [m], `instance` (H, W) int32, pose (4, 4)."""
        # A frame can bring a new point with every pixel: make room before.
        while self.count + depth.size > len(self._table.points):
            self._grow()
        pose = np.ascontiguousarray(world_from_camera, dtype=np.float64)
        view = _View(camera.fx, camera.fy, camera.cx, camera.cy, pose, self.nearest, self.farthest)
        self.count = _insert(self._table, self.count, depth, instance, view)

    def result(self) -> tuple[np.ndarray, np.ndarray]:
        """Return points (N, 3) float32 [m] and instance (N,) int32, sorted by instance and cell."""
        table = self._table
        used = table.keys != 0
        order = np.argsort(table.keys[used], kind="stable")
        rows = table.rows[used][order]
        return table.points[rows], table.labels[rows]


@compiled
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
