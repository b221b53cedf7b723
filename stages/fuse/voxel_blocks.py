"""Storage of the volumetric map: blocks of 8^3 voxels in flat growing arrays, found through a hash of coordinates.

A voxel (i, j, k) covers [i, i+1) x [j, j+1) x [k, k+1) times the voxel size; its value belongs to its centre. Within a
block voxels run x fastest: index = x + 8 y + 64 z. Blocks keep the order in which they were first seen (by one thread,
so that it never depends on timing); whoever writes them sorts them (`canonical_order`).
"""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.compiled import compiled

SIDE = 8
"""Voxels along the edge of a block."""
VOXELS = SIDE**3
"""Voxels of a block."""
COORDINATE_LIMIT = 1 << 20
"""Block and voxel coordinates lie within +-2^20: three of them fit into one 64-bit key."""
AWAY = 1 << 24
"""Added before fractions are cut off, so that this rounds down on both sides of zero."""
FIXED_POINT = 256
"""Colours are kept as 8.8 fixed point, so that late observations still move the mean."""

FIELDS: dict[str, tuple[type, tuple[int, ...]]] = {
    "tsdf": (np.float32, (VOXELS,)),
    "weight": (np.float32, (VOXELS,)),
    "color": (np.uint16, (VOXELS, 3)),
    "segment": (np.int32, (VOXELS,)),
    "votes": (np.int16, (VOXELS,)),
    "hits": (np.uint8, (VOXELS,)),
    "coordinates": (np.int32, (3,)),
    "last_touched": (np.int32, ()),
}
"""What a block holds: array -> type and shape per block."""


@compiled(inline="always")
def pack(x: int, y: int, z: int) -> int:
    """Return the 64-bit key of integer coordinates, each within +-COORDINATE_LIMIT."""
    return ((x + COORDINATE_LIMIT) << 42) | ((y + COORDINATE_LIMIT) << 21) | (z + COORDINATE_LIMIT)


@compiled(inline="always")
def mix(key: int, mask: int) -> int:
    """Return the first place to look for `key` in a table of mask + 1 (a power of two) entries."""
    mixed = (key ^ (key >> 31)) * 0x1D8E4E27C47D124F
    return (mixed ^ (mixed >> 32)) & mask


@compiled
def find(keys: np.ndarray, slots: np.ndarray, key: int) -> int:
    """Return the slot of `key` in the open-addressing table (keys (T,), -1 empty; slots (T,)), or -1."""
    mask = keys.shape[0] - 1
    hash_slot = mix(key, mask)
    while keys[hash_slot] != -1:
        if keys[hash_slot] == key:
            return slots[hash_slot]
        hash_slot = (hash_slot + 1) & mask
    return -1


@compiled
def _insert(keys: np.ndarray, slots: np.ndarray, key: int, slot: int) -> None:
    mask = keys.shape[0] - 1
    hash_slot = mix(key, mask)
    while keys[hash_slot] != -1:
        hash_slot = (hash_slot + 1) & mask
    keys[hash_slot] = key
    slots[hash_slot] = slot


@compiled
def fill_table(keys: np.ndarray, slots: np.ndarray, coordinates: np.ndarray, count: int) -> None:
    for slot in range(count):
        _insert(keys, slots, pack(coordinates[slot, 0], coordinates[slot, 1], coordinates[slot, 2]), slot)


@compiled(nogil=True)
def _touch(
    depth: np.ndarray,
    intrinsics: np.ndarray,
    world_from_camera: np.ndarray,
    stride: int,
    near: float,
    far: float,
    truncation: float,
    block_size: float,
    keys: np.ndarray,
    slots: np.ndarray,
    coordinates: np.ndarray,
    last_touched: np.ndarray,
    count: int,
    stamp: int,
    touched: np.ndarray,
) -> tuple[int, int]:
    """Append the blocks on the rays' truncation bands; return (blocks, touched), touched = -1 when full."""
    height, width = depth.shape
    fx, fy, cx, cy = intrinsics
    capacity = coordinates.shape[0]
    turn = world_from_camera[:3, :3] / block_size
    start_x, start_y, start_z = world_from_camera[:3, 3] / block_size + AWAY
    touched_count = 0
    last_key = -1
    for row in range(stride // 2, height, stride):
        y = (row - cy) / fy
        for column in range(stride // 2, width, stride):
            distance = depth[row, column]
            if not (near <= distance <= far):
                continue
            x = (column - cx) / fx
            ray_x = turn[0, 0] * x + turn[0, 1] * y + turn[0, 2]
            ray_y = turn[1, 0] * x + turn[1, 1] * y + turn[1, 2]
            ray_z = turn[2, 0] * x + turn[2, 1] * y + turn[2, 2]
            first = max(distance - truncation, 0.0)
            length = (distance + truncation - first) * np.sqrt(x * x + y * y + 1.0)
            steps = int(np.ceil(length * 2.0 / block_size))
            stretch = (distance + truncation - first) / steps
            for step in range(steps + 2):
                along, shift = first + stretch * step, 0.0
                if step > steps:  # the cell with the measured point is numbered like its first voxel
                    along, shift = distance, 0.5 / SIDE
                block_x = int(start_x + along * ray_x - shift) - AWAY
                block_y = int(start_y + along * ray_y - shift) - AWAY
                block_z = int(start_z + along * ray_z - shift) - AWAY
                key = pack(block_x, block_y, block_z)
                if key == last_key:
                    continue
                last_key = key
                slot = find(keys, slots, key)
                if slot < 0:
                    if count == capacity:
                        return count, -1
                    slot = count
                    count += 1
                    coordinates[slot, 0] = block_x
                    coordinates[slot, 1] = block_y
                    coordinates[slot, 2] = block_z
                    last_touched[slot] = 0
                    _insert(keys, slots, key, slot)
                if last_touched[slot] != stamp:
                    last_touched[slot] = stamp
                    touched[touched_count] = slot
                    touched_count += 1
    return count, touched_count


class VoxelBlocks:
    """The arrays of the map. `count` blocks are in use; every array has room for `capacity` of them.

    tsdf (C, 512) float32 in truncation distances, positive before the surface; weight (C, 512) float32; color
    (C, 512, 3) uint16, 8.8 fixed point; segment (C, 512) int32, 0 none; votes (C, 512) int16; hits (C, 512)
    uint8: measured points in the cell between a voxel's centre and the next ones in x, y and z; coordinates (C, 3)
    int32.
    Fresh memory is zero and is only backed by the machine once it is used, so spare capacity costs nothing.
    """

    tsdf: np.ndarray
    weight: np.ndarray
    color: np.ndarray
    segment: np.ndarray
    votes: np.ndarray
    hits: np.ndarray
    coordinates: np.ndarray
    last_touched: np.ndarray

    def __init__(self, voxel_size: float, capacity: int = 1 << 12) -> None:
        self.voxel_size = float(voxel_size)
        self.count = 0
        self._stamp = 0
        for name, (kind, shape) in FIELDS.items():
            setattr(self, name, np.zeros((capacity, *shape), dtype=kind))
        self._make_table(capacity)

    @property
    def capacity(self) -> int:
        """Blocks that fit before the arrays grow."""
        return len(self.coordinates)

    @property
    def block_size(self) -> float:
        """Edge of a block [m]."""
        return SIDE * self.voxel_size

    def touch(
        self,
        depth: np.ndarray,
        intrinsics: np.ndarray,
        world_from_camera: np.ndarray,
        *,
        truncation: float,
        near: float,
        far: float,
        stride: int,
    ) -> np.ndarray:
        """Return the slots (T,) int32 of the blocks within the truncation band of a frame, made where missing.

        Every `stride`-th ray of depth (H, W) float32 [m] is followed from `truncation` before to `truncation` behind
        its depth; depths outside of [near, far] are skipped. intrinsics (4,): fx, fy, cx, cy [pixels].
        """
        self._stamp += 1
        touched = np.empty(self.capacity, dtype=np.int32)
        while True:
            self.count, used = _touch(
                depth,
                intrinsics,
                world_from_camera,
                stride,
                near,
                far,
                truncation,
                self.block_size,
                self.keys,
                self.slots,
                self.coordinates,
                self.last_touched,
                self.count,
                self._stamp,
                touched,
            )
            if used >= 0:
                return touched[:used]
            self._grow(2 * self.capacity)
            self._stamp += 1
            touched = np.empty(self.capacity, dtype=np.int32)

    def canonical_order(self) -> np.ndarray:
        """Return the slots (count,) of the blocks sorted by coordinates: z slowest, x fastest."""
        used = self.coordinates[: self.count]
        return np.lexsort((used[:, 0], used[:, 1], used[:, 2])).astype(np.int32)

    def _make_table(self, capacity: int) -> None:
        size = 1 << int(np.ceil(np.log2(2 * capacity)))
        self.keys = np.full(size, -1, dtype=np.int64)
        self.slots = np.zeros(size, dtype=np.int32)

    def _grow(self, capacity: int) -> None:
        """Make room, one array after the other, so that no more than one is held twice at a time."""
        for name, (kind, shape) in FIELDS.items():
            larger: np.ndarray = np.zeros((capacity, *shape), dtype=kind)
            larger[: self.count] = getattr(self, name)[: self.count]
            setattr(self, name, larger)
        self._make_table(capacity)
        fill_table(self.keys, self.slots, self.coordinates, self.count)
