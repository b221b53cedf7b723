"""Drawer units whose drawers are deep enough for things to stand in."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.geometry.solids import box, cylinder
from scenewright.stages.library.design import DARK_PLASTIC, LACQUER, STEEL, WOOD, Design, Moving, painted
from scenewright.stages.library.families.storage import Carcass, drawer


def drawer_unit(random: np.random.Generator, style: int) -> Design:
    """Return a narrow unit on casters or a plinth: two deep drawers, a flat one above a deep one, or three.

    Every drawer is an open box; the free height above its floor is 9 cm in a flat and 14 cm or more in a deep one.
    """
    kind = ("two", "flat_and_deep", "three")[style % 3]
    casters = style % 2 == 0
    carcass_paint = (LACQUER if random.random() < 0.6 else WOOD).sample(random)
    front_paint = carcass_paint.darker(1.04) if random.random() < 0.5 else WOOD.sample(random)
    metal, board = STEEL.sample(random), 0.016
    width, depth = float(random.uniform(0.40, 0.52)), float(random.uniform(0.46, 0.58))
    heights = {
        "two": [float(random.uniform(0.25, 0.30))] * 2,
        "flat_and_deep": [float(random.uniform(0.28, 0.33)), float(random.uniform(0.15, 0.17))],
        "three": [float(random.uniform(0.21, 0.24))] * 3,
    }[kind]
    foot = 0.06 if casters else 0.05
    top = foot + board + sum(heights) + 0.004
    x = (-width / 2, width / 2)
    frame = Carcass(x, (0.0, depth), (foot, top + board), board)
    pieces = painted(carcass_paint, frame.boards())
    if casters:
        black = DARK_PLASTIC.sample(random)
        for sx in (-1, 1):
            for y in (0.06, depth - 0.06):
                pieces += painted(black, cylinder(0.028, (0.0, foot), (sx * (width / 2 - 0.05), y), count=12))
    else:
        pieces += painted(carcass_paint.darker(0.7), box((x[0] + 0.02, x[1] - 0.02), (0.04, depth - 0.02), (0.0, foot)))
    moving: list[Moving] = []
    low = foot + board
    for number, tall in enumerate(heights, start=1):
        edges = (low, low + tall)
        moving.append(drawer(number, x, edges, 0.0, depth - 0.03, front_paint, carcass_paint.darker(1.1), metal))
        low += tall
    return Design("drawer_unit", tuple(pieces), tuple(moving), contains=True, recipe={"style": kind})
