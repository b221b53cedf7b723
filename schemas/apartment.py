"""An apartment as data: rooms, doors, furniture, things on it. What `agent run --world` reads and episodes hold."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator
from scenewright.schemas.base import Model, Name

Coordinate = Annotated[float, Field(ge=-50.0, le=50.0)]
Point = tuple[Coordinate, Coordinate]
Label = Annotated[str, Field(min_length=1, max_length=80)]
"""A class, or what somebody wrote in its place: data, never an instruction."""
MOST_ROOMS, MOST_FURNITURE, MOST_THINGS = 12, 60, 300
"""Most rooms, furniture and things of an apartment; bounds, by eye."""
LARGEST_SIDE = 30.0
"""Largest side of a whole apartment [m]."""


class Room(Model):
    """A rectangle of floor between walls, low and high corner (x, y) [m]."""

    name: Name
    low: Point
    high: Point

    @model_validator(mode="after")
    def _has_an_area(self) -> Room:
        if any(high - low < 1.0 for low, high in zip(self.low, self.high, strict=True)):
            raise ValueError("`high` must be at least 1 m beyond `low` in x and in y")
        return self


class Door(Model):
    """An opening in the wall that two rooms share: its centre (x, y) [m] and width [m]."""

    rooms: tuple[Name, Name]
    centre: Point
    width: float = Field(0.9, ge=0.3, le=3.0)


class Furniture(Model):
    """An upright box that carries things on its top, or behind its door: centre and size (x, y) [m], height [m]."""

    name: Name
    label: Label
    centre: Point
    size: tuple[Annotated[float, Field(ge=0.1, le=4.0)], Annotated[float, Field(ge=0.1, le=4.0)]]
    height: float = Field(ge=0.05, le=3.0)
    door: bool = False
    """Things are inside, and neither seen nor reached while it is closed."""
    opened: bool = False


class Thing(Model):
    """Something that can be carried, or that carries (a plate, a box): where it is (x, y) [m] and on or in what."""

    name: Name
    label: Label
    color: str = Field("", max_length=40)
    used: bool = False
    """Seen from near only."""
    on: Name
    at: Point
    carries: bool = False
    radius: float = Field(0.04, ge=0.01, le=0.5)


class Apartment(Model):
    """apartment.json. `start` is where the robot stands (x, y) [m] and its yaw [rad]."""

    rooms: tuple[Room, ...] = Field(min_length=1, max_length=MOST_ROOMS)
    doors: tuple[Door, ...] = Field((), max_length=60)
    furniture: tuple[Furniture, ...] = Field((), max_length=MOST_FURNITURE)
    things: tuple[Thing, ...] = Field((), max_length=MOST_THINGS)
    start: tuple[Coordinate, Coordinate, float]

    @model_validator(mode="after")
    def _fits_together(self) -> Apartment:
        rooms = {room.name for room in self.rooms}
        bodies = [piece.name for piece in self.furniture] + [item.name for item in self.things]
        for name in bodies:
            if bodies.count(name) > 1:
                raise ValueError(f"two things are called {name!r}")
        for door in self.doors:
            if not set(door.rooms) <= rooms:
                raise ValueError(f"a door leads to a room that is none of {', '.join(sorted(rooms))}")
        carriers = {body.name for body in self.furniture} | {item.name for item in self.things if item.carries}
        for item in self.things:
            if item.on not in carriers or item.on == item.name:
                raise ValueError(f"{item.name!r} is on {item.on!r}, which carries nothing")
        self._check_chains()
        for axis, name in enumerate("xy"):
            extent = max(r.high[axis] for r in self.rooms) - min(r.low[axis] for r in self.rooms)
            if extent > LARGEST_SIDE:
                raise ValueError(f"the rooms reach over {extent:.1f} m in {name}, more than {LARGEST_SIDE:g}")
        x, y, _ = self.start
        if not any(r.low[0] < x < r.high[0] and r.low[1] < y < r.high[1] for r in self.rooms):
            raise ValueError("`start` is in no room")
        return self

    def _check_chains(self) -> None:
        """Raise ValueError where things carry each other in a circle."""
        above = {item.name: item.on for item in self.things}
        for name in above:
            passed, at = {name}, above[name]
            while at in above:
                if at in passed:
                    raise ValueError(f"{name!r} carries itself")
                passed.add(at)
                at = above[at]
