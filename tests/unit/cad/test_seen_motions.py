"""What the log shows moving is the strongest ground of a joint, and its axis and reach are the joint's in the scene."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.schemas.articulations import Articulation
from scenewright.stages.cad.joint_evidence import joint_evidence
from scenewright.stages.cad.model_surfaces import load_surface
from scenewright.stages.cad.seen_motions import seen_motions
from scenewright.stages.cad.shapes import Placement, shape_of_state
from scenewright.stages.kit.formats.cad_models import model_folder
from scenewright.stages.kit.formats.scene_links import model_links
from scenewright.stages.kit.geometry.transforms import transform_from_yaw
from scenewright.stages.urdf.bodies import as_it_moved

from tests.unit.cad.models import write_library
from tests.unit.cad.test_cad_stage import model_named
from tests.unit.cad.test_joint_evidence import FRONT, HEIGHT, WIDTH, cupboard, looked_at, write_urdf_of

YAW, SHIFT, TILT, TURNED = 0.7, np.array([1.0, -2.0, 0.1]), 0.03, 2.3
"""How the cupboard stands; by how much the hinge that was seen leans, and how far its door was opened [rad]."""


@pytest.fixture(scope="module")
def cupboards(tmp_path_factory):
    return write_library(tmp_path_factory.mktemp("cupboards"), {"plain": cupboard(False)})


@pytest.fixture
def placed(cupboards):
    surface = load_surface(model_folder(cupboards, "plain"), model_named(cupboards, "plain"))
    shape = shape_of_state(surface.model, surface.model.states[0])
    world = transform_from_yaw(YAW, SHIFT)
    return surface, Placement(shape, 1.0, world[:3, :3], world[:3, 3], 0, 0, 0)


def seen(*, opened=True, kind="revolute", lean=TILT, shift=0.0):
    """The left door of the cupboard, as a log shows it: opened or shut, its hinge leaning by so much [rad]."""
    world = transform_from_yaw(YAW, SHIFT)
    x = [-WIDTH / 2 + shift, shift]
    shut = np.array([(x[0], FRONT, 0), (x[1], FRONT, 0), (x[1], FRONT, HEIGHT), (x[0], FRONT, HEIGHT)])
    away = shut + [0.0, -0.4, 0.0]
    corners = [tuple(world[:3, :3] @ corner + world[:3, 3]) for corner in (*shut, *away)]
    axis = np.array([np.sin(lean), 0.0, -np.cos(lean)]) * (1 if opened else -1)
    return Articulation(
        type=kind,
        axis=tuple(world[:3, :3] @ axis),
        origin=tuple(world[:3, :3] @ [x[0], FRONT - 0.02, 0.3] + world[:3, 3]),
        travel=TURNED,
        leaf=tuple(corners[:4] if opened else corners[4:]),
        leaf_after=tuple(corners[4:] if opened else corners[:4]),
        last_before=10,
        first_after=20,
        overlap=0.9,
    )


@pytest.mark.parametrize("opened", [True, False])
def test_a_joint_is_the_one_whose_leaf_was_seen_to_move(placed, opened):
    found = seen_motions(*placed, [seen(opened=opened)])
    assert list(found) == ["left"]
    motion = found["left"]
    assert motion.axis == pytest.approx((np.sin(TILT), 0, -np.cos(TILT)))
    assert motion.angle == pytest.approx(TILT, abs=1e-6)
    assert motion.travel == motion.upper == TURNED


@pytest.mark.parametrize("other", [{"kind": "prismatic"}, {"lean": 0.6}, {"shift": 0.9}], ids=str)
def test_another_motion_is_no_ground(placed, other):
    assert seen_motions(*placed, [seen(**other)]) == {}


def test_it_is_the_first_ground_even_of_a_model_that_fits_badly(cupboards, placed):
    surface, placement = placed
    looked = looked_at(cupboards, "plain")
    evidence = joint_evidence(surface, placement, looked, vouched=False, articulations=[seen()])
    assert evidence["left"].grounds == ("moved",) and evidence["right"].grounds == ("thing",)
    assert not any(entry.grounds for entry in joint_evidence(surface, placement, looked, vouched=False).values())


def test_the_joint_of_the_scene_turns_as_it_was_seen_to(cupboards, placed, tmp_path):
    model, folder = model_named(cupboards, "plain"), model_folder(cupboards, "plain")
    write_urdf_of(folder, model)
    moved = as_it_moved(model, seen_motions(*placed, [seen()]))
    body = model_links(tmp_path, "thing", moved, folder, 1.0, {"left": 2.2})
    joint, record = body.joints[0], body.joint_records[0]
    assert joint.axis == pytest.approx((np.sin(TILT), 0, -np.cos(TILT))) and record.axis == joint.axis
    assert joint.upper == record.upper == TURNED and body.joint_values["thing__left"] == 2.2
    assert body.joints[1].axis == (0.0, 0.0, 1.0) and body.joints[1].upper == 1.9
    assert as_it_moved(model, {}) is model
