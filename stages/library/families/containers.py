"""Boxes and bins."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.geometry.solids import box as block
from scenewright.stages.kit.geometry.solids import cylinder, hull, shell
from scenewright.stages.library.design import CARDBOARD, PLASTIC, STEEL, Design, Paint, painted


def box(random: np.random.Generator, style: int) -> Design:
    """Return a food carton that a gripper can hold, a flat package, or an open cardboard box."""
    kind = ("carton", "open", "package")[style % 3]
    paint = CARDBOARD.sample(random)
    if kind == "carton":
        width, depth, height = (
            float(random.uniform(0.11, 0.19)),
            float(random.uniform(0.05, 0.07)),
            float(random.uniform(0.16, 0.27)),
        )
        band = paint.darker(0.7)
        x, y = width / 2, depth / 2
        pieces = painted(paint, block((-x, x), (-y, y), (0, 0.62 * height)))
        pieces += painted(band, block((-x, x), (-y, y), (0.62 * height, 0.8 * height)))
        pieces += painted(paint, block((-x, x), (-y, y), (0.8 * height, height)))
        return Design("box", tuple(pieces), grasp_width=round(depth, 4), recipe={"style": kind})
    if kind == "package":
        width, depth, height = (
            float(random.uniform(0.20, 0.30)),
            float(random.uniform(0.15, 0.20)),
            float(random.uniform(0.07, 0.12)),
        )
        brown = Paint(CARDBOARD.colors[0], 180.0)
        x, y, tape = width / 2, depth / 2, 0.024
        pieces = painted(brown, block((-x, -tape), (-y, y), (0, height)), block((tape, x), (-y, y), (0, height)))
        pieces += painted(brown.darker(1.18), block((-tape, tape), (-y, y), (0, height)))
        return Design("box", tuple(pieces), recipe={"style": kind})
    width, depth, height = (
        float(random.uniform(0.30, 0.42)),
        float(random.uniform(0.24, 0.32)),
        float(random.uniform(0.20, 0.28)),
    )
    brown, wall = Paint(CARDBOARD.colors[0], 250.0), 0.006
    x, y = width / 2, depth / 2
    pieces = painted(brown, block((-x, x), (-y, y), (0, wall)))
    pieces += painted(
        brown, block((-x, -x + wall), (-y, y), (wall, height)), block((x - wall, x), (-y, y), (wall, height))
    )
    inner = (-x + wall, x - wall)
    pieces += painted(brown, block(inner, (-y, -y + wall), (wall, height)), block(inner, (y - wall, y), (wall, height)))
    flap, drop = 0.45 * depth, 0.10
    for sign in (-1, 1):  # two flaps that hang outwards
        points = [
            (a, sign * (y + b), height - c)
            for a in (-x, x)
            for b, c in ((-wall, 0.0), (0.0, 0.0), (flap * 0.75, drop), (flap * 0.75 + 0.003, drop - 0.005))
        ]
        pieces += painted(brown.darker(1.08), hull(np.array(points)))
    return Design("box", tuple(pieces), contains=True, recipe={"style": kind})


def bin(random: np.random.Generator, style: int) -> Design:  # noqa: A001
    """Return a waste bin: a round tapered bucket (even styles) or a rectangular one, both hollow."""
    if style % 2 == 0:
        radius, height = float(random.uniform(0.13, 0.17)), float(random.uniform(0.28, 0.42))
        foot, wall = radius * float(random.uniform(0.75, 0.9)), 0.004
        paint = Paint((PLASTIC if style % 4 == 0 else STEEL).sample(random).color, 1000.0)
        pieces = painted(paint.darker(0.85), cylinder(foot - wall / 2, (0, 0.006), count=20))
        rim = height - 0.015
        outer = [(foot, 0.0), (radius, rim)]
        pieces += painted(paint, shell([(r - wall, z) for r, z in outer], outer, count=20))
        edge = radius + 0.005
        pieces += painted(
            paint.darker(0.9),
            shell([(radius - wall, rim), (radius - wall, height)], [(edge, rim), (edge, height)], count=20),
        )
        return Design("bin", tuple(pieces), contains=True, recipe={"style": "round"})
    width, depth, height = (
        float(random.uniform(0.24, 0.32)),
        float(random.uniform(0.20, 0.26)),
        float(random.uniform(0.34, 0.50)),
    )
    paint, wall, taper = PLASTIC.sample(random), 0.004, 0.85
    pieces = painted(
        paint.darker(0.85),
        block((-width / 2 * taper, width / 2 * taper), (-depth / 2 * taper, depth / 2 * taper), (0, 0.006)),
    )
    outer = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * np.array([width / 2, depth / 2])
    inset = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * wall
    for k in range(4):
        ring = [k, (k + 1) % 4]
        points = []
        for shape, z in ((taper, 0.0), (1.0, height)):
            points += [(*(outer[i] * shape), z) for i in ring] + [(*(outer[i] * shape + inset[i]), z) for i in ring]
        pieces += painted(paint, hull(np.array(points)))
    return Design("bin", tuple(pieces), contains=True, recipe={"style": "rectangular"})
