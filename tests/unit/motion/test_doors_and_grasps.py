"""Door arcs and grasps as pure geometry."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.kit.acting.hand.grip import narrowest_width
from scenewright.stages.kit.acting.hand.sampled_grasps import _square, sample_grasps
from scenewright.stages.kit.motion.doors import (
    ContactPoint,
    body_from_moved,
    closing_direction,
    push_points,
    tool_poses,
)
from scenewright.stages.kit.simulation.shapes import surface_points

HINGE = Joint(
    name="f__hinge",
    type="revolute",
    part="f__door",
    origin=(-0.3, -0.3, 0.0),
    axis=(0.0, 0.0, -1.0),
    lower=0.0,
    upper=2.0,
    handle=(0.25, -0.35, 0.9),
)
SLIDE = HINGE.model_copy(update={"type": "prismatic", "axis": (0.0, -1.0, 0.0), "upper": 0.4})


def test_a_point_goes_along_the_circle_about_the_hinge() -> None:
    point = np.array([0.3, -0.3, 0.5, 1.0])
    moved = body_from_moved(HINGE, np.pi / 2) @ point
    np.testing.assert_allclose(moved[:3], [-0.3, -0.9, 0.5], atol=1e-12)
    np.testing.assert_allclose((body_from_moved(SLIDE, 0.2) @ point)[:3], [0.3, -0.5, 0.5])


def test_closing_direction_is_against_the_opening_motion() -> None:
    for joint in (HINGE, SLIDE):
        point = np.array([0.3, -0.3, 0.5])
        opened = (body_from_moved(joint, 1e-4) @ np.append(point, 1.0))[:3]
        direction = closing_direction(joint, point)
        assert float(direction @ (opened - point)) == pytest.approx(-np.linalg.norm(opened - point))


def test_push_points_lie_on_the_outside_far_from_the_hinge() -> None:
    door = trimesh.creation.box(extents=(0.6, 0.05, 1.4))
    door.apply_translation([0.0, -0.325, 0.7])
    points = push_points(HINGE, door, np.random.default_rng(0), 6, (0.4, 1.2))
    assert len(points) == 6
    for entry in points:
        assert entry.point[1] == pytest.approx(-0.35, abs=1e-6)
        assert 0.4 <= entry.point[2] <= 1.2
        assert entry.point[0] > 0.0
        assert entry.inward[1] > 0.9


def test_points_to_push_a_door_further_open_lie_on_its_inside() -> None:
    door = trimesh.creation.box(extents=(0.6, 0.05, 1.4))
    door.apply_translation([0.0, -0.325, 0.7])
    points = push_points(HINGE, door, np.random.default_rng(0), 6, (0.4, 1.2), opening=True)
    assert len(points) == 6
    for entry in points:
        assert entry.point[1] == pytest.approx(-0.3, abs=1e-6) and entry.point[0] > 0.0 and entry.inward[1] < -0.9


def test_tool_poses_are_rigid_and_press_along_the_closing_direction() -> None:
    contact = ContactPoint(np.array([0.2, -0.35, 0.9]), np.array([0.0, 1.0, 0.0]))
    values = np.array([1.0, 0.5, 0.0])
    poses = tool_poses(HINGE, contact, np.eye(4), values, tilt=np.array([0.0, 0.3, 0.6]), roll=0.4, gap=0.02)
    for pose, value, tilt in zip(poses, values, (0.0, 0.3, 0.6), strict=True):
        np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-12)
        assert np.linalg.det(pose[:3, :3]) == pytest.approx(1.0)
        moved = body_from_moved(HINGE, value)
        inward = moved[:3, :3] @ contact.inward
        assert float(pose[:3, 2] @ inward) == pytest.approx(np.cos(tilt))
        np.testing.assert_allclose(pose[:3, 3], (moved @ np.append(contact.point, 1))[:3] - 0.02 * inward, atol=1e-12)


def _grasps(mesh: trimesh.Trimesh, opening: float = 0.08) -> list:
    points, normals = surface_points([mesh], 4000, np.random.default_rng(0))
    pose = np.eye(4)
    pose[:3, 3] = [1.0, 2.0, 0.5]
    return sample_grasps(points, normals, pose, opening=opening, random=np.random.default_rng(1))


def test_grasps_of_a_box_are_square_to_its_faces() -> None:
    grasps = _grasps(trimesh.creation.box(extents=(0.05, 0.07, 0.2)))
    assert grasps
    for grasp in grasps:
        closing = grasp.body_from_tool[:3, 1]
        assert max(abs(closing[0]), abs(closing[1])) > np.cos(0.35)
        assert grasp.width < 0.08
        assert min(abs(grasp.width - 0.05), abs(grasp.width - 0.07)) < 0.02
    flat = [grasp for grasp in grasps if grasp.pitch == 0.0]
    assert all(grasp.width == pytest.approx(0.05, abs=0.006) for grasp in flat)


def test_the_tool_point_is_between_the_sides_of_a_cylinder() -> None:
    for grasp in _grasps(trimesh.creation.cylinder(radius=0.03, height=0.2)):
        position, closing = grasp.body_from_tool[:3, 3], grasp.body_from_tool[:3, 1]
        assert abs(float(position @ closing)) < 0.006
        assert np.linalg.norm(position[:2]) < 0.031
        assert grasp.body_from_tool[2, 2] < 0.01  # never from below


def test_an_item_wider_than_the_gripper_has_no_grasp() -> None:
    mesh = trimesh.creation.box(extents=(0.12, 0.15, 0.2))
    assert _grasps(mesh) == []
    points, _ = surface_points([mesh], 4000, np.random.default_rng(0))
    assert narrowest_width(points) == pytest.approx(0.12, abs=0.003)


def _from_the_side(mesh: trimesh.Trimesh) -> list:
    """Grasps of a thing with inner faces whose walls are 2 mm thick, from the side."""
    return [grasp for grasp in _grasps(mesh) if grasp.pitch == 0.0]


def test_a_thin_walled_cup_is_grasped_from_the_side() -> None:
    """The inner face of the wall, 2 mm behind the outer one, points the other way and must not count."""
    wall = trimesh.creation.annulus(r_min=0.033, r_max=0.035, height=0.1)
    bottom = trimesh.creation.cylinder(radius=0.033, height=0.002)
    bottom.apply_translation([0.0, 0.0, -0.049])
    found = _from_the_side(trimesh.util.concatenate([wall, bottom]))
    assert len(found) >= 16
    for grasp in found:
        assert grasp.width == pytest.approx(0.07, abs=0.003)
        assert abs(float(grasp.body_from_tool[:3, 3] @ grasp.body_from_tool[:3, 1])) < 0.003


def test_a_thin_walled_box_is_not_grasped_at_its_corners() -> None:
    """From corner to corner the box would fit between the fingers too, but they would slip off."""
    outer, inner = trimesh.creation.box(extents=(0.05, 0.05, 0.1)), trimesh.creation.box(extents=(0.046, 0.046, 0.1))
    inner.invert()
    found = _from_the_side(trimesh.util.concatenate([outer, inner]))
    assert found and 0.05 * np.sqrt(2) < 0.08 - 0.006
    for grasp in found:
        closing = np.abs(grasp.body_from_tool[:2, 1])
        assert closing.max() > 0.99 and grasp.width < 0.056


def test_what_only_faces_away_is_not_square() -> None:
    out, side = np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0])
    assert not _square(np.zeros((0, 3)), out, np.inf) and not _square(np.array([-out, -out, side]), out, np.inf)
    assert _square(np.array([-out, out, out]), out, np.inf)
    leaning = np.array([0.4, 0.9, 0.0]) / np.hypot(0.4, 0.9)
    assert _square(np.array([leaning, leaning]), out, 0.5) and not _square(np.array([leaning, leaning]), out, 0.3)


def test_a_round_item_is_held_by_its_sides_and_not_squeezed_out() -> None:
    points, normals = surface_points(
        [trimesh.creation.cylinder(radius=0.03, height=0.2)], 4000, np.random.default_rng(0)
    )
    any_way, held = (
        sample_grasps(points, normals, np.eye(4), opening=0.08, random=np.random.default_rng(1), friction=friction)
        for friction in (np.inf, 0.3)
    )
    assert 0 < len(held) < len(any_way)
    assert min(grasp.width for grasp in any_way) < 0.055 < min(grasp.width for grasp in held)
