"""Dense alignment against the motion a frame was rendered with; its figures on a wrong pose."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.kit.registration.alignment import align, judge
from scenewright.stages.kit.registration.pyramid import Pyramid, build_pyramid
from scenewright.stages.kit.registration.rigid_motion import angle_of, between, distance_of, exponential

from tests.unit.poses.textured_room import CAMERA, render, round_walk

TARGET = round_walk(49)[6]  # a corner with a block before it: depth fixes every direction
MOTION = exponential(np.array([0.02, -0.06, 0.03, 0.05, -0.02, 0.04]))


def pyramid(pose: np.ndarray, color: bool = True) -> Pyramid:
    image, depth = render(pose)
    return build_pyramid(depth, image if color else None, CAMERA, width=160, levels=3, maximum_depth=4.5)


@pytest.mark.parametrize(("color", "tolerance"), [(True, 0.003), (False, 0.006)])
def test_a_rendered_motion_is_found(color: bool, tolerance: float) -> None:
    found = align(pyramid(TARGET, color), pyramid(TARGET @ MOTION, color), np.eye(4))
    wrong = between(MOTION, found.target_from_source)
    assert distance_of(wrong) < tolerance and angle_of(wrong) < tolerance
    assert found.overlap > 0.7 and found.agreement > 0.95 and found.uncertainty < 0.02


def test_exposure_does_not_move_the_camera() -> None:
    image, depth = render(TARGET @ MOTION)
    darker = (image * 0.7 + 20).astype(np.uint8)
    source = build_pyramid(depth, darker, CAMERA, width=160, levels=3, maximum_depth=4.5)
    wrong = between(MOTION, align(pyramid(TARGET), source, np.eye(4)).target_from_source)
    assert distance_of(wrong) < 0.004 and angle_of(wrong) < 0.004


def test_a_wrong_pose_floats() -> None:
    target, source = pyramid(TARGET), pyramid(TARGET @ MOTION)
    right = judge(target, source, MOTION)
    back = exponential(np.array([0, 0, 0, 0, 0, -0.5]))
    wrong = judge(target, source, back @ MOTION)
    assert right.agreement > 0.95 > 0.6 > wrong.agreement and right.overlap > 2 * wrong.overlap


def test_a_blank_wall_is_uncertain() -> None:
    """A plane fixes three of six directions; the others must be said to be unknown."""
    depth = np.full((CAMERA.height, CAMERA.width), 1.5, dtype=np.float32)
    wall = build_pyramid(depth, None, CAMERA, width=160, levels=3, maximum_depth=4.5)
    found = align(wall, wall, np.eye(4))
    assert found.uncertainty > 1.0 and found.residual < 1e-6
    np.testing.assert_allclose(found.target_from_source, np.eye(4), atol=1e-6)


@pytest.mark.parametrize("z", [0.4, 1.5, 4.0])
def test_a_wall_is_known_as_well_as_noise_and_systematic_error_allow(z: float) -> None:
    depth = np.full((CAMERA.height, CAMERA.width), z, dtype=np.float32)
    wall = build_pyramid(depth, None, CAMERA, width=160, levels=3, maximum_depth=4.5)
    points = np.count_nonzero(wall.levels[0].normals[::2, ::2, 2])
    variance = (0.0012 + 0.0019 * (z - 0.4) ** 2) ** 2 + (0.005 * z) ** 2
    known = judge(wall, wall, np.eye(4)).information
    assert known[5, 5] == pytest.approx(0.01 * points / variance, rel=1e-3)
    assert np.abs(known[:, 3:5]).max() < 1e-6 * known[5, 5]


def test_black_holes_of_registered_colour_are_no_edges() -> None:
    image, depth = render(TARGET)
    image[40:60, 50:70] = 0
    levels = build_pyramid(depth, image, CAMERA, width=160, levels=3, maximum_depth=4.5).levels
    assert (levels[0].brightness[38:62, 48:72] == -1).all() and (levels[0].gradient[38:62, 48:72] == 0).all()
    assert (levels[0].brightness[70:100, 80:140] > 0).all()


def test_intrinsics_of_the_levels_see_the_same_points() -> None:
    levels = pyramid(TARGET).levels
    assert [level.points.shape[:2] for level in levels] == [(120, 160), (60, 80), (30, 40)]
    for level in levels:
        fx, fy, cx, cy = level.intrinsics
        x, y, z = level.points[10, 13]
        assert (fx * x / z + cx, fy * y / z + cy) == pytest.approx((13, 10), abs=1e-3)
    # A pixel of a halved image covers 2x2, so that its centre lies between theirs.
    whole, half = levels[0].points[20:22, 30:32].reshape(-1, 3), levels[1].points[10, 15]
    np.testing.assert_allclose(whole.mean(axis=0), half, atol=2e-3)


def test_nothing_in_common_is_zero_overlap() -> None:
    far = exponential(np.array([0.0, np.pi, 0.0, 0.0, 0.0, 0.0]))
    found = align(pyramid(TARGET), pyramid(TARGET), far)
    assert found.overlap == 0.0 and found.uncertainty == float("inf") or found.overlap < 0.1
    assert distance_of(inverse(far) @ found.target_from_source) < 1e-6
