"""Plants in pots, vases, and forks, knives, spoons and spatulas."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.geometry.solids import Solid, bar, box, cylinder, hull, shell
from scenewright.stages.library.design import CERAMIC, GLASS, PLASTIC, STEEL, WOOD, Design, Paint, painted

LEAVES = ((70, 120, 60), (58, 104, 66), (96, 140, 70))
"""Colours of leaves; by eye."""
EARTH = Paint((74, 54, 40), 1100.0)
"""Earth of a flower pot: density [kg/m^3]; by eye."""


def _leaf(root: np.ndarray, turn: float, pitch: float, long: float, wide: float) -> Solid:
    """A pointed leaf that grows out of `root` (3,) [m] towards the direction of `turn` and `pitch` [rad]."""
    along = np.array([np.cos(turn) * np.cos(pitch), np.sin(turn) * np.cos(pitch), np.sin(pitch)])
    across = np.array([-np.sin(turn), np.cos(turn), 0.0])
    up = np.cross(along, across)
    tip, middle = root + long * along, root + 0.45 * long * along
    points = [
        root - 0.002 * across,
        root + 0.002 * across,
        tip,
        middle + 0.5 * wide * across,
        middle - 0.5 * wide * across,
    ]
    points += [middle - 0.06 * wide * up - 0.05 * long * along, middle + 0.02 * wide * up]
    return hull(np.array(points), curved=True)


def plant(random: np.random.Generator, style: int) -> Design:
    """Return a plant in a pot: a tuft of long leaves (even styles), or a small tree with a stem and a crown."""
    tree = style % 2 == 1
    radius = float(random.uniform(0.13, 0.18) if tree else random.uniform(0.06, 0.10))
    pot = float(random.uniform(0.22, 0.30) if tree else random.uniform(0.09, 0.14))
    clay, green = CERAMIC.sample(random), Paint(LEAVES[int(random.integers(3))], 300.0)
    wall = 0.006
    foot = 0.72 * radius
    pieces = painted(clay.darker(0.9), cylinder(foot - 0.5 * wall, (0.0, 0.008), count=16))
    outer = [(foot, 0.0), (radius, pot)]
    pieces += painted(clay, shell([(r - wall, z) for r, z in outer], outer, count=16))
    soil, heap = 0.90 * pot, radius - wall - 0.10 * (radius - foot)
    pieces += painted(EARTH, cylinder(foot - wall, (0.008, soil), count=16, top_radius=heap))
    pieces += painted(EARTH, cylinder(heap, (soil, 1.02 * pot), count=16, top_radius=0.016))
    leaves = int(random.integers(8, 13))
    if not tree:
        for k in range(leaves):
            turn = 2 * np.pi * k / leaves + float(random.uniform(-0.2, 0.2))
            root = np.array([0.3 * radius * np.cos(turn), 0.3 * radius * np.sin(turn), soil])
            long = pot * float(random.uniform(1.6, 2.4))
            pieces += painted(green, _leaf(root, turn, float(random.uniform(0.75, 1.25)), long, 0.22 * long))
        return Design("plant", tuple(pieces), recipe={"style": "tuft", "leaves": leaves})
    height = float(random.uniform(0.9, 1.4))
    pieces += painted(
        WOOD.sample(random), bar(np.array([0.0, 0.0, soil]), np.array([0.0, 0.0, 0.92 * height]), 0.014, count=8)
    )
    for k in range(2 * leaves):
        level = 0.5 + 0.45 * k / (2 * leaves)
        turn = 2.4 * k + float(random.uniform(-0.3, 0.3))
        long = float(random.uniform(0.22, 0.32)) * (1.25 - 0.5 * (level - 0.5))
        root = np.array([0.0, 0.0, level * height])
        pieces += painted(green, _leaf(root, turn, float(random.uniform(0.1, 0.7)), long, 0.42 * long))
    return Design("plant", tuple(pieces), recipe={"style": "tree", "leaves": 2 * leaves})


def vase(random: np.random.Generator, style: int) -> Design:
    """Return a hollow vase: bellied, conical, or a straight cylinder."""
    kind = ("belly", "cone", "straight")[style % 3]
    height, radius = float(random.uniform(0.18, 0.34)), float(random.uniform(0.045, 0.065))
    paint = (CERAMIC if random.random() < 0.65 else GLASS).sample(random)
    paint = Paint(paint.color, 2300.0)
    wall, floor = 0.0045, 0.010
    profile = {
        "belly": [(0.85, 0.0), (1.35, 0.35), (0.62, 0.82), (0.80, 1.0)],
        "cone": [(0.62, 0.0), (0.9, 0.5), (1.15, 1.0)],
        "straight": [(1.0, 0.0), (1.0, 1.0)],
    }[kind]
    outer = [(r * radius, z * height) for r, z in profile]
    pieces = painted(paint.darker(0.95), cylinder(outer[0][0] - 0.5 * wall, (0.0, floor), count=16))
    pieces += painted(paint, shell([(r - wall, z) for r, z in outer], outer, count=16))
    return Design("vase", tuple(pieces), contains=True, recipe={"style": kind})


def utensil(random: np.random.Generator, style: int) -> Design:
    """Return a knife, a fork, a spoon or a spatula that lies flat, long along y."""
    kind = ("knife", "fork", "spoon", "spatula")[style % 4]
    steel, grip = Paint(STEEL.sample(random).color, 4000.0), (PLASTIC if random.random() < 0.5 else WOOD).sample(random)
    long = float(random.uniform(0.19, 0.24) if kind != "spatula" else random.uniform(0.27, 0.34))
    wide, thick = float(random.uniform(0.015, 0.022)), float(random.uniform(0.007, 0.011))
    split = 0.45 * long
    pieces = painted(grip, box((-0.5 * wide, 0.5 * wide), (0.0, split), (0.0, thick)))
    blade = {"knife": 0.9, "fork": 1.3, "spoon": 1.9, "spatula": 4.0}[kind] * wide
    low, high = 0.25 * thick, 0.25 * thick + 0.002
    if kind == "knife":
        outline = [
            (-0.5 * blade, 0.0),
            (0.5 * blade, 0.0),
            (-0.5 * blade, -0.85 * (long - split)),
            (0.1 * blade, -(long - split)),
        ]
        pieces += painted(steel, hull(np.array([(a, b, c) for a, b in outline for c in (low, high)])))
    elif kind == "fork":
        neck = 0.55 * (long - split)
        pieces += painted(steel, box((-0.2 * wide, 0.2 * wide), (-neck, 0.0), (low, high)))
        pieces += painted(steel, box((-0.5 * blade, 0.5 * blade), (-neck - 0.012, -neck), (low, high)))
        for k in range(4):
            left = -0.5 * blade + k * blade / 4 + 0.08 * blade / 4
            tine = (left, left + 0.84 * blade / 4 * 0.6)
            pieces += painted(steel, box(tine, (split - long, -neck - 0.012), (low, high)))
    elif kind == "spoon":
        neck = 0.62 * (long - split)
        pieces += painted(steel, box((-0.2 * wide, 0.2 * wide), (-neck, 0.0), (low, high)))
        angle = 2 * np.pi * np.arange(12) / 12
        middle, half = 0.5 * (-neck + split - long), 0.5 * (long - split - neck)
        rim = [(0.5 * blade * np.cos(a), middle + half * np.sin(a), high + 0.004) for a in angle]
        base = [(0.3 * blade * np.cos(a), middle + 0.6 * half * np.sin(a), 0.0) for a in angle]
        pieces += painted(steel, hull(np.array(rim + base), curved=True))
    else:
        neck = 0.60 * (long - split)
        pieces += painted(
            steel, bar(np.array([0.0, 0.0, 0.5 * thick]), np.array([0.0, -neck, 0.5 * thick]), 0.004, count=8)
        )
        pieces += painted(steel, box((-0.5 * blade, 0.5 * blade), (split - long, -neck), (low, high)))
    extents = np.ptp(np.concatenate([piece.solid.vertices for piece in pieces])[:, :2], axis=0)
    width = round(float(extents.min()), 4)
    return Design("utensil", tuple(pieces), grasp_width=width if width < 0.078 else None, recipe={"style": kind})
