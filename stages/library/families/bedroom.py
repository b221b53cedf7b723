"""Beds, books and lamps."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.geometry.solids import box, cushion, cylinder, shell
from scenewright.stages.library.design import CARDBOARD, FABRIC, LINEN, PAPER, STEEL, WOOD, Design, Paint, painted


def bed(random: np.random.Generator, style: int) -> Design:
    """Return a single or double bed: frame, head board, mattress, blanket, pillows. The head is at the back (+y)."""
    double = style % 2 == 0
    width, length = (
        float(random.uniform(1.4, 1.65) if double else random.uniform(0.92, 1.05)),
        float(random.uniform(2.02, 2.12)),
    )
    wood, linen, blanket = (
        WOOD.sample(random),
        LINEN.sample(random),
        (FABRIC if random.random() < 0.5 else LINEN).sample(random),
    )
    rail, leg, top = 0.03, 0.07, float(random.uniform(0.46, 0.56))
    frame_top = float(random.uniform(0.28, 0.34))
    head = float(random.uniform(0.85, 1.1))
    x, y = width / 2, length / 2
    pieces = []
    for sx in (-1, 1):
        corner = sorted((sx * x, sx * (x - leg)))
        pieces += painted(wood, box((corner[0], corner[1]), (-y, -y + leg), (0, frame_top)))
        pieces += painted(wood, box((corner[0], corner[1]), (y - leg, y), (0, head)))
        side = sorted((sx * (x - 0.01), sx * (x - 0.01 - rail)))
        pieces += painted(wood, box((side[0], side[1]), (-y + leg, y - leg), (frame_top - 0.14, frame_top)))
    pieces += painted(wood, box((-x + leg, x - leg), (-y + 0.01, -y + 0.01 + rail), (frame_top - 0.14, frame_top)))
    pieces += painted(wood, box((-x + leg, x - leg), (y - 0.05, y - 0.02), (frame_top - 0.14, head - 0.02)))
    inner = x - 0.01 - rail
    slat = (frame_top - 0.08, frame_top - 0.06)
    pieces += painted(wood.darker(1.1), box((-inner, inner), (-y + 0.01 + rail, y - 0.05), slat))
    mattress = (-inner + 0.005, inner - 0.005)
    pieces += painted(linen, cushion(mattress, (-y + 0.05, y - 0.055), (slat[1], top), 0.02))
    cover = (mattress[0] - 0.012, mattress[1] + 0.012)
    pieces += painted(blanket, cushion(cover, (-y + 0.045, y - 0.65), (max(frame_top, top - 0.13), top + 0.035), 0.015))
    count = 2 if double else 1
    step = (mattress[1] - mattress[0]) / count
    for k in range(count):
        span = (mattress[0] + k * step + 0.08, mattress[0] + (k + 1) * step - 0.08)
        pieces += painted(linen.darker(1.05), cushion(span, (y - 0.52, y - 0.10), (top, top + 0.11), 0.04))
    return Design("bed", tuple(pieces), recipe={"double": int(double)})


def book(random: np.random.Generator, style: int) -> Design:
    """Return a closed book that lies flat: two covers, a spine, the pages set back."""
    width, length, thick = (
        float(random.uniform(0.13, 0.19)),
        float(random.uniform(0.19, 0.26)),
        float(random.uniform(0.018, 0.045)),
    )
    cover = Paint(CARDBOARD.sample(random).color, 800.0)
    page = PAPER.sample(random)
    board = 0.003
    x, y = width / 2, length / 2
    pieces = painted(cover, box((-x, x), (-y, y), (0, board)), box((-x, x), (-y, y), (thick - board, thick)))
    pieces += painted(cover, box((-x, -x + board), (-y, y), (board, thick - board)))
    pieces += painted(page, box((-x + board, x - 0.005), (-y + 0.004, y - 0.004), (board, thick - board)))
    return Design("book", tuple(pieces), recipe={"style": style})


def lamp(random: np.random.Generator, style: int) -> Design:
    """Return a table lamp (even styles) or a floor lamp: foot, pole, a hollow shade."""
    tall = style % 2 == 1
    height = float(random.uniform(1.45, 1.65) if tall else random.uniform(0.38, 0.52))
    shade_height, radius = (
        (0.28, float(random.uniform(0.17, 0.21))) if tall else (0.18, float(random.uniform(0.11, 0.14)))
    )
    metal, cloth = STEEL.sample(random), LINEN.sample(random)
    base = 0.15 if tall else 0.075
    low = height - shade_height
    pieces = painted(
        metal, cylinder(base, (0, 0.02), count=24), cylinder(0.012, (0.02, low + 0.6 * shade_height), count=10)
    )
    bulb = Paint((250, 240, 200), 800.0)
    pieces += painted(
        bulb, cylinder(0.03, (low + 0.6 * shade_height, low + 0.9 * shade_height), count=10, top_radius=0.015)
    )
    upper = 0.7 * radius
    wall = 0.004
    pieces += painted(
        cloth, shell([(radius - wall, low), (upper - wall, height)], [(radius, low), (upper, height)], count=16)
    )
    spoke = low + 0.55 * shade_height
    at = radius - (radius - upper) * 0.55 - wall
    pieces += painted(
        metal,
        box((-at, at), (-0.004, 0.004), (spoke, spoke + 0.006)),
        box((-0.004, 0.004), (-at, at), (spoke + 0.006, spoke + 0.012)),
    )
    return Design("lamp", tuple(pieces), recipe={"tall": int(tall)})
