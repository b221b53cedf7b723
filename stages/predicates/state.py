"""What the robot perceives at one moment: the answers of the twelve perception calls."""

from __future__ import annotations

from dataclasses import dataclass

TABLE_HEIGHT, TABLE_LEFT, TABLE_RIGHT = 0.0, -40.0, 25.0
FINGER_HEIGHT, LARGEST_OPENING = 2.0, 5.0


@dataclass(frozen=True)
class Seen:
    """One object: middle x, bottom y, width and height of its box, category, and water [tens of drops]."""

    x: float
    y: float
    width: float
    height: float
    category: str
    water: float = 0.0


@dataclass(frozen=True)
class State:
    """A moment; lengths in the kitchen's units."""

    objects: dict[str, Seen]
    gripper_x: float = 0.0
    gripper_y: float = 25.0
    """Of the fingers' tips."""
    opening: float = LARGEST_OPENING
    mass: float = 0.0
    """What the gripper feels in its fingers."""
