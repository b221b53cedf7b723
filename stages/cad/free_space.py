"""What the cameras saw empty: neither a CAD model nor what is completed may fill it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.kit.formats.numpy_files import read_arrays
from scipy.spatial import cKDTree

SIDE = 8
"""Voxels along the edge of a block."""
REACH = 1 << 20
"""Added to the coordinates of blocks, so that three of 21 bits make one number."""
LEAST_WEIGHT = 0.5
"""Voxels that were hardly observed are not known to be empty."""
BEFORE_SURFACE = 0.03
"""So far before a surface space is empty for certain [m]: surface is not exact to less."""
AGAIN = "make the panoptic map again"


@dataclass(frozen=True)
class Blocks:
    """A sparse grid of values."""

    keys: np.ndarray
    """(B,) int64, sorted: packed block coordinates."""
    values: np.ndarray
    """(B, 512); over the voxels of a block x runs fastest."""
    edge: float
    """Of a voxel [m]."""

    def at(self, points: np.ndarray) -> np.ndarray:
        """Return the values (N,) at points (N, 3), world [m]; 0 where there is no block."""
        if len(self.keys) == 0 or len(points) == 0:
            return np.zeros(len(points), dtype=self.values.dtype)
        voxel = np.floor(points / self.edge).astype(np.int64)
        block, inner = voxel // SIDE, voxel % SIDE
        block_key = _packed_keys(block)
        row = np.minimum(np.searchsorted(self.keys, block_key), len(self.keys) - 1)
        column = inner[:, 0] + SIDE * inner[:, 1] + SIDE * SIDE * inner[:, 2]
        return np.where(self.keys[row] == block_key, self.values[row, column], 0)


def blocks_of(coordinates: np.ndarray, values: np.ndarray, edge: float) -> Blocks:
    """Return the grid of blocks (B, 3) in any order, with values (B, 512)."""
    keys = _packed_keys(coordinates)
    order = np.argsort(keys, kind="stable")
    return Blocks(keys[order], values[order], edge)


@dataclass(frozen=True)
class FreeSpace:
    """What was seen empty: near surfaces exactly, by the map's signed distances, and anywhere coarsely, by the cells
    that frames saw through. Either is empty where the map lacks it."""

    near: Blocks
    """float16: metres in front of the nearest surface, at most the truncation distance; 0 on, behind and where nothing
    was observed."""
    far: Blocks
    """bool: cells that frames saw through."""

    def depth_within(self, points: np.ndarray) -> np.ndarray:
        """Return how far [m] each of the points (N, 3), world, lies in space that was seen empty (N,).

        0 on and behind observed surface and wherever nothing was observed; at most the truncation distance.
        """
        return self.near.at(points).astype(float)

    def is_empty(self, points: np.ndarray, own: cKDTree | None = None) -> np.ndarray:
        """Return (N,) bool: points (N, 3), world, that were seen to lie in nothing.

        Rays that pass beside a thing go through cells that it reaches into. So cells count where those around a point,
        as far as half an edge, were seen through too, and none that is within an edge of `own`, points of what was seen
        of the thing that is asked for.
        """
        corners = 0.5 * self.far.edge * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        around = np.logical_and.reduce([self.far.at(points + corner) > 0 for corner in corners])
        if own is not None and around.any():
            distance, _ = own.query(points[around], distance_upper_bound=self.far.edge)
            around[around] = ~np.isfinite(distance)
        return (self.depth_within(points) > BEFORE_SURFACE) | around


NOWHERE = Blocks(np.zeros(0, dtype=np.int64), np.zeros((0, SIDE**3), dtype=np.float16), 1.0)
NOTHING_KNOWN = FreeSpace(NOWHERE, NOWHERE)
"""The free space of a map that was made without a volume."""


def _packed_keys(blocks: np.ndarray) -> np.ndarray:
    shifted = np.asarray(blocks, dtype=np.int64) + REACH
    return (shifted[:, 0] << 42) | (shifted[:, 1] << 21) | shifted[:, 2]


def load_free_space(panoptic_map: PanopticMap) -> FreeSpace:
    """Return the free space of a map; `NOTHING_KNOWN` when it was made without a volume. Raises BadInput when the
    volume is torn."""
    return FreeSpace(_near_surfaces(panoptic_map), _anywhere(panoptic_map))


def _near_surfaces(panoptic_map: PanopticMap) -> Blocks:
    path = panoptic_map.path("volume.npz")
    if not path.is_file():
        return NOWHERE
    info = panoptic_map.info
    names, shapes = ("block_coordinates", "tsdf", "weight"), ("B 3", f"B {SIDE**3}", f"B {SIDE**3}")
    blocks, tsdf, weight = read_arrays(path, *names, shapes=shapes, hint=AGAIN)
    distance = np.where(weight >= LEAST_WEIGHT, np.maximum(tsdf, 0), 0).astype(np.float16)
    return blocks_of(blocks, distance * np.float16(info.truncation_distance), info.voxel_size)


def _anywhere(panoptic_map: PanopticMap) -> Blocks:
    path = panoptic_map.path("free_space.npz")
    if not path.is_file():
        return NOWHERE
    names, shapes = ("block_coordinates", "free", "edge"), ("B 3", f"B {SIDE**3 // 8}", "1")
    blocks, free, edge = read_arrays(path, *names, shapes=shapes, hint=AGAIN)
    if free.dtype != np.uint8 or not float(edge[0]) > 0:
        raise BadInput(f"{path}: free is {free.dtype}, edge {float(edge[0])}; expected uint8 and a length", hint=AGAIN)
    return blocks_of(blocks, np.unpackbits(free, axis=1, bitorder="little").astype(bool), float(edge[0]))
