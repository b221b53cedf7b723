"""What the arm believes around it: boxes of what was seen, fronts, what it holds; for collision checks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.schemas.base import as_transform
from scenewright.stages.agent.world.physics.fronts import Front
from scenewright.stages.agent.world.physics.shapes import record_of, slab, urdf_of
from scenewright.stages.kit.acting.belief import BelievedRoom
from scenewright.stages.kit.acting.query import NOTHING, CollisionQuery, carrying
from scenewright.stages.kit.simulation.robot_description import RobotDescription

CLEARANCE = 0.004
"""Distance kept from what is believed in [m]; by eye."""
HELD = "held"
"""Name of the box of what is in the hand."""
Box = tuple[np.ndarray, np.ndarray]
Believed = Box | Front


@dataclass(frozen=True)
class Hold:
    """What the robot believes to have in its hand: the box of what it grasped, and where it is in the hand."""

    size: np.ndarray
    tool_from_box: np.ndarray
    foot: float
    """Height of the tool point over the foot of what is held [m], the hand as it grasped."""
    rotation: np.ndarray
    """Of the hand then, base frame."""
    home: np.ndarray
    """Arm (J,) with which it is carried about: folded, and the hand as upright as it grasped, since what is held above
    its middle swings between the fingers when they turn."""


class Beliefs(BelievedRoom):
    """Boxes and doors around the robot, for collision checks."""

    def __init__(self, description: RobotDescription) -> None:
        super().__init__(description, CLEARANCE)
        self._boxes: dict[str, object] = {}

    def show(self, boxes: dict[str, Believed]) -> None:
        """Believe in these boxes, name -> lower and upper corner (3,) [m] in the map frame, in these fronts, and in
        nothing else but what is held."""
        wanted_boxes = {name: _identity(entry) for name, entry in boxes.items()}
        for name in [n for n, box in self._boxes.items() if n != HELD and wanted_boxes.get(n) != box]:
            self.world.remove_body(name)
            del self._boxes[name]
        for name, box in wanted_boxes.items():
            if name in self._boxes:
                continue
            entry = boxes[name]
            if isinstance(entry, Front):
                self._add_front(name, entry)
            else:
                assert isinstance(box, tuple)
                part = slab(box[:3], tuple(max(h, low + 0.004) for low, h in zip(box[:3], box[3:], strict=True)))  # type: ignore[arg-type]
                self.add(record_of(name, "box", (0, 0, 0), 0), urdf_of(name, (part,), 1.0))
            self._boxes[name] = box

    def _add_front(self, name: str, front: Front) -> None:
        record = record_of(name, "front", (0, 0, 0), 0).model_copy(
            update={
                "world_from_body": as_transform(front.map_from_front),
                "joints": (front.joint,),
                "joint_values": {front.joint.name: front.value},
            }
        )
        self.add(record, front.urdf())

    def hold(self, hold: Hold | None) -> CollisionQuery:
        """Believe in the box of what is held, or in none; return the query of a hand that carries it."""
        if HELD in self._boxes:
            self.world.remove_body(HELD)
            del self._boxes[HELD]
        if hold is None:
            return NOTHING
        half = hold.size / 2
        part = slab(tuple(-half), tuple(half))  # type: ignore[arg-type]
        self.add(record_of(HELD, "box", (0, 0, 0), 0), urdf_of(HELD, (part,), 1.0))
        self._boxes[HELD] = tuple(half)
        return carrying(HELD, hold.tool_from_box, (HELD,))


def _identity(entry: Believed) -> object:
    """Return what tells a box or a front from another one: numbers to the millimetre."""
    if not isinstance(entry, Front):
        return (*np.round(entry[0], 3).tolist(), *np.round(entry[1], 3).tolist())
    pose = tuple(np.round(entry.map_from_front, 3).ravel().tolist())
    return (pose, entry.size, entry.panel, entry.bar, round(entry.value, 3), entry.floor, entry.levels)
