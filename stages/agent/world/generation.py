"""Apartments out of a recipe (data/agent/apartment.toml) and a seed, stocked with what a task needs, and clutter."""

from __future__ import annotations

from functools import cache
from math import hypot, pi

import numpy as np
from scenewright.schemas.apartment import Apartment, Door, Furniture, Room, Thing
from scenewright.schemas.base import Model
from scenewright.schemas.errors import UsageError
from scenewright.schemas.outside import file_toml
from scenewright.schemas.places import REINSTALL, data_file

RECIPE = data_file("agent/apartment.toml")
TRIES = 60
"""Whole apartments that are drawn before a seed is given up."""
PLACES = 200
"""Places that are tried for each piece and thing."""
RIM = 0.1
"""Things keep this far from the edge of what carries them [m]."""
GAP = 0.09
"""Gap between things [m]: room for fingers. By eye."""
BESIDE = 0.45
"""Distance of the robot's start from the edge of the table in front of it [m]; by eye."""


class Piece(Model):
    """One piece of furniture of the recipe."""

    size: tuple[float, float]
    height: float
    wall: bool = False
    door: bool = False


class Recipe(Model):
    """apartment.toml."""

    rooms: tuple[int, int]
    side: tuple[float, float]
    door_width: float
    passage: float
    door_clearance: float
    clutter: tuple[int, int]
    furniture: dict[str, Piece]
    things: dict[str, float]


@cache
def recipe() -> Recipe:
    """Return the committed recipe."""
    return Recipe.model_validate(file_toml(RECIPE, hint=REINSTALL))


class NoRoom(Exception):
    """A piece or a thing fits nowhere."""


class Draft:
    """An apartment in the making."""

    def __init__(self, random: np.random.Generator) -> None:
        self.random, self.recipe = random, recipe()
        self.rooms, self.doors = self._rooms()
        self.furniture: list[Furniture] = []
        self.things: list[Thing] = []

    def _rooms(self) -> tuple[list[Room], list[Door]]:
        """Cut rooms out of two columns of one or two rooms; neighbours have a door."""
        low, high = self.recipe.rooms
        count = int(self.random.integers(low, high + 1))
        width, depth = (self.random.uniform(*self.recipe.side, 2) for _ in "xy")
        cells = [(0, 0), (1, 0), (0, 1), (1, 1)][:count]
        xs, ys = np.round(np.cumsum([0.0, *width]), 1), np.round(np.cumsum([0.0, *depth]), 1)
        rooms = [
            Room(name=f"room_{k}", low=(xs[i], ys[j]), high=(xs[i + 1], ys[j + 1])) for k, (i, j) in enumerate(cells)
        ]
        doors = []
        for k, (i, j) in enumerate(cells):
            for m, (p, q) in enumerate(cells[:k]):
                if abs(i - p) + abs(j - q) == 1:
                    along = self.random.uniform(0.25, 0.75)
                    x = xs[1] if i != p else xs[i] + along * (xs[i + 1] - xs[i])
                    y = ys[1] if j != q else ys[j] + along * (ys[j + 1] - ys[j])
                    centre = (round(float(x), 2), round(float(y), 2))
                    doors.append(Door(rooms=(f"room_{m}", f"room_{k}"), centre=centre, width=self.recipe.door_width))
        return rooms, doors

    def add_furniture(self, label: str, *, opened: bool = False) -> str:
        """Put a piece somewhere; return its name. Raises NoRoom."""
        piece = self.recipe.furniture[label]
        name = f"{label}_{sum(f.label == label for f in self.furniture)}"
        for _ in range(PLACES):
            room = self.rooms[int(self.random.integers(len(self.rooms)))]
            placed = self._draw_place(room, piece)
            if placed is None:
                continue
            centre, size = placed
            candidate = Furniture(
                name=name, label=label, centre=centre, size=size, height=piece.height, door=piece.door, opened=opened
            )
            if all(_gap(candidate, earlier) >= self.recipe.passage for earlier in self.furniture) and all(
                _distance(candidate, door.centre) >= self.recipe.door_clearance for door in self.doors
            ):
                self.furniture.append(candidate)
                return name
        raise NoRoom

    def _draw_place(self, room: Room, piece: Piece) -> tuple[tuple[float, float], tuple[float, float]] | None:
        """Draw a place in a room: with its back to a wall, or free with a way all around."""
        side = int(self.random.integers(4))
        along, across = piece.size if side < 2 else piece.size[::-1]
        low, high = np.array(room.low), np.array(room.high)
        half = np.array([along, across]) / 2
        margin = half + (0.1 if piece.wall else self.recipe.passage)
        if np.any(high - low < 2 * margin):
            return None
        x, y = self.random.uniform(low + margin, high - margin)
        if piece.wall:
            if side < 2:
                y = (low[1] + half[1] + 0.1, high[1] - half[1] - 0.1)[side]
            else:
                x = (low[0] + half[0] + 0.1, high[0] - half[0] - 0.1)[side - 2]
        return (round(float(x), 2), round(float(y), 2)), (along, across)

    def named(self, label: str) -> list[str]:
        """Names of the furniture of a label."""
        return [piece.name for piece in self.furniture if piece.label == label]

    def add_thing(self, label: str, on: str, *, color: str = "", used: bool = False, carries: bool = False) -> str:
        """Put a thing on or in a piece of furniture; return its name. Raises NoRoom."""
        piece = next(f for f in self.furniture if f.name == on)
        radius = self.recipe.things.get(label, 0.04)
        half = np.array(piece.size) / 2 - RIM - radius
        beside = [t for t in self.things if t.on == on]
        name = f"{label.replace(' ', '-')}_{sum(t.label == label for t in self.things)}"
        for _ in range(PLACES):
            x, y = np.array(piece.centre) + self.random.uniform(-half, half)
            if all(hypot(x - t.at[0], y - t.at[1]) > radius + t.radius + GAP for t in beside):
                at = (round(float(x), 3), round(float(y), 3))
                self.things.append(
                    Thing(name=name, label=label, color=color, used=used, on=on, at=at, carries=carries, radius=radius)
                )
                return name
        raise NoRoom

    def finished(self, before: str | None) -> Apartment:
        """Return the apartment; the robot stands before a piece of furniture, or somewhere in the first room."""
        if before is None:
            room = self.rooms[0]
            margin = 0.5
            for _ in range(PLACES):
                x, y = self.random.uniform(np.array(room.low) + margin, np.array(room.high) - margin)
                if all(_distance(piece, (x, y)) > margin for piece in self.furniture):
                    break
            else:
                raise NoRoom
            yaw = float(self.random.uniform(-pi, pi))
        else:
            piece = next(f for f in self.furniture if f.name == before)
            wide = piece.size[0] >= piece.size[1]
            side = 1 if self.random.random() < 0.5 else -1
            off = BESIDE + (piece.size[1] if wide else piece.size[0]) / 2
            x, y = piece.centre[0] + (0 if wide else side * off), piece.centre[1] + (side * off if wide else 0)
            yaw = (-side * pi / 2) if wide else (pi if side > 0 else 0.0)
        return Apartment(
            rooms=tuple(self.rooms),
            doors=tuple(self.doors),
            furniture=tuple(self.furniture),
            things=tuple(self.things),
            start=(round(float(x), 3), round(float(y), 3), yaw),
        )


def drawn(seed: int, stream: int, stock: object) -> Apartment:
    """Return the apartment of a seed: `stock(draft)` adds what is needed and returns the name of the furniture before
    which the robot starts, or None. Raises UsageError when it fits into no apartment of the recipe."""
    random = np.random.default_rng([seed, stream, 71])
    for _ in range(TRIES):
        draft = Draft(random)
        try:
            return draft.finished(stock(draft))  # type: ignore[operator]
        except NoRoom:
            continue
    raise UsageError(f"seed {seed}: no apartment in {TRIES} draws", hint="choose another --seed")


def _gap(a: Furniture, b: Furniture) -> float:
    """Free distance [m] between two pieces: the larger of the gaps in x and y."""
    gaps = [abs(a.centre[k] - b.centre[k]) - (a.size[k] + b.size[k]) / 2 for k in (0, 1)]
    return max(gaps)


def _distance(piece: Furniture, point: tuple[float, float]) -> float:
    """Distance [m] of a point from a piece's edge, 0 inside."""
    outside = [max(0.0, abs(point[k] - piece.centre[k]) - piece.size[k] / 2) for k in (0, 1)]
    return hypot(*outside)
