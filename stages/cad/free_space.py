"""What the cameras saw empty: a CAD model must not fill it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.kit.formats.numpy_files import read_arrays

SIDE = 8
"""Voxels along the edge of a block."""
REACH = 1 << 20
"""Added to the coordinates of blocks, so that three of 21 bits make one number."""
LEAST_WEIGHT = 0.5
"""Voxels that were hardly observed are not known to be empty."""


@dataclass(frozen=True)
class FreeSpace:
    """Observed voxels of a map's truncated signed distance field; empty where the map has no volume."""

    keys: np.ndarray
    """(B,) int64, sorted: packed block coordinates."""
    distance: np.ndarray
    """(B, 512) float16: metres in front of the nearest surface, at most the truncation distance; 0 on, behind and
    where nothing was observed. Over the voxels of a block x runs fastest."""
    voxel_size: float

    def depth_within(self, points: np.ndarray) -> np.ndarray:
        """Return how far [m] each of the points (N, 3), world, lies in space that was seen empty (N,).

        0 on and behind observed surface and wherever nothing was observed; at most the truncation distance.
        """
        if len(self.keys) == 0 or len(points) == 0:
            return np.zeros(len(points))
        voxel = np.floor(points / self.voxel_size).astype(np.int64)
        block, inner = voxel // SIDE, voxel % SIDE
        block_key = _packed_keys(block)
        row = np.minimum(np.searchsorted(self.keys, block_key), len(self.keys) - 1)
        has_block = self.keys[row] == block_key
        column = inner[:, 0] + SIDE * inner[:, 1] + SIDE * SIDE * inner[:, 2]
        return np.where(has_block, self.distance[row, column].astype(float), 0.0)


NOTHING_KNOWN = FreeSpace(np.zeros(0, dtype=np.int64), np.zeros((0, SIDE**3), dtype=np.float16), 1.0)
"""The free space of a map that was made without a volume."""


def _packed_keys(blocks: np.ndarray) -> np.ndarray:
    shifted = np.asarray(blocks, dtype=np.int64) + REACH
    return (shifted[:, 0] << 42) | (shifted[:, 1] << 21) | shifted[:, 2]


def load_free_space(panoptic_map: PanopticMap) -> FreeSpace:
    """Return the free space of a map; `NOTHING_KNOWN` when it was made without a volume. Raises BadInput when the
    volume is torn."""
    path = panoptic_map.path("volume.npz")
    if not path.is_file():
        return NOTHING_KNOWN
    info = panoptic_map.info
    blocks, tsdf, weight = read_arrays(
        path,
        "block_coordinates",
        "tsdf",
        "weight",
        shapes=("B 3", f"B {SIDE**3}", f"B {SIDE**3}"),
        hint="make the panoptic map again",
    )
    keys = _packed_keys(blocks)
    order = np.argsort(keys, kind="stable")
    tsdf, weight = tsdf[order], weight[order]
    distance = np.where(weight >= LEAST_WEIGHT, np.maximum(tsdf, 0), 0).astype(np.float16)
    return FreeSpace(keys[order], distance * np.float16(info.truncation_distance), info.voxel_size)
