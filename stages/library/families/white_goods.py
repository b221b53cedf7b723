"""Ovens, hobs, dishwashers and washing machines: flaps, racks that slide out behind them, round doors, knobs."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.base import as_vector
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.kit.geometry.solids import Solid, bar, box, cylinder, hull, shell
from scenewright.stages.library.design import (
    APPLIANCE,
    DARK_PLASTIC,
    SCREEN,
    STEEL,
    Design,
    Moving,
    Paint,
    Piece,
    bar_handle,
    painted,
)
from scenewright.stages.library.families.appliances import WHITE, lined_chamber
from scenewright.stages.library.families.parts import DEPTH_FROM_HEIGHT, GAP, Span, flap, knob, slide_out

GLASS_CERAMIC = Paint((24, 26, 30), 2300.0)
"""Glass ceramic of a hob: density [kg/m^3]; by eye."""
SIDES = 16
"""Sides of a drum or a round door."""


def _hot_plates(x: Span, y: Span, top: float, paint: Paint) -> list[Piece]:
    """Four thin round plates on a hob."""
    plates = []
    for column, share in ((0, 0.25), (1, 0.75)):
        for row, depth_share in ((0, 0.28), (1, 0.74)):
            at = (x[0] + share * (x[1] - x[0]), y[0] + depth_share * (y[1] - y[0]))
            radius = (0.085, 0.105)[(row + column) % 2]
            plates += painted(paint, cylinder(radius, (top, top + 0.002), at, count=20))
    return plates


def _oven_door(x: Span, z: Span, paint: Paint, metal: Paint) -> Moving:
    """A flap with a window, 4 cm thick."""
    thick, frame = 0.04, 0.07
    face = -GAP - thick
    inner, pane = (x[0] + frame, x[1] - frame), (z[0] + frame, z[1] - 1.4 * frame)
    pieces = painted(paint, box(x, (face, -GAP), (z[0], pane[0])), box(x, (face, -GAP), (pane[1], z[1])))
    pieces += painted(paint, box((x[0], inner[0]), (face, -GAP), pane), box((inner[1], x[1]), (face, -GAP), pane))
    pieces += painted(SCREEN_GLASS, box(inner, (face + 0.004, -GAP - 0.004), pane))
    return flap(pieces, x, z, face, metal)


SCREEN_GLASS = Paint(SCREEN.colors[0], 1400.0)
"""Glass of an oven door: density [kg/m^3]; by eye."""


def oven(random: np.random.Generator, style: int) -> Design:
    """Return an oven to build in, or a cooker with a hob on top; a flap, a tray and a grid, a row of knobs."""
    cooker = style % 2 == 1
    width, depth = float(random.uniform(0.55, 0.62)), float(random.uniform(0.50, 0.58))
    paint, metal = Paint(APPLIANCE.sample(random).color, 350.0), STEEL.sample(random)
    wall, panel = 0.045, 0.10
    low = float(random.uniform(0.24, 0.30)) if cooker else 0.0
    height = low + float(random.uniform(0.56, 0.62))
    x, chamber = (-width / 2, width / 2), (low, height - panel)
    pieces = lined_chamber(x, chamber, depth, wall, paint, Paint((58, 60, 66), paint.density))
    pieces += painted(paint, box(x, (-0.03, depth), (height - panel, height)))
    if cooker:
        pieces += painted(Paint(paint.color, 120.0), box(x, (0.0, depth), (0.06, low)))  # an empty compartment
        pieces += painted(DARK_PLASTIC.sample(random), box((x[0] + 0.03, x[1] - 0.03), (0.05, depth), (0.0, 0.06)))
        pieces += painted(GLASS_CERAMIC, box(x, (-0.03, depth), (height, height + 0.012)))
        pieces += _hot_plates(x, (0.0, depth), height + 0.012, metal)
    door = _oven_door((x[0] + 0.002, x[1] - 0.002), (low + 0.004, chamber[1] - 0.004), paint.darker(0.9), metal)
    moving = [door]
    inner, floor = (x[0] + wall + 0.006, x[1] - wall - 0.006), low + wall
    free = chamber[1] - wall - floor
    for number, share in ((1, 0.10), (2, 0.52)):
        z = (floor + share * free, floor + share * free + 0.022)
        rack = slide_out(
            f"rack_{number}", inner, (0.004, depth - wall - 0.012), z, 0.006, 0.6 * depth, metal, behind="door_hinge"
        )
        moving.append(rack)
    count = 6 if cooker else int(random.integers(2, 5))
    for number in range(1, count + 1):
        at = np.array([x[0] + width * (number - 0.5) / count, -0.03, height - 0.5 * panel])
        moving.append(knob(number, at, (0.0, -1.0, 0.0), 0.019, metal.darker(0.8)))
    recipe: dict[str, float | int | str] = {"style": "cooker" if cooker else "built_in", "knobs": count}
    return Design("oven", tuple(pieces), tuple(moving), contains=True, recipe=recipe)


def hob(random: np.random.Generator, style: int) -> Design:
    """Return a hob that stands on a worktop: glass with knobs on top, or gas with grids and knobs in front."""
    gas = style % 2 == 1
    width, depth = float(random.uniform(0.52, 0.75)), float(random.uniform(0.44, 0.52))
    x, y = (-width / 2, width / 2), (-depth / 2, depth / 2)
    metal, dark = STEEL.sample(random), DARK_PLASTIC.sample(random)
    tall = float(random.uniform(0.075, 0.10) if gas else random.uniform(0.045, 0.06))
    moving = []
    if gas:
        pieces = painted(Paint(metal.color, 700.0), box(x, y, (0.0, tall)))
        for column in (0.27, 0.73):
            for row in (0.28, 0.74):
                at = (x[0] + column * width, y[0] + row * depth)
                pieces += painted(dark, cylinder(0.05, (tall, tall + 0.034), at, count=16))  # level with the grid
        grid = Paint((36, 36, 38), 2400.0)
        for k in range(2):
            span = (x[0] + 0.02 + k * (width / 2 - 0.01), x[0] + width / 2 - 0.01 + k * (width / 2 - 0.01))
            for share in (0.08, 0.28, 0.51, 0.74, 0.94):
                at_y = y[0] + share * depth
                pieces += painted(grid, box(span, (at_y - 0.005, at_y + 0.005), (tall + 0.022, tall + 0.034)))
            for at_x in span:
                edge = (min(at_x, span[1] - 0.01), min(at_x, span[1] - 0.01) + 0.01)
                pieces += painted(grid, box(edge, (y[0] + 0.03, y[1] - 0.02), (tall, tall + 0.022)))
        for number in range(1, 5):
            foot = np.array([x[0] + width * number / 5, y[0], 0.5 * tall])
            moving.append(knob(number, foot, (0.0, -1.0, 0.0), 0.018, dark))
    else:
        pieces = painted(
            Paint(metal.color, 700.0), box((x[0] + 0.02, x[1] - 0.02), (y[0] + 0.02, y[1] - 0.02), (0.0, tall - 0.008))
        )
        pieces += painted(GLASS_CERAMIC, box(x, y, (tall - 0.008, tall)))
        pieces += _hot_plates((x[0], x[1] - 0.09), y, tall, Paint((70, 72, 78), 2300.0))
        for number in range(1, 5):
            foot = np.array([x[1] - 0.05, y[0] + depth * number / 5, tall])
            moving.append(knob(number, foot, (0.0, 0.0, 1.0), 0.019, metal))
    return Design("hob", tuple(pieces), tuple(moving), recipe={"style": "gas" if gas else "glass"})


def dishwasher(random: np.random.Generator, style: int) -> Design:
    """Return a dishwasher, 60 or 45 cm wide: a flap and two racks that slide out behind it."""
    slim = style % 2 == 1
    width = float(random.uniform(0.445, 0.46) if slim else random.uniform(0.59, 0.605))
    depth, height = float(random.uniform(0.54, 0.58)), float(random.uniform(0.81, 0.87))
    paint, metal = Paint(APPLIANCE.sample(random).color, 300.0), STEEL.sample(random)
    plinth, wall, thick = 0.11, 0.03, 0.045
    x, chamber = (-width / 2, width / 2), (plinth, height)
    pieces = lined_chamber(x, chamber, depth, wall, paint, Paint((200, 204, 208), paint.density))
    pieces += painted(DARK_PLASTIC.sample(random), box((x[0] + 0.01, x[1] - 0.01), (0.06, depth - 0.02), (0.0, plinth)))
    face, strip = -GAP - thick, height - 0.11
    side, z = (x[0] + 0.002, x[1] - 0.002), (plinth + 0.004, height - 0.002)
    panel = painted(paint.darker(1.02), box(side, (face, -GAP), (z[0], strip)))
    panel += painted(DARK_PLASTIC.sample(random), box(side, (face, -GAP), (strip, z[1])))
    moving = [flap(panel, side, z, face, metal)]
    inner, wire = (x[0] + wall + 0.01, x[1] - wall - 0.01), Paint((188, 194, 202), 900.0)
    low, free = plinth + wall, height - plinth - 2 * wall
    for number, (start, end) in enumerate(((0.05, 0.26), (0.52, 0.70)), start=1):
        bounds = (low + start * free, low + end * free)
        reach = (0.01, depth - wall - 0.02)
        moving.append(slide_out(f"rack_{number}", inner, reach, bounds, 0.006, 0.8 * depth, wire, behind="door_hinge"))
    recipe: dict[str, float | int | str] = {"style": "slim" if slim else "full"}
    return Design("dishwasher", tuple(pieces), tuple(moving), contains=True, recipe=recipe)


def _around_hole(x: Span, z: Span, middle: tuple[float, float], radius: float, y: Span) -> list[Solid]:
    """Return convex pieces of a wall of the bounds [m] with a round hole of the given radius around (x, z) `middle`."""
    square = (
        (middle[0] - 1.12 * radius, middle[0] + 1.12 * radius),
        (middle[1] - 1.12 * radius, middle[1] + 1.12 * radius),
    )
    solids = [
        box(x, y, (z[0], square[1][0])),
        box(x, y, (square[1][1], z[1])),
        box((x[0], square[0][0]), y, square[1]),
        box((square[0][1], x[1]), y, square[1]),
    ]
    angles = np.linspace(0, 2 * np.pi, SIDES + 1) + np.pi / 4
    for a, b in zip(angles[:-1], angles[1:], strict=True):
        points = []
        for angle in (a, b):
            direction = np.array([np.cos(angle), np.sin(angle)])
            outer = 1.12 * radius / np.abs(direction).max()
            points += [
                (middle[0] + r * direction[0], d, middle[1] + r * direction[1]) for r in (radius, outer) for d in y
            ]
        solids.append(hull(np.array(points)))
    return solids


def washing_machine(random: np.random.Generator, style: int) -> Design:
    """Return a front loader (even styles with a drawer for powder, odd ones slim): drum, round door, a knob."""
    slim = style % 2 == 1
    width, height = float(random.uniform(0.585, 0.605)), float(random.uniform(0.83, 0.87))
    depth = float(random.uniform(0.40, 0.46) if slim else random.uniform(0.54, 0.60))
    paint, dark = Paint(APPLIANCE.sample(random).color, 900.0), DARK_PLASTIC.sample(random)
    metal, wall = STEEL.sample(random), 0.02
    x, panel = (-width / 2, width / 2), height - 0.13
    radius = float(random.uniform(0.15, 0.17))
    middle = (0.0, float(random.uniform(0.40, 0.44)))
    feet = 0.02
    pieces = painted(
        paint,
        box((x[0], x[0] + wall), (0.0, depth), (feet, height - wall)),
        box((x[1] - wall, x[1]), (0.0, depth), (feet, height - wall)),
        box((x[0] + wall, x[1] - wall), (0.0, depth), (feet, feet + wall)),
        box((x[0] + wall, x[1] - wall), (depth - wall, depth), (feet + wall, height - wall)),
        box(x, (0.0, depth), (height - wall, height)),
    )
    inner = (x[0] + wall, x[1] - wall)
    pieces += painted(paint, _around_hole(inner, (feet + wall, panel), middle, radius, (0.0, wall)))
    for sx in (-1, 1):
        for y in (0.05, depth - 0.05):
            pieces += painted(dark, cylinder(0.02, (0.0, feet), (sx * (width / 2 - 0.05), y), count=10))
    pieces += _drum(middle, radius, (wall, depth - 0.06), Paint((186, 190, 196), 1500.0))
    moving = [_round_door(middle, radius, paint, dark, metal)]
    split = inner[0] + (0.36 if not slim else 0.0) * (inner[1] - inner[0])
    pieces += painted(paint.darker(0.97), box((split, inner[1]), (0.0, wall), (panel, height - wall)))
    if not slim:
        box_y, z = (-GAP, 0.20), (panel + 0.012, height - wall - 0.012)
        front = painted(
            paint.darker(0.94),
            box((inner[0] + 0.004, split - 0.004), (-GAP - 0.014, -GAP), (panel + 0.004, height - wall - 0.004)),
        )
        handle = np.array([0.5 * (inner[0] + split), -GAP - 0.014 - 0.035, 0.5 * (z[0] + z[1])])
        front += bar_handle(handle, "x", 0.10, 0.035, 0.006, dark)
        moving.append(
            slide_out(
                "drawer_1", (inner[0] + 0.012, split - 0.012), box_y, z, 0.004, 0.14, WHITE, handle=handle, front=front
            )
        )
    at = np.array([split + 0.35 * (inner[1] - split), 0.0, 0.5 * (panel + height - wall)])
    moving.append(knob(1, at, (0.0, -1.0, 0.0), 0.026, metal))
    window = (split + 0.60 * (inner[1] - split), inner[1] - 0.02)
    pieces += painted(dark, box(window, (-0.002, 0.0), (at[2] - 0.02, at[2] + 0.02)))
    recipe: dict[str, float | int | str] = {"style": "slim" if slim else "full"}
    return Design("washing_machine", tuple(pieces), tuple(moving), contains=True, recipe=recipe)


def _drum(middle: tuple[float, float], radius: float, y: Span, paint: Paint) -> list[Piece]:
    """A drum that lies on its side, open to the front, with a flat strip at its lowest place."""
    wide, deep = 1.3 * radius, y[1] - y[0]
    collar = 0.03
    wedges = shell([(radius, 0.0), (radius, collar)], [(radius + 0.006, 0.0), (radius + 0.006, collar)], count=SIDES)
    wedges += shell(
        [(radius, collar), (wide, collar + 0.02)],
        [(radius + 0.006, collar), (wide + 0.006, collar + 0.02)],
        count=SIDES,
    )
    wedges += shell(
        [(wide, collar + 0.02), (wide, deep)], [(wide + 0.006, collar + 0.02), (wide + 0.006, deep)], count=SIDES
    )
    wedges.append(cylinder(wide + 0.006, (deep, deep + 0.008), count=SIDES))
    pose = DEPTH_FROM_HEIGHT.copy()
    pose[:3, 3] = (middle[0], y[0], middle[1])
    pieces = painted(paint, [solid.moved(pose) for solid in wedges])
    low = middle[1] - wide * np.cos(np.pi / SIDES)
    strip = 0.5 * wide
    return pieces + painted(
        paint, box((-strip, strip), (y[0] + collar + 0.03, y[1] - 0.004), (low, low + 0.155 * wide))
    )


def _round_door(middle: tuple[float, float], radius: float, paint: Paint, dark: Paint, metal: Paint) -> Moving:
    """A porthole hinged at its left edge, with a bar handle at the right one."""
    rim, thick, standoff = 1.22 * radius, 0.03, 0.045
    back = -GAP
    ring = shell([(0.82 * radius, 0.0), (0.82 * radius, thick)], [(rim, 0.0), (rim, thick)], count=SIDES)
    pose = DEPTH_FROM_HEIGHT.copy()
    pose[:3, 3] = (middle[0], back - thick, middle[1])
    pieces = painted(paint.darker(0.93), [solid.moved(pose) for solid in ring])
    pane = np.array([middle[0], back - 0.6 * thick, middle[1]])
    pieces += painted(Paint(dark.color, 1200.0), bar(pane, pane + [0, 0.012, 0], 0.84 * radius, count=SIDES))
    handle = np.array([middle[0] + 0.5 * (rim + 0.84 * radius), back - thick - standoff, middle[1]])
    pieces += bar_handle(handle, "z", 0.13, standoff, 0.008, metal)
    joint = Joint(
        name="door_hinge",
        type="revolute",
        part="door",
        origin=as_vector(np.array([middle[0] - rim, back - thick, middle[1]])),
        axis=(0.0, 0.0, -1.0),
        lower=0.0,
        upper=2.0,
        handle=as_vector(handle),
        handle_axis=(0.0, 0.0, 1.0),
    )
    return Moving(joint, tuple(pieces))
