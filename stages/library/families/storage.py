"""Cabinets, wall cabinets and shelves: hollow carcasses with shelves, hinged doors and sliding drawers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.schemas.base import as_vector
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.kit.geometry.solids import Solid, box
from scenewright.stages.library.design import LACQUER, STEEL, WOOD, Design, Moving, Paint, bar_handle, painted

GAP = 0.002
"""Gap between a front and the carcass, and between neighbouring fronts [m]; by eye."""
HANDLE_RADIUS = 0.008
"""Radius of a handle bar [m]; by eye."""
STANDOFF = 0.05
"""Distance of the middle of the handle bar from the front [m]: a Panda finger (2 cm deep) fits behind it."""


@dataclass(frozen=True)
class Carcass:
    """Outer bounds of a hollow box without front, and the thickness of its boards [m]."""

    x: tuple[float, float]
    y: tuple[float, float]
    z: tuple[float, float]
    board: float

    def boards(self, *, back: float = 0.008) -> list[Solid]:
        """Return two sides, bottom, top and back; none overlap."""
        (x0, x1), (y0, y1), (z0, z1), t = self.x, self.y, self.z, self.board
        inner = (x0 + t, x1 - t)
        return [
            box((x0, x0 + t), (y0, y1), (z0, z1)),
            box((x1 - t, x1), (y0, y1), (z0, z1)),
            box(inner, (y0, y1), (z0, z0 + t)),
            box(inner, (y0, y1), (z1 - t, z1)),
            box(inner, (y1 - back, y1), (z0 + t, z1 - t)),
        ]

    def shelf(self, height: float, *, x: tuple[float, float] | None = None, recess: float = 0.02) -> Solid:
        """Return an inner board whose top is at `height` [m]."""
        span = x if x is not None else (self.x[0] + self.board, self.x[1] - self.board)
        return box(span, (self.y[0] + recess, self.y[1] - 0.008), (height - self.board, height))


def hinged_door(
    number: int,
    x: tuple[float, float],
    z: tuple[float, float],
    front: float,
    hinge: str,
    paint: Paint,
    metal: Paint,
    *,
    thick: float = 0.018,
    limit: float = 2.0,
    handle_at: float | None = None,
    name: str = "door",
) -> Moving:
    """Return an overlay door before the plane y = `front`, hinged at its `left` (x[0]) or `right` (x[1]) edge.

    Positive joint values open it towards -y. The handle is a vertical bar near the free edge, its middle at height
    `handle_at` [m].
    """
    back = front - GAP
    panel = box((x[0] + GAP / 2, x[1] - GAP / 2), (back - thick, back), z)
    free = x[0] + 0.045 if hinge == "right" else x[1] - 0.045
    height = z[1] - z[0]
    length = float(np.clip(0.35 * height, 0.12, 0.30))
    middle = handle_at if handle_at is not None else 0.5 * (z[0] + z[1])
    handle = np.array([free, back - thick - STANDOFF, middle])
    origin = np.array([x[1] if hinge == "right" else x[0], back, 0.5 * (z[0] + z[1])])
    joint = Joint(
        name=f"{name}_{number}_hinge",
        type="revolute",
        part=f"{name}_{number}",
        origin=as_vector(origin),
        axis=(0.0, 0.0, 1.0) if hinge == "right" else (0.0, 0.0, -1.0),
        lower=0.0,
        upper=limit,
        handle=as_vector(handle),
        handle_axis=(0.0, 0.0, 1.0),
    )
    pieces = painted(paint, panel) + bar_handle(handle, "z", length, STANDOFF, HANDLE_RADIUS, metal)
    return Moving(joint, tuple(pieces))


def drawer(
    number: int,
    x: tuple[float, float],
    z: tuple[float, float],
    front: float,
    depth: float,
    paint: Paint,
    inner: Paint,
    metal: Paint,
) -> Moving:
    """Return an open box that slides out along -y behind a front of size x, z [m]; handle: a horizontal bar.

    The box is `depth` deep behind the plane y = `front`, and narrower than the front, which overlaps the carcass.
    """
    back = front - GAP
    thick, wall = 0.018, 0.012
    panel = box((x[0] + GAP / 2, x[1] - GAP / 2), (back - thick, back), (z[0] + GAP / 2, z[1] - GAP / 2))
    side = (x[0] + 0.03, x[1] - 0.03)
    bottom, top = z[0] + 0.025, z[1] - 0.04
    ahead, behind = back, front + depth
    walls = [
        box(side, (ahead, behind), (bottom, bottom + wall)),
        box((side[0], side[0] + wall), (ahead, behind), (bottom + wall, top)),
        box((side[1] - wall, side[1]), (ahead, behind), (bottom + wall, top)),
        box((side[0] + wall, side[1] - wall), (behind - wall, behind), (bottom + wall, top)),
    ]
    handle = np.array([0.5 * (x[0] + x[1]), back - thick - STANDOFF, 0.5 * (z[0] + z[1])])
    length = float(np.clip(0.4 * (x[1] - x[0]), 0.12, 0.26))
    joint = Joint(
        name=f"drawer_{number}_slide",
        type="prismatic",
        part=f"drawer_{number}",
        origin=as_vector(np.array([0.5 * (x[0] + x[1]), front, 0.5 * (z[0] + z[1])])),
        axis=(0.0, -1.0, 0.0),
        lower=0.0,
        upper=round(0.85 * depth, 4),
        handle=as_vector(handle),
        handle_axis=(1.0, 0.0, 0.0),
    )
    pieces = (
        painted(paint, panel) + painted(inner, walls) + bar_handle(handle, "x", length, STANDOFF, HANDLE_RADIUS, metal)
    )
    return Moving(joint, tuple(pieces))


def _paints(random: np.random.Generator) -> tuple[Paint, Paint, Paint]:
    carcass = (WOOD if random.random() < 0.5 else LACQUER).sample(random)
    front = (
        carcass.darker(1.04) if random.random() < 0.5 else (WOOD if random.random() < 0.5 else LACQUER).sample(random)
    )
    return carcass, front, STEEL.sample(random)


def cabinet(random: np.random.Generator, style: int) -> Design:
    """Return a base cabinet with two doors, a chest of drawers, one with both, or a night stand."""
    kind = ("doors", "drawers", "mixed", "night_stand")[style % 4]
    carcass_paint, front_paint, metal = _paints(random)
    sizes = {
        "doors": ((0.80, 1.0), (0.42, 0.55), (0.78, 0.90)),
        "drawers": ((0.70, 0.90), (0.42, 0.50), (0.76, 0.95)),
        "mixed": ((0.80, 1.0), (0.45, 0.56), (0.82, 0.90)),
        "night_stand": ((0.42, 0.52), (0.36, 0.42), (0.50, 0.60)),
    }[kind]
    width, depth, height = (float(random.uniform(*bounds)) for bounds in sizes)
    board, plinth = 0.018, 0.07
    frame = Carcass((-width / 2, width / 2), (0.0, depth), (plinth, height), board)
    pieces = painted(carcass_paint, frame.boards())
    pieces += painted(
        carcass_paint.darker(0.7), box((-width / 2 + 0.02, width / 2 - 0.02), (0.05, depth - 0.02), (0.0, plinth))
    )
    low, high = plinth, height - GAP
    moving: list[Moving] = []

    def doors(z: tuple[float, float]) -> None:
        middle = 0.5 * (z[0] + board + z[1] - board)
        pieces.extend(painted(carcass_paint, frame.shelf(middle)))
        at = z[1] - 0.5 * float(np.clip(0.35 * (z[1] - z[0]), 0.12, 0.30)) - 0.05
        moving.append(hinged_door(len(moving) + 1, (-width / 2, 0.0), z, 0.0, "left", front_paint, metal, handle_at=at))
        moving.append(hinged_door(len(moving) + 1, (0.0, width / 2), z, 0.0, "right", front_paint, metal, handle_at=at))

    def drawers(z: tuple[float, float], rows: int) -> None:
        edges = np.linspace(z[0], z[1], rows + 1)
        for k in range(rows):
            moving.append(
                drawer(
                    len(moving) + 1,
                    (-width / 2, width / 2),
                    (float(edges[k]), float(edges[k + 1])),
                    0.0,
                    depth - 0.04,
                    front_paint,
                    carcass_paint.darker(1.1),
                    metal,
                )
            )

    if kind == "doors":
        doors((low, high))
    elif kind == "drawers":
        drawers((low, high), int(random.integers(3, 5)))
    elif kind == "night_stand":
        drawers((low, high), 2)
    else:
        split = height - 0.20
        pieces.extend(painted(carcass_paint, frame.shelf(split + board / 2, recess=0.0)))
        doors((low, split))
        drawers((split, high), 1)
    return Design("cabinet", tuple(pieces), tuple(moving), contains=True, recipe={"style": kind})


def wall_cabinet(random: np.random.Generator, style: int) -> Design:
    """Return a cabinet that hangs on a wall, with one or two doors and one or two shelves."""
    double = style % 2 == 0
    carcass_paint, front_paint, metal = _paints(random)
    width = float(random.uniform(0.72, 0.95) if double else random.uniform(0.40, 0.55))
    depth, height, board = float(random.uniform(0.30, 0.36)), float(random.uniform(0.58, 0.75)), 0.018
    frame = Carcass((-width / 2, width / 2), (0.0, depth), (0.0, height), board)
    pieces = painted(carcass_paint, frame.boards())
    shelves = int(random.integers(1, 3))
    for k in range(shelves):
        pieces += painted(carcass_paint, frame.shelf(board + (k + 1) * (height - board) / (shelves + 1)))
    at, z = 0.15, (0.0, height)
    if double:
        moving = [
            hinged_door(1, (-width / 2, 0.0), z, 0.0, "left", front_paint, metal, handle_at=at),
            hinged_door(2, (0.0, width / 2), z, 0.0, "right", front_paint, metal, handle_at=at),
        ]
    else:
        hinge = "left" if random.random() < 0.5 else "right"
        moving = [hinged_door(1, (-width / 2, width / 2), z, 0.0, hinge, front_paint, metal, handle_at=at)]
    return Design("wall_cabinet", tuple(pieces), tuple(moving), contains=True, recipe={"doors": len(moving)})


def shelf(random: np.random.Generator, style: int) -> Design:
    """Return a bookcase with a back, an open rack with posts, or a cube shelf with uprights."""
    kind = ("bookcase", "rack", "cubes")[style % 3]
    paint = (WOOD if random.random() < 0.6 else LACQUER).sample(random)
    if kind == "rack":
        width, depth, height = random.uniform(0.75, 1.0), random.uniform(0.32, 0.42), random.uniform(1.2, 1.7)
        metal = STEEL.sample(random)
        post = 0.03
        pieces = []
        for x in (-width / 2, width / 2 - post):
            for y in (0.0, depth - post):
                pieces += painted(metal, box((x, x + post), (y, y + post), (0, height)))
        levels = int(random.integers(4, 6))
        for k in range(levels):
            z = 0.12 + k * (height - 0.14) / (levels - 1)
            # boards between the posts, notched: a middle board and two strips that reach the sides
            pieces += painted(paint, box((-width / 2 + post, width / 2 - post), (0.0, depth), (z - 0.02, z)))
            for strip in ((-width / 2, -width / 2 + post), (width / 2 - post, width / 2)):
                pieces += painted(paint, box(strip, (post, depth - post), (z - 0.02, z)))
        return Design("shelf", tuple(pieces), contains=True, recipe={"style": kind, "levels": levels})
    board = 0.02 if kind == "bookcase" else 0.03
    columns, rows = (1, int(random.integers(4, 6))) if kind == "bookcase" else (2, int(random.integers(2, 4)))
    width, depth = (
        (random.uniform(0.70, 0.95), random.uniform(0.26, 0.33))
        if kind == "bookcase"
        else (0.77, random.uniform(0.36, 0.40))
    )
    height = random.uniform(1.5, 1.95) if kind == "bookcase" else rows * 0.36 + board
    frame = Carcass((-width / 2, width / 2), (0.0, float(depth)), (0.0, float(height)), board)
    pieces = painted(paint, frame.boards(back=0.008))
    for row in range(1, rows):
        pieces += painted(paint, frame.shelf(board + row * (float(height) - board) / rows, recess=0.0))
    for column in range(1, columns):
        x = -width / 2 + column * width / columns
        for row in range(rows):
            upright = (board + row * (height - board) / rows, (row + 1) * (height - board) / rows)
            pieces += painted(paint, box((x - board / 2, x + board / 2), (0.0, depth - 0.008), upright))
    return Design("shelf", tuple(pieces), contains=True, recipe={"style": kind, "rows": rows})
