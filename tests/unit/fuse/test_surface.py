"""Surface nets: a closed surface is watertight, faces look outwards, order is canonical, silhouettes make no walls."""

from __future__ import annotations

import numpy as np
import trimesh

from stages.fuse.surface import extract_surface
from stages.fuse.voxel_blocks import SIDE, VoxelBlocks, _insert, pack

VOXEL = 0.05


def filled(extent: int, value: object, seed: int | None = None) -> VoxelBlocks:
    """Blocks at -extent .. extent - 1 on every axis, set to value(points) in truncation distances, all observed."""
    axis = np.arange(-extent, extent)
    coordinates = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3).astype(np.int32)
    if seed is not None:
        coordinates = np.random.default_rng(seed).permutation(coordinates)
    blocks = VoxelBlocks(VOXEL, len(coordinates))
    cell = np.arange(SIDE**3)
    inside = np.stack([cell % SIDE, cell // SIDE % SIDE, cell // SIDE**2], axis=-1)
    for slot, block in enumerate(coordinates):
        points = (block * SIDE + inside + 0.5) * VOXEL
        blocks.coordinates[slot] = block
        blocks.tsdf[slot] = value(points)
        blocks.weight[slot] = 1
        blocks.segment[slot] = np.where(points[:, 0] < 0, 1, 2)
        blocks.color[slot] = 256 * 100
        _insert(blocks.keys, blocks.slots, pack(*(int(c) for c in block)), slot)
    blocks.count = len(coordinates)
    return blocks


def sphere(points: np.ndarray) -> np.ndarray:
    return np.clip((np.linalg.norm(points - [0.01, 0.02, -0.015], axis=1) - 0.31) / (4 * VOXEL), -1, 1)


def test_sphere_is_closed_and_looks_outwards() -> None:
    surface = extract_surface(filled(1, sphere), minimum_weight=0.5)
    mesh = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
    assert mesh.is_watertight and mesh.is_winding_consistent
    assert mesh.volume > 0
    assert abs(mesh.volume / (4 / 3 * np.pi * 0.31**3) - 1) < 0.03
    assert mesh.euler_number == 2
    radius = np.linalg.norm(surface.vertices - [0.01, 0.02, -0.015], axis=1)
    assert np.abs(radius - 0.31).max() < 0.1 * VOXEL
    assert (surface.colors == 100).all()
    left = surface.vertices[:, 0] < -VOXEL
    assert (surface.segment[left] == 1).all() and (surface.segment[surface.vertices[:, 0] > VOXEL] == 2).all()


def test_plane_is_exact_across_blocks() -> None:
    normal = np.array([0.2, -0.3, 0.933])
    normal /= np.linalg.norm(normal)
    surface = extract_surface(filled(1, lambda p: (p @ normal - 0.03) / (4 * VOXEL)), minimum_weight=0.5, jump=9)
    assert len(surface.vertices) > 200
    assert np.abs(surface.vertices @ normal - 0.03).max() < 1e-5


def test_order_of_allocation_does_not_matter() -> None:
    first, second = (extract_surface(filled(1, sphere, seed), minimum_weight=0.5) for seed in (1, 2))
    for name in ("vertices", "faces", "colors", "segment"):
        assert getattr(first, name).tobytes() == getattr(second, name).tobytes()


def test_unobserved_voxels_end_the_surface() -> None:
    blocks = filled(1, sphere)
    whole = extract_surface(blocks, minimum_weight=0.5)
    centre_x = (blocks.coordinates[:, :1] * SIDE + np.arange(SIDE**3) % SIDE + 0.5) * VOXEL
    blocks.weight[centre_x > 0] = 0
    half = extract_surface(blocks, minimum_weight=0.5)
    assert 0.4 * len(whole.faces) < len(half.faces) < 0.6 * len(whole.faces)
    assert half.vertices[:, 0].max() < 1.01 * VOXEL
    assert half.vertices[:, 0].max() > -0.6 * VOXEL, "up to the last observed voxel"


def test_steps_are_no_surface() -> None:
    def step(points: np.ndarray) -> np.ndarray:
        return np.where(points[:, 0] < 0, -0.4, 1.0)

    assert len(extract_surface(filled(1, step), minimum_weight=0.5).vertices) == 0
    assert len(extract_surface(filled(1, step), minimum_weight=0.5, jump=2).vertices) > 0


def test_nothing_gives_nothing() -> None:
    surface = extract_surface(VoxelBlocks(VOXEL), minimum_weight=0.1)
    assert surface.vertices.shape == (0, 3) and surface.faces.shape == (0, 3)
