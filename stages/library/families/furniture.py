"""Stools, benches, wardrobes, trolleys and shelves on a wall."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.geometry.solids import bar, box, cushion, cylinder, hull
from scenewright.stages.library.design import DARK_PLASTIC, FABRIC, LACQUER, STEEL, WOOD, Design, Piece, painted
from scenewright.stages.library.families.storage import GAP, Carcass, drawer, hinged_door


def stool(random: np.random.Generator, style: int) -> Design:
    """Return a round wooden stool with three legs, a bar stool with four, or an upholstered cube."""
    kind = ("round", "bar", "cube")[style % 3]
    wood = WOOD.sample(random)
    if kind == "cube":
        side, height = 0.5 * float(random.uniform(0.36, 0.44)), float(random.uniform(0.40, 0.46))
        span, fabric = (-side, side), FABRIC.sample(random)
        pieces = painted(wood, box((-side + 0.02, side - 0.02), (-side + 0.02, side - 0.02), (0.0, 0.03)))
        pieces += painted(fabric, cushion(span, span, (0.03, height - 0.06), 0.012))
        pieces += painted(fabric.darker(1.08), cushion(span, span, (height - 0.06, height), 0.012))
        return Design("stool", tuple(pieces), recipe={"style": kind})
    legs = 3 if kind == "round" else 4
    height = float(random.uniform(0.42, 0.50) if kind == "round" else random.uniform(0.62, 0.76))
    radius = float(random.uniform(0.15, 0.19))
    seat = 0.03
    pieces = painted(wood.darker(1.06), cylinder(radius, (height - seat, height), count=28))
    spread = radius * float(random.uniform(1.0, 1.15))
    angles = 2 * np.pi * (np.arange(legs) + 0.5) / legs
    feet = [np.array([spread * np.cos(a), spread * np.sin(a), 0.0]) for a in angles]
    tops = [np.array([0.62 * radius * np.cos(a), 0.62 * radius * np.sin(a), height - seat]) for a in angles]
    for foot, top in zip(feet, tops, strict=True):
        leg = bar(foot, top, 0.016, count=10)
        points = leg.vertices.copy()
        points[:, 2] = np.clip(points[:, 2], 0.0, height - seat)  # cut level with the floor and the seat
        pieces += painted(wood, hull(points, curved=True))
    share = 0.35
    rungs = [foot + share * (top - foot) for foot, top in zip(feet, tops, strict=True)]
    pieces += painted(wood, [bar(a, b, 0.010, count=8) for a, b in zip(rungs, rungs[1:] + rungs[:1], strict=True)])
    return Design("stool", tuple(pieces), recipe={"style": kind})


def bench(random: np.random.Generator, style: int) -> Design:
    """Return a bench without a back on two panels, or one with a back of slats on four legs."""
    plain = style % 2 == 0
    width, depth = float(random.uniform(1.0, 1.6)), float(random.uniform(0.34, 0.42))
    seat, wood = float(random.uniform(0.43, 0.47)), WOOD.sample(random)
    x, y = width / 2, depth / 2
    if plain:
        pieces = painted(wood.darker(1.05), box((-x, x), (-y, y), (seat - 0.04, seat)))
        for sign in (-1, 1):
            side = sorted((sign * (x - 0.12), sign * (x - 0.16)))
            pieces += painted(wood, box((side[0], side[1]), (-y + 0.02, y - 0.02), (0.0, seat - 0.04)))
        pieces += painted(wood, box((-x + 0.16, x - 0.16), (-0.015, 0.015), (0.12, 0.20)))
        return Design("bench", tuple(pieces), recipe={"style": "plain"})
    back, leg = float(random.uniform(0.80, 0.92)), 0.05
    pieces = []
    for sign in (-1, 1):
        side = sorted((sign * x, sign * (x - leg)))
        pieces += painted(wood, box((side[0], side[1]), (-y, -y + leg), (0.0, seat - 0.03)))
        pieces += painted(wood, box((side[0], side[1]), (y - leg, y), (0.0, back)))
        pieces += painted(wood, box((side[0], side[1]), (-y + leg, y - leg), (seat - 0.10, seat - 0.03)))
    pieces += painted(wood, box((-x + leg, x - leg), (-y, -y + 0.025), (seat - 0.10, seat - 0.03)))
    pieces += painted(wood.darker(1.05), box((-x, x), (-y - 0.01, y - leg), (seat - 0.03, seat)))
    for share in (0.45, 0.72, 0.95):
        top = seat + share * (back - seat)
        pieces += painted(wood, box((-x + leg, x - leg), (y - 0.035, y - 0.015), (top - 0.08, top)))
    return Design("bench", tuple(pieces), recipe={"style": "back"})


def wardrobe(random: np.random.Generator, style: int) -> Design:
    """Return a wardrobe with two doors, a shelf and a rod; odd styles have two drawers below the doors."""
    width, depth = float(random.uniform(0.85, 1.15)), float(random.uniform(0.52, 0.60))
    height, board, plinth = float(random.uniform(1.75, 2.05)), 0.019, 0.06
    carcass = (WOOD if random.random() < 0.5 else LACQUER).sample(random)
    front = carcass.darker(1.04) if random.random() < 0.5 else LACQUER.sample(random)
    metal = STEEL.sample(random)
    x = (-width / 2, width / 2)
    frame = Carcass(x, (0.0, depth), (plinth, height), board)
    pieces = painted(carcass, frame.boards())
    pieces += painted(carcass.darker(0.7), box((x[0] + 0.02, x[1] - 0.02), (0.04, depth - 0.02), (0.0, plinth)))
    moving = []
    low = plinth
    if style % 2:
        split = plinth + board + 0.24
        pieces += painted(carcass, frame.shelf(split + board / 2, recess=0.0))
        for number, span in ((1, (x[0], 0.0)), (2, (0.0, x[1]))):
            moving.append(
                drawer(
                    number, span, (plinth + board, split - GAP), 0.0, depth - 0.05, front, carcass.darker(1.1), metal
                )
            )
        pieces += painted(carcass, box((-0.009, 0.009), (0.0, depth - 0.008), (plinth + board, split - board / 2)))
        low = split
    shelf = height - 0.32
    pieces += painted(carcass, frame.shelf(shelf))
    rod = np.array([x[0] + board, 0.5 * depth, shelf - 0.07])
    pieces += painted(metal, bar(rod, np.array([x[1] - board, *rod[1:]]), 0.0125, count=10))
    z, at = (low, height - GAP), min(1.05, 0.5 * (low + height))
    count = len(moving)
    moving.append(hinged_door(count + 1, (x[0], 0.0), z, 0.0, "left", front, metal, handle_at=at))
    moving.append(hinged_door(count + 2, (0.0, x[1]), z, 0.0, "right", front, metal, handle_at=at))
    recipe: dict[str, float | int | str] = {"style": "drawers" if style % 2 else "doors"}
    return Design("wardrobe", tuple(pieces), tuple(moving), contains=True, recipe=recipe)


def trolley(random: np.random.Generator, style: int) -> Design:
    """Return a trolley on four casters with two or three trays between posts, and a bar to push at +x."""
    levels = 2 + style % 2
    width, depth, height = (
        float(random.uniform(0.60, 0.90)),
        float(random.uniform(0.40, 0.52)),
        float(random.uniform(0.74, 0.92)),
    )
    metal, black = STEEL.sample(random), DARK_PLASTIC.sample(random)
    sheet = (LACQUER if style % 4 < 2 else WOOD).sample(random)
    x, y, foot, post = width / 2, depth / 2, 0.10, 0.015
    pieces: list[Piece] = []
    for sx in (-1, 1):
        for sy in (-1, 1):
            at = (sx * (x - post), sy * (y - post))
            pieces += painted(metal, cylinder(post, (foot, height), at, count=12))
            pieces += painted(black, cylinder(0.012, (0.07, foot), at, count=8))
            wheel = np.array([at[0], at[1], 0.035])
            pieces += painted(black, bar(wheel - [0, 0.012, 0], wheel + [0, 0.012, 0], 0.035, count=16))
    for k in range(levels):
        top = 0.16 + k * (height - 0.16) / (levels - 1)
        inner = (-x + 2 * post, x - 2 * post)
        pieces += painted(sheet, box(inner, (-y, y), (top - 0.018, top)))
        for sign in (-1, 1):
            strip = sorted((sign * x, sign * (x - 2 * post)))
            pieces += painted(sheet, box((strip[0], strip[1]), (-y + 2 * post, y - 2 * post), (top - 0.018, top)))
    reach, grip = x + 0.06, height - 0.04
    for sy in (-1, 1):
        start = np.array([x - post, sy * (y - post), grip])
        pieces += painted(metal, bar(start, np.array([reach, sy * (y - post), grip]), 0.009, count=8))
    pieces += painted(
        metal, bar(np.array([reach, -y + 0.006, grip]), np.array([reach, y - 0.006, grip]), 0.012, count=10)
    )
    return Design("trolley", tuple(pieces), recipe={"levels": levels})


def wall_shelf(random: np.random.Generator, style: int) -> Design:
    """Return a shelf for a wall at +y: a board on brackets, two boards between uprights, or a floating box board."""
    kind = ("brackets", "ladder", "floating")[style % 3]
    width, depth = float(random.uniform(0.55, 1.10)), float(random.uniform(0.18, 0.27))
    paint, metal = (WOOD if random.random() < 0.6 else LACQUER).sample(random), STEEL.sample(random)
    x = width / 2
    if kind == "floating":
        thick = float(random.uniform(0.035, 0.05))
        return Design(
            "wall_shelf", tuple(painted(paint, box((-x, x), (-depth, 0.0), (0.0, thick)))), recipe={"style": kind}
        )
    if kind == "ladder":
        height, side = float(random.uniform(0.45, 0.65)), 0.018
        pieces = []
        for sign in (-1, 1):
            edge = sorted((sign * x, sign * (x - side)))
            pieces += painted(metal, box((edge[0], edge[1]), (-depth, 0.0), (0.0, height)))
        for share in (0.12, 0.62):
            top = share * height + 0.018
            pieces += painted(paint, box((-x + side, x - side), (-depth, 0.0), (top - 0.018, top)))
        return Design("wall_shelf", tuple(pieces), recipe={"style": kind})
    tall, thick = float(random.uniform(0.14, 0.22)), float(random.uniform(0.018, 0.028))
    pieces = painted(paint, box((-x, x), (-depth, 0.0), (tall, tall + thick)))
    for sign in (-1, 1):
        at = sign * (x - 0.10)
        pieces += painted(metal, box((at - 0.012, at + 0.012), (-0.006, 0.0), (0.0, tall)))
        pieces += painted(metal, box((at - 0.012, at + 0.012), (-0.85 * depth, -0.006), (tall - 0.006, tall)))
        start, end = np.array([at, -0.006, 0.03]), np.array([at, -0.7 * depth, tall - 0.008])
        pieces += painted(metal, bar(start, end, 0.005, count=8))
    return Design("wall_shelf", tuple(pieces), recipe={"style": kind})
