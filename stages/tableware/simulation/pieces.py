"""Tableware as rigid bodies: convex pieces, mass, centre of mass, inertia.

A dish's wall is a ring of convex wedges, its floor a prism. The wedges' inner faces touch the inner cone, their outer
corners lie on the outer one, so that dishes nest as high as `items.rise` says at any angle. Bullet rounds convex pieces
off outwards by a margin; pieces are made smaller by it. Mass and inertia are those of the true shape (`dish_shapes`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import cos, pi

import numpy as np
from scenewright.stages.tableware.world.dish_shapes import shell_mesh, utensil_mesh
from scenewright.stages.tableware.world.items import Kind, Measures

OUTER = 3
"""Facets of a wedge's outer face: nearly round, while the inner face is one facet."""
THINNEST = 2e-4
"""Least thickness of a piece without its margin [m]; by eye."""
FOOT = 0.0006
"""Height at which the floor stands clear of the table, so that the dish rests on its foot ring all round [m]; by
eye."""
MARGIN = 0.001
"""Distance by which Bullet rounds convex hulls off [m]."""
DISH_DENSITY = 1500.0
"""Melamine [kg/m^3]."""
UTENSIL_DENSITY = 7800.0
"""Steel [kg/m^3]."""


@dataclass(frozen=True)
class Solid:
    """A rigid body in its item's frame (foot centre or middle of the underside, z up) [m, kg]."""

    pieces: tuple[np.ndarray, ...]
    """Corners (N, 3) of each convex piece, of a dish without the margin."""
    mass: float
    center: np.ndarray
    """(3,) centre of mass."""
    inertia: np.ndarray
    """(3,) moments about the centre of mass along the item's axes [kg m^2]."""


@lru_cache(maxsize=16)
def solid(kind: Kind, measures: Measures) -> Solid:
    """Return the body of a thing of a kind that measures `measures`."""
    if measures.is_dish:
        mesh = shell_mesh(measures)
        pieces, density = shell_pieces(measures), DISH_DENSITY
    else:
        mesh = utensil_mesh(measures, kind == "fork")
        pieces, density = utensil_boxes(measures, kind == "fork"), UTENSIL_DENSITY
    mesh.density = density
    return Solid(tuple(pieces), float(mesh.mass), np.array(mesh.center_mass), np.diag(mesh.moment_inertia).copy())


def shell_pieces(shell: Measures, sides: int | None = None, margin: float = MARGIN) -> list[np.ndarray]:
    """Return the wedges (12, 3) of a dish's wall, and its floor (2 * 3 * sides, 3), shrunk by `margin` [m].

    `sides` are 16, or 12 where the wall is thick enough for it.
    """
    if sides is None:
        sides = 12 if shell.inner_radius(shell.height) / cos(pi / 12) + 2.0 * margin < shell.rim_radius else 16
    half, step = pi / sides, 2.0 * pi / sides / OUTER
    lean = shell.slant / shell.height
    low, high = margin * shell.height / shell.slant, shell.height * (1.0 - margin / shell.slant)
    pieces = []
    for number in range(sides):
        corners: list[list[float]] = []
        for height in (low, high):
            outer, inner = shell.outer_radius(height) - margin * lean, shell.inner_radius(height) + margin * lean
            inner = min(inner / cos(half), outer - THINNEST)
            angles = 2.0 * pi * number / sides + step * np.arange(OUTER + 1)
            for radius, turns in ((outer, angles), (inner, angles[[0, -1]])):
                corners.extend([radius * np.cos(angle), radius * np.sin(angle), height] for angle in turns)
        pieces.append(np.array(corners))
    disc = []
    for height in (margin + FOOT, max(shell.wall - margin, margin + FOOT + THINNEST)):
        reach = shell.outer_radius(height) - margin
        angles = step * np.arange(OUTER * sides)
        disc.append(np.column_stack([reach * np.cos(angles), reach * np.sin(angles), np.full(len(angles), height)]))
    return [*pieces, np.concatenate(disc)]


def utensil_boxes(strip: Measures, fork: bool) -> list[np.ndarray]:
    """Return boxes, as their corners (8, 3), that follow a utensil's plan; a fork's tines are one."""
    points = np.asarray(utensil_mesh(strip, fork).vertices)
    cuts = np.array([-0.5, -0.2, 0.08, 0.20, 0.30, 0.42, 0.5]) * strip.length
    pieces = []
    for low, high in zip(cuts[:-1], cuts[1:], strict=True):
        in_section = (points[:, 0] > low - 0.02 * strip.length) & (points[:, 0] < high + 0.02 * strip.length)
        half = float(np.abs(points[in_section, 1]).mean() + np.abs(points[in_section, 1]).max()) / 2
        pieces.append(np.array([[x, y, z] for x in (low, high) for y in (-half, half) for z in (0.0, strip.height)]))
    return pieces


def obj_text(solid_body: Solid) -> str:
    """Return a Wavefront file with each piece as an object, which pybullet loads as one convex hull each."""
    import trimesh

    lines, first = [], 1
    for number, corners in enumerate(solid_body.pieces):
        hull = trimesh.convex.convex_hull(corners)
        lines.append(f"o piece_{number}")
        lines.extend(f"v {x:.7f} {y:.7f} {z:.7f}" for x, y, z in hull.vertices)
        lines.extend("f " + " ".join(str(first + index) for index in face) for face in hull.faces)
        first += len(hull.vertices)
    return "\n".join(lines) + "\n"


def urdf_text(kind: Kind, measures: Measures, mesh_path: str) -> str:
    """Return the URDF of a free body of a kind; a dish's pieces lie in a Wavefront file (`obj_text`)."""
    body = solid(kind, measures)
    x, y, z = body.center
    ixx, iyy, izz = body.inertia
    if measures.is_dish:
        shapes = f'<collision><geometry><mesh filename="{mesh_path}"/></geometry></collision>'
    else:
        shapes = "".join(_box(corners) for corners in body.pieces)
    return (
        f'<robot name="{kind}"><link name="{kind}">'
        f'<inertial><origin xyz="{x:.8g} {y:.8g} {z:.8g}"/><mass value="{body.mass:.8g}"/>'
        f'<inertia ixx="{ixx:.8g}" ixy="0" ixz="0" iyy="{iyy:.8g}" iyz="0" izz="{izz:.8g}"/></inertial>'
        f"{shapes}</link></robot>"
    )


def _box(corners: np.ndarray) -> str:
    middle, size = (corners.max(axis=0) + corners.min(axis=0)) / 2, np.ptp(corners, axis=0)
    x, y, z = middle
    a, b, c = size
    return (
        f'<collision><origin xyz="{x:.8g} {y:.8g} {z:.8g}"/><geometry><box size="{a:.8g} {b:.8g} {c:.8g}"/></geometry>'
        f"</collision>"
    )
