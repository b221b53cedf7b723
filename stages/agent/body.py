"""The one interface between a world and an arm: what the robot's cameras and joints tell, what it can be made to do.

A world in physics or a real robot has to offer the same. Nothing here names a true thing: positions are measured,
labels are what the eyes say. Positions are in the map frame [m], which the robot's localisation defines.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np

from schemas.plan import Failure

if TYPE_CHECKING:
    from stages.agent.obstacle_map import ObstacleMap

Position = tuple[float, float, float]


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


class Body(Protocol):
    """A robot in some world."""

    @property
    def base(self) -> Base:
        """Where localisation says that it stands."""
        ...

    @property
    def seconds(self) -> float:
        """Since the beginning."""
        ...

    @property
    def same_thing(self) -> float:
        """Two sightings this near are of one thing [m]: how well its eyes and localisation measure."""
        ...

    @property
    def enough(self) -> int:
        """Regions of views by which a class has to be ahead before anything is done about it."""
        ...

    @property
    def stand_off(self) -> float:
        """Of the middle of the base from the edge of furniture on which it works [m]."""
        ...

    @property
    def obstacles(self) -> ObstacleMap:
        """What it knows of the floor: what its sweeps saw, what it touched, doors that it opened."""
        ...

    @property
    def short_armed(self) -> bool:
        """Whether its arm ends short of the far side of a table, so that other sides have to be known."""
        ...

    def sweep(self) -> Sweep:
        """Turn the head camera around once, and enter what it sees into the obstacle map."""
        ...

    def drive(self, base: Base, toward: str) -> Felt:
        """Drive to a pose along the obstacle map. `toward`: what the arm calls its goal; empty: exploring."""
        ...

    def look(self, at: Position, *, close: bool) -> Look:
        """Look at the surface around a position: all of it (three wrist poses), or what lies there from near by."""
        ...

    def look_at_hand(self, view: int) -> Detection | None:
        """What the hand holds as seen from one of the wrist's views; None: nothing. The same view says the same."""
        ...

    def reaches(self, base: Base, at: Position, *, take: bool = False) -> bool:
        """Whether a collision-free arm pose at the position exists in the robot's own map, from a base pose; to `take`
        what is there a grasp of what was seen of it, where the map holds shapes."""
        ...

    def grasp(self, at: Position, label: str, candidate: int) -> Felt:
        """Close the hand at a position by the grasp of a rank (0 first). `label`: what is believed to be there."""
        ...

    def release(self, at: Position, label: str, *, gently: bool = False) -> Felt:
        """Let go over a position, 15 cm above it or, gently, at contact. `label`: what is believed to be below."""
        ...

    def pull(self, at: Position, *, opening: bool) -> Felt:
        """Open or close the door or drawer of the furniture at a position."""
        ...
