"""Where depth was measured: the points of a depth image, counted in the cells of the map that they fall into.

A cell is the cube between eight voxel centres, as in surface.py, and is numbered like its first voxel. Points are taken
about a voxel apart, but all of them where depth changes steeply from pixel to pixel: what is seen at a flat angle is
sampled thinly in one direction. Depth that is hardly known makes no point.
"""

from __future__ import annotations

import numpy as np
from scenewright.stages.fuse.voxel_blocks import AWAY, VoxelBlocks, find, pack
from scenewright.stages.kit.compiled import compiled

TILE = 4
"""Pixels a side that are looked at together."""
STEEP = 2.0
"""A tile is steep where its depth changes by more than this many times its width: seen at less than 27 degrees."""
LARGEST_DEVIATION = 0.08
"""Depth of a larger standard deviation tells not in which cell its point is [m]."""
MOST_HITS = 255
"""Largest count of a voxel: it has 8 bits."""


def sure_depth(depth: np.ndarray, deviation: np.ndarray | None) -> np.ndarray:
    """Return depth (H, W) float32 [m] that is 0 where its deviation (H, W) [m] is over LARGEST_DEVIATION."""
    return depth if deviation is None else np.where(deviation <= LARGEST_DEVIATION, depth, np.float32(0))


@compiled(nogil=True)
def _count_hits(
    depth: np.ndarray,
    intrinsics: np.ndarray,
    world_from_camera: np.ndarray,
    near: float,
    far: float,
    voxel_size: float,
    keys: np.ndarray,
    slots: np.ndarray,
    hits: np.ndarray,
) -> None:
    height, width = depth.shape
    fx, fy, cx, cy = intrinsics
    eye = world_from_camera[:3, 3] / voxel_size - 0.5 + AWAY
    across = world_from_camera[:3, 0] / (fx * voxel_size)
    down = world_from_camera[:3, 1] / (fy * voxel_size)
    start = world_from_camera[:3, 2] / voxel_size - cx * across - cy * down
    eye_x, eye_y, eye_z = eye[0], eye[1], eye[2]
    across_x, across_y, across_z = across[0], across[1], across[2]
    pixel = np.float32(1 / min(fx, fy))
    slope = np.float32(STEEP * (TILE - 1)) * pixel
    pitch = pixel / np.float32(voxel_size)
    nearest, farthest = np.float32(near), np.float32(far)
    last_block, slot, last_cell = -1, -1, -1
    lows = np.empty(width // TILE, dtype=np.float32)
    highs = np.empty(width // TILE, dtype=np.float32)
    for top in range(0, height - TILE + 1, TILE):
        for n in range(len(lows)):
            low, high = farthest, np.float32(0)
            for row in range(top, top + TILE):
                for column in range(TILE * n, TILE * n + TILE):
                    z = depth[row, column]
                    low = min(low, z) if z >= nearest else low
                    high = max(high, z) if z <= farthest else high
            lows[n], highs[n] = low, high
        for n in range(len(lows)):
            low, high = lows[n], highs[n]
            if high < nearest:
                continue
            spacing = low * pitch
            if high - low > slope * low or spacing > 0.5:
                step = 1
            elif spacing > 0.25:
                step = 2
            else:
                step = 4
            for row in range(top + step // 2, top + TILE, step):
                ray_x = start[0] + row * down[0]
                ray_y = start[1] + row * down[1]
                ray_z = start[2] + row * down[2]
                for column in range(TILE * n + step // 2, TILE * n + TILE, step):
                    z = depth[row, column]
                    if not (nearest <= z <= farthest):
                        continue
                    i = int(z * (column * across_x + ray_x) + eye_x) - AWAY
                    j = int(z * (column * across_y + ray_y) + eye_y) - AWAY
                    k = int(z * (column * across_z + ray_z) + eye_z) - AWAY
                    block = pack(i >> 3, j >> 3, k >> 3)
                    cell = (i & 7) | (j & 7) << 3 | (k & 7) << 6
                    if block != last_block:
                        last_block = block
                        slot = find(keys, slots, block)
                    elif cell == last_cell:
                        continue
                    last_cell = cell
                    if slot >= 0 and hits[slot, cell] < MOST_HITS:
                        hits[slot, cell] += 1


def count_hits(
    blocks: VoxelBlocks,
    depth: np.ndarray,
    intrinsics: np.ndarray,
    world_from_camera: np.ndarray,
    *,
    near: float,
    far: float,
) -> None:
    """Count the points of depth (H, W) float32 [m] between `near` and `far` in blocks.hits, which stops at MOST_HITS.

    intrinsics (4,): fx, fy, cx, cy [pixels]; world_from_camera (4, 4). Blocks that are missing are left out.
    """
    _count_hits(
        depth, intrinsics, world_from_camera, near, far, blocks.voxel_size, blocks.keys, blocks.slots, blocks.hits
    )
