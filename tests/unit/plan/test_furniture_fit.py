"""Where furniture stands and how far it is open, by what a camera saw of it."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.kit.geometry.transforms import apply, inverse, look_at, transform_from_yaw
from scenewright.stages.kit.rendering.object_views import Picture, View
from scenewright.stages.kit.rendering.ray_casting import SceneRenderer
from scenewright.stages.kit.rendering.surfaces import build_soup
from scenewright.stages.kit.simulation.shapes import surface_points
from scenewright.stages.plan.furniture_fit import Range, Surface, fit_furniture

CAMERA = Camera(width=160, height=120, fx=170.0, fy=170.0, cx=79.5, cy=59.5)
HINGE = np.array([0.2, -0.25, 0.0])
"""Of a box 40 cm deep, 50 cm wide and 30 cm high whose door is on its +x side."""
WALL = 9


def cabinet(door: float) -> list[trimesh.Trimesh]:
    """Five walls around a hollow, and a door that is open by an angle [rad]."""
    sizes = [
        ((0.4, 0.5, 0.02), (0.0, 0.0, 0.01)),
        ((0.4, 0.5, 0.02), (0.0, 0.0, 0.29)),
        ((0.4, 0.02, 0.3), (0.0, -0.24, 0.15)),
        ((0.4, 0.02, 0.3), (0.0, 0.24, 0.15)),
        ((0.02, 0.5, 0.3), (-0.19, 0.0, 0.15)),
    ]
    parts = []
    for size, middle in sizes:
        parts.append(trimesh.creation.box(extents=size))
        parts[-1].apply_translation(middle)
    leaf = trimesh.creation.box(extents=(0.02, 0.5, 0.3))
    leaf.apply_translation((0.01, 0.25, 0.15))
    leaf.apply_transform(transform_from_yaw(-door, HINGE))
    return [*parts, leaf]


def surface_at(values: dict[str, float]) -> Surface:
    """The cabinet where it is believed."""
    return surface_points(cabinet(values["door"]), 9000, np.random.default_rng(0))


def look(door: float, truth: np.ndarray, eye: tuple[float, float, float]) -> tuple[np.ndarray, View]:
    """What a camera sees of a cabinet that stands elsewhere, a wall behind it: points of the cabinet, 2 mm of noise."""
    meshes = [mesh.apply_transform(truth) for mesh in cabinet(door)]
    wall = trimesh.creation.box(extents=(0.1, 6.0, 6.0))
    wall.apply_translation((-1.2, 0.0, 0.0))
    soup = build_soup([*((1, mesh) for mesh in meshes), (WALL, wall)])
    pose = look_at(np.array(eye), np.array([0.0, 0.0, 0.15]))
    seen = SceneRenderer(soup, shadows=False, antialias=False).render(CAMERA, pose)
    depth = seen.depth + np.random.default_rng(1).normal(0, 0.002, seen.depth.shape) * (seen.depth > 0)
    points = apply(pose, back_project(depth, CAMERA)[seen.instance == 1].astype(float))
    return points, View(Picture(seen.color, depth, seen.instance, CAMERA), pose)


@pytest.mark.parametrize(("door", "shift", "yaw"), [(0.0, (0.15, 0.03, 0.0), 0.05), (1.3, (-0.08, 0.05, 0.0), -0.1)])
def test_furniture_comes_home_with_its_door_as_open_as_it_is(
    door: float, shift: tuple[float, float, float], yaw: float
) -> None:
    """Also where a shut front stands before its place by more than a door that is ajar would."""
    truth = transform_from_yaw(yaw, np.array(shift))
    points, view = look(door, truth, (1.1, 0.8, 0.7))
    found = fit_furniture(points, [view], surface_at, [Range("door", 0.0, 1.9)], {"door": 0.0})
    off = inverse(truth) @ found.motion
    assert np.linalg.norm(off[:3, 3]) < 0.01
    assert abs(np.arctan2(off[1, 0], off[0, 0])) < 0.02
    assert found.joints["door"] == pytest.approx(door, abs=0.05)


def test_a_door_that_was_seen_through_is_not_there() -> None:
    """It is believed open; of an open door a view from the front shows nothing else than of a shut one."""
    points, view = look(0.0, np.eye(4), (1.3, 0.0, 0.3))
    found = fit_furniture(points, [view], surface_at, [Range("door", 0.0, 1.9)], {"door": 1.6})
    assert found.joints["door"] == pytest.approx(0.0, abs=0.05)


def test_what_stands_where_it_is_believed_stays() -> None:
    points, view = look(0.4, np.eye(4), (1.2, 0.3, 0.7))
    found = fit_furniture(points, [view], surface_at, [Range("door", 0.0, 1.9)], {"door": 0.4})
    assert found.joints == {"door": 0.4}
    assert np.abs(found.motion - np.eye(4)).max() < 0.01


def test_an_open_door_does_not_turn_the_furniture_behind_it() -> None:
    """Little but the door is in sight, which is believed shut."""
    points, view = look(0.9, np.eye(4), (0.5, -1.3, 0.3))

    def near(motion: np.ndarray) -> bool:
        return abs(float(np.arctan2(motion[1, 0], motion[0, 0]))) < 0.2

    found = fit_furniture(points, [view], surface_at, [Range("door", 0.0, 1.9)], {"door": 0.0}, near)
    assert found.joints["door"] == pytest.approx(0.9, abs=0.05)
    assert np.abs(found.motion - np.eye(4)).max() < 0.03
