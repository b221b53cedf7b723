"""What joints are for, on boxes of known size and place."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.kit.geometry.solids import box
from scenewright.stages.library.joint_kinds import joint_kind

CABINET = box((-0.5, 0.5), (0.0, 0.5), (0.0, 1.0)).vertices


def kind_of(kind: str, origin, axis, part: np.ndarray, model: np.ndarray = CABINET) -> str:
    joint = Joint(name="j", type=kind, part="p", origin=origin, axis=axis, lower=0.0, upper=1.0)
    return joint_kind(joint, part, np.concatenate([part, model]))


@pytest.mark.parametrize(
    ("expected", "kind", "origin", "axis", "part"),
    [
        ("drawer", "prismatic", (0, 0, 0), (0, -1, 0), box((-0.45, 0.45), (0.0, 0.45), (0.7, 0.9))),
        ("door", "prismatic", (0, 0, 0), (1, 0, 0), box((-0.45, 0.05), (-0.02, 0.0), (0.1, 0.9))),
        ("lid", "prismatic", (0, 0, 1), (0, 0, 1), box((-0.5, 0.5), (0.0, 0.5), (1.0, 1.02))),
        ("slide", "prismatic", (0, 0, 0), (0, 0, -1), box((-0.02, 0.02), (-0.02, 0.0), (0.5, 0.54))),
        ("door", "revolute", (-0.5, 0, 0.5), (0, 0, -1), box((-0.5, 0.0), (-0.02, 0.0), (0.1, 0.9))),
        ("door", "revolute", (0, -0.02, 0.1), (1, 0, 0), box((-0.5, 0.5), (-0.02, 0.0), (0.1, 0.6))),
        ("lid", "revolute", (0, 0.5, 1.0), (-1, 0, 0), box((-0.5, 0.5), (0.0, 0.5), (1.0, 1.03))),
        ("knob", "revolute", (0.2, 0, 0.9), (0, -1, 0), box((0.18, 0.22), (-0.02, 0.0), (0.88, 0.92))),
        ("lever", "revolute", (0.2, 0, 1.0), (0, 0, 1), box((0.19, 0.31), (-0.01, 0.01), (1.0, 1.02))),
    ],
)
def test_kinds(expected, kind, origin, axis, part):
    assert kind_of(kind, origin, axis, part.vertices) == expected


def test_a_door_of_a_whole_kitchen_is_no_lever():
    kitchen = box((-2.0, 2.0), (0.0, 2.0), (0.0, 2.4)).vertices
    door = box((0.0, 0.4), (-0.02, 0.0), (1.5, 2.1)).vertices
    assert kind_of("revolute", (0.0, 0.0, 1.8), (0, 0, -1), door, kitchen) == "door"


def test_turning_and_moving_the_model_changes_nothing():
    angle = 0.7
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]])
    shift = np.array([3.0, -2.0, 0.5])
    knob = box((0.18, 0.22), (-0.02, 0.0), (0.88, 0.92)).vertices
    origin, axis = turn @ np.array([0.2, 0, 0.9]) + shift, turn @ np.array([0, -1.0, 0])
    assert kind_of("revolute", tuple(origin), tuple(axis), knob @ turn.T + shift, CABINET @ turn.T + shift) == "knob"
