"""Bottles, cups and bowls. Cups and bowls are hollow: a floor and a ring of convex wedges."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.geometry.solids import Solid, bar, cylinder, shell
from scenewright.stages.library.design import CERAMIC, GLASS, PLASTIC, Design, Paint, painted


def bottle(random: np.random.Generator, style: int) -> Design:
    """Return a filled bottle: body, shoulder, neck and cap; slim (wine), round (soft drink) or squat (sauce)."""
    kind = ("slim", "round", "squat")[style % 3]
    widths, heights = {
        "slim": ((0.033, 0.038), (0.26, 0.30)),
        "round": ((0.031, 0.036), (0.20, 0.25)),
        "squat": ((0.030, 0.035), (0.14, 0.18)),
    }[kind]
    radius, height = float(random.uniform(*widths)), float(random.uniform(*heights))
    glass, label, cap = GLASS.sample(random), CERAMIC.sample(random), PLASTIC.sample(random)
    body = {"slim": 0.62, "round": 0.68, "squat": 0.66}[kind] * height
    shoulder = {"slim": 0.76, "round": 0.86, "squat": 0.84}[kind] * height
    neck = 0.013
    water = Paint(label.color, 950.0)
    low, high = 0.25 * body, 0.78 * body
    pieces = painted(glass, cylinder(radius, (0, low), count=20), cylinder(radius, (high, body), count=20))
    pieces += painted(water, cylinder(radius + 0.0006, (low, high), count=20))
    pieces += painted(glass, cylinder(radius, (body, shoulder), count=20, top_radius=neck))
    pieces += painted(glass, cylinder(neck, (shoulder, height - 0.016), count=14))
    pieces += painted(cap, cylinder(neck + 0.002, (height - 0.016, height), count=14))
    return Design("bottle", tuple(pieces), grasp_width=round(2 * (radius + 0.0006), 4), recipe={"style": kind})


def cup(random: np.random.Generator, style: int) -> Design:
    """Return a mug with a handle (even styles) or a tumbler, hollow, graspable across its body."""
    mug = style % 2 == 0
    radius, height = float(random.uniform(0.034, 0.038)), float(random.uniform(0.085, 0.105))
    foot = radius * (float(random.uniform(0.92, 1.0)) if mug else float(random.uniform(0.74, 0.84)))
    paint = CERAMIC.sample(random) if mug else Paint(PLASTIC.sample(random).color, 1200.0)
    wall, floor = (0.004, 0.006) if mug else (0.0025, 0.004)
    inner = paint.darker(1.04)
    pieces = painted(inner, cylinder(foot - wall * 0.5, (0, floor), count=16))
    pieces += painted(
        paint, shell([(foot - wall, 0.0), (radius - wall, height)], [(foot, 0.0), (radius, height)], count=16)
    )
    if mug:
        pieces += painted(paint, _ear(foot, radius, height))
    recipe: dict[str, float | int | str] = {"style": "mug" if mug else "tumbler"}
    return Design("cup", tuple(pieces), contains=True, grasp_width=round(2 * radius, 4), recipe=recipe)


def _ear(foot: float, radius: float, height: float) -> list[Solid]:
    """A mug's handle at +x: five short bars along a C."""
    angles = np.linspace(0.5 * np.pi, -0.5 * np.pi, 6)
    middle, tall, wide = 0.52 * height, 0.30 * height, 0.030
    attach = 0.5 * (foot + radius) - 0.002
    points = [np.array([attach + wide * np.cos(a), 0.0, middle + tall * np.sin(a)]) for a in angles]
    bars = []
    for a, b in zip(points[:-1], points[1:], strict=True):
        overlap = 0.0022 * (b - a) / np.linalg.norm(b - a)  # closes the wedge that the bend opens on the outside
        bars.append(bar(a - overlap, b + overlap, 0.0045, count=8))
    return bars


def bowl(random: np.random.Generator, style: int) -> Design:
    """Return a bowl: a foot, a floor and three rings of a curved wall."""
    radius, height = float(random.uniform(0.065, 0.085)), float(random.uniform(0.05, 0.07))
    if style % 2:
        radius, height = radius * 1.3, height * 1.15
    paint = CERAMIC.sample(random)
    wall, floor, foot = 0.0045, 0.010, 0.45 * radius
    angles = np.linspace(0.18, 1.0, 4)
    rise = (angles - angles[0]) / (1 - angles[0])
    outer = [
        (
            foot * 1.05 + (radius - foot * 1.05) * float(np.sin(0.5 * np.pi * r)),
            floor * 0.5 + (height - floor * 0.5) * float(r**1.6),
        )
        for r in rise
    ]
    inner = [(r - wall, z) for r, z in outer]
    inner[0] = (outer[0][0] - 2 * wall, outer[0][1])
    pieces = painted(
        paint, cylinder(foot * 0.9, (0.0, floor * 0.5), count=16), cylinder(outer[0][0], (floor * 0.5, floor), count=16)
    )
    pieces += painted(paint, shell(inner, outer, count=16))
    return Design("bowl", tuple(pieces), contains=True, recipe={"style": style % 2})
