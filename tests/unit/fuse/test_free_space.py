"""The grid of free space: the cells that rays went through, and no others."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.fuse.free_space import CELL, FEWEST, SHORT, STRIDE, FreeSpace

CAMERA = Camera(width=80, height=64, fx=60.0, fy=60.0, cx=40.0, cy=32.0)
AHEAD = np.eye(4)


def looked(depth: np.ndarray, pose: np.ndarray = AHEAD, times: int = FEWEST, far: float = 4.0) -> FreeSpace:
    free = FreeSpace()
    for _ in range(times):
        free.add_frame(CAMERA, depth.astype(np.float32), pose, far)
    return free


def fan(depth: float) -> np.ndarray:
    """World points of a fan of rays to a plane at `depth` (R, 3), seen from the origin along +z."""
    rows, columns = np.mgrid[STRIDE // 2 : 64 : STRIDE, STRIDE // 2 : 80 : STRIDE].reshape(2, -1)
    return depth * np.stack([(columns - 40.0) / 60.0, (rows - 32.0) / 60.0, np.ones(len(rows))], axis=1)


def test_a_fan_of_rays_is_free_up_to_the_wall_and_not_behind_it() -> None:
    free = looked(np.full((64, 80), 2.0))
    ends = fan(2.0)
    for share in (0.2, 0.5, 0.8):
        assert free.is_free(share * ends).mean() > 0.85, "all but cells of which a ray cuts a corner"
    toward = ends / np.linalg.norm(ends, axis=1, keepdims=True)
    assert not free.is_free(ends + 0.05 * toward).any(), "the surface's own cell is not free"
    assert not free.is_free(ends + 0.3 * toward).any()
    assert not free.is_free(ends * [1, 1, 0] - [0, 0, 0.5]).any(), "nobody looked back"


def test_one_frame_is_not_enough_and_a_frame_counts_once() -> None:
    depth = np.full((64, 80), 2.0)
    assert not looked(depth, times=FEWEST - 1).is_free(0.5 * fan(2.0)).any()
    free = looked(depth, times=3)
    assert free.frames[: free.count].max() == 3, "many rays of a frame go through the cells at the camera"
    assert looked(depth, times=300).frames.max() == 255


def test_pixels_without_depth_and_far_ones() -> None:
    assert not looked(np.zeros((64, 80))).is_free(0.5 * fan(2.0)).any()
    free = looked(np.full((64, 80), 9.0), far=3.0)
    assert free.is_free(fan(2.5)).mean() > 0.85 and not free.is_free(fan(3.2)).any()


def test_a_grid_that_grows_is_the_grid_that_was() -> None:
    poses = []
    for place in ((0, 0, 0), (30, 0, 0), (-20, 10, 5), (0, -40, -3)):
        pose = np.eye(4)
        pose[:3, 3] = place
        poses.append(pose)
    depth = np.full((64, 80), 3.0)
    together = FreeSpace()
    for pose in 2 * poses:
        together.add_frame(CAMERA, depth.astype(np.float32), pose, 4.0)
    probes = fan(3.0) * np.linspace(0.05, 1.4, len(fan(3.0)))[:, None]
    for pose in poses:
        assert (together.is_free(probes + pose[:3, 3]) == looked(depth, pose).is_free(probes + pose[:3, 3])).all()
    assert together.count > 64


@settings(max_examples=25, deadline=None)
@given(st.floats(0.4, 3.5), st.floats(-np.pi, np.pi), st.integers(0, 2**32 - 1))
def test_free_cells_lie_between_the_camera_and_the_surface(depth: float, turn: float, seed: int) -> None:
    pose = np.eye(4)
    c, s = np.cos(turn), np.sin(turn)
    pose[:3, :3], pose[:3, 3] = [[c, -s, 0], [s, c, 0], [0, 0, 1]], np.random.default_rng(seed).uniform(-3, 3, 3)
    free = looked(np.full((64, 80), depth), pose)
    blocks, cells = np.nonzero(free.frames[: free.count])
    inside = np.stack([cells % 8, cells // 8 % 8, cells // 64], axis=1)
    middles = (8 * free.coordinates[blocks] + inside + 0.5) * CELL
    seen = (middles - pose[:3, 3]) @ pose[:3, :3]
    assert (seen[:, 2] > -CELL).all() and (seen[:, 2] < depth - (SHORT - 1.0) * CELL * 0.8 + CELL).all()


def test_the_map_keeps_what_was_seen_through() -> None:
    """What is written says of every cell what the grid says, blocks sorted by z, y, x."""
    free = looked(np.full((64, 80), 2.0))
    arrays = free.as_arrays()
    blocks, edge = arrays["block_coordinates"], float(arrays["edge"][0])
    assert edge == CELL and blocks.tolist() == sorted(blocks.tolist(), key=lambda c: c[::-1])
    cells = np.unpackbits(arrays["free"], axis=1, bitorder="little").astype(bool)
    assert cells.shape == (len(blocks), 512) and cells.any(axis=1).all()
    inner = np.stack(np.meshgrid(*[np.arange(8)] * 3, indexing="ij"), -1)[..., ::-1].reshape(-1, 3)
    middles = ((blocks[:, None] * 8 + inner + 0.5) * edge).reshape(-1, 3)
    assert np.array_equal(free.is_free(middles), cells.ravel())
    assert cells.sum() == (free.frames[: free.count] >= FEWEST).sum()
