"""Laptops, mice, remote controls, printers and wall clocks."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.geometry.solids import bar, box, hull, prism, rounded_rectangle
from scenewright.stages.library.design import DARK_PLASTIC, PLASTIC, SCREEN, STEEL, Design, Paint, bar_handle, painted
from scenewright.stages.library.families.parts import GAP, lid, slide_out


def laptop(random: np.random.Generator, style: int) -> Design:
    """Return a closed laptop: a base with keys and touch pad, a screen that turns up about its back edge."""
    width = float(random.uniform(0.30, 0.38))
    depth = width * float(random.uniform(0.66, 0.72))
    base, thick = float(random.uniform(0.011, 0.016)), 0.006
    case = Paint((STEEL if style % 2 == 0 else DARK_PLASTIC).sample(random).color, 1200.0)
    dark = Paint((30, 30, 34), 1000.0)
    x, y = (-width / 2, width / 2), (-depth / 2, depth / 2)
    pieces = painted(case, prism(rounded_rectangle(x, y, 0.008), (0.0, base)))
    row = (y[1] - 0.03, y[1] - 0.03 - 0.42 * depth)
    pitch = (row[0] - row[1]) / 5
    for k in range(5):
        keys = (row[0] - (k + 1) * pitch + 0.0015, row[0] - k * pitch - 0.0015)
        pieces += painted(dark, box((x[0] + 0.02, x[1] - 0.02), keys, (base, base + 0.001)))
    pad = (row[1] - 0.012 - 0.3 * depth, row[1] - 0.012)
    pieces += painted(case.darker(0.88), box((-0.06, 0.06), pad, (base, base + 0.0005)))
    low = base + 0.0025
    cover = painted(case, box(x, y, (low + 0.002, low + thick)))
    cover += painted(
        SCREEN.sample(random), box((x[0] + 0.006, x[1] - 0.006), (y[0] + 0.008, y[1] - 0.016), (low, low + 0.002))
    )
    handle = np.array([0.0, y[0], low + 0.5 * thick])
    moving = (lid(cover, (y[1], low), 2.2, handle=handle, name="screen"),)
    return Design("laptop", tuple(pieces), moving, recipe={"style": style % 2})


def mouse(random: np.random.Generator, style: int) -> Design:
    """Return a computer mouse: a domed body, a wheel between two keys."""
    long, wide, tall = (
        0.5 * float(random.uniform(0.095, 0.12)),
        0.5 * float(random.uniform(0.056, 0.066)),
        float(random.uniform(0.032, 0.042)),
    )
    paint = Paint((DARK_PLASTIC if style % 2 == 0 else PLASTIC).sample(random).color, 700.0)
    points = []
    for share, rise in ((-1.0, 0.30), (-0.62, 0.78), (-0.05, 1.0), (0.55, 0.86), (1.0, 0.35)):
        half = wide * np.sqrt(max(0.0, 1.0 - (0.86 * abs(share)) ** 4))
        ring = [
            (-half, 0.0),
            (half, 0.0),
            (-half, 0.45 * rise),
            (half, 0.45 * rise),
            (-0.55 * half, rise),
            (0.55 * half, rise),
        ]
        points += [(a, share * long, b * tall) for a, b in ring]
    pieces = painted(paint, hull(np.array(points), curved=True))
    at = np.array([0.0, -0.62 * long, 0.80 * tall])
    pieces += painted(Paint((60, 62, 66), 700.0), bar(at - [0.003, 0, 0], at + [0.003, 0, 0], 0.2 * tall, count=12))
    extent = float(np.ptp(np.concatenate([piece.solid.vertices for piece in pieces])[:, 0]))
    return Design("mouse", tuple(pieces), grasp_width=round(extent, 4), recipe={"style": style % 2})


def remote(random: np.random.Generator, style: int) -> Design:
    """Return a remote control, long along y: a slab with rows of round keys, or a phone-like one with a screen."""
    phone = style % 2 == 1
    wide = float(random.uniform(0.066, 0.076) if phone else random.uniform(0.040, 0.054))
    long = float(random.uniform(0.135, 0.160) if phone else random.uniform(0.15, 0.21))
    tall = float(random.uniform(0.008, 0.011) if phone else random.uniform(0.016, 0.024))
    case = Paint((DARK_PLASTIC if random.random() < 0.6 else PLASTIC).sample(random).color, 1400.0)
    x, y = (-wide / 2, wide / 2), (-long / 2, long / 2)
    pieces = painted(case, prism(rounded_rectangle(x, y, 0.008), (0.0, tall)))
    if phone:
        screen = box((x[0] + 0.004, x[1] - 0.004), (y[0] + 0.006, y[1] - 0.006), (tall, tall + 0.0008))
        pieces += painted(SCREEN.sample(random), screen)
    else:
        rows = int(random.integers(4, 7))
        for row in range(rows):
            for column in (-1, 0, 1):
                key = np.array([0.28 * column * wide, y[0] + long * (0.2 + 0.7 * row / rows), tall])
                light = Paint((200, 60, 54) if row == rows - 1 and column == -1 else (150, 152, 156), 1000.0)
                pieces += painted(light, bar(key, key + [0, 0, 0.002], 0.11 * wide, count=8))
    recipe: dict[str, float | int | str] = {"style": "phone" if phone else "keys"}
    return Design("remote", tuple(pieces), grasp_width=round(wide, 4), recipe=recipe)


def clock(random: np.random.Generator, style: int) -> Design:
    """Return a clock for a wall at +y, round (even styles) or square, with two hands and marks for the hours."""
    radius, deep = float(random.uniform(0.11, 0.19)), float(random.uniform(0.025, 0.04))
    rim, face = (STEEL if random.random() < 0.5 else PLASTIC).sample(random), Paint((244, 244, 240), 900.0)
    dark = Paint((30, 30, 32), 900.0)
    rim = Paint(rim.color, 900.0)
    middle = np.array([0.0, 0.0, radius])
    front = -deep
    if style % 2 == 0:
        pieces = painted(rim, bar(middle + [0, front + 0.004, 0], middle, radius, count=32))
        pieces += painted(face, bar(middle + [0, front, 0], middle + [0, front + 0.004, 0], 0.93 * radius, count=32))
    else:
        pieces = painted(rim, box((-radius, radius), (front + 0.004, 0.0), (0.0, 2 * radius)))
        edge = 0.06 * radius
        inner = box((-radius + edge, radius - edge), (front, front + 0.004), (edge, 2 * radius - edge))
        pieces += painted(face, inner)
    for hour in range(12):
        direction = np.array([np.sin(np.pi * hour / 6), 0.0, np.cos(np.pi * hour / 6)])
        inner_end = 0.76 if hour % 3 == 0 else 0.82
        mark = middle + [0, front, 0]
        pieces += painted(
            dark, bar(mark + inner_end * radius * direction, mark + 0.88 * radius * direction, 0.0025, count=6)
        )
    time = float(random.uniform(0.0, 12.0))
    for turn, reach in ((time / 12, 0.5), (time % 1.0, 0.74)):
        direction = np.array([np.sin(2 * np.pi * turn), 0.0, np.cos(2 * np.pi * turn)])
        start = middle + [0, front - 0.002, 0]
        pieces += painted(
            dark, bar(start - 0.08 * radius * direction, start + reach * radius * direction, 0.003, count=6)
        )
    return Design("clock", tuple(pieces), recipe={"style": "round" if style % 2 == 0 else "square"})


def printer(random: np.random.Generator, style: int) -> Design:
    """Return a printer: a drawer for paper, a slot with a tray for sheets, a lid over the scanner's glass, buttons."""
    width, depth = float(random.uniform(0.40, 0.50)), float(random.uniform(0.34, 0.42))
    height = float(random.uniform(0.20, 0.28) if style % 2 == 0 else random.uniform(0.32, 0.40))
    paint = Paint((PLASTIC.colors[1] if style % 3 else DARK_PLASTIC.sample(random).color), 420.0)
    dark = Paint((44, 46, 50), 600.0)
    wall, bay = 0.015, 0.085
    x = (-width / 2, width / 2)
    inner = (x[0] + wall, x[1] - wall)
    slot = bay + wall + 0.055
    pieces = painted(
        paint,
        box((x[0], inner[0]), (0.0, depth), (0.0, height)),
        box((inner[1], x[1]), (0.0, depth), (0.0, height)),
        box(inner, (0.0, depth), (0.0, 0.008)),
        box(inner, (depth - wall, depth), (0.008, height)),
        box(inner, (0.0, depth - wall), (bay, bay + wall)),
        box(inner, (0.0, depth - wall), (slot, height - 0.004)),
    )
    pieces += painted(dark, box(inner, (0.55 * depth, depth - wall), (bay + wall, slot)))
    pieces += painted(
        Paint((150, 170, 176), 2400.0),
        box((inner[0] + 0.02, inner[1] - 0.03), (0.03, depth - 0.04), (height - 0.004, height)),
    )
    buttons = (inner[1] - 0.10, inner[1] - 0.01)
    pieces += painted(dark, box(buttons, (-0.004, 0.0), (slot + 0.01, min(height - 0.012, slot + 0.045))))
    low = height + GAP
    cover = painted(paint.darker(1.03), box(x, (0.004, depth), (low, low + 0.028)))
    grip = np.array([0.0, -0.036, low + 0.014])
    cover += bar_handle(grip, "x", 0.10, 0.04, 0.006, dark)
    front = painted(
        paint.darker(0.9), box((inner[0] + 0.003, inner[1] - 0.003), (-GAP - 0.012, -GAP), (0.011, bay - 0.003))
    )
    pull = np.array([0.0, -GAP - 0.012 - 0.04, 0.5 * bay])
    front += bar_handle(pull, "x", 0.12, 0.04, 0.006, dark)
    reach = (-GAP, depth - wall - 0.006)
    moving = (
        slide_out(
            "drawer_1",
            (inner[0] + 0.006, inner[1] - 0.006),
            reach,
            (0.012, bay - 0.012),
            0.004,
            0.7 * depth,
            dark,
            handle=pull,
            front=front,
        ),
        lid(cover, (depth, low), 1.2, handle=grip),
    )
    return Design(
        "printer", tuple(pieces), moving, contains=True, recipe={"style": "flat" if style % 2 == 0 else "tall"}
    )
