"""Bodies, planes, voxels, canonical frames, the knife, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.stages.cutting.world.body import Body, Plane
from scenewright.stages.cutting.world.canonical import box_edges, canonical
from scenewright.stages.cutting.world.foods import FAMILIES, make_food
from scenewright.stages.cutting.world.knife import Knife, Refused, cut
from scenewright.stages.cutting.world.voxels import Grid, occupancy
from scenewright.stages.kit.geometry.transforms import transform_from
from scipy.spatial.transform import Rotation


def block(x: float, y: float, z: float) -> Body:
    mesh = trimesh.creation.box((x, y, z))
    return Body.of_mesh(mesh.vertices, mesh.faces)


@pytest.mark.parametrize("family", FAMILIES)
def test_foods_are_closed_differ_by_seed_and_are_the_same_again(family: str) -> None:
    body = make_food(family, np.random.default_rng(3))
    mesh = trimesh.Trimesh(body.vertices, body.faces, process=False)
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.volume == pytest.approx(body.volume, rel=1e-9)
    assert 2e-5 < body.volume < 2.5e-3
    assert np.array_equal(body.vertices, make_food(family, np.random.default_rng(3)).vertices)
    assert body.volume != make_food(family, np.random.default_rng(4)).volume
    assert np.allclose(body.moments[0], mesh.center_mass, atol=1e-9)


@settings(max_examples=40, deadline=None)
@given(
    st.sampled_from(sorted(FAMILIES)),
    st.integers(0, 1000),
    st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda n: np.linalg.norm(n) > 0.1),
    st.floats(-0.01, 0.01),
)
def test_a_cut_conserves_volume_and_leaves_closed_fragments(
    family: str, seed: int, normal: tuple[float, float, float], offset: float
) -> None:
    body = make_food(family, np.random.default_rng(seed))
    unit = np.array(normal) / np.linalg.norm(normal)
    parts = cut(body, Plane(unit, offset), Knife())
    assert sum(part.volume for part in parts) == pytest.approx(body.volume, rel=1e-6)
    for part in parts:
        assert trimesh.Trimesh(part.vertices, part.faces, process=False).is_watertight


def test_halves_of_a_block_have_the_volumes_of_the_formula() -> None:
    first, second = cut(block(0.04, 0.05, 0.1), Plane.through(np.array([0, 0, 0.02]), np.array([0, 0, 2.0])), Knife())
    assert first.volume == pytest.approx(0.04 * 0.05 * 0.03, rel=1e-9)
    assert second.volume == pytest.approx(0.04 * 0.05 * 0.07, rel=1e-9)


def test_what_falls_apart_gives_more_than_two() -> None:
    shape = trimesh.creation.annulus(0.02, 0.03, 0.01)
    body = Body.of_mesh(shape.vertices, shape.faces)
    assert len(cut(body, Plane(np.array([1.0, 0, 0]), 0.0), Knife())) == 2
    assert len(cut(body, Plane.through(np.array([0.021, 0, 0]), np.array([1.0, 0, 0])), Knife())) == 2
    parts = cut(body, Plane.through(np.array([0.01, 0, 0]), np.array([1.0, 0, 0])), Knife())
    assert sum(part.volume for part in parts) == pytest.approx(body.volume, rel=1e-6)


@pytest.mark.parametrize(
    ("size", "normal", "offset", "kind"),
    [
        ((0.04, 0.04, 0.1), (0, 0, 1), 0.06, "plane_misses"),
        ((0.04, 0.04, 0.1), (0, 0, 1), 0.0495, "sliver"),
        ((0.04, 0.04, 0.3), (0, 1, 0), 0.0, "blade_too_short"),
        ((0.15, 0.15, 0.2), (0, 0, 1), 0.0, "blade_too_low"),
        ((0.002, 0.002, 0.003), (0, 0, 1), 0.0, "held_too_small"),
    ],
)
def test_the_knife_refuses_with_numbers(size: tuple, normal: tuple, offset: float, kind: str) -> None:
    with pytest.raises(Refused) as refused:
        cut(block(*size), Plane(np.array(normal, dtype=float), -offset), Knife())
    assert refused.value.failure.kind == kind and refused.value.failure.numbers


@pytest.mark.parametrize("turn", [(0, 0, 0), (0.3, -0.8, 1.9), (2.0, 1.0, 0.4)])
def test_voxels_fill_what_the_mesh_encloses(turn: tuple[float, float, float]) -> None:
    pose = transform_from(Rotation.from_rotvec(turn).as_matrix(), np.array([0.1, 0.2, -0.3]))
    body = block(0.03, 0.05, 0.07).moved(pose)
    low, high = body.vertices.min(axis=0), body.vertices.max(axis=0)
    grid = Grid.around(low, high, 0.001)
    filled = occupancy(body.vertices, body.faces, grid)
    assert filled.sum() * 1e-9 == pytest.approx(body.volume, rel=0.02)
    middles = grid.origin + 0.001 * (np.argwhere(np.ones(grid.shape)) + 0.5)
    inside = np.abs((middles - pose[:3, 3]) @ pose[:3, :3]) < np.array([0.015, 0.025, 0.035])
    assert (filled.reshape(-1) == inside.all(axis=1)).mean() > 0.999


def test_voxels_of_foods_leave_no_column_open() -> None:
    for seed, family in enumerate(FAMILIES):
        body = make_food(family, np.random.default_rng(seed))
        shape = canonical(body)
        grid, filled = shape.voxels(float(shape.size.max()) / 48)
        assert filled.sum() * grid.voxel**3 == pytest.approx(body.volume, rel=0.03)
        assert not filled[..., -1].all() and filled.any()


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6))
def test_the_canonical_frame_does_not_depend_on_the_pose(seed: int) -> None:
    random = np.random.default_rng(seed)
    food = make_food("carrot", np.random.default_rng(1))
    body = cut(food, Plane.through(np.array([0, 0, 0.01]), np.array([0.2, 0.3, 1.0])), Knife())[0]
    pose = transform_from(Rotation.random(random_state=seed).as_matrix(), random.normal(size=3))
    here, there = canonical(body), canonical(body.moved(pose))
    assert np.allclose(here.size, there.size, atol=1e-6)
    assert here.size[2] == max(here.size)
    assert np.allclose(here.vertices.min(axis=0), there.vertices.min(axis=0), atol=1e-6)


def test_the_box_of_a_blocks_moments_is_the_block() -> None:
    assert np.allclose(box_edges(block(0.03, 0.05, 0.07).moments[1]), (0.03, 0.05, 0.07))
