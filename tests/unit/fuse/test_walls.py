"""Walls by geometry: a long plane with nothing behind it is one, the front of a cabinet before it is none."""

from __future__ import annotations

import numpy as np
from scenewright.stages.fuse.unnamed_pieces import FLOOR
from scenewright.stages.fuse.walls import of_walls
from scenewright.stages.kit.geometry.point_clouds import vertex_normals

from tests.unit.fuse.test_unnamed_pieces import COUNTER, VOXEL, Corners, room


def walls_of(*boxes: Corners, turned: float = 0.0, lowest: float = FLOOR) -> tuple[np.ndarray, np.ndarray]:
    """Which vertices of a room that is turned about z [rad] are of walls, and the part of each."""
    vertices, faces, owner = room(*boxes)
    seen = (vertices[:, 2] > lowest) & ((owner < 2) | (vertices[:, 1] < 1.95))  # nobody sees what touches the wall
    c, s = np.cos(turned), np.sin(turned)
    vertices = vertices @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]).T
    return of_walls(vertices, vertex_normals(vertices, faces), seen, VOXEL), owner


def test_a_wall_at_any_angle_and_no_front_before_it() -> None:
    hung = ((0.0, 1.65, 1.4), (1.5, 2.0, 2.0))
    for turned in (0.0, 0.04, 1.0, -2.5):
        found, owner = walls_of(COUNTER, hung, turned=turned)
        assert found[owner == 1].mean() > 0.95
        assert found[owner > 1].mean() < 0.05, "but for what is close to the wall"


def test_what_is_low_or_narrow_is_no_wall() -> None:
    low, pillar = ((-1.5, -1.0, 0.0), (1.5, -0.9, 1.0)), ((-0.3, -0.3, 0.0), (0.3, 0.3, 2.3))
    found, owner = walls_of(low, pillar)
    assert not found[owner == 2].any() and not found[owner == 3].any()


def test_a_wall_of_which_only_what_is_over_a_counter_was_seen() -> None:
    found, owner = walls_of(lowest=0.95)
    assert found[owner == 1].sum() > 0.5 * (owner == 1).sum()


def test_nothing() -> None:
    assert of_walls(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, bool), VOXEL).shape == (0,)
