"""Tables and desks."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.geometry.solids import Solid, box, cylinder, prism, rounded_rectangle
from scenewright.stages.library.design import LACQUER, STEEL, WOOD, Design, painted


def _corner_legs(width: float, depth: float, height: float, leg: float, inset: float) -> list[Solid]:
    legs = []
    for sx in (-1, 1):
        for sy in (-1, 1):
            x, y = sx * (width / 2 - inset - leg / 2), sy * (depth / 2 - inset - leg / 2)
            legs.append(box((x - leg / 2, x + leg / 2), (y - leg / 2, y + leg / 2), (0, height)))
    return legs


def _apron(width: float, depth: float, leg: float, inset: float, z: tuple[float, float]) -> list[Solid]:
    x, y = width / 2 - inset - leg, depth / 2 - inset - leg
    thick = 0.02
    edge_x, edge_y = width / 2 - inset - leg / 2, depth / 2 - inset - leg / 2
    boards = [box((-x, x), (s * edge_y - thick / 2, s * edge_y + thick / 2), z) for s in (-1, 1)]
    return boards + [box((s * edge_x - thick / 2, s * edge_x + thick / 2), (-y, y), z) for s in (-1, 1)]


def table(random: np.random.Generator, style: int) -> Design:
    """Return a dining table, a kitchen table with rounded corners, a coffee table or a round pedestal table."""
    kind = ("dining", "kitchen", "coffee", "round")[style % 4]
    top_wood, leg_wood = WOOD.sample(random), WOOD.sample(random)
    thick = random.uniform(0.025, 0.04)
    if kind == "round":
        radius, height = random.uniform(0.45, 0.60), random.uniform(0.72, 0.76)
        metal = STEEL.sample(random)
        pieces = painted(top_wood, cylinder(radius, (height - thick, height), count=32))
        pieces += painted(
            metal,
            cylinder(0.05, (0.03, height - thick), count=16),
            cylinder(0.26, (0, 0.03), count=24, top_radius=0.22),
        )
        return Design("table", tuple(pieces), recipe={"style": kind})
    sizes = {
        "dining": ((1.4, 1.9), (0.8, 0.95), (0.73, 0.77)),
        "kitchen": ((0.9, 1.25), (0.70, 0.80), (0.72, 0.76)),
        "coffee": ((0.85, 1.2), (0.5, 0.65), (0.40, 0.48)),
    }[kind]
    width, depth, height = (random.uniform(*bounds) for bounds in sizes)
    leg, inset = random.uniform(0.045, 0.075), random.uniform(0.0, 0.05)
    if kind == "kitchen":
        outline = rounded_rectangle((-width / 2, width / 2), (-depth / 2, depth / 2), 0.06)
        top = prism(outline, (height - thick, height))
        inset = 0.05
        paint = LACQUER.sample(random)
    else:
        top = box((-width / 2, width / 2), (-depth / 2, depth / 2), (height - thick, height))
        paint = top_wood
    pieces = painted(paint, top) + painted(leg_wood, _corner_legs(width, depth, height - thick, leg, inset))
    pieces += painted(leg_wood, _apron(width, depth, leg, inset, (height - thick - 0.08, height - thick)))
    if kind == "coffee":
        x, y = width / 2 - inset - leg, depth / 2 - inset
        pieces += painted(paint, box((-x, x), (-y, y), (0.12, 0.14)))
    return Design("table", tuple(pieces), recipe={"style": kind})


def desk(random: np.random.Generator, style: int) -> Design:
    """Return a writing desk: panel sides, steel legs, or trestles with a modesty panel; all with a deep top."""
    kind = ("panel", "steel", "trestle")[style % 3]
    width, depth, height = random.uniform(1.2, 1.7), random.uniform(0.62, 0.80), random.uniform(0.71, 0.75)
    thick = random.uniform(0.022, 0.03)
    top_paint = (WOOD if random.random() < 0.6 else LACQUER).sample(random)
    pieces = painted(top_paint, box((-width / 2, width / 2), (-depth / 2, depth / 2), (height - thick, height)))
    under = height - thick
    if kind == "panel":
        side = LACQUER.sample(random)
        x = width / 2 - 0.03
        pieces += painted(side, box((-x - 0.025, -x), (-depth / 2 + 0.02, depth / 2 - 0.02), (0, under)))
        pieces += painted(side, box((x, x + 0.025), (-depth / 2 + 0.02, depth / 2 - 0.02), (0, under)))
        pieces += painted(side, box((-x, x), (depth / 2 - 0.06, depth / 2 - 0.042), (under - 0.35, under)))
    elif kind == "steel":
        metal = STEEL.sample(random)
        leg, inset = 0.05, 0.02
        pieces += painted(metal, _corner_legs(width, depth, under, leg, inset))
        pieces += painted(metal, _apron(width, depth, leg, inset, (under - 0.04, under)))
    else:
        wood = WOOD.sample(random)
        for sign in (-1, 1):
            x = sign * (width / 2 - 0.22)
            for sy in (-1, 1):
                y = sy * (depth / 2 - 0.08)
                pieces += painted(wood, box((x - 0.14, x - 0.10), (y - 0.02, y + 0.02), (0, under - 0.04)))
                pieces += painted(wood, box((x + 0.10, x + 0.14), (y - 0.02, y + 0.02), (0, under - 0.04)))
            for dx in (-0.12, 0.12):
                pieces += painted(
                    wood,
                    box((x + dx - 0.02, x + dx + 0.02), (-depth / 2 + 0.06, depth / 2 - 0.06), (under - 0.04, under)),
                )
            for sy in (-1, 1):
                y = sy * (depth / 2 - 0.08)
                pieces += painted(wood, box((x - 0.10, x + 0.10), (y - 0.015, y + 0.015), (0.28, 0.32)))
            lower = (-depth / 2 + 0.10, depth / 2 - 0.10)
            pieces += painted(
                wood, box((x + 0.105, x + 0.135), lower, (0.20, 0.24)), box((x - 0.135, x - 0.105), lower, (0.20, 0.24))
            )
    return Design("desk", tuple(pieces), recipe={"style": kind})
