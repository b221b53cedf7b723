"""Plates, pans, pots with lids, jugs, cans and kettles: hollow ones are a floor and rings of convex wedges."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.base import as_vector
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.kit.geometry.solids import Solid, bar, box, cylinder, hull, shell
from scenewright.stages.library.design import CERAMIC, DARK_PLASTIC, PLASTIC, STEEL, Design, Moving, Paint, painted

SHEET = 2700.0
"""Density of the aluminium of pans and pots [kg/m^3]."""
SIDES = 16
"""Sides of a round dish or pan."""


def arc_handle(middle: np.ndarray, outward: np.ndarray, reach: float, half: float, radius: float) -> list[Solid]:
    """Return a C-shaped handle of bars: it leaves a wall along `outward` (3,) around `middle` (3,), `half` tall [m]."""
    angles = np.linspace(0.5 * np.pi, -0.5 * np.pi, 6)
    points = [middle + reach * np.cos(a) * outward + half * np.sin(a) * np.array([0, 0, 1.0]) for a in angles]
    bars = []
    for a, b in zip(points[:-1], points[1:], strict=True):
        overlap = 0.45 * radius * (b - a) / np.linalg.norm(b - a)  # closes the wedge that the bend opens outside
        bars.append(bar(a - overlap, b + overlap, radius, count=8))
    return bars


def _sheet(random: np.random.Generator) -> Paint:
    source = (STEEL if random.random() < 0.6 else CERAMIC).sample(random)
    return Paint(source.color, SHEET)


def plate(random: np.random.Generator, style: int) -> Design:
    """Return a flat dinner plate, a deep plate, or a small one: a floor and a rim that rises outwards."""
    kind = ("dinner", "deep", "small")[style % 3]
    radius = float({"dinner": random.uniform(0.125, 0.145), "deep": random.uniform(0.105, 0.12)}.get(kind, 0.0))
    radius = radius or float(random.uniform(0.075, 0.095))
    rise = float(random.uniform(0.030, 0.042) if kind == "deep" else random.uniform(0.016, 0.024))
    paint = CERAMIC.sample(random)
    floor, thick, wall = radius * float(random.uniform(0.60, 0.70)), 0.005, 0.009
    pieces = painted(paint, cylinder(floor - 0.5 * wall, (0.0, thick), count=24))
    pieces += painted(
        paint.darker(1.03),
        shell([(floor - wall, 0.0), (radius - wall, rise)], [(floor, 0.0), (radius, rise)], count=24),
    )
    return Design("plate", tuple(pieces), recipe={"style": kind})


def pan(random: np.random.Generator, style: int) -> Design:
    """Return a frying pan or a deeper sauteuse with a long handle along +x."""
    deep = style % 2 == 1
    radius = float(random.uniform(0.09, 0.11) if deep else random.uniform(0.11, 0.15))
    height = float(random.uniform(0.062, 0.085) if deep else random.uniform(0.042, 0.052))
    paint, grip = Paint((52, 54, 58), SHEET) if random.random() < 0.5 else _sheet(random), DARK_PLASTIC.sample(random)
    foot, wall, floor = radius * (0.94 if deep else 0.80), 0.0035, 0.005
    pieces = painted(paint.darker(0.9), cylinder(foot - 0.5 * wall, (0.0, floor), count=SIDES))
    pieces += painted(
        paint, shell([(foot - wall, 0.0), (radius - wall, height)], [(foot, 0.0), (radius, height)], count=SIDES)
    )
    long, rise = float(random.uniform(0.15, 0.20)), float(random.uniform(0.005, 0.03))
    at = 0.8 * height
    start = np.array([radius - 0.004 - 0.2 * (radius - foot), 0.0, at])
    end = np.array([radius + long, 0.0, at + rise])
    pieces += painted(paint, bar(start, start + 0.25 * (end - start), 0.008, count=8))
    pieces += painted(grip, bar(start + 0.25 * (end - start), end, 0.0105, count=10))
    return Design("pan", tuple(pieces), contains=True, recipe={"style": "sauteuse" if deep else "frying"})


def cooking_pot(random: np.random.Generator, style: int) -> Design:
    """Return a pot (even styles) or a low casserole with two ears, and a lid that lifts off upwards."""
    low = style % 2 == 1
    radius = float(random.uniform(0.11, 0.14) if low else random.uniform(0.085, 0.12))
    height = float(random.uniform(0.09, 0.11) if low else random.uniform(0.13, 0.19))
    paint, dark = _sheet(random), DARK_PLASTIC.sample(random)
    wall, floor = 0.0035, 0.006
    pieces = painted(paint.darker(0.9), cylinder(radius - 0.5 * wall, (0.0, floor), count=SIDES))
    ring = [(radius, 0.0), (radius, height)]
    pieces += painted(paint, shell([(r - wall, z) for r, z in ring], ring, count=SIDES))
    at = 0.78 * height
    for sign in (-1, 1):
        inside, outside = sign * (radius - 0.5 * wall), sign * (radius + 0.035)
        for y in (-0.035, 0.035):
            pieces += painted(dark, bar(np.array([inside, y, at]), np.array([outside, y, at]), 0.006, count=8))
        pieces += painted(dark, bar(np.array([outside, -0.041, at]), np.array([outside, 0.041, at]), 0.007, count=8))
    bottom = height + 0.001
    cover = painted(paint, cylinder(radius + 0.003, (bottom, bottom + 0.004), count=SIDES))
    cover += painted(
        paint, cylinder(0.92 * radius, (bottom + 0.004, bottom + 0.02), count=SIDES, top_radius=0.3 * radius)
    )
    grip = (bottom + 0.02, bottom + 0.05)
    cover += painted(dark, cylinder(0.009, (grip[0], grip[1] - 0.008), count=10))
    cover += painted(dark, cylinder(0.017, (grip[1] - 0.008, grip[1]), count=14))
    handle = np.array([0.0, 0.0, 0.5 * (grip[0] + grip[1])])
    joint = Joint(
        name="lid_lift",
        type="prismatic",
        part="lid",
        origin=(0.0, 0.0, bottom),
        axis=(0.0, 0.0, 1.0),
        lower=0.0,
        upper=round(0.9 * height, 4),
        handle=as_vector(handle),
        handle_axis=(0.0, 0.0, 1.0),
    )
    moving = (Moving(joint, tuple(cover)),)
    return Design("cooking_pot", tuple(pieces), moving, contains=True, recipe={"style": "casserole" if low else "pot"})


def jug(random: np.random.Generator, style: int) -> Design:
    """Return a jug with a handle at +x and a spout at -x: bellied (even styles) or straight."""
    height, radius = float(random.uniform(0.17, 0.24)), float(random.uniform(0.048, 0.062))
    paint = (CERAMIC if random.random() < 0.6 else PLASTIC).sample(random)
    wall, floor = 0.004, 0.008
    belly = 1.22 if style % 2 == 0 else 1.0
    outer = [(0.92 * radius, 0.0), (belly * radius, 0.38 * height), (0.86 * radius, height)]
    pieces = painted(paint.darker(0.95), cylinder(0.92 * radius - 0.5 * wall, (0.0, floor), count=SIDES))
    pieces += painted(paint, shell([(r - wall, z) for r, z in outer], outer, count=SIDES))
    top = 0.86 * radius
    middle = np.array([top - 0.002 + 0.06 * radius, 0.0, 0.62 * height])
    pieces += painted(paint, arc_handle(middle, np.array([1.0, 0, 0]), 0.045, 0.24 * height, 0.006))
    beak = [
        (-top + 0.5 * wall, y, z)
        for y, z in ((-0.022, height), (0.022, height), (-0.006, 0.8 * height), (0.006, 0.8 * height))
    ]
    beak += [(-top - 0.026, 0.0, height + 0.004), (-top - 0.02, 0.0, height - 0.006)]
    pieces += painted(paint, hull(np.array(beak)))
    return Design("jug", tuple(pieces), contains=True, recipe={"style": "belly" if style % 2 == 0 else "straight"})


def can(random: np.random.Generator, style: int) -> Design:
    """Return a drink can (shoulders drawn in), or a food can with a rim at both ends; full, graspable across."""
    drink = style % 2 == 0
    radius = float(random.uniform(0.026, 0.033) if drink else random.uniform(0.032, 0.038))
    height = float(random.uniform(0.105, 0.16) if drink else random.uniform(0.075, 0.115))
    print_paint, metal = Paint(PLASTIC.sample(random).color, 1000.0), Paint(STEEL.sample(random).color, 1000.0)
    if drink:
        pieces = painted(metal, cylinder(0.8 * radius, (0.0, 0.008), count=20, top_radius=radius))
        pieces += painted(print_paint, cylinder(radius, (0.008, height - 0.012), count=20))
        pieces += painted(metal, cylinder(radius, (height - 0.012, height), count=20, top_radius=0.84 * radius))
    else:
        rim = 0.004
        pieces = painted(
            metal, cylinder(radius, (0.0, rim), count=20), cylinder(radius, (height - rim, height), count=20)
        )
        pieces += painted(print_paint, cylinder(radius - 0.001, (rim, height - rim), count=20))
    recipe: dict[str, float | int | str] = {"style": "drink" if drink else "food"}
    return Design("can", tuple(pieces), grasp_width=round(2 * radius, 4), recipe=recipe)


def kettle(random: np.random.Generator, style: int) -> Design:
    """Return an electric kettle: base plate, tapered hollow body, spout, handle at +x, and a lid hinged there."""
    height, radius = float(random.uniform(0.17, 0.21)), float(random.uniform(0.07, 0.085))
    paint = (STEEL if style % 2 == 0 else PLASTIC).sample(random)
    paint, dark = Paint(paint.color, 1400.0), DARK_PLASTIC.sample(random)
    wall, base = 0.003, 0.022
    upper = radius * float(random.uniform(0.68, 0.80))
    pieces = painted(dark, cylinder(radius + 0.006, (0.0, base), count=20))
    pieces += painted(paint.darker(0.9), cylinder(radius - 0.5 * wall, (base, base + 0.006), count=20))
    outer = [(radius, base), (upper, height)]
    pieces += painted(paint, shell([(r - wall, z) for r, z in outer], outer, count=SIDES))
    neck = np.array([upper, 0.0, 0.86 * height])
    pieces += painted(
        dark, arc_handle(neck - [0.002, 0, 0.26 * height], np.array([1.0, 0, 0]), 0.062, 0.26 * height, 0.009)
    )
    beak = [(-upper + 0.5 * wall, y, z) for y in (-0.02, 0.02) for z in (height, 0.78 * height)]
    pieces += painted(
        paint, hull(np.array([*beak, (-upper - 0.035, 0.0, height), (-upper - 0.03, 0.0, height - 0.01)]))
    )
    bottom = height + 0.001
    cover = painted(dark, cylinder(upper - 0.001, (bottom, bottom + 0.008), count=16))
    cover += painted(dark, box((-0.6 * upper, -0.35 * upper), (-0.012, 0.012), (bottom + 0.008, bottom + 0.024)))
    joint = Joint(
        name="lid_hinge",
        type="revolute",
        part="lid",
        origin=(upper - 0.001, 0.0, bottom),
        axis=(0.0, 1.0, 0.0),
        lower=0.0,
        upper=1.45,
        handle=(-0.475 * upper, 0.0, bottom + 0.016),
        handle_axis=(0.0, 1.0, 0.0),
    )
    recipe: dict[str, float | int | str] = {"style": "steel" if style % 2 == 0 else "plastic"}
    return Design("kettle", tuple(pieces), (Moving(joint, tuple(cover)),), contains=True, recipe=recipe)
