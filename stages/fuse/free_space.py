"""Where cameras saw that nothing is: a coarse grid of the cells that rays of depth went through.

A map of surfaces does not tell the unknown from the empty. What lies behind a wall was never looked into; what lies
behind a counter was, over it.
"""

from __future__ import annotations

import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.fuse.integration import intrinsics_of
from scenewright.stages.fuse.voxel_blocks import AWAY, COORDINATE_LIMIT, SIDE, VOXELS, fill_table, find, pack
from scenewright.stages.kit.compiled import compiled

CELL = 0.08
"""Edge of a cell [m]: a few voxels of the map, a fraction of the thickness of furniture."""
STRIDE = 8
"""Every how many-th pixel is looked along."""
SHORT = 1.5
"""A ray ends this many cells before the measured point: the cell of a surface is not free."""
_PART = 2 * COORDINATE_LIMIT - 1
"""Bits of one coordinate in a key."""
FEWEST = 2
"""Frames that have to see a cell as free."""


class FreeSpace:
    """Cells of CELL metres that frames saw through, in blocks of SIDE^3 that are found by their coordinates."""

    def __init__(self) -> None:
        self.count = 0
        self.coordinates = np.zeros((64, 3), np.int32)
        self.frames = np.zeros((64, VOXELS), np.uint8)
        """Frames that saw through each cell, 255 at most."""
        self._last = np.zeros((64, VOXELS), np.int32)
        self._keys, self._slots = np.full(256, -1, np.int64), np.zeros(256, np.int32)
        self._frame = 0

    def add_frame(self, camera: Camera, depth: np.ndarray, world_from_camera: np.ndarray, far: float) -> None:
        """Look along the pixels of a frame: depth (H, W) float32 [m], world_from_camera (4, 4); `far` [m]."""
        self._frame += 1
        arguments = (
            np.ascontiguousarray(depth, np.float32),
            intrinsics_of(camera),
            np.ascontiguousarray(world_from_camera, float),
            far,
        )
        keys = np.unique(_blocks_on_rays(*arguments))
        new = keys[_missing(self._keys, self._slots, keys)]
        if len(new):
            self._append(new)
        _see_through(*arguments, self._keys, self._slots, self.frames, self._last, self._frame)

    def is_free(self, points: np.ndarray) -> np.ndarray:
        """Return which points (N, 3) [m], world frame, lie in cells that enough frames saw through."""
        cells = np.floor(np.asarray(points, float) / CELL).astype(np.int64)
        return _look_up(cells, self._keys, self._slots, self.frames) >= FEWEST

    def as_arrays(self) -> dict[str, np.ndarray]:
        """Return the cells that enough frames saw through, in canonical order: block_coordinates (B, 3) int32, `free`
        (B, 64) uint8, a bit for each of 8^3 cells of a block, x fastest, lowest bit first, and the `edge` (1,) of one
        [m]. Blocks without such a cell are left out."""
        free = self.frames[: self.count] >= FEWEST
        kept = np.flatnonzero(free.any(axis=1))
        kept = kept[np.lexsort(self.coordinates[kept].T)]
        return {
            "block_coordinates": self.coordinates[kept],
            "free": np.packbits(free[kept], axis=1, bitorder="little"),
            "edge": np.array([CELL]),
        }

    def _append(self, keys: np.ndarray) -> None:
        first, self.count = self.count, self.count + len(keys)
        if self.count > len(self.coordinates):
            size = max(self.count, 2 * len(self.coordinates)) - len(self.coordinates)
            self.coordinates = np.concatenate([self.coordinates, np.zeros((size, 3), np.int32)])
            self.frames = np.concatenate([self.frames, np.zeros((size, VOXELS), np.uint8)])
            self._last = np.concatenate([self._last, np.zeros((size, VOXELS), np.int32)])
        self.coordinates[first : self.count] = (
            np.stack([keys >> 42, (keys >> 21) & _PART, keys & _PART], axis=1) - COORDINATE_LIMIT
        )
        if 3 * self.count > len(self._keys):
            size = 4 * 2 ** int(np.ceil(np.log2(self.count)))
            self._keys, self._slots = np.full(size, -1, np.int64), np.zeros(size, np.int32)
        self._keys[:] = -1
        fill_table(self._keys, self._slots, self.coordinates, self.count)


@compiled
def _walk(
    depth: np.ndarray, intrinsics: np.ndarray, world_from_camera: np.ndarray, row: int, column: int, far: float
) -> tuple[np.ndarray, int]:
    """Return a step of one cell along a pixel's ray [m], and how many of them stay in front of what was measured."""
    x, y = (column - intrinsics[2]) / intrinsics[0], (row - intrinsics[3]) / intrinsics[1]
    length = np.sqrt(x * x + y * y + 1.0)
    ray = (world_from_camera[:3, 0] * x + world_from_camera[:3, 1] * y + world_from_camera[:3, 2]) / length
    reach = min(depth[row, column], far) * length
    return ray * CELL, max(int(reach * 0.99 / CELL - SHORT) + 1, 0)


@compiled
def _blocks_on_rays(depth: np.ndarray, intrinsics: np.ndarray, world_from_camera: np.ndarray, far: float) -> np.ndarray:
    """Return the keys of the blocks on the rays, each many times."""
    keys = np.empty(1024, np.int64)
    count = 0
    for row in range(STRIDE // 2, depth.shape[0], STRIDE):
        for column in range(STRIDE // 2, depth.shape[1], STRIDE):
            if not depth[row, column] > 0:
                continue
            step, steps = _walk(depth, intrinsics, world_from_camera, row, column, far)
            place = world_from_camera[:3, 3].copy()
            last = -1
            for _ in range(steps):
                place += step
                key = _key_of(place)
                if key != last:
                    if count == keys.shape[0]:
                        keys = np.concatenate((keys, np.empty_like(keys)))
                    keys[count] = key
                    count += 1
                    last = key
    return keys[:count]


@compiled
def _key_of(place: np.ndarray) -> int:
    size = CELL * SIDE
    return pack(
        int(place[0] / size + AWAY) - AWAY, int(place[1] / size + AWAY) - AWAY, int(place[2] / size + AWAY) - AWAY
    )


@compiled
def _see_through(
    depth: np.ndarray,
    intrinsics: np.ndarray,
    world_from_camera: np.ndarray,
    far: float,
    keys: np.ndarray,
    slots: np.ndarray,
    frames: np.ndarray,
    last: np.ndarray,
    frame: int,
) -> None:
    """Count this frame once in every cell on its rays."""
    for row in range(STRIDE // 2, depth.shape[0], STRIDE):
        for column in range(STRIDE // 2, depth.shape[1], STRIDE):
            if not depth[row, column] > 0:
                continue
            step, steps = _walk(depth, intrinsics, world_from_camera, row, column, far)
            place = world_from_camera[:3, 3].copy()
            key, slot = -1, -1
            for _ in range(steps):
                place += step
                here = _key_of(place)
                if here != key:
                    key, slot = here, find(keys, slots, here)
                i, j, k = int(place[0] / CELL + AWAY), int(place[1] / CELL + AWAY), int(place[2] / CELL + AWAY)
                cell = (i % SIDE) + SIDE * (j % SIDE) + SIDE * SIDE * (k % SIDE)
                if last[slot, cell] != frame:
                    last[slot, cell] = frame
                    frames[slot, cell] = min(frames[slot, cell] + 1, 255)


@compiled
def _missing(keys: np.ndarray, slots: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    missing = np.zeros(wanted.shape[0], np.bool_)
    for number in range(wanted.shape[0]):
        missing[number] = find(keys, slots, wanted[number]) < 0
    return missing


@compiled
def _look_up(cells: np.ndarray, keys: np.ndarray, slots: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Return how many frames saw through cells (N, 3) int64."""
    counts = np.zeros(cells.shape[0], np.int64)
    for number in range(cells.shape[0]):
        i, j, k = cells[number]
        slot = find(keys, slots, pack(i // SIDE, j // SIDE, k // SIDE))
        if slot >= 0:
            counts[number] = frames[slot, (i % SIDE) + SIDE * (j % SIDE) + SIDE * SIDE * (k % SIDE)]
    return counts
