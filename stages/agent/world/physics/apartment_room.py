"""An apartment in physics: its boxes as bodies and meshes, hollow where they have a door (`doors.py`)."""

from __future__ import annotations

from math import hypot

import numpy as np
import trimesh
from scenewright.schemas.apartment import Apartment, Furniture, Thing
from scenewright.schemas.base import as_transform
from scenewright.stages.agent.world.physics.doors import Doored, doored
from scenewright.stages.agent.world.physics.room import Room
from scenewright.stages.agent.world.physics.shapes import (
    COLORS,
    joined,
    mesh_of,
    record_of,
    shape_of,
    slab,
    stained,
    urdf_of,
)
from scenewright.stages.kit.geometry.transforms import apply, inverse
from scenewright.stages.kit.motion.doors import body_from_moved, is_closed, open_value
from scenewright.stages.kit.rendering.ray_casting import SceneRenderer

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
"""Class -> colour (RGB) of the furniture."""
RESTS = 0.06
"""A thing whose foot is at most this far below a top is on it [m]."""
HANDLES = (0.25, 0.25, 0.28)
"""Colour of handles; what they are on is a little darker than its furniture."""
IN_VIEW = 6.0
"""What is farther from a camera is not rendered [m]."""


class ApartmentRoom(Room):
    """Boxes, leaves and drawers. What is behind a closed door is there from the start, and hidden by it."""

    def __init__(self, apartment: Apartment) -> None:
        super().__init__(apartment)
        self._meshes: dict[str, trimesh.Trimesh] = {}
        self.doored = {piece.name: doored(apartment, piece) for piece in apartment.furniture if piece.door}
        self.parts = {made.joint.part: made.joint.part.rsplit("__", 1)[1] for made in self.doored.values()}
        self.parts |= {f"{name}__handle": "handle" for name in self.doored}
        self._number = {name: 1 + k for k, name in enumerate([*self.furniture, *self.things, *self.parts])}
        self.named = {number: name for name, number in self._number.items()}
        self._add_walls()
        for piece in apartment.furniture:
            color = FURNITURE_COLORS.get(piece.label, (0.5, 0.5, 0.5))
            if piece.door:
                self._add_doored(piece, self.doored[piece.name], color)
                continue
            (x, y), (w, d) = piece.centre, piece.size
            part = slab((x - w / 2, y - d / 2, 0.0), (x + w / 2, y + d / 2, piece.height))
            self.world.add_body(record_of(piece.name, piece.label, (0, 0, 0), 0), urdf_of(piece.name, (part,), 1.0))
            self._meshes[piece.name] = mesh_of((part,), color)
        for thing in apartment.things:
            self._add_thing(thing)
        self.world.settle(0.5)

    def _add_doored(self, piece: Furniture, made: Doored, color: tuple[float, float, float]) -> None:
        record = record_of(piece.name, piece.label, (0, 0, 0), 0).model_copy(
            update={
                "world_from_body": as_transform(made.pose),
                "joints": (made.joint,),
                "joint_values": {made.joint.name: open_value(made.joint) if piece.opened else 0.0},
            }
        )
        self.world.add_body(record, made.urdf())
        darker = (0.93 * color[0], 0.93 * color[1], 0.93 * color[2])
        self._meshes[piece.name] = mesh_of(made.still, color)
        self._meshes[piece.name].apply_transform(made.pose)
        for name, pieces, paint in (
            (made.joint.part, made.moving, darker),
            (f"{piece.name}__handle", made.handle, HANDLES),
        ):
            self._meshes[name] = mesh_of(pieces, paint)

    def joint_value(self, name: str) -> float:
        """Return how far the door of a piece of furniture is open [rad] or [m]."""
        return self.world.joint_value(name, self.doored[name].joint.name)

    def opened(self) -> set[str]:
        """Return the furniture whose door is not shut."""
        return {
            name
            for name, doored_piece in self.doored.items()
            if not is_closed(doored_piece.joint, self.joint_value(name))
        }

    def _add_walls(self) -> None:
        slabs = []
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
                    start_corner, end_corner = [low[0], low[1]], [low[0], low[1]]
                    start_corner[axis], end_corner[axis] = start, end
                    start_corner[1 - axis] -= WALL
                    end_corner[1 - axis] += WALL
                    slabs.append(
                        slab((start_corner[0], start_corner[1], 0.0), (end_corner[0], end_corner[1], WALL_HEIGHT))
                    )
        low = np.min([room.low for room in self.apartment.rooms], axis=0) - 0.5
        high = np.max([room.high for room in self.apartment.rooms], axis=0) + 0.5
        floor = slab((float(low[0]), float(low[1]), -0.1), (float(high[0]), float(high[1]), 0.0))
        self.world.add_body(record_of("walls", "wall", (0, 0, 0), 0), urdf_of("walls", tuple(slabs), 1.0))
        self.world.add_body(record_of("floor", "floor", (0, 0, 0), 0), urdf_of("floor", (floor,), 1.0))
        walls = mesh_of(tuple(slabs), (0.82, 0.81, 0.78))
        self._meshes["walls"] = joined([walls, mesh_of((floor,), (0.60, 0.56, 0.50))])

    def _add_thing(self, thing: Thing) -> None:
        shape, on = shape_of(thing), self.furniture.get(thing.on)
        height = on.height if on is not None else 0.77
        at = np.array([*thing.at, self.doored[thing.on].floor if thing.on in self.doored else height])
        if thing.on in self.doored:  # in a drawer that stands open it is where the drawer is
            at = apply(self._displacement(thing.on), at[None])[0]
        record = record_of(thing.name, thing.label, (float(at[0]), float(at[1]), float(at[2]) + 0.002), shape.mass)
        self.world.add_body(record, urdf_of(thing.name, shape.parts(), shape.mass))
        self._meshes[thing.name] = stained(thing, mesh_of(shape.parts(), COLORS.get(thing.color, shape.color)))

    def _displacement(self, name: str) -> np.ndarray:
        """Return the displacement (4, 4), world frame, of a drawer from where it is shut; of a leaf none, for nothing
        stands in it."""
        doored_piece = self.doored[name]
        if doored_piece.joint.type == "revolute":
            return np.eye(4)
        return (
            doored_piece.pose @ body_from_moved(doored_piece.joint, self.joint_value(name)) @ inverse(doored_piece.pose)
        )

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
            elif name in self.parts:
                doored_piece = self.doored[name.rsplit("__", 1)[0]]
                placed = mesh.copy()
                placed.apply_transform(
                    doored_piece.pose @ body_from_moved(doored_piece.joint, self.joint_value(doored_piece.name))
                )
            entries.append((self._number.get(name, 0), placed))
        return SceneRenderer(entries, shadows=False, antialias=False)

    # ---- truth ----

    def lies(self, name: str) -> tuple[float, float, float]:
        """Return the middle of a thing's foot [m], world frame."""
        x, y, z = self.world.pose(name)[:3, 3]
        return float(x), float(y), float(z)

    def carrier(self, name: str) -> str:
        """Return the thing or furniture that a thing is on or in now, or `floor`."""
        x, y, z = self.lies(name)
        for carrier in self.things.values():
            if carrier.carries and carrier.name != name:
                u, v, w = self.lies(carrier.name)
                if hypot(x - u, y - v) <= carrier.radius and -0.02 <= z - w < 0.2:
                    return carrier.name
        for door in self.doored:
            if self._inside(door, np.array([x, y, z])):
                return door
        for piece in self.furniture.values():
            inside = all(abs(p - c) <= s / 2 for p, c, s in zip((x, y), piece.centre, piece.size, strict=True))
            if inside and z >= piece.height - RESTS:
                return piece.name
        return "floor"

    def _inside(self, name: str, at: np.ndarray) -> bool:
        """Whether a point (3,) is in furniture with a door, or in its drawer where that is now."""
        doored_piece, piece = self.doored[name], self.furniture[name]
        in_furniture_frame = apply(inverse(self._displacement(name) @ doored_piece.pose), at[None])[0]
        size = np.array(piece.size if abs(doored_piece.pose[0, 0]) > 0.5 else piece.size[::-1])
        drawer = doored_piece.joint.type == "prismatic"
        lowest = doored_piece.floor - RESTS if drawer else 0.0
        return bool(
            np.all(np.abs(in_furniture_frame[:2]) <= size / 2)
            and lowest <= in_furniture_frame[2] < piece.height - RESTS
        )
