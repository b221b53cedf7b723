"""The apartment as it truly is: bodies in pybullet, meshes for the cameras, and what lies on what."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot

import numpy as np
import trimesh

from schemas.apartment import Apartment, Furniture, Thing
from stages.agent.world.physics.shapes import COLORS, joined, mesh_of, record_of, shape_of, slab, stained, urdf_of
from stages.kit.rendering.ray_casting import SceneRenderer
from stages.kit.simulation.world import PhysicsWorld

WALL_HEIGHT, WALL = 2.4, 0.05
"""Height and half thickness of walls [m]."""
FURNITURE_COLORS = {
    "table": (0.70, 0.55, 0.38),
    "bed": (0.60, 0.62, 0.75),
    "sofa": (0.45, 0.50, 0.42),
    "shelf": (0.50, 0.36, 0.24),
    "fridge": (0.88, 0.88, 0.90),
    "dresser": (0.55, 0.42, 0.30),
}
RESTS = 0.06
"""A thing whose foot is at most this far below a top is on it [m]."""
IN_VIEW = 6.0
"""What is farther from a camera is not rendered [m]."""


@dataclass(frozen=True)
class Body:
    """A thing as it truly is: on or in what (empty: in the hand), where, and how often it came to lie anew."""

    thing: Thing
    on: str
    at: tuple[float, float]
    moved: int


class Room:
    """Walls, furniture and things. What is behind a closed door is in no pybullet world: nobody can get at it."""

    def __init__(self, apartment: Apartment) -> None:
        self.apartment = apartment
        self.world = PhysicsWorld()
        self.furniture: dict[str, Furniture] = {piece.name: piece for piece in apartment.furniture}
        self.things: dict[str, Thing] = {thing.name: thing for thing in apartment.things}
        self._meshes: dict[str, trimesh.Trimesh] = {}
        self.moved = dict.fromkeys(self.things, 0)
        self._number = {name: 1 + k for k, name in enumerate([*self.furniture, *self.things])}
        self.named = {number: name for name, number in self._number.items()}
        """Instance number in a picture -> name; walls and floors are 0."""
        self._add_walls()
        for piece in apartment.furniture:
            (x, y), (w, d) = piece.centre, piece.size
            part = slab((x - w / 2, y - d / 2, 0.0), (x + w / 2, y + d / 2, piece.height))
            self.world.add_body(record_of(piece.name, piece.label, (0, 0, 0), 0), urdf_of(piece.name, (part,), 1.0))
            self._meshes[piece.name] = mesh_of((part,), FURNITURE_COLORS.get(piece.label, (0.5, 0.5, 0.5)))
        for thing in apartment.things:
            if not self._shut_in(thing):
                self._add_thing(thing)
        self.world.settle(0.5)

    def close(self) -> None:
        """End the pybullet world."""
        self.world.close()

    def _shut_in(self, thing: Thing) -> bool:
        piece = self.furniture.get(thing.on)
        return piece is not None and piece.door

    def _add_walls(self) -> None:
        parts = []
        for room in self.apartment.rooms:
            (x0, y0), (x1, y1) = room.low, room.high
            for low, high, axis in (
                ((x0, y0), (x1, y0), 0),
                ((x0, y1), (x1, y1), 0),
                ((x0, y0), (x0, y1), 1),
                ((x1, y0), (x1, y1), 1),
            ):
                cuts = [low[axis], high[axis]]
                for door in self.apartment.doors:
                    if abs(door.centre[1 - axis] - low[1 - axis]) < 0.2 and low[axis] < door.centre[axis] < high[axis]:
                        cuts += [door.centre[axis] - door.width / 2, door.centre[axis] + door.width / 2]
                cuts.sort()
                for start, end in zip(cuts[::2], cuts[1::2], strict=True):
                    near, far = [low[0], low[1]], [low[0], low[1]]
                    near[axis], far[axis] = start, end
                    near[1 - axis] -= WALL
                    far[1 - axis] += WALL
                    parts.append(slab((near[0], near[1], 0.0), (far[0], far[1], WALL_HEIGHT)))
        low = np.min([room.low for room in self.apartment.rooms], axis=0) - 0.5
        high = np.max([room.high for room in self.apartment.rooms], axis=0) + 0.5
        floor = slab((float(low[0]), float(low[1]), -0.1), (float(high[0]), float(high[1]), 0.0))
        self.world.add_body(record_of("walls", "wall", (0, 0, 0), 0), urdf_of("walls", tuple(parts), 1.0))
        self.world.add_body(record_of("floor", "floor", (0, 0, 0), 0), urdf_of("floor", (floor,), 1.0))
        walls = mesh_of(tuple(parts), (0.82, 0.81, 0.78))
        self._meshes["walls"] = joined([walls, mesh_of((floor,), (0.60, 0.56, 0.50))])

    def _add_thing(self, thing: Thing) -> None:
        shape, on = shape_of(thing), self.furniture.get(thing.on)
        height = (on.height if on is not None else 0.77) + 0.002
        record = record_of(thing.name, thing.label, (*thing.at, height), shape.mass)
        self.world.add_body(record, urdf_of(thing.name, shape.parts(), shape.mass))
        self._meshes[thing.name] = stained(thing, mesh_of(shape.parts(), COLORS.get(thing.color, shape.color)))

    def renderer(self, eye: np.ndarray) -> SceneRenderer:
        """Return what the cameras at a place (3,) see, as everything lies now."""
        entries = []
        for name, mesh in self._meshes.items():
            placed = mesh
            if name in self.things:
                pose = self.world.pose(name)
                if np.linalg.norm(pose[:2, 3] - eye[:2]) > IN_VIEW:
                    continue
                placed = mesh.copy()
                placed.apply_transform(pose)
            entries.append((self._number.get(name, 0), placed))
        return SceneRenderer(entries, shadows=False, antialias=False)

    # ---- truth ----

    def gap(self, piece: Furniture, x: float, y: float) -> float:
        """Return the free distance [m] of a point from a piece of furniture."""
        off = [max(0.0, abs(p - c) - s / 2) for p, c, s in zip((x, y), piece.centre, piece.size, strict=True)]
        return hypot(*off)

    def lies(self, name: str) -> tuple[float, float, float]:
        """Return the middle of a thing's foot [m], world frame."""
        if name not in self.world.bodies:
            return (*self.things[name].at, 0.0)
        x, y, z = self.world.pose(name)[:3, 3]
        return float(x), float(y), float(z)

    def body(self, name: str, held: str | None) -> Body:
        """Return how a thing lies now."""
        thing, moved = self.things[name], self.moved[name]
        x, y, z = self.lies(name)
        if name == held:
            return Body(thing, "", (x, y), moved)
        if name not in self.world.bodies:
            return Body(thing, thing.on, thing.at, moved)
        for other in self.things.values():
            if other.carries and other.name != name and other.name in self.world.bodies:
                u, v, w = self.lies(other.name)
                if hypot(x - u, y - v) <= other.radius and -0.02 <= z - w < 0.2:
                    return Body(thing, other.name, (x, y), moved)
        for piece in self.furniture.values():
            inside = all(abs(p - c) <= s / 2 for p, c, s in zip((x, y), piece.centre, piece.size, strict=True))
            if inside and z >= piece.height - RESTS:
                return Body(thing, piece.name, (x, y), moved)
        return Body(thing, "floor", (x, y), moved)
