"""What a robot's senses say, as records: where it is, what it saw, what a motion felt like.

Nothing here names a true thing: positions are measured, labels are what the eyes say. Positions are in the map frame
[m], which the robot's localisation defines.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scenewright.schemas.plan import Failure

Position = tuple[float, float, float]
Take = Literal["", "any", "level"]
"""Whether something is to be taken, and whether a level hand has to, as for what goes into a shelf."""
CANDIDATES = 40
"""Grasps that are planned before a robot gives up, those from above first: eight of each of five pitches."""


@dataclass(frozen=True)
class Base:
    """Pose of the driving base: x, y [m], yaw [rad]."""

    x: float
    y: float
    yaw: float


@dataclass(frozen=True)
class SeenFurniture:
    """A large box that the head camera made out: centre and size (x, y) [m], height [m]."""

    label: str
    centre: tuple[float, float]
    size: tuple[float, float]
    height: float
    door: bool
    opened: bool
    open_to: float | None = None
    """Heading out of a shelf [rad] whose leaf is open: it is looked and got into from there alone."""
    levels: tuple[float, ...] = ()
    """Heights of the boards of an open shelf [m]."""
    top: bool = False
    """Things lie on its top as well: they are got at with its door closed."""
    more: bool = False
    """It has doors or drawers that were not opened yet: to open it once more opens the next one."""


@dataclass(frozen=True)
class Detection:
    """A thing that the wrist camera made out."""

    label: str
    position: Position
    color: str
    used: bool | None
    """None: cannot be told from here."""
    radius: float
    """Of its extent over the ground [m]."""
    whole: bool = True
    """False where the edge of the picture cuts it: its middle is not known."""


@dataclass(frozen=True)
class Look:
    """What the wrist camera saw from its three poses at one base, or from one pose near by.

    `sector` and `close` name the region of views: errors of the eyes persist within one.
    """

    detections: tuple[Detection, ...]
    sector: int
    """Quarter turn of the camera around what was looked at, 0 to 3."""
    close: bool
    in_view: bool = True
    """False where the camera did not get to see the place: what is not among the detections may be there."""


@dataclass(frozen=True)
class Sweep:
    """What the head camera saw on one turn: cells of the obstacle map (N, 2) that are free and that are not."""

    free: np.ndarray
    occupied: np.ndarray
    furniture: tuple[SeenFurniture, ...]


FeltKind = Literal["", "no_way", "no_grasp", "no_trajectory", "door_stuck", "out_of_reach"]


@dataclass(frozen=True)
class Felt:
    """What the robot itself knows of a motion: whether one was planned and carried out. Not whether it did any good."""

    ok: bool
    kind: FeltKind = ""
    failure: Failure | None = None
    """What motion planning or control said, with its numbers, where there is motion."""
    furniture: SeenFurniture | None = None
    """The furniture of a door that was moved, where more of it than the door is changed: a drawer is in the way."""
