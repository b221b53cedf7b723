"""What a look tells of a body before it is acted on: the truth, the truth through eyes and a robot that err."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import hypot
from typing import Protocol

import numpy as np
from scenewright.schemas.interactive_scene import SceneBody
from scenewright.schemas.scene_parts import SurfacePlane
from scenewright.stages.kit.motion.physical_robot import PhysicalRobot
from scenewright.stages.kit.rendering.segmenter_errors import SegmenterErrors, quarter_turn
from scenewright.stages.plan.correspondence import renamed
from scenewright.stages.plan.erring_robot import ErringRobot
from scenewright.stages.plan.world_model import WorldModel, moved_record, true_record

NEAR_BY = 1.5
"""Largest distance of a look from near by [m]."""
CELL = 0.05
"""A thing that was moved by more is seen anew [m]."""
Seen = tuple[SceneBody, str, tuple[SurfacePlane, ...]]
"""Record, URDF text and planes, under the name that the plan uses."""


@dataclass(frozen=True)
class Room:
    """The room where the plan is executed, as files tell it; its physics is in the robot's world."""

    records: dict[str, SceneBody]
    texts: dict[str, str]
    planes: dict[str, tuple[SurfacePlane, ...]]


class Eyes(Protocol):
    """How the robot sees."""

    again: bool
    """Whether it looks once more from where it will act: what it measured elsewhere is off by two stops' errors."""

    def seen(self, body: str, here: str) -> Seen | None:
        """Return what a look shows of a planned body that is called `here` in the room; None: it is not made out."""
        ...


class TrueEyes:
    """Pose, joint values and shape as they are in the room."""

    again = False

    def __init__(self, model: WorldModel, room: Room, physical: PhysicalRobot, joint_names: Mapping[str, str]) -> None:
        self._model, self._room, self._physical = model, room, physical
        self._joint_names = joint_names

    def seen(self, body: str, here: str) -> Seen:
        """Return the truth; what it stands on stays as believed."""
        record = true_record(self._physical.world, here, self._room.records[here])
        names = {
            room_joint: planned for planned, room_joint in self._joint_names.items() if planned.startswith(f"{body}__")
        }
        record, text = renamed(record, self._room.texts[here], body, names)
        return record, text, self._room.planes[here]


class NoisyEyes:
    """The truth from where the robot believes to stand, unless the segmentation misses a body or takes it for something
    else, for good from each region of views (`kit/rendering/segmenter_errors.py`): then it stays as believed."""

    again = True

    def __init__(self, true: TrueEyes, robot: ErringRobot, errors: SegmenterErrors) -> None:
        self._true, self._robot, self._errors = true, robot, errors

    def seen(self, body: str, here: str) -> Seen | None:
        """Return it where localisation's error puts it."""
        record, text, planes = self._true.seen(body, here)
        at, base = np.array(record.world_from_body)[:2, 3], self._robot.robot.configuration().base
        side, is_close = quarter_turn(base.tolist(), at.tolist()), hypot(*(base[:2] - at)) < NEAR_BY
        lies = hash(tuple(np.rint(at / CELL).astype(int).tolist()))
        if self._errors.misses(here, lies, side, is_close):
            return None
        if self._errors.class_of(here, record.class_name, side, is_close) != record.class_name:
            return None
        pose = self._robot.map_from_true() @ np.array(record.world_from_body)
        return moved_record(record, pose, dict(record.joint_values)), text, planes
