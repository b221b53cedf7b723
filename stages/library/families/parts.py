"""Moving parts that several families share: lids, flaps, knobs and boxes that slide out. The front looks along -y."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.base import as_vector
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.kit.geometry.solids import Solid, bar, box
from scenewright.stages.library.design import Moving, Paint, Piece, bar_handle, painted

GAP = 0.002
"""Gap between what moves and what stays [m]; by eye."""
KNOB_TURN = 4.7
"""Range of a knob [rad]: three quarters of a turn."""

Span = tuple[float, float]

DEPTH_FROM_HEIGHT = np.array([[1.0, 0, 0, 0], [0, 0, 1.0, 0], [0, -1.0, 0, 0], [0, 0, 0, 1.0]])
"""(4, 4): lays a solid of revolution about z on its side, what was up points back (+y)."""


def open_box(x: Span, y: Span, z: Span, wall: float) -> list[Solid]:
    """Return floor and four walls, `wall` thick, within the outer bounds [m]; none overlap."""
    inner = (x[0] + wall, x[1] - wall)
    return [
        box(x, y, (z[0], z[0] + wall)),
        box((x[0], inner[0]), y, (z[0] + wall, z[1])),
        box((inner[1], x[1]), y, (z[0] + wall, z[1])),
        box(inner, (y[0], y[0] + wall), (z[0] + wall, z[1])),
        box(inner, (y[1] - wall, y[1]), (z[0] + wall, z[1])),
    ]


def lid(
    pieces: list[Piece],
    hinge: tuple[float, float],
    limit: float,
    *,
    handle: np.ndarray | None = None,
    name: str = "lid",
    handle_axis: tuple[float, float, float] = (1.0, 0.0, 0.0),
) -> Moving:
    """Return a lid that turns up about its back edge, which runs along x at `hinge` = (y, z) [m].

    `limit` [rad]; `handle` (3,): where it is grasped, closed.
    """
    joint = Joint(
        name=f"{name}_hinge",
        type="revolute",
        part=name,
        origin=(0.0, hinge[0], hinge[1]),
        axis=(-1.0, 0.0, 0.0),
        lower=0.0,
        upper=limit,
        handle=None if handle is None else as_vector(handle),
        handle_axis=None if handle is None else handle_axis,
    )
    return Moving(joint, tuple(pieces))


def flap(
    pieces: list[Piece], x: Span, z: Span, front: float, metal: Paint, *, limit: float = 1.57, standoff: float = 0.05
) -> Moving:
    """Return a door that turns down about its lower edge, with a bar handle along its upper one.

    `pieces` are its panel, from its outer face y = `front` [m] back to y = -GAP. It turns about the lower edge of that
    face, so that its own weight holds it closed.
    """
    handle = np.array([0.5 * (x[0] + x[1]), front - standoff, z[1] - 0.05])
    bars = bar_handle(handle, "x", 0.75 * (x[1] - x[0]), standoff, 0.009, metal)
    joint = Joint(
        name="door_hinge",
        type="revolute",
        part="door",
        origin=(0.5 * (x[0] + x[1]), front, z[0]),
        axis=(1.0, 0.0, 0.0),
        lower=0.0,
        upper=limit,
        handle=as_vector(handle),
        handle_axis=(1.0, 0.0, 0.0),
    )
    return Moving(joint, (*pieces, *bars))


def knob(number: int, foot: np.ndarray, outward: tuple[float, float, float], radius: float, paint: Paint) -> Moving:
    """Return a knob that turns about the direction `outward` of the surface point `foot` (3,) it sits on.

    A round grip of 1.8 radii height; a pointer on its face shows how far it is turned.
    """
    direction = np.asarray(outward, dtype=float)
    start, height = foot + 0.001 * direction, 1.1 * radius
    end = start + height * direction
    side = np.array([0.0, 0, 1.0]) if abs(direction[2]) < 0.5 else np.array([0, 1.0, 0])
    pointer = bar(end + 0.25 * radius * side, end + 0.85 * radius * side, 0.12 * radius, count=6)
    pieces = painted(paint, bar(start, end, radius, count=16)) + painted(
        paint.darker(0.5 + 0.9 * _dark(paint)), pointer
    )
    joint = Joint(
        name=f"knob_{number}_turn",
        type="revolute",
        part=f"knob_{number}",
        origin=as_vector(foot),
        axis=outward,
        lower=0.0,
        upper=KNOB_TURN,
        handle=as_vector(0.5 * (start + end)),
        handle_axis=outward,
    )
    return Moving(joint, tuple(pieces))


def _dark(paint: Paint) -> float:
    return float(sum(paint.color) < 300)


def slide_out(
    name: str,
    x: Span,
    y: Span,
    z: Span,
    wall: float,
    travel: float,
    paint: Paint,
    *,
    behind: str | None = None,
    handle: np.ndarray | None = None,
    front: list[Piece] | None = None,
) -> Moving:
    """Return an open box of the outer bounds [m] that slides out along -y by `travel` [m].

    `behind` names the joint that has to be open first; `front` are pieces before the box (a panel, a handle).
    """
    joint = Joint(
        name=f"{name}_slide",
        type="prismatic",
        part=name,
        origin=(0.5 * (x[0] + x[1]), y[0], 0.5 * (z[0] + z[1])),
        axis=(0.0, -1.0, 0.0),
        lower=0.0,
        upper=round(travel, 4),
        handle=None if handle is None else as_vector(handle),
        handle_axis=None if handle is None else (1.0, 0.0, 0.0),
    )
    return Moving(joint, (*painted(paint, open_box(x, y, z, wall)), *(front or [])), behind=behind)
