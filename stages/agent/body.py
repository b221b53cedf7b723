"""The one interface between a world and an arm: what the robot's cameras and joints tell, what it can be made to do.

A world in physics or a real robot has to offer the same.
"""

from __future__ import annotations

from typing import Protocol

from scenewright.stages.agent.obstacle_map import ObstacleMap
from scenewright.stages.agent.senses import CANDIDATES, Base, Detection, Felt, Look, Position, Sweep, Take


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

    def reaches(self, base: Base, at: Position, *, take: Take = "") -> bool:
        """Whether a collision-free arm pose at the position exists in the robot's own map, from a base pose; to `take`
        what is there a grasp of what was seen of it, where the map holds shapes."""
        ...

    @property
    def held_level(self) -> bool:
        """Whether what it holds, if anything, was taken by a level hand, so that it can go into a shelf."""
        ...

    def grasp(self, at: Position, label: str, candidate: int, *, level: bool = False, most: int = CANDIDATES) -> Felt:
        """Close the hand at a position by the grasp of a rank (0 first), of a `level` hand alone where that is said.
        `most`: grasps that are planned before it gives up. `label`: what is believed to be there."""
        ...

    def release(self, at: Position, label: str, *, gently: bool = False) -> Felt:
        """Let go over a position, 15 cm above it or, gently, at contact. `label`: what is believed to be below."""
        ...

    def pull(self, at: Position, *, opening: bool) -> Felt:
        """Open or close the door or drawer of the furniture at a position."""
        ...
