"""Chairs and sofas."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.geometry.solids import (
    Solid,
    bar,
    box,
    circle,
    cushion,
    cylinder,
    hull,
    prism,
    rounded_rectangle,
)
from scenewright.stages.library.design import FABRIC, PLASTIC, STEEL, WOOD, Design, Piece, painted


def chair(random: np.random.Generator, style: int) -> Design:
    """Return a wooden slat chair, an upholstered dining chair, a plastic shell chair or a swivel chair."""
    makers = (_slat_chair, _upholstered_chair, _swivel_chair, _panel_chair)
    return makers[style % len(makers)](random)


def _chair_frame(random: np.random.Generator) -> tuple[float, float, float, float, float]:
    width, depth = random.uniform(0.40, 0.46), random.uniform(0.40, 0.46)
    seat, back = random.uniform(0.44, 0.47), random.uniform(0.82, 0.96)
    return width, depth, seat, back, random.uniform(0.03, 0.04)


def _leaning_post(x: tuple[float, float], y: float, z: tuple[float, float], thick: float, lean: float) -> Solid:
    lower = [(a, y + b, z[0]) for a in x for b in (0.0, thick)]
    upper = [(a, y + b + lean, z[1]) for a in x for b in (0.0, thick)]
    return hull(np.array(lower + upper))


def _four_legs(width: float, depth: float, seat: float, leg: float, back: float, lean: float) -> list[Solid]:
    """Two front legs up to the seat; two rear legs that go on as leaning back posts."""
    left, right = (-width / 2, -width / 2 + leg), (width / 2 - leg, width / 2)
    front, rear = (-depth / 2, -depth / 2 + leg), (depth / 2 - leg, depth / 2)
    legs = [box(x, front, (0, seat)) for x in (left, right)]
    legs += [box(x, rear, (0, seat)) for x in (left, right)]
    legs += [_leaning_post(x, rear[0], (seat, back), leg, lean) for x in (left, right)]
    return legs


def _slat_chair(random: np.random.Generator) -> Design:
    width, depth, seat, back, leg = _chair_frame(random)
    lean = random.uniform(0.05, 0.09)
    wood = WOOD.sample(random)
    solids = _four_legs(width, depth, seat, leg, back, lean)
    inner = width / 2 - leg

    def across(height: float, tall: float) -> Solid:
        at = depth / 2 - leg + lean * (height - seat) / (back - seat)
        rise = lean * tall / (back - seat)
        return _leaning_post((-inner, inner), at + 0.25 * leg, (height, height + tall), 0.5 * leg, rise)

    slats = int(random.integers(3, 5))
    pitch = (back - seat - 0.12) / slats
    solids += [across(seat + 0.10 + k * pitch, 0.55 * pitch) for k in range(slats)]
    rail = (seat - 0.07, seat - 0.001)
    solids += [box((-inner, inner), (-depth / 2 + 0.008, -depth / 2 + 0.026), rail)]
    solids += [box((-inner, inner), (depth / 2 - 0.026, depth / 2 - 0.008), rail)]
    span = (-depth / 2 + leg, depth / 2 - leg)
    solids += [
        box(x, span, rail) for x in ((-width / 2 + 0.008, -width / 2 + 0.026), (width / 2 - 0.026, width / 2 - 0.008))
    ]
    solids += [
        box(x, span, (0.16, 0.19))
        for x in ((-width / 2 + 0.008, -width / 2 + 0.026), (width / 2 - 0.026, width / 2 - 0.008))
    ]
    top = box((-width / 2 - 0.005, width / 2 + 0.005), (-depth / 2 - 0.012, depth / 2 - leg), (seat, seat + 0.02))
    return Design("chair", tuple(painted(wood, solids) + painted(wood.darker(1.05), top)), recipe={"style": "slats"})


def _upholstered_chair(random: np.random.Generator) -> Design:
    width, depth, seat, back, leg = _chair_frame(random)
    wood, fabric = WOOD.sample(random), FABRIC.sample(random)
    lean = random.uniform(0.05, 0.08)
    base = seat - 0.07
    solids = _four_legs(width, depth, base, leg, base + 0.10, 0.01)[:4]
    pad = cushion((-width / 2 - 0.01, width / 2 + 0.01), (-depth / 2 - 0.01, depth / 2), (base, seat), 0.015)
    back_rest = _leaning_post((-width / 2, width / 2), depth / 2 - 0.05, (seat - 0.001, back), 0.05, lean)
    return Design(
        "chair", tuple(painted(wood, solids) + painted(fabric, pad, back_rest)), recipe={"style": "upholstered"}
    )


def _panel_chair(random: np.random.Generator) -> Design:
    """Moulded seat and back on splayed round legs."""
    width, depth, seat, back, _ = _chair_frame(random)
    shell, wood = PLASTIC.sample(random), WOOD.sample(random)
    legs = []
    for sx in (-1, 1):
        for sy in (-1, 1):
            foot = np.array([sx * (width / 2 - 0.01), sy * (depth / 2 - 0.01), 0.0])
            legs.append(bar(foot, np.array([sx * (width / 2 - 0.09), sy * (depth / 2 - 0.09), seat - 0.012]), 0.016))
    flat = prism(rounded_rectangle((-width / 2, width / 2), (-depth / 2, depth / 2), 0.06), (seat - 0.012, seat))
    panels = []
    lean = random.uniform(0.07, 0.10)
    for k in range(3):  # a back that bends: the middle panel stands further back than the two outer ones
        x = (-width / 2 + k * width / 3, -width / 2 + (k + 1) * width / 3)
        inset = (0.0, 0.0) if k == 1 else ((0.03, 0.0) if k == 0 else (0.0, 0.03))
        lower = [(a, depth / 2 - 0.03 - i + t, seat) for a, i in zip(x, inset, strict=True) for t in (0, 0.012)]
        upper = [(a, depth / 2 - 0.03 - i + t + lean, back) for a, i in zip(x, inset, strict=True) for t in (0, 0.012)]
        panels.append(hull(np.array(lower + upper)))
    legs_floor = [_cut_at_floor(leg) for leg in legs]
    return Design("chair", tuple(painted(wood, legs_floor) + painted(shell, flat, panels)), recipe={"style": "shell"})


def _cut_at_floor(solid: Solid) -> Solid:
    """Flatten what a slanted bar has below z = 0 onto the floor."""
    points = solid.vertices.copy()
    points[:, 2] = np.maximum(points[:, 2], 0.0)
    return hull(points, curved=True)


def _swivel_chair(random: np.random.Generator) -> Design:
    width, depth, seat, back, _ = _chair_frame(random)
    metal, fabric, dark = STEEL.sample(random), FABRIC.sample(random), PLASTIC.colors[0]
    black = FABRIC.sample(random)
    caster = type(black)(dark, 900.0)
    pieces: list[Piece] = []
    reach = 0.29
    for k in range(5):
        angle = 2 * np.pi * k / 5 + np.pi / 2
        tip = np.array([reach * np.cos(angle), reach * np.sin(angle)])
        side = 0.02 * np.array([-np.sin(angle), np.cos(angle)])
        points = [
            (*(tip * r + s * side), z)
            for r, s, z in [
                (0.08, -1, 0.07),
                (0.08, 1, 0.07),
                (0.08, -1, 0.12),
                (0.08, 1, 0.12),
                (1, -0.6, 0.07),
                (1, 0.6, 0.07),
                (1, -0.6, 0.085),
                (1, 0.6, 0.085),
            ]
        ]
        pieces += painted(metal, hull(np.array(points)))
        pieces += painted(caster, cylinder(0.027, (0.0, 0.07), (tip[0], tip[1]), count=10))
    pieces += painted(metal, cylinder(0.03, (0.12, seat - 0.10), count=12))
    pieces += painted(caster, box((-0.10, 0.10), (-0.10, 0.10), (seat - 0.10, seat - 0.08)))
    pieces += painted(fabric, cushion((-width / 2, width / 2), (-depth / 2, depth / 2), (seat - 0.08, seat), 0.025))
    pieces += painted(caster, box((-0.04, 0.04), (depth / 2, depth / 2 + 0.02), (seat - 0.06, seat + 0.22)))
    back_rest = _leaning_post((-width / 2 + 0.02, width / 2 - 0.02), depth / 2 - 0.03, (seat + 0.10, back), 0.05, 0.05)
    pieces += painted(fabric, back_rest)
    if random.random() < 0.6:
        for sign in (-1, 1):
            x = (sign * (width / 2 + 0.03) - 0.025, sign * (width / 2 + 0.03) + 0.025)
            pieces += painted(caster, box(x, (-0.12, 0.14), (seat + 0.19, seat + 0.215)))
            pieces += painted(caster, box(x, (0.0, 0.05), (seat - 0.06, seat + 0.19)))
    return Design("chair", tuple(pieces), recipe={"style": "swivel"})


def sofa(random: np.random.Generator, style: int) -> Design:
    """Return a sofa with two or three seats: base, cushions, arms, back, short legs."""
    seats = 2 + style % 2
    arm, seat_width = random.uniform(0.14, 0.22), random.uniform(0.60, 0.70)
    width, depth = seats * seat_width + 2 * arm, random.uniform(0.82, 0.95)
    seat, back, arm_height = random.uniform(0.40, 0.45), random.uniform(0.76, 0.90), random.uniform(0.56, 0.64)
    fabric, wood = FABRIC.sample(random), WOOD.sample(random)
    foot = random.uniform(0.06, 0.12)
    thick = 0.20
    pieces = []
    for x in (-width / 2 + 0.06, width / 2 - 0.06):
        for y in (-depth / 2 + 0.06, depth / 2 - 0.06):
            pieces += painted(
                wood, prism(circle(0.02, 10, (x, y)), (0, foot), circle(0.028, 10, (x, y)), round_sides=True)
            )
    pieces += painted(
        fabric.darker(0.9),
        box((-width / 2 + arm, width / 2 - arm), (-depth / 2 + 0.01, depth / 2), (foot, seat - 0.15)),
    )
    for sign in (-1, 1):
        low, high = sorted((sign * width / 2, sign * (width / 2 - arm)))
        pieces += painted(fabric, cushion((low, high), (-depth / 2, depth / 2), (foot, arm_height), 0.03))
    inner = (-width / 2 + arm, width / 2 - arm)
    pieces += painted(fabric, cushion(inner, (depth / 2 - thick, depth / 2), (seat - 0.15, back), 0.03))
    step = (inner[1] - inner[0]) / seats
    for k in range(seats):
        span = (inner[0] + k * step + 0.004, inner[0] + (k + 1) * step - 0.004)
        pieces += painted(
            fabric.darker(1.04), cushion(span, (-depth / 2, depth / 2 - thick), (seat - 0.15, seat), 0.02)
        )
        if style % 4 < 2:
            pieces += painted(
                fabric.darker(1.04),
                cushion(span, (depth / 2 - thick - 0.12, depth / 2 - thick), (seat, back - 0.05), 0.03),
            )
    return Design("sofa", tuple(pieces), recipe={"seats": seats})
