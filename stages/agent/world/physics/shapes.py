"""What things and rooms are made of: pieces (data/agent/things.toml) as URDF for pybullet and as meshes for cameras."""

from __future__ import annotations

from functools import cache
from math import cos, pi, sin

import numpy as np
import trimesh
from scenewright.schemas.apartment import Thing
from scenewright.schemas.base import Model, as_transform, as_vector
from scenewright.schemas.interactive_scene import SceneBody
from scenewright.schemas.outside import file_toml
from scenewright.schemas.places import REINSTALL, data_file
from scenewright.schemas.scene_parts import Box, Joint
from scenewright.stages.kit.simulation.shapes import paint

SHAPES = data_file("agent/things.toml")
COLORS = {
    "red": (0.80, 0.10, 0.10),
    "blue": (0.10, 0.20, 0.80),
    "green": (0.10, 0.60, 0.20),
    "white": (0.92, 0.92, 0.92),
    "yellow": (0.95, 0.85, 0.15),
}
"""Names of colours that things have and eyes say, sRGB."""
STAIN = (0.30, 0.16, 0.06)
"""What a used cup has on its top."""
RIM_PARTS = 12
"""Pieces of a round rim; by eye."""
MOVING_MASS = 3.0
"""Mass of a leaf or a drawer [kg]; by eye."""


class Piece(Model):
    """One convex piece."""

    box: tuple[float, float, float] | None = None
    cylinder: tuple[float, float] | None = None
    """Radius, height."""
    sphere: float | None = None
    at: tuple[float, float, float]
    yaw: float = 0.0


class Shape(Model):
    """A class of things."""

    mass: float
    color: tuple[float, float, float]
    pieces: tuple[Piece, ...]
    rim: tuple[float, float] | None = None
    """Radius and height of a ring of short walls."""

    def parts(self) -> tuple[Piece, ...]:
        """Return the pieces, those of the rim included."""
        if self.rim is None:
            return self.pieces
        radius, height = self.rim
        angles = [2 * pi * k / RIM_PARTS for k in range(RIM_PARTS)]
        wall = (0.006, 2 * pi * radius / RIM_PARTS, height)
        ring = [Piece(box=wall, at=(radius * cos(a), radius * sin(a), height / 2), yaw=a) for a in angles]
        return (*self.pieces, *ring)


@cache
def shapes() -> dict[str, Shape]:
    """Return the committed shapes by class."""
    return {label: Shape.model_validate(entry) for label, entry in file_toml(SHAPES, hint=REINSTALL).items()}


def shape_of(thing: Thing) -> Shape:
    """Return the shape of a thing; of a class that has none a box as wide as the thing is."""
    catalogued = shapes().get(thing.label)
    if catalogued is not None:
        return catalogued
    side = min(2 * thing.radius, 0.06)
    return Shape(mass=0.2, color=(0.5, 0.5, 0.5), pieces=(Piece(box=(side, side, 0.08), at=(0, 0, 0.04)),))


def _geometry(piece: Piece) -> str:
    if piece.box is not None:
        return f'<box size="{piece.box[0]} {piece.box[1]} {piece.box[2]}"/>'
    if piece.cylinder is not None:
        return f'<cylinder radius="{piece.cylinder[0]}" length="{piece.cylinder[1]}"/>'
    return f'<sphere radius="{piece.sphere}"/>'


def urdf_of(name: str, parts: tuple[Piece, ...], mass: float) -> str:
    """Return URDF text of one rigid body; its frame is at the middle of its foot."""
    return f'<robot name="{name}">{link_text(name, parts, mass)}</robot>'


def link_text(name: str, parts: tuple[Piece, ...], mass: float) -> str:
    """Return the <link> of pieces in the link's frame."""
    extent = np.max([np.abs(piece.at) for piece in parts], axis=0) + 0.03
    inertia = mass * float((extent**2).sum()) / 6
    height = sum(piece.at[2] for piece in parts) / len(parts)
    shapes_text = "".join(
        f'<collision><origin xyz="{p.at[0]} {p.at[1]} {p.at[2]}" rpy="0 0 {p.yaw}"/><geometry>{_geometry(p)}'
        "</geometry></collision>"
        for p in parts
    )
    return (
        f'<link name="{name}"><inertial><origin xyz="0 0 {height}"/><mass value="{mass}"/>'
        f'<inertia ixx="{inertia}" ixy="0" ixz="0" iyy="{inertia}" iyz="0" izz="{inertia}"/></inertial>'
        f"{shapes_text}</link>"
    )


def jointed_text(name: str, still: tuple[Piece, ...], moving: tuple[Piece, ...], joint: Joint) -> str:
    """Return URDF text of furniture with one joint; pieces in its own frame, the joint at 0."""
    shift = [-value for value in joint.origin]
    moving_parts = tuple(
        piece.model_copy(update={"at": tuple(a + b for a, b in zip(piece.at, shift, strict=True))}) for piece in moving
    )
    at, along = (" ".join(str(value) for value in vector) for vector in (joint.origin, joint.axis))
    return (
        f'<robot name="{name}">{link_text(name, still, 1.0)}{link_text(joint.part, moving_parts, MOVING_MASS)}'
        f'<joint name="{joint.name}" type="{joint.type}"><parent link="{name}"/><child link="{joint.part}"/>'
        f'<origin xyz="{at}"/><axis xyz="{along}"/>'
        f'<limit lower="{joint.lower}" upper="{joint.upper}" effort="100" velocity="5"/></joint></robot>'
    )


def record_of(name: str, label: str, position: tuple[float, float, float], mass: float) -> SceneBody:
    """Return the scene record of a body at a position [m]; `mass` 0: it stands still for ever."""
    pose = np.eye(4)
    pose[:3, 3] = position
    return SceneBody(
        name=name,
        class_name=label,
        movable=mass > 0,
        world_from_body=as_transform(pose),
        box=Box(center=as_vector(pose[:3, 3]), size=(0.1, 0.1, 0.1)),
        mass=mass,
        world_from_reconstructed=None,
    )


def mesh_of(parts: tuple[Piece, ...], color: tuple[float, float, float]) -> trimesh.Trimesh:
    """Return the pieces as one painted mesh, body frame [m]."""
    meshes = []
    for piece in parts:
        if piece.box is not None:
            mesh = trimesh.creation.box(extents=piece.box)
        elif piece.cylinder is not None:
            mesh = trimesh.creation.cylinder(radius=piece.cylinder[0], height=piece.cylinder[1], sections=24)
        else:
            mesh = trimesh.creation.icosphere(subdivisions=2, radius=piece.sphere or 0.03)
        mesh.apply_transform(trimesh.transformations.rotation_matrix(piece.yaw, (0, 0, 1)))
        mesh.apply_translation(piece.at)
        paint(mesh, np.array([*(round(255 * value) for value in color), 255], np.uint8))
        meshes.append(mesh)
    return joined(meshes)


def joined(meshes: list[trimesh.Trimesh]) -> trimesh.Trimesh:
    """Return painted meshes as one."""
    mesh = trimesh.util.concatenate(meshes)
    assert isinstance(mesh, trimesh.Trimesh)
    return mesh


def stained(thing: Thing, mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return the mesh with a stain on its top where the thing is used."""
    if not thing.used:
        return mesh
    top = float(mesh.vertices[:, 2].max())
    stain = trimesh.creation.cylinder(radius=0.026, height=0.002, sections=24)
    stain.apply_translation((0, 0, top + 0.001))
    paint(stain, np.array([*(round(255 * value) for value in STAIN), 255], np.uint8))
    return joined([mesh, stain])


def slab(low: tuple[float, float, float], high: tuple[float, float, float]) -> Piece:
    """Return the box between two corners [m]."""
    size = tuple(b - a for a, b in zip(low, high, strict=True))
    return Piece(box=size, at=tuple((a + b) / 2 for a, b in zip(low, high, strict=True)))  # type: ignore[arg-type]
