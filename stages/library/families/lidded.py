"""Chests and toolboxes: boxes with a lid hinged at the back, which a bar at its front edge opens."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.geometry.solids import box, cylinder, hull
from scenewright.stages.library.design import (
    FABRIC,
    LACQUER,
    PLASTIC,
    STEEL,
    WOOD,
    Design,
    Paint,
    Piece,
    bar_handle,
    painted,
)
from scenewright.stages.library.families.parts import GAP, Span, lid, open_box


def chest(random: np.random.Generator, style: int) -> Design:
    """Return a storage chest: flat with a cushion to sit on, flat, or with a vaulted lid; feet under the flat ones."""
    kind = ("seat", "flat", "vaulted")[style % 3]
    width, depth = float(random.uniform(0.75, 1.15)), float(random.uniform(0.40, 0.52))
    height, wall = float(random.uniform(0.34, 0.44)), 0.02
    wood = (WOOD if random.random() < 0.75 else LACQUER).sample(random)
    metal = STEEL.sample(random)
    x, y = (-width / 2, width / 2), (-depth / 2, depth / 2)
    feet = 0.0 if kind == "vaulted" else 0.04
    pieces = painted(wood, open_box(x, y, (feet, height), wall))
    if feet:
        for sx in (-1, 1):
            for sy in (-1, 1):
                at = (sx * (width / 2 - 0.05), sy * (depth / 2 - 0.05))
                pieces += painted(wood.darker(0.7), cylinder(0.025, (0.0, feet), at, count=12))
    low = height + GAP
    thick = 0.03
    cover = painted(wood.darker(1.05), box((x[0] - 0.01, x[1] + 0.01), (y[0] - 0.01, y[1]), (low, low + thick)))
    if kind == "seat":
        pad = box((x[0] + 0.02, x[1] - 0.02), (y[0] + 0.02, y[1] - 0.02), (low + thick, low + thick + 0.05))
        cover += painted(FABRIC.sample(random), pad)
    elif kind == "vaulted":
        cover += _vault(wood, metal, x, y, low + thick, float(random.uniform(0.08, 0.12)))
    handle = np.array([0.0, y[0] - 0.01 - 0.05, low + 0.5 * thick])
    cover += bar_handle(handle, "x", 0.16, 0.05, 0.008, metal)
    moving = (lid(cover, (y[1], low), 1.4, handle=handle),)
    return Design("chest", tuple(pieces), moving, contains=True, recipe={"style": kind})


def _vault(wood: Paint, metal: Paint, x: Span, y: Span, low: float, rise: float) -> list[Piece]:
    """Slats along x on an arch over y, three iron bands across."""
    angles = np.linspace(np.pi, 0.0, 7)
    middle, half = 0.5 * (y[0] + y[1]), 0.5 * (y[1] - y[0])
    arch = [(middle + half * np.cos(a), low + rise * np.sin(a)) for a in angles]
    pieces = []
    for k, (a, b) in enumerate(zip(arch[:-1], arch[1:], strict=True)):
        foot = [(a[0], low), (b[0], low)]
        corners = [(e, *p) for e in x for p in (a, b, *foot)]
        shade = wood.darker(0.96 if k % 2 else 1.04)
        pieces += painted(Paint(shade.color, 300.0), hull(np.unique(np.array(corners), axis=0)))
    for share in (0.1, 0.5, 0.9):
        at = x[0] + share * (x[1] - x[0])
        for a, b in zip(arch[:-1], arch[1:], strict=True):
            direction = np.array([0.0, b[0] - a[0], b[1] - a[1]])
            out = np.cross([1.0, 0, 0], direction / np.linalg.norm(direction)) * 0.003
            ends = [np.array([e, *p]) + s * out for e in (at - 0.015, at + 0.015) for p in (a, b) for s in (0.0, 1.0)]
            pieces += painted(metal, hull(np.array(ends)))
    return pieces


def toolbox(random: np.random.Generator, style: int) -> Design:
    """Return a toolbox: plastic with a grip on its lid (even styles), or a steel case with rounded-off lid."""
    plastic = style % 2 == 0
    width, depth = float(random.uniform(0.38, 0.52)), float(random.uniform(0.18, 0.25))
    height, wall = float(random.uniform(0.11, 0.16)), 0.004
    paint = Paint((PLASTIC if plastic else STEEL).sample(random).color, 950.0 if plastic else 2600.0)
    dark = Paint((38, 40, 44), 950.0)
    x, y = (-width / 2, width / 2), (-depth / 2, depth / 2)
    pieces = painted(dark if plastic else paint, open_box(x, y, (0.0, height), wall if plastic else 0.002))
    low, cap = height + GAP, float(random.uniform(0.03, 0.05))
    inset = 0.012 if plastic else 0.03
    # a lid of sheets: a flat top, and sloping sides that only look solid from outside
    profile = [(x[0], y[0], low), (x[1], y[0], low), (x[0], y[1], low), (x[1], y[1], low)]
    roof = [
        (a + s * inset, b + t * inset, low + cap)
        for a, s in ((x[0], 1), (x[1], -1))
        for b, t in ((y[0], 1), (y[1], -1))
    ]
    cover = painted(Paint(paint.color, 0.25 * paint.density), hull(np.array(profile + roof)))
    top = low + cap
    for sign in (-1, 1):
        post = sorted((sign * 0.075, sign * 0.06))
        cover += painted(dark, box((post[0], post[1]), (-0.012, 0.012), (top, top + 0.035)))
    cover += painted(dark, box((-0.08, 0.08), (-0.013, 0.013), (top + 0.035, top + 0.055)))
    handle = np.array([0.0, y[0] - 0.042, low + 0.012])
    cover += bar_handle(handle, "x", 0.09, 0.045, 0.006, dark)
    moving = (lid(cover, (y[1], low), 1.5, handle=handle),)
    recipe: dict[str, float | int | str] = {"style": "plastic" if plastic else "steel"}
    return Design("toolbox", tuple(pieces), moving, contains=True, recipe=recipe)
