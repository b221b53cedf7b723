"""What a look tells of a body before it is acted on, and the look that tells the truth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from scenewright.schemas.interactive_scene import SceneBody
from scenewright.schemas.scene_parts import SurfacePlane
from scenewright.stages.kit.motion.physical_robot import PhysicalRobot
from scenewright.stages.plan.correspondence import renamed
from scenewright.stages.plan.world_model import WorldModel, true_record

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
