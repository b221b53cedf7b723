"""Parts that masks take for one: who is joined by looks, and who stays apart on what it stands."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.fuse.joining import joined, pair_looks, stands_on
from scenewright.stages.fuse.layout.evidence import Scene
from scenewright.stages.kit.geometry.point_clouds import vertex_normals

from tests.unit.fuse.rooms import Corners, sheets

VOXEL = 0.02
LEFT, RIGHT, FAR = (
    ((-0.4, 0.0, 0.0), (0.0, 0.4, 0.9)),
    ((0.02, 0.0, 0.0), (0.4, 0.4, 0.9)),
    ((1.2, 0.0, 0.0), (1.6, 0.4, 0.9)),
)
ON_TOP = ((-0.3, 0.1, 0.92), (-0.1, 0.3, 1.1))
Look = tuple[np.ndarray, np.ndarray]


def look(*shares: tuple[int, int, int]) -> Look:
    """A look of (mask, thing, points)."""
    return tuple(np.concatenate([np.full(row[2], row[k]) for row in shares]) for k in (0, 1))  # type: ignore[return-value]


BOTH, ONE, NEITHER = look((1, 1, 30), (1, 2, 20)), look((1, 1, 30), (0, 2, 20)), look((0, 1, 30), (0, 2, 20))
TWO, HALF = look((1, 1, 30), (2, 2, 20)), look((1, 1, 30), (1, 2, 8), (0, 2, 12))


def test_looks_join_part_or_say_nothing() -> None:
    looks = [BOTH, BOTH, ONE, NEITHER, TWO, HALF, look((1, 1, 30), (1, 2, 3)), look((1, 1, 30))]
    both, apart = pair_looks(looks)
    assert both == {(1, 2): 2}, "what is hardly seen says nothing"
    assert apart == {(1, 2): 2}, "half of a thing in a mask is neither"
    assert pair_looks([]) == ({}, {}) == pair_looks([look((1, 0, 30), (1, 2, 30))]), "no thing is nobody's part"


def room(*boxes: Corners) -> tuple[Scene, np.ndarray]:
    """Boxes as things 1, 2, ..."""
    vertices, faces, owner = sheets(*boxes, voxel=VOXEL)
    nothing = np.zeros(len(vertices))
    scene = Scene(vertices, vertex_normals(vertices, faces), nothing, nothing, nothing, np.zeros((0, 3)), None)
    return scene, np.maximum(owner - 1, 0)


@pytest.mark.parametrize(
    ("boxes", "looks", "expected"),
    [
        ((LEFT, RIGHT), [BOTH] * 2, {2: 1}),
        ((LEFT, RIGHT), [BOTH], {}),
        ((LEFT, RIGHT), [BOTH] * 9 + [TWO], {}),
        ((LEFT, RIGHT), [BOTH] * 10 + [TWO], {2: 1}),
        ((LEFT, FAR), [BOTH] * 9, {}),
        ((LEFT, ON_TOP), [BOTH] * 9, {}),
    ],
)
def test_parts_that_touch_are_one_where_masks_have_both(
    boxes: tuple[Corners, ...], looks: list[Look], expected: dict[int, int]
) -> None:
    scene, instance = room(*boxes)
    assert joined(scene, instance, frozenset({1, 2}), looks, VOXEL) == expected
    assert joined(scene, instance, frozenset({1}), looks, VOXEL) == {}, "no part of what is no thing"


def test_parts_of_a_part_are_of_the_largest() -> None:
    scene, instance = room(((0.0, 0.0, 0.0), (0.2, 0.4, 0.9)), ((0.22, 0.0, 0.0), (0.8, 0.4, 0.9)), RIGHT)
    three = look((1, 1, 30), (1, 2, 20), (1, 3, 20))
    assert joined(scene, instance, frozenset({1, 2, 3}), [three] * 3, VOXEL) == {1: 2, 3: 2}


def test_what_stands_on_a_top_does_and_what_stands_beside_it_does_not() -> None:
    scene, instance = room(LEFT, ON_TOP)
    points = [scene.vertices[instance == k] for k in (1, 2)]
    normals = [scene.normals[instance == k] for k in (1, 2)]
    assert stands_on(points[1], points[0], normals[0], VOXEL) and not stands_on(points[0], points[1], normals[1], VOXEL)
    assert not stands_on(points[1], points[0][:0], normals[0][:0], VOXEL)
