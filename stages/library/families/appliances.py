"""Fridges and microwaves: thick hollow bodies, hinged doors with bar handles."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.base import as_vector
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.kit.geometry.solids import Solid, bar, box, cylinder
from scenewright.stages.library.design import (
    APPLIANCE,
    DARK_PLASTIC,
    PLASTIC,
    SCREEN,
    STEEL,
    Design,
    Moving,
    Paint,
    Piece,
    bar_handle,
    painted,
)
from scenewright.stages.library.families.storage import GAP

WHITE = Paint((242, 244, 246), 220.0)
"""White liner of appliances: colour, and density [kg/m^3]; by eye."""
SHELF_GLASS = Paint((206, 222, 226), 2400.0)
"""Glass of shelves and turntables: density [kg/m^3]; by eye."""


def _hollow(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float], wall: float) -> list[Solid]:
    """A box with thick walls, open towards -y."""
    inner = (x[0] + wall, x[1] - wall)
    return [
        box((x[0], x[0] + wall), y, z),
        box((x[1] - wall, x[1]), y, z),
        box(inner, y, (z[0], z[0] + wall)),
        box(inner, y, (z[1] - wall, z[1])),
        box(inner, (y[1] - wall, y[1]), (z[0] + wall, z[1] - wall)),
    ]


def lined_chamber(
    x: tuple[float, float], z: tuple[float, float], depth: float, wall: float, paint: Paint, liner: Paint = WHITE
) -> list[Piece]:
    """Return the hollow body of a chamber, open towards -y: outer walls in `paint`, a `liner` inside."""
    skin = 0.006
    outer = painted(paint, _hollow(x, (0.0, depth), z, wall - skin))
    inset = wall - skin
    inner = _hollow((x[0] + inset, x[1] - inset), (0.0, depth - inset), (z[0] + inset, z[1] - inset), skin)
    return outer + painted(liner, inner)


def _fridge_door(
    name: str,
    x: tuple[float, float],
    z: tuple[float, float],
    hinge: str,
    paint: Paint,
    metal: Paint,
    racks: list[float],
    wall: float,
    handle_height: float,
) -> Moving:
    """A thick door; inside it trays at the given heights, each a floor, a rail and two ends."""
    thick, standoff, radius = 0.055, 0.055, 0.011
    face = -GAP - thick
    liner = -GAP - 0.006
    pieces = painted(paint, box(x, (face, liner), z)) + painted(WHITE, box(x, (liner, -GAP), z))
    depth, rail = 0.085, 0.06
    inner = (x[0] + wall + 0.03, x[1] - wall - 0.03)
    for height in racks:
        pieces += painted(
            WHITE,
            box(inner, (-GAP, depth), (height - 0.008, height)),
            box(inner, (depth - 0.006, depth), (height, height + rail)),
            box((inner[0], inner[0] + 0.006), (-GAP, depth - 0.006), (height, height + rail)),
            box((inner[1] - 0.006, inner[1]), (-GAP, depth - 0.006), (height, height + rail)),
        )
    free = x[0] + 0.05 if hinge == "right" else x[1] - 0.05
    length = float(np.clip(0.4 * (z[1] - z[0]), 0.18, 0.45))
    handle = np.array([free, face - standoff, handle_height])
    pieces += bar_handle(handle, "z", length, standoff, radius, metal)
    joint = Joint(
        name=f"{name}_hinge",
        type="revolute",
        part=name,
        axis=(0.0, 0.0, 1.0) if hinge == "right" else (0.0, 0.0, -1.0),
        origin=as_vector(np.array([x[1] if hinge == "right" else x[0], -GAP, 0.5 * (z[0] + z[1])])),
        lower=0.0,
        upper=2.0,
        handle=as_vector(handle),
        handle_axis=(0.0, 0.0, 1.0),
    )
    return Moving(joint, tuple(pieces))


def fridge(random: np.random.Generator, style: int) -> Design:
    """Return a fridge: tall with one door, with a freezer door above, with one below, or a small one."""
    kind = ("single", "top_freezer", "bottom_freezer", "small")[style % 4]
    width, depth = float(random.uniform(0.56, 0.66)), float(random.uniform(0.50, 0.56))
    height = float(
        {"single": random.uniform(1.35, 1.6), "small": random.uniform(0.84, 0.95)}.get(kind, random.uniform(1.6, 1.8))
    )
    paint, metal = APPLIANCE.sample(random), STEEL.sample(random)
    hinge = "right" if random.random() < 0.7 else "left"
    wall, foot = 0.04, 0.03
    x = (-width / 2, width / 2)
    split = {"top_freezer": foot + 0.68 * (height - foot), "bottom_freezer": foot + 0.36 * (height - foot)}.get(kind)
    chambers = [(foot, height)] if split is None else [(foot, split), (split, height)]
    main = 1 if kind == "bottom_freezer" else 0
    pieces, moving = [], []
    pieces += painted(DARK_PLASTIC.sample(random), box((x[0] + 0.02, x[1] - 0.02), (0.04, depth - 0.02), (0.0, foot)))
    for number, z in enumerate(chambers):
        name = "door" if number == main else "freezer_door"
        pieces += lined_chamber(x, z, depth, wall, paint)
        inner = (z[0] + wall, z[1] - wall)
        span = (x[0] + wall, x[1] - wall)
        shelves = (
            max(1, round((inner[1] - inner[0]) / 0.31))
            if number == main
            else max(0, round((inner[1] - inner[0]) / 0.3) - 1)
        )
        for k in range(shelves - (1 if number == main and shelves > 1 else 0)):
            top = inner[0] + (k + 1) * (inner[1] - inner[0]) / shelves
            if top > inner[1] - 0.12:
                continue
            # the shelf stops before the door trays
            pieces += painted(SHELF_GLASS, box(span, (0.10, depth - wall), (top - 0.008, top)))
        racks = (
            list(np.linspace(inner[0] + 0.06, inner[1] - 0.22, 3 if inner[1] - inner[0] > 0.7 else 2))
            if number == main
            else []
        )
        below_split = split is not None and number == 0
        at = z[1] - 0.30 if below_split and kind == "top_freezer" else (z[1] - 0.16 if below_split else z[0] + 0.32)
        at = min(max(at, z[0] + 0.14), z[1] - 0.14) if number != main else at
        if kind in ("single", "small"):
            at = foot + 0.62 * (height - foot)
        panel = (z[0] + GAP, z[1] - GAP / 2)
        moving.append(
            _fridge_door(name, x, panel, hinge, paint.darker(1.02), metal, [float(r) for r in racks], wall, at)
        )
    moving.sort(key=lambda link: link.joint.part)
    return Design("fridge", tuple(pieces), tuple(moving), contains=True, recipe={"style": kind, "hinge": hinge})


def microwave(random: np.random.Generator, style: int) -> Design:
    """Return a microwave oven: hollow cavity with a turntable, door hinged at the left, controls at the right."""
    width, depth, height = (
        float(random.uniform(0.46, 0.54)),
        float(random.uniform(0.34, 0.40)),
        float(random.uniform(0.28, 0.32)),
    )
    paint = (APPLIANCE if style % 2 else DARK_PLASTIC).sample(random)
    paint = Paint(paint.color, 450.0)
    metal, dark = STEEL.sample(random), SCREEN.sample(random)
    foot, wall, panel = 0.012, 0.022, 0.10
    split = width / 2 - panel
    pieces = []
    for sx in (-1, 1):
        for y in (0.04, depth - 0.04):
            pieces += painted(
                DARK_PLASTIC.sample(random), cylinder(0.015, (0.0, foot), (sx * (width / 2 - 0.05), y), count=10)
            )
    body = _hollow((-width / 2, split), (0.0, depth), (foot, height), wall)
    pieces += painted(paint, body)
    pieces += painted(paint, box((split, width / 2), (-0.03, depth), (foot, height)))
    middle = (-width / 2 + split) / 2
    pieces += painted(
        SHELF_GLASS, cylinder(0.13, (foot + wall + 0.004, foot + wall + 0.010), (middle, depth / 2 - 0.01), count=24)
    )
    pieces += painted(
        DARK_PLASTIC.sample(random),
        cylinder(0.03, (foot + wall, foot + wall + 0.004), (middle, depth / 2 - 0.01), count=12),
    )
    face = -0.03
    pieces += painted(
        dark, box((split + 0.012, width / 2 - 0.012), (face - 0.002, face), (height - 0.07, height - 0.03))
    )
    buttons = PLASTIC.sample(random)
    if style % 2:
        for share in (0.35, 0.62):
            at = np.array([split + panel / 2, face, foot + share * (height - 0.08 - foot)])
            pieces += painted(metal, bar(at, at + np.array([0, -0.015, 0]), 0.02, count=14))
    else:
        for row in range(3):
            for column in range(2):
                left, low = split + 0.018 + column * 0.036, foot + 0.03 + row * 0.045
                pieces += painted(buttons, box((left, left + 0.026), (face - 0.003, face), (low, low + 0.026)))
    thick, standoff = 0.028, 0.052
    x, z = (-width / 2, split - GAP), (foot, height)
    back = -GAP
    door = painted(
        paint.darker(1.05),
        box(x, (back - thick, back), (z[0], z[0] + 0.045)),
        box(x, (back - thick, back), (z[1] - 0.045, z[1])),
    )
    door += painted(paint.darker(1.05), box((x[0], x[0] + 0.04), (back - thick, back), (z[0] + 0.045, z[1] - 0.045)))
    door += painted(paint.darker(1.05), box((x[1] - 0.06, x[1]), (back - thick, back), (z[0] + 0.045, z[1] - 0.045)))
    door += painted(
        dark, box((x[0] + 0.04, x[1] - 0.06), (back - thick + 0.004, back - 0.004), (z[0] + 0.045, z[1] - 0.045))
    )
    handle = np.array([x[1] - 0.03, back - thick - standoff, 0.5 * (z[0] + z[1])])
    door += bar_handle(handle, "z", 0.72 * (z[1] - z[0]), standoff, 0.009, metal)
    joint = Joint(
        name="door_hinge",
        type="revolute",
        part="door",
        origin=as_vector(np.array([x[0], back, 0.5 * (z[0] + z[1])])),
        axis=(0.0, 0.0, -1.0),
        lower=0.0,
        upper=1.92,
        handle=as_vector(handle),
        handle_axis=(0.0, 0.0, 1.0),
    )
    return Design("microwave", tuple(pieces), (Moving(joint, tuple(door)),), contains=True, recipe={"style": style % 2})
