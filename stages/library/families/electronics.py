"""Monitors and keyboards."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.geometry.solids import box, cylinder, hull, prism, rounded_rectangle
from scenewright.stages.library.design import DARK_PLASTIC, PLASTIC, SCREEN, STEEL, Design, Paint, painted


def monitor(random: np.random.Generator, style: int) -> Design:
    """Return a computer monitor on a stand (a wide foot, or a round one); the screen looks along -y."""
    width = float(random.uniform(0.48, 0.62))
    tall = width * float(random.uniform(0.56, 0.62))
    low = float(random.uniform(0.09, 0.14))
    case, metal, screen = DARK_PLASTIC.sample(random), STEEL.sample(random), SCREEN.sample(random)
    if style % 3 == 2:
        case = Paint(PLASTIC.colors[1], 900.0)
    bezel, thick = 0.014, 0.028
    x, z = width / 2, (low, low + tall)
    front = 0.0
    pieces = painted(case, box((-x, x), (front + 0.004, front + thick), z))
    pieces += painted(case, box((-x, x), (front, front + 0.004), (z[0], z[0] + 2 * bezel)))
    pieces += painted(case, box((-x, x), (front, front + 0.004), (z[1] - bezel, z[1])))
    for side in ((-x, -x + bezel), (x - bezel, x)):
        pieces += painted(case, box(side, (front, front + 0.004), (z[0] + 2 * bezel, z[1] - bezel)))
    pieces += painted(
        screen, box((-x + bezel, x - bezel), (front + 0.002, front + 0.004), (z[0] + 2 * bezel, z[1] - bezel))
    )
    hump = [
        (a, front + thick + b, c)
        for a, b, c in [
            (-0.5 * x, 0, z[0] + 0.15 * tall),
            (0.5 * x, 0, z[0] + 0.15 * tall),
            (-0.5 * x, 0, z[1] - 0.2 * tall),
            (0.5 * x, 0, z[1] - 0.2 * tall),
            (-0.3 * x, 0.03, z[0] + 0.25 * tall),
            (0.3 * x, 0.03, z[0] + 0.25 * tall),
            (-0.3 * x, 0.03, z[1] - 0.3 * tall),
            (0.3 * x, 0.03, z[1] - 0.3 * tall),
        ]
    ]
    pieces += painted(case, hull(np.array(hump)))
    neck = front + thick + 0.03
    pieces += painted(metal, box((-0.03, 0.03), (neck, neck + 0.02), (0.012, z[0] + 0.55 * tall)))
    if style % 2:
        pieces += painted(metal, cylinder(0.11, (0.0, 0.012), (0.0, neck - 0.02), count=28))
    else:
        foot = rounded_rectangle((-0.14, 0.14), (neck - 0.14, neck + 0.06), 0.03)
        pieces += painted(metal, prism(foot, (0.0, 0.012)))
    return Design("monitor", tuple(pieces), recipe={"style": style % 2})


def keyboard(random: np.random.Generator, style: int) -> Design:
    """Return a keyboard: a wedge with rows of key caps."""
    full = style % 2 == 0
    width, depth = (
        float(random.uniform(0.42, 0.45) if full else random.uniform(0.29, 0.32)),
        float(random.uniform(0.125, 0.14)),
    )
    case = Paint(PLASTIC.colors[(0, 1, 1, 0)[style % 4]], 500.0)
    dark = sum(case.color) < 300
    keys = Paint((70, 72, 78), 500.0) if dark else Paint((245, 245, 245), 500.0)
    x, y, low, high = width / 2, depth / 2, 0.012, 0.022
    wedge = [(a, b, c) for a in (-x, x) for b, c in ((-y, 0.0), (y, 0.0), (-y, low), (y, high))]
    pieces = painted(case, hull(np.array(wedge)))
    rows, margin = 5, 0.009
    pitch = (depth - 2 * margin) / rows
    slope = (high - low) / depth

    def cap(left: float, right: float, row: int) -> None:
        y0, y1 = -y + margin + row * pitch + 0.0015, -y + margin + (row + 1) * pitch - 0.0015
        z0, z1 = low + slope * (y0 + y), low + slope * (y1 + y)
        points = [(left, y0, z0), (right, y0, z0), (left, y1, z1), (right, y1, z1)]
        inset = 0.0015
        for row_edge in (y0 + inset, y1 - inset):  # all tops lie in one plane
            height = low + slope * (row_edge + y) + 0.004
            points += [(left + inset, row_edge, height), (right - inset, row_edge, height)]
        pieces.extend(painted(keys, hull(np.array(points))))

    blocks = [(-x + margin, x - margin if not full else x - 0.105)] + ([(x - 0.095, x - margin)] if full else [])
    for number, (left, right) in enumerate(blocks):
        for row in range(rows):
            # one long cap per group keeps the collision shape small: the space bar row, and three groups else
            cuts = (
                np.array([0.0, 0.28, 0.72, 1.0])
                if number == 0 and row == 0
                else np.linspace(0, 1, 5 if number == 0 else 2)
            )
            for a, b in zip(cuts[:-1], cuts[1:], strict=True):
                cap(left + a * (right - left) + 0.001, left + b * (right - left) - 0.001, row)
    return Design("keyboard", tuple(pieces), recipe={"full": int(full)})
