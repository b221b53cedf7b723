"""One step of weighted smoothing of the TSDF before its surface is drawn: what was seen once is noisy, planes are not.

A voxel of weight w keeps w / (w + n s) of its value and takes the rest from its neighbours, where n is the number of
axes on which both neighbours were observed and s the `strength`. Only such pairs count, so a plane stays where it is;
well observed voxels hardly move. This is one Jacobi step towards the maximum a posteriori field under a smoothness
prior, of which further steps change little.
"""

from __future__ import annotations

import numpy as np
from numba import prange
from scenewright.stages.fuse.surface import find_neighbours, voxel_at
from scenewright.stages.fuse.voxel_blocks import SIDE, VOXELS, VoxelBlocks
from scenewright.stages.kit.compiled import compiled


@compiled(parallel=True)
def _smooth(
    order: np.ndarray, neighbours: np.ndarray, tsdf: np.ndarray, weight: np.ndarray, strength: float, result: np.ndarray
) -> None:
    for rank in prange(order.shape[0]):
        for cell in range(VOXELS):
            voxel = order[rank] * VOXELS + cell
            if weight[voxel] <= 0:
                continue
            x, y, z = cell % SIDE, (cell // SIDE) % SIDE, cell // (SIDE * SIDE)
            total = 0.0
            axes = 0
            for axis in range(3):
                after = voxel_at(neighbours, rank, x + (axis == 0), y + (axis == 1), z + (axis == 2))
                before = voxel_at(neighbours, rank, x - (axis == 0), y - (axis == 1), z - (axis == 2))
                if after >= 0 and before >= 0 and weight[after] > 0 and weight[before] > 0:
                    total += 0.5 * (tsdf[after] + tsdf[before])
                    axes += 1
            own_weight = weight[voxel]
            result[voxel] = (own_weight * tsdf[voxel] + strength * total) / (own_weight + strength * axes)


def smoothed_tsdf(blocks: VoxelBlocks, strength: float) -> np.ndarray:
    """Return the TSDF (C, 512) float32 after the step; `strength` is in units of weight, 0 changes nothing."""
    if strength == 0:
        return blocks.tsdf
    order = blocks.canonical_order()
    result = np.zeros_like(blocks.tsdf)
    _smooth(
        order,
        find_neighbours(order, blocks),
        blocks.tsdf.reshape(-1),
        blocks.weight.reshape(-1),
        strength,
        result.reshape(-1),
    )
    return result
