"""What floats stands on the narrow thing below it: shades on their feet, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.fuse.feet import feet_of
from scenewright.stages.fuse.joining import root, wholes

from tests.unit.fuse.rooms import Corners
from tests.unit.fuse.test_joining import VOXEL, room

SHADE = ((-0.12, -0.12, 0.4), (0.12, 0.12, 0.6))
FOOT = ((-0.04, -0.04, 0.0), (0.04, 0.04, 0.34))


@pytest.mark.parametrize(
    ("boxes", "expected"),
    [
        ((SHADE, FOOT), {2: 1}),
        ((SHADE, ((0.2, 0.0, 0.0), (0.28, 0.08, 0.34))), {}),  # beside it
        ((SHADE, ((0.06, 0.06, 0.0), (0.12, 0.12, 0.34))), {}),  # below it, but not below its middle
        ((SHADE, ((-0.12, -0.12, 0.0), (0.12, 0.12, 0.34))), {}),  # as wide
        ((SHADE, ((-0.04, -0.04, 0.0), (0.04, 0.04, 0.02))), {}),  # far below it
        ((SHADE, FOOT, ((-0.5, -0.12, 0.36), (-0.12, 0.12, 0.4))), {}),  # a shelf beside it carries it
    ],
)
def test_what_floats_stands_on_what_is_narrow_below_its_middle(
    boxes: tuple[Corners, ...], expected: dict[int, int]
) -> None:
    scene, instance = room(*boxes)
    assert feet_of(scene, instance, {1, 2}, {2}, 4, VOXEL) == expected
    assert feet_of(scene, instance, {1, 2}, (), 4, VOXEL) == {}, "what has a name is no foot"
    assert feet_of(scene, instance, {2}, {2}, 4, VOXEL) == {}, "what is no thing has none"


@pytest.mark.parametrize(("distance", "expected"), [(0.05, {}), (0.2, {2: 1})])
def test_a_wall_may_carry_what_is_beside_it(distance: float, expected: dict[int, int]) -> None:
    far = 0.12 + distance
    scene, instance = room(SHADE, FOOT, ((far, -1.0, 0.0), (far + 0.04, 1.0, 1.0)))
    assert feet_of(scene, instance, {1, 2}, {2}, 3, VOXEL) == expected


def test_a_foot_has_a_foot_and_all_are_one() -> None:
    stem = ((-0.06, -0.06, 0.22), (0.06, 0.06, 0.34))
    scene, instance = room(SHADE, stem, ((-0.03, -0.03, 0.0), (0.03, 0.03, 0.16)))
    feet = feet_of(scene, instance, {1, 2, 3}, {2, 3}, 4, VOXEL)
    assert feet == {2: 1, 3: 2}
    parts = {k: root(feet, k) for k in feet}
    assert parts == {2: 1, 3: 1}
    np.testing.assert_array_equal(wholes(instance, parts), [0, 1, 1, 1])
