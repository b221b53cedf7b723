"""A room as it truly is: bodies in pybullet, meshes for the cameras, and what lies on or in what.

Two sources: the boxes of an apartment (`apartment_room.py`), and a true scene of library models (`scene_room.py`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import hypot

import numpy as np
from scenewright.schemas.apartment import Apartment, Furniture, Thing
from scenewright.stages.agent.world.physics.eyes import FIXTURE
from scenewright.stages.kit.rendering.ray_casting import SceneRenderer
from scenewright.stages.kit.simulation.world import PhysicsWorld


@dataclass(frozen=True)
class Body:
    """A thing as it truly is: on or in what (empty: in the hand), where, and how often it came to lie anew."""

    thing: Thing
    on: str
    at: tuple[float, float]
    moved: int


class Room(ABC):
    """Walls, furniture and things. `apartment` says what they are, and where the robot starts."""

    parts: dict[str, str]
    """What moves of furniture -> its class, handles included."""
    fixtures: tuple[str, ...] = ()
    """What stands in a room and is neither furniture that the robot goes to nor a thing."""
    named: dict[int, str]
    """Instance number in a picture -> name; walls and floors are 0."""

    def __init__(self, apartment: Apartment) -> None:
        self.apartment = apartment
        self.world = PhysicsWorld()
        self.furniture: dict[str, Furniture] = {piece.name: piece for piece in apartment.furniture}
        self.things: dict[str, Thing] = {thing.name: thing for thing in apartment.things}
        self.moved = dict.fromkeys(self.things, 0)

    def close(self) -> None:
        """End the pybullet world."""
        self.world.close()

    @abstractmethod
    def opened(self) -> set[str]:
        """Return the furniture of which a door is not shut."""

    @abstractmethod
    def renderer(self, eye: np.ndarray) -> SceneRenderer:
        """Return what the cameras at a place (3,) see, as everything lies now."""

    @abstractmethod
    def lies(self, name: str) -> tuple[float, float, float]:
        """Return the middle of a thing's foot [m], world frame."""

    @abstractmethod
    def carrier(self, name: str) -> str:
        """Return the thing or furniture that a thing is on or in now, or `floor`."""

    def owner(self, name: str) -> str:
        """Return the furniture that the eyes take a named body or part for: a door is of its furniture."""
        return name.split("__")[0]

    def label(self, name: str) -> str:
        """Return the class by which the eyes name a thing, a part or a fixture; empty for all else."""
        thing = self.things.get(name)
        if thing is not None:
            return thing.label
        return FIXTURE if name in self.fixtures else self.parts.get(name, "")

    def gap(self, piece: Furniture, x: float, y: float) -> float:
        """Return the free distance [m] of a point from a piece of furniture."""
        off = [max(0.0, abs(p - c) - s / 2) for p, c, s in zip((x, y), piece.centre, piece.size, strict=True)]
        return hypot(*off)

    def body(self, name: str, held: str | None) -> Body:
        """Return how a thing lies now."""
        x, y, _ = self.lies(name)
        return Body(self.things[name], "" if name == held else self.carrier(name), (x, y), self.moved[name])
