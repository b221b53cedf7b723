"""A cabinet that stands open is its carcass and a door at the angle at which it was seen."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scenewright.schemas.base import as_vector
from scenewright.stages.cad.carcasses import patches_of
from scenewright.stages.cad.families.fitting import Fitted, fit
from scenewright.stages.cad.families.forms import Reading
from scenewright.stages.cad.families.open_cabinets import NOTHING, opened
from scenewright.stages.cad.families.stand_in import write_form
from scenewright.stages.cad.model_surfaces import to_world
from scenewright.stages.kit.formats.cad_models import part_transforms
from scenewright.stages.kit.formats.entity_meshes import EntityMesh
from scenewright.stages.kit.geometry.transforms import apply, transform_from_yaw
from scipy.spatial import cKDTree

from tests.panoptic_maps import seen_surface
from tests.unit.cad.test_families import EYES, node

WIDE, DEEP, HIGH, WALL = 0.62, 0.6, 1.6, 0.05
SHELVES = (0.45, 0.8, 1.15)
FINE = 0.03


def carcass():
    """Boxes (low, high) of a fridge that one sees into; its front at y = -DEEP / 2."""
    x, y = WIDE / 2, DEEP / 2
    walls = [
        ((-x, -y, 0.0), (-x + WALL, y, HIGH)),
        ((x - WALL, -y, 0.0), (x, y, HIGH)),
        ((-x, y - WALL, 0.0), (x, y, HIGH)),
        ((-x, -y, 0.0), (x, y, WALL)),
        ((-x, -y, HIGH - WALL), (x, y, HIGH)),
    ]
    return walls + [((-x + WALL, -y + 0.02, z - 0.015), (x - WALL, y - WALL, z)) for z in SHELVES]


class NotBehind:
    """Free space where nothing is known."""

    def is_empty(self, points, own=None):
        return np.zeros(len(points), dtype=bool)


def open_reading(angle, *, right=True, yaw=0.0, door=True) -> Reading:
    """What cameras see of a fridge whose door stands at an angle [rad]."""
    side = 1.0 if right else -1.0
    hinge = np.array([side * WIDE / 2, -DEEP / 2, 0.0])
    meshes = [trimesh.creation.box(bounds=box) for box in carcass()]
    if door:
        leaf = trimesh.creation.box(bounds=[(min(-side * WIDE, 0), -0.04, 0.02), (max(-side * WIDE, 0), 0.0, HIGH)])
        leaf.apply_transform(transform_from_yaw(side * angle, np.zeros(3)))
        leaf.apply_translation(hinge)
        meshes.append(leaf)
    whole = trimesh.util.concatenate(meshes)
    whole.apply_transform(transform_from_yaw(yaw, np.array([0.1, -0.2, 0.0])))
    eyes = [*EYES, (0.1, -2.2, 1.2), (-0.5, -1.8, 0.9), (0.6, -1.8, 1.4), (0.0, -1.5, 0.7)]
    mesh = seen_surface({1: whole}, eyes, noise=0.002)[1]
    entity = EntityMesh(np.asarray(mesh.vertices), np.asarray(mesh.faces), np.zeros((len(mesh.vertices), 3), np.uint8))
    return Reading(patches_of(entity), 0.0, np.eye(3), NotBehind(), cKDTree(entity.vertices))


@pytest.mark.parametrize("right", [True, False])
@pytest.mark.parametrize("angle", [1.2, 1.8, 2.2])
def test_a_door_stands_at_the_angle_at_which_it_was_seen(right, angle):
    found = fit("cabinet", open_reading(angle, right=right, yaw=0.4))
    assert isinstance(found, Fitted), found
    door = found.form.leaves[0]
    assert door.value == pytest.approx(angle, abs=0.08)
    assert found.form.classes[0] == "fridge" and found.explained > 0.85
    corners = np.concatenate([piece.corners for piece in found.form.pieces])
    assert np.ptp(corners, axis=0) == pytest.approx([WIDE, DEEP, HIGH], abs=FINE)
    shut = door.pieces[0].corners
    assert np.ptp(shut, axis=0)[0] == pytest.approx(WIDE, abs=FINE)
    assert door.origin[0] == pytest.approx(shut[:, 0].max() if right else shut[:, 0].min(), abs=0.01)


def test_boards_are_where_they_were_seen():
    form = fit("cabinet", open_reading(1.8)).form
    tops = sorted(piece.corners[:, 2].max() for piece in form.pieces if piece.name == "board")
    assert tops == pytest.approx(SHELVES, abs=0.01) and all(
        piece.level is not None for piece in form.pieces if piece.name == "board"
    )


def test_a_board_is_where_something_stands():
    reading = replace(open_reading(1.8), carrying=(SHELVES[0] + 0.01, 1.4))
    form = fit("cabinet", reading).form
    tops = sorted(piece.corners[:, 2].max() for piece in form.pieces if piece.name == "board")
    assert tops == pytest.approx([*SHELVES, 1.4], abs=0.01)


def test_a_carcass_without_a_door_is_none_of_these():
    reading = open_reading(1.8, door=False)
    assert opened(reading.patches, 0.0) == NOTHING
    assert str(fit("cabinet", reading)).endswith(NOTHING)


def test_its_model_stands_as_it_was_seen_and_shuts(tmp_path):
    angle = 1.8
    form = fit("cabinet", open_reading(angle, yaw=0.3)).form
    placement, surface = write_form(node("fridge"), form, tmp_path / "thing_3_cabinet")
    (joint,) = surface.model.joints
    assert joint.type == "revolute" and joint.upper >= placement.shape.joints[joint.name] > 1.6
    leaf = form.leaves[0]
    seen = np.concatenate([piece.corners for piece in leaf.standing]) @ form.turn.T
    pose = part_transforms(surface.model, placement.shape.joints)[joint.part]
    placed = to_world(placement, apply(pose, surface.corners[joint.part]))
    assert cKDTree(placed).query(seen)[0].max() < 1e-3
    shut = part_transforms(surface.model, {joint.name: 0.0})[joint.part]
    closed = apply(shut, surface.corners[joint.part])
    assert np.ptp(closed[:, 1]) < 0.1, "shut, it lies in the front"
    assert as_vector(joint.axis)[2] == 1.0 and math.isclose(joint.lower, 0.0)
