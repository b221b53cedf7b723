"""What hangs from the ceiling or on a wall: pendant lamps and pictures. Their back, or top, is what is fastened."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.geometry.solids import box, cylinder, shell
from scenewright.stages.library.design import CARDBOARD, LINEN, PAPER, STEEL, WOOD, Design, Paint, Piece, painted

BULB = Paint((250, 240, 200), 800.0)
"""Lit lamp glass: density [kg/m^3]; by eye."""


def pendant_lamp(random: np.random.Generator, style: int) -> Design:
    """Return a lamp that hangs from the ceiling: canopy, cord, and a cone, a drum or a bar under two cords."""
    kind = ("cone", "drum", "bar")[style % 3]
    drop = float(random.uniform(0.55, 0.95))
    metal, cloth = STEEL.sample(random), LINEN.sample(random)
    canopy = painted(metal, cylinder(0.055, (drop - 0.03, drop), count=20, top_radius=0.06))
    if kind == "bar":
        return Design("pendant_lamp", tuple(_bar_lamp(random, drop, metal)), recipe={"style": kind})
    tall = float(random.uniform(0.16, 0.24) if kind == "cone" else random.uniform(0.18, 0.28))
    radius = float(random.uniform(0.14, 0.20) if kind == "cone" else random.uniform(0.18, 0.26))
    upper = radius * (0.35 if kind == "cone" else 0.96)
    wall = 0.004
    pieces = canopy + painted(metal, cylinder(0.008, (0.75 * tall, drop - 0.03), count=8))
    pieces += painted(BULB, cylinder(0.02, (0.35 * tall, 0.75 * tall), count=12, top_radius=0.03))
    shade = shell([(radius - wall, 0.0), (upper - wall, tall)], [(radius, 0.0), (upper, tall)], count=20)
    pieces += painted(metal.darker(1.1) if kind == "cone" else cloth, shade)
    reach = radius + (upper - radius) * 0.85 - wall
    spoke = 0.85 * tall
    pieces += painted(metal, box((-reach, -0.008), (-0.004, 0.004), (spoke, spoke + 0.006)))
    pieces += painted(metal, box((0.008, reach), (-0.004, 0.004), (spoke, spoke + 0.006)))
    return Design("pendant_lamp", tuple(pieces), recipe={"style": kind})


def _bar_lamp(random: np.random.Generator, drop: float, metal: Paint) -> list[Piece]:
    half, thick = 0.5 * float(random.uniform(0.7, 1.2)), float(random.uniform(0.035, 0.05))
    deep = 0.5 * float(random.uniform(0.05, 0.08))
    profile = Paint(metal.color, 700.0)  # thin sheet around drivers and air
    pieces = painted(profile, box((-half, half), (-deep, deep), (0.012, thick + 0.012)))
    pieces += painted(BULB, box((-half + 0.01, half - 0.01), (-deep + 0.006, deep - 0.006), (0.0, 0.012)))
    for x in (-0.7 * half, 0.7 * half):
        pieces += painted(metal, cylinder(0.004, (thick + 0.012, drop - 0.025), (x, 0.0), count=6))
    return pieces + painted(profile, box((-0.8 * half, 0.8 * half), (-0.03, 0.03), (drop - 0.025, drop)))


def picture(random: np.random.Generator, style: int) -> Design:
    """Return a framed picture that hangs flat on a wall at +y: landscape, portrait or square; some with a mount."""
    kind = ("landscape", "portrait", "square")[style % 3]
    long, ratio = float(random.uniform(0.40, 0.90)), float(random.uniform(0.62, 0.80))
    width, height = {"landscape": (long, long * ratio), "portrait": (long * ratio, long), "square": (long, long)}[kind]
    if kind != "landscape":
        width, height = 0.75 * width, 0.75 * height
    rail, deep = float(random.uniform(0.018, 0.040)), float(random.uniform(0.018, 0.035))
    frame = Paint((WOOD if random.random() < 0.6 else STEEL).sample(random).color, 550.0)
    paper, print_paint = PAPER.sample(random), Paint(CARDBOARD.sample(random).color, 700.0)
    x, inner = width / 2, width / 2 - rail
    pieces = painted(
        frame, box((-x, x), (-deep, 0.0), (0.0, rail)), box((-x, x), (-deep, 0.0), (height - rail, height))
    )
    for side in ((-x, -inner), (inner, x)):
        pieces += painted(frame, box(side, (-deep, 0.0), (rail, height - rail)))
    sheet = box((-inner, inner), (-0.5 * deep, 0.0), (rail, height - rail))
    if random.random() < 0.5:
        border = 0.15 * min(width, height)
        pieces += painted(paper, sheet)
        span = (-inner + border, inner - border)
        motif = box(span, (-0.5 * deep - 0.001, -0.5 * deep), (rail + border, height - rail - border))
        pieces += painted(print_paint, motif)
    else:
        pieces += painted(print_paint, sheet)
    return Design("picture", tuple(pieces), recipe={"style": kind})
