"""Boards that lie across things or lean on them, and trays."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.geometry.solids import bar, box, hull, prism, rounded_rectangle
from scenewright.stages.library.design import LACQUER, PLASTIC, STEEL, WOOD, Design, Paint, Piece, painted


def board(random: np.random.Generator, style: int) -> Design:
    """Return a plank that lies flat (even styles), or a panel that leans back against what stands at +y.

    A leaning panel is drawn leaning: it stands on its lower front edge and touches the plane y = maximum with its upper
    back edge, so that turning it about z is all that placing it takes.
    """
    if style % 2 == 0:
        long, wide = float(random.uniform(0.9, 1.7)), float(random.uniform(0.18, 0.32))
        thick = float(random.uniform(0.016, 0.030))
        paint = (WOOD if random.random() < 0.75 else LACQUER).sample(random)
        half = 0.5 * wide
        # the ends are cut across the grain and look darker
        pieces = painted(paint, box((-long / 2 + 0.01, long / 2 - 0.01), (-half, half), (0.0, thick)))
        for sign in (-1, 1):
            low, high = sorted((sign * long / 2, sign * (long / 2 - 0.01)))
            pieces += painted(paint.darker(0.85), box((low, high), (-half, half), (0.0, thick)))
        return Design("board", tuple(pieces), recipe={"style": "plank"})
    kind = ("whiteboard", "panel")[style // 2 % 2]
    tall, wide = float(random.uniform(0.75, 1.25)), float(random.uniform(0.55, 0.95))
    lean = float(np.radians(random.uniform(8.0, 14.0)))
    return Design("board", tuple(_leaning_panel(random, kind, tall, wide, lean)), recipe={"style": kind, "lean": lean})


def _leaning_panel(random: np.random.Generator, kind: str, tall: float, wide: float, lean: float) -> list[Piece]:
    """A panel `tall` x `wide` [m] whose faces lean back by `lean` [rad]; its lower edge lies flat on the floor."""
    thick = 0.018
    up, back = np.array([0.0, np.sin(lean), np.cos(lean)]), np.array([0.0, np.cos(lean), -np.sin(lean)])

    def slab(x: tuple[float, float], depth: tuple[float, float], height: tuple[float, float], *, foot: bool) -> Piece:
        corners = [
            np.array([a, 0.0, 0.0]) + d * back + (h + (d * np.tan(lean) if foot and h == height[0] else 0.0)) * up
            for a in x
            for d in depth
            for h in height
        ]
        return Piece(hull(np.array(corners)), paint)

    half = 0.5 * wide
    if kind == "panel":
        paint = WOOD.sample(random)
        return [slab((-half, half), (0.0, thick), (0.0, tall), foot=True)]
    paint, rail = STEEL.sample(random), 0.02
    pieces = [
        slab((-half, half), (0.0, thick), (0.0, rail), foot=True),
        slab((-half, half), (0.0, thick), (tall - rail, tall), foot=False),
        slab((-half, -half + rail), (0.0, thick), (rail, tall - rail), foot=False),
        slab((half - rail, half), (0.0, thick), (rail, tall - rail), foot=False),
    ]
    paint = Paint((246, 247, 248), 700.0)
    pieces.append(slab((-half + rail, half - rail), (0.003, thick - 0.003), (rail, tall - rail), foot=False))
    return pieces


def tray(random: np.random.Generator, style: int) -> Design:
    """Return a tray to carry things on: a floor with a low rim, and at both ends a handle bar or a raised grip."""
    long, wide, rim = (
        0.5 * float(random.uniform(0.36, 0.50)),
        0.5 * float(random.uniform(0.26, 0.34)),
        float(random.uniform(0.022, 0.038)),
    )
    wall, floor = 0.006, 0.006
    kind = ("bars", "grips")[style % 2]
    paint = (WOOD if kind == "grips" else PLASTIC).sample(random)
    paint = Paint(paint.color, 650.0)
    if kind == "bars":
        pieces = painted(paint, prism(rounded_rectangle((-long, long), (-wide, wide), 0.02), (0.0, floor)))
        sides = 0.02
    else:
        pieces = painted(paint, box((-long, long), (-wide, wide), (0.0, floor)))
        sides = 0.0
    span = (-wide + max(sides, wall), wide - max(sides, wall))
    for sign in (-1, 1):
        y = sorted((sign * wide, sign * (wide - wall)))
        pieces += painted(paint.darker(0.92), box((-long + sides, long - sides), (y[0], y[1]), (floor, rim)))
        x = sorted((sign * long, sign * (long - wall)))
        pieces += painted(paint.darker(0.92), box((x[0], x[1]), span, (floor, rim)))
        if kind == "grips":
            grip = (-0.06, 0.06)
            for post in ((grip[0], grip[0] + 0.015), (grip[1] - 0.015, grip[1])):
                pieces += painted(paint.darker(0.85), box((x[0], x[1]), post, (rim, rim + 0.035)))
            pieces += painted(paint.darker(0.85), box((x[0] - 0.003, x[1] + 0.003), grip, (rim + 0.035, rim + 0.05)))
        else:
            metal, out = STEEL.sample(random), sign * (long + 0.03)
            near_end, height = sign * long, 0.6 * rim
            pieces += painted(metal, bar(np.array([out, -0.05, height]), np.array([out, 0.05, height]), 0.005, count=8))
            for end in (-0.05, 0.05):
                pieces += painted(
                    metal, bar(np.array([near_end, end, height]), np.array([out, end, height]), 0.0045, count=8)
                )
    return Design("tray", tuple(pieces), recipe={"style": kind})
