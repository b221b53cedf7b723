"""Which shapes of masks are believed: those with an outline in space, and those of masks that are sure."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenewright.stages.fuse.belief import AS_SURE, OUTLINE, WEAK, doubted, flush_shares, usual_score
from scenewright.stages.kit.geometry.point_clouds import vertex_normals

from tests.unit.fuse.rooms import sheets

VOXEL = 0.02


def shares(scene: tuple[np.ndarray, np.ndarray, np.ndarray], instance: np.ndarray) -> np.ndarray:
    vertices, faces, _ = scene
    return flush_shares(vertices, vertex_normals(vertices, faces), instance, VOXEL)


def test_a_patch_out_of_a_plane_has_no_outline_and_a_box_has_one() -> None:
    scene = sheets(((-1.0, -1.0, 0.0), (-0.4, -0.4, 0.6)))
    vertices, _, owner = scene
    patch = (np.abs(vertices - [1.0, 0.0, 0.0]) < [0.4, 0.3, 0.01]).all(axis=1)
    found = shares(scene, np.where(patch, 1, np.where(owner == 2, 2, 0)))
    assert found.shape == (3,) and found[1] > OUTLINE + 0.15 and found[2] < 0.1


def test_a_half_of_a_box_is_flush_where_it_was_cut() -> None:
    scene = sheets(((-1.0, -1.0, 0.0), (-0.4, -0.4, 0.6)))
    half = (scene[2] == 2) & (scene[0][:, 0] > -0.7)
    found = shares(scene, half.astype(int))
    assert 0.2 < found[1] < OUTLINE + 0.3


def test_flat_on_a_wall_and_nothing() -> None:
    scene = sheets(((-0.5, 1.96, 1.0), (0.5, 2.0, 1.6)))
    assert shares(scene, (scene[2] == 2).astype(int))[1] < 0.1, "a screen has an edge"
    assert flush_shares(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, int), VOXEL).tolist() == []


def test_doubt_has_two_reasons() -> None:
    flush = np.array([0.0, 0.1, 0.1, 0.9, 0.9, 0.1])
    told = np.array([0.0, 0.6, 0.8, 0.7 * AS_SURE - 0.01, 0.7 * AS_SURE, 0.6 * WEAK - 0.01])
    assert usual_score([1, 2], told, flush) == pytest.approx(0.7)
    reasons = doubted([1, 2, 3, 4], told, flush, 0.7)
    assert list(reasons) == [3] and reasons[3].startswith("flush along 90% of its outline")
    reasons = doubted([1, 2, 5], told, flush, 0.6)
    assert list(reasons) == [5] and reasons[5].startswith("masks had it in few looks: 0.17 where 0.60")


def test_without_a_thing_that_stands_free_half_of_the_looks_are_usual() -> None:
    assert usual_score([], np.zeros(1), np.zeros(1)) == 0.5
    assert usual_score([1], np.array([0.0, 0.9]), np.array([0.0, 0.9])) == 0.5
    assert doubted([], np.zeros(1), np.zeros(1), 0.5) == {}


@given(
    st.lists(st.tuples(st.floats(0, 1), st.floats(0, 1)), min_size=1, max_size=8), st.integers(0, 7), st.floats(0, 1)
)
def test_surer_masks_are_not_doubted_more(rows: list[tuple[float, float]], which: int, more: float) -> None:
    """Of a thing that stands flush: the others say what is usual."""
    k = which % len(rows) + 1
    flush = np.array([0.0, *(f for f, _ in rows)])
    flush[k] = 1.0
    told = np.array([0.0, *(t for _, t in rows)])
    surer = told.copy()
    surer[k] = min(1.0, told[k] + more)
    things = list(range(1, len(told)))
    usual = usual_score(things, told, flush)
    assert usual == usual_score(things, surer, flush)
    before, after = (doubted(things, each, flush, usual) for each in (told, surer))
    assert k in before or k not in after
    assert {j for j in before if j != k} == {j for j in after if j != k}
