"""Sinks with a tap, and toilets with a lid."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.kit.geometry.solids import Solid, bar, box, cylinder, hull, prism, rounded_rectangle
from scenewright.stages.library.design import LACQUER, STEEL, WOOD, Design, Moving, Paint, Piece, painted
from scenewright.stages.library.families.parts import GAP, Span, lid, open_box
from scenewright.stages.library.families.storage import hinged_door
from scipy.spatial import ConvexHull

PORCELAIN = Paint((244, 244, 242), 2300.0)
"""Porcelain of basins: density [kg/m^3]; by eye."""


def _tap(middle: np.ndarray, reach: float, tall: float, metal: Paint) -> tuple[list[Piece], Moving]:
    """A tap on the surface point `middle` (3,): a pipe, a spout along -y, and on top a lever that turns about z."""
    top = middle + [0, 0, tall]
    pieces = painted(metal, cylinder(0.024, (middle[2], middle[2] + 0.008), (middle[0], middle[1]), count=14))
    pieces += painted(metal, cylinder(0.013, (middle[2] + 0.008, top[2]), (middle[0], middle[1]), count=12))
    bend = top + [0, -reach, -0.012]
    pieces += painted(metal, bar(top + [0, 0, -0.012], bend, 0.011, count=10))
    pieces += painted(metal, bar(bend + [0, 0.008, 0], bend + [0, 0.008, -0.035], 0.010, count=10))
    low = top[2] + 0.001
    lever = painted(metal, cylinder(0.013, (low, low + 0.018), (top[0], top[1]), count=12))
    lever += painted(
        metal,
        bar(np.array([top[0], top[1], low + 0.012]), np.array([top[0] + 0.085, top[1], low + 0.020]), 0.006, count=8),
    )
    joint = Joint(
        name="lever_turn",
        type="revolute",
        part="lever",
        origin=(float(top[0]), float(top[1]), float(low)),
        axis=(0.0, 0.0, -1.0),
        lower=0.0,
        upper=1.2,
        handle=(float(top[0]) + 0.06, float(top[1]), float(low) + 0.0175),
        handle_axis=(1.0, 0.0, 0.0),
    )
    return pieces, Moving(joint, tuple(lever))


def _frame(x: Span, y: Span, hole_x: Span, hole_y: Span, z: Span) -> list[Solid]:
    """Return four boards around a rectangular hole."""
    return [
        box(x, (y[0], hole_y[0]), z),
        box(x, (hole_y[1], y[1]), z),
        box((x[0], hole_x[0]), hole_y, z),
        box((hole_x[1], x[1]), hole_y, z),
    ]


def sink(random: np.random.Generator, style: int) -> Design:
    """Return a wash basin on a pedestal (even styles), or a kitchen sink in a base unit with two doors; with a tap."""
    metal = Paint(STEEL.sample(random).color, 4000.0)
    if style % 2 == 0:
        return _wash_basin(random, metal)
    width, depth, height = (
        float(random.uniform(0.80, 1.0)),
        float(random.uniform(0.56, 0.62)),
        float(random.uniform(0.86, 0.92)),
    )
    carcass, front = LACQUER.sample(random), (WOOD if random.random() < 0.5 else LACQUER).sample(random)
    top, board, plinth = height - 0.03, 0.018, 0.09
    x, y = (-width / 2, width / 2), (0.0, depth)
    hole_x, hole_y = (x[0] + 0.12, x[1] - 0.12), (0.07, depth - 0.13)
    pieces = painted(front.darker(0.9), _frame(x, (-0.02, depth), hole_x, hole_y, (top, height)))
    steel = Paint((186, 190, 194), 2600.0)
    low = height - float(random.uniform(0.17, 0.21))
    rim = ((hole_x[0], hole_x[1]), (hole_y[0], hole_y[1]))
    pieces += painted(steel, open_box(rim[0], rim[1], (low, height), 0.004))
    inner = (x[0] + board, x[1] - board)
    pieces += painted(
        carcass,
        box((x[0], inner[0]), y, (plinth, top)),
        box((inner[1], x[1]), y, (plinth, top)),
        box(inner, y, (plinth, plinth + board)),
        box(inner, (depth - 0.008, depth), (plinth + board, top)),
    )
    pieces += painted(carcass.darker(0.7), box((x[0] + 0.02, x[1] - 0.02), (0.05, depth - 0.02), (0.0, plinth)))
    at = np.array([0.0, depth - 0.07, height])
    tap, lever = _tap(at, 0.20, float(random.uniform(0.22, 0.30)), metal)
    z = (plinth, top - GAP)
    doors = [
        hinged_door(1, (x[0], 0.0), z, 0.0, "left", front, metal, handle_at=z[1] - 0.16),
        hinged_door(2, (0.0, x[1]), z, 0.0, "right", front, metal, handle_at=z[1] - 0.16),
    ]
    return Design("sink", tuple(pieces + tap), (*doors, lever), contains=True, recipe={"style": "kitchen"})


def _wash_basin(random: np.random.Generator, metal: Paint) -> Design:
    width, depth = float(random.uniform(0.48, 0.62)), float(random.uniform(0.40, 0.50))
    height, bowl = float(random.uniform(0.80, 0.88)), float(random.uniform(0.13, 0.17))
    x, y = (-width / 2, width / 2), (-depth / 2, depth / 2)
    hole_x, hole_y = (x[0] + 0.04, x[1] - 0.04), (y[0] + 0.04, y[1] - 0.12)
    low = height - bowl
    pieces = painted(PORCELAIN, box((hole_x[0], hole_x[1]), hole_y, (low, low + 0.02)))
    pieces += painted(PORCELAIN, _frame(x, y, hole_x, hole_y, (height - 0.05, height)))
    pieces += painted(
        PORCELAIN,
        _frame(
            (hole_x[0] - 0.02, hole_x[1] + 0.02),
            (hole_y[0] - 0.02, hole_y[1] + 0.02),
            hole_x,
            hole_y,
            (low, height - 0.05),
        ),
    )
    foot = rounded_rectangle((-0.11, 0.11), (-0.09, 0.13), 0.04)
    pieces += painted(Paint(PORCELAIN.color, 900.0), prism(foot, (0.0, low), 0.82 * foot))
    tap, lever = _tap(np.array([0.0, y[1] - 0.06, height]), 0.13, 0.13, metal)
    return Design("sink", tuple(pieces + tap), (lever,), contains=True, recipe={"style": "pedestal"})


def toilet(random: np.random.Generator, style: int) -> Design:
    """Return a toilet on the floor with a cistern behind it; seat ring, and a lid that turns up about its back edge."""
    long, wide = float(random.uniform(0.46, 0.52)), 0.5 * float(random.uniform(0.35, 0.39))
    seat, tank = float(random.uniform(0.39, 0.43)), float(random.uniform(0.74, 0.84))
    light = Paint(PORCELAIN.color, 600.0)  # hollow inside
    back = 0.5 * long
    angle = 2 * np.pi * np.arange(17) / 16

    def ring(scale: float, shift: float = 0.0) -> np.ndarray:
        return np.column_stack([scale * wide * np.cos(angle), scale * 0.5 * long * np.sin(angle) + shift])

    foot = np.column_stack([0.11 * np.cos(angle[:-1]), 0.17 * np.sin(angle[:-1]) + 0.05])
    pieces = painted(light, prism(foot, (0.0, 0.24), ring(0.72)[:-1], round_sides=True))
    outer, inner, low = ring(1.0), ring(0.76), ring(0.72)
    for k in range(16):
        points = []
        for edge in (k, k + 1):
            points += [(*outer[edge], seat), (*inner[edge], seat), (*low[edge], 0.24), (*(0.70 * low[edge]), 0.24)]
        pieces += painted(light, hull(np.array(points), curved=True))
        rim = [(*r[edge], z) for r in (ring(0.99), ring(0.70)) for edge in (k, k + 1) for z in (seat, seat + 0.018)]
        pieces += painted(PORCELAIN.darker(0.97), hull(np.array(rim)))
    step = back + 0.03
    pieces += painted(light, box((-0.16, 0.16), (0.6 * back, step + 0.16), (0.18, seat - 0.06)))
    cistern = Paint(PORCELAIN.color, 550.0)
    spread = float(random.uniform(0.17, 0.21))
    pieces += painted(cistern, box((-spread, spread), (step, step + 0.16), (seat - 0.06, tank - 0.03)))
    pieces += painted(
        cistern.darker(1.02), box((-spread - 0.008, spread + 0.008), (step - 0.008, step + 0.168), (tank - 0.03, tank))
    )
    pieces += painted(STEEL.sample(random), cylinder(0.02, (tank, tank + 0.006), (0.0, step + 0.08), count=12))
    bottom = seat + 0.018 + GAP
    outline = ring(0.99)[:-1].copy()
    outline[:, 1] = np.minimum(outline[:, 1], back - 0.06)
    cover = painted(PORCELAIN, prism(outline[_hull_order(outline)], (bottom, bottom + 0.016)))
    handle = np.array([0.0, -0.495 * long, bottom + 0.008])
    moving = (lid(cover, (back - 0.06, bottom), 1.55, handle=handle),)
    return Design("toilet", tuple(pieces), moving, contains=True, recipe={"style": style % 2})


def _hull_order(outline: np.ndarray) -> np.ndarray:
    """Return the numbers of the corners of the convex hull of points (N, 2), counter-clockwise."""
    return np.asarray(ConvexHull(outline).vertices)
