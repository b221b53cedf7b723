"""Surface nets: a closed surface is watertight, faces look outwards, order is canonical, silhouettes make no walls."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.fuse.integration import integrate
from scenewright.stages.fuse.surface import Surface, extract_surface
from scenewright.stages.fuse.voxel_blocks import SIDE, VoxelBlocks, _insert, pack
from scenewright.stages.kit.geometry.cameras import back_project
from scipy.spatial import cKDTree

VOXEL = 0.05
CAMERA = Camera(width=320, height=240, fx=262.0, fy=262.0, cx=159.5, cy=119.5)


def filled(extent: int, value: object, seed: int | None = None, hits: int = 1) -> VoxelBlocks:
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
        blocks.hits[slot] = hits
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
    assert len(extract_surface(filled(1, step, hits=2), minimum_weight=0.5).vertices) > 0, "measured there"
    assert len(extract_surface(filled(1, sphere, hits=0), minimum_weight=0.5).vertices) == 0, "measured nowhere"


def mapped(frames: list[tuple[np.ndarray, np.ndarray]], voxel: float) -> Surface:
    """Return the surface of depth images with their poses."""
    blocks = VoxelBlocks(voxel)
    for depth, pose in frames:
        integrate(blocks, depth, CAMERA, pose, truncation=4 * voxel, near=0.1, far=4.0)
    return extract_surface(blocks, minimum_weight=0.1)


@pytest.mark.parametrize("angle", [5, 10, 20, 45, 90])
def test_planes_are_whole_at_any_angle(angle: float) -> None:
    """A plane through (0, 0, 1.5) that the optical axis meets at the angle [deg], from twenty places close by."""
    normal = np.array([0.0, -np.cos(np.radians(angle)), -np.sin(np.radians(angle))])
    rays = back_project(np.ones((CAMERA.height, CAMERA.width), np.float32), CAMERA)
    facing = np.minimum(rays @ normal, -1e-3)
    frames, seen = [], []
    for place in np.random.default_rng(0).uniform(-0.03, 0.03, (20, 3)):
        pose = np.eye(4)
        pose[:3, 3] = place
        depth = (([0, 0, 1.5] - place) @ normal / facing).astype(np.float32)
        depth[(depth < 0.8) | (depth > 2.2)] = 0
        frames.append((depth, pose))
        seen.append((rays * depth[..., None])[(depth > 1.0) & (depth < 2.0)][::7] + place)
    surface = mapped(frames, 0.02)
    points = np.concatenate(seen)
    points = points[(np.abs(points[:, 0]) < 0.4) & (np.abs(points[:, 1]) < 0.4)]
    assert (cKDTree(surface.vertices).query(points)[0] < 0.02).mean() > 0.98
    assert np.abs((surface.vertices - [0, 0, 1.5]) @ normal).max() < 0.02


def test_silhouettes_are_no_surface() -> None:
    """A board 1 m away before a wall at 2 m, from three places: nothing was measured between them."""
    depth = np.full((CAMERA.height, CAMERA.width), 2.0, np.float32)
    depth[:, : CAMERA.width // 2] = 1.0
    poses = [np.eye(4) for _ in range(3)]
    for shift, pose in zip((-0.004, 0.0, 0.004), poses, strict=True):
        pose[2, 3] = shift
    z = mapped([(depth, pose) for pose in poses], 0.02).vertices[:, 2]
    assert (np.abs(z - 1) < 0.03).any() and (np.abs(z - 2) < 0.03).any()
    assert ((np.abs(z - 1) < 0.03) | (np.abs(z - 2) < 0.03)).all()


def test_nothing_gives_nothing() -> None:
    surface = extract_surface(VoxelBlocks(VOXEL), minimum_weight=0.1)
    assert surface.vertices.shape == (0, 3) and surface.faces.shape == (0, 3)
