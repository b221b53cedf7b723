"""Furniture and fittings of training rooms, varied far beyond the library: every draw is another shape.

A maker takes a random generator and returns one mesh that stands on z = 0 with its back at y = 0 and its front towards
-y (what hangs: z = 0 is its lower edge). They serve pictures, not physics: pieces may overlap, nothing moves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import trimesh

Random = np.random.Generator
Where = Literal["floor", "wall_floor", "wall", "ceiling"]
Span = tuple[float, float]


def color(random: Random) -> np.ndarray:
    """Return (4,) uint8: mostly the greys, woods and whites of furniture, else anything."""
    kind = random.random()
    if kind < 0.25:
        rgb = np.full(3, random.uniform(15, 90))
    elif kind < 0.45:
        rgb = np.full(3, random.uniform(170, 250))
    elif kind < 0.65:
        rgb = np.array([1.0, random.uniform(0.65, 0.85), random.uniform(0.4, 0.7)]) * random.uniform(70, 220)
    else:
        rgb = random.uniform(10, 245, 3)
    return np.array([*np.clip(rgb + random.normal(0, 4, 3), 5, 250), 255]).astype(np.uint8)


def painted(mesh: trimesh.Trimesh, paint: np.ndarray) -> trimesh.Trimesh:
    """Return the mesh with this colour (4,), or one for each of its faces (F, 4), uint8."""
    mesh.visual.face_colors = paint  # type: ignore[union-attr]
    return mesh


def box(x: Span, y: Span, z: Span, paint: np.ndarray) -> trimesh.Trimesh:
    """Return a painted box between these bounds [m]."""
    mesh = trimesh.creation.box(bounds=np.array([[x[0], y[0], z[0]], [x[1], y[1], z[1]]]))
    return painted(mesh, paint)


def soft(x: Span, y: Span, z: Span, paint: np.ndarray, radius: float) -> trimesh.Trimesh:
    """Return a painted box with rounded edges."""
    low, high = np.array([x[0], y[0], z[0]]), np.array([x[1], y[1], z[1]])
    radius = min(radius, 0.45 * float((high - low).min()))
    ball = trimesh.creation.icosphere(subdivisions=1, radius=radius).vertices
    corners = np.stack(np.meshgrid(*zip(low + radius, high - radius, strict=True)), axis=-1).reshape(-1, 3)
    mesh = trimesh.convex.convex_hull((corners[:, None] + ball[None]).reshape(-1, 3))
    return painted(mesh, paint)


def rod(start: np.ndarray, end: np.ndarray, radius: float, paint: np.ndarray, sections: int = 8) -> trimesh.Trimesh:
    """Return a painted rod between two points [m]."""
    mesh = trimesh.creation.cylinder(radius=radius, segment=np.stack([start, end]), sections=sections)
    return painted(mesh, paint)


def disc(x: float, y: float, z: Span, radius: float, paint: np.ndarray, top: float | None = None) -> trimesh.Trimesh:
    """Return an upright painted cylinder, or a frustum with another radius at the top."""
    mesh = trimesh.creation.cylinder(radius=1.0, height=z[1] - z[0], sections=20)
    wide = np.where(mesh.vertices[:, 2] > 0, radius if top is None else top, radius)
    mesh.vertices = np.column_stack([mesh.vertices[:, :2] * wide[:, None], mesh.vertices[:, 2]])
    mesh.apply_translation([x, y, 0.5 * (z[0] + z[1])])
    return painted(mesh, paint)


def join(parts: list[trimesh.Trimesh]) -> trimesh.Trimesh:
    """Return the parts as one mesh."""
    return trimesh.util.concatenate(parts)  # type: ignore[return-value]


def legs(x: Span, y: Span, height: float, paint: np.ndarray, random: Random) -> list[trimesh.Trimesh]:
    """Return what holds a board up: four legs, two panels or trestles, one pedestal, or a sledge of rods."""
    kind, thick = int(random.integers(5)), float(random.uniform(0.02, 0.08))
    inset = float(random.uniform(0.0, 0.12))
    xs, ys = (x[0] + inset, x[1] - inset), (y[0] + inset, y[1] - inset)
    middle = (0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1]))
    if kind <= 1:
        lean = float(random.choice([0.0, 0.0, 0.08]))
        ends = [(a, b) for a in xs for b in ys]
        out = [np.array([np.sign(a - middle[0]) * lean, np.sign(b - middle[1]) * lean, 0.0]) for a, b in ends]
        return [
            rod(np.array([a, b, 0.0]) + o, np.array([a, b, height]), thick / 2, paint, 4 if kind else 10)
            for (a, b), o in zip(ends, out, strict=True)
        ]
    if kind == 2:
        return [box((a - thick / 2, a + thick / 2), ys, (0, height), paint) for a in xs]
    if kind == 3 and x[1] - x[0] < 1.6:
        foot = float(random.uniform(0.2, 0.42)) * min(x[1] - x[0], y[1] - y[0])
        return [disc(*middle, (0, 0.03), foot, paint), disc(*middle, (0, height), thick / 1.5, paint)]
    parts = []
    for a in xs:
        parts.append(rod(np.array([a, ys[0], 0.02]), np.array([a, ys[1], 0.02]), 0.02, paint))
        parts += [rod(np.array([a, b, 0.02]), np.array([a, b, height]), 0.02, paint) for b in ys]
    return parts


def table(random: Random) -> trimesh.Trimesh:
    """A table: round, oval or rectangular, low to bar height; long ones may be several pushed together."""
    height = float(
        random.choice(
            [random.uniform(0.3, 0.52), random.uniform(0.66, 0.8), random.uniform(0.9, 1.1)], p=[0.3, 0.6, 0.1]
        )
    )
    top, frame, thick = color(random), color(random), float(random.uniform(0.012, 0.07))
    if random.random() < 0.3:
        across = float(random.uniform(0.25, 0.75))
        board = disc(0, 0, (height - thick, height), across, top)
        board.apply_scale([1.0, float(random.choice([1.0, random.uniform(0.6, 1.0)])), 1.0])
        return join(
            [board, *legs((-0.7 * across, 0.7 * across), (-0.6 * across, 0.6 * across), height - thick, frame, random)]
        )
    depth = float(random.uniform(0.45, 1.1))
    length = float(random.uniform(0.8, 1.8)) * depth
    parts = []
    for k in range(int(random.choice([1, 2, 3], p=[0.7, 0.18, 0.12]))):
        x = (k * (length + 0.004), k * (length + 0.004) + length)
        if random.random() < 0.25:
            parts.append(soft(x, (0, depth), (height - thick, height), top, 0.03))
        else:
            parts.append(box(x, (0, depth), (height - thick, height), top))
        if random.random() < 0.4:
            parts.append(
                box((x[0] + 0.05, x[1] - 0.05), (0.06, depth - 0.06), (height - thick - 0.08, height - thick), frame)
            )
        parts += legs(x, (0, depth), height - thick, frame, random)
    if height < 0.55 and random.random() < 0.4:
        parts.append(box((0.05, length - 0.05), (0.05, depth - 0.05), (0.1, 0.13), top))
    return join(parts)


def desk(random: Random) -> trimesh.Trimesh:
    """A writing desk with a board at the back, a block of drawers, or an arm around the corner."""
    width, depth, height = random.uniform([1.0, 0.55, 0.68], [2.0, 0.9, 0.8])
    top, frame = color(random), color(random)
    parts = [box((0, width), (-depth, 0), (height - 0.03, height), top)]
    parts += legs((0, width), (-depth, 0), height - 0.03, frame, random)
    if random.random() < 0.5:
        at = float(random.choice([0.03, width - 0.48]))
        parts += block_of_fronts((at, at + 0.45), (-depth + 0.05, -0.05), (0.05, height - 0.04), color(random), random)
    if random.random() < 0.3:
        parts.append(box((0, width), (-0.03, 0), (0.3, height - 0.03), frame))
    if random.random() < 0.2:
        parts.append(
            box(
                (width - depth, width), (-depth - float(random.uniform(0.4, 1.0)), -depth), (height - 0.03, height), top
            )
        )
    return join(parts)


def seat_cushions(x: Span, y: Span, z: Span, number: int, paint: np.ndarray, radius: float) -> list[trimesh.Trimesh]:
    """Return cushions side by side along x."""
    edges = np.linspace(x[0], x[1], number + 1)
    return [soft((a + 0.004, b - 0.004), y, z, paint, radius) for a, b in zip(edges[:-1], edges[1:], strict=True)]


def sofa(random: Random) -> trimesh.Trimesh:
    """A sofa for one to five: straight, with a chaise longue, or around a corner; with or without arms and feet."""
    places = int(random.choice([1, 2, 3, 4, 5], p=[0.15, 0.25, 0.3, 0.2, 0.1]))
    width, depth = places * float(random.uniform(0.52, 0.75)), float(random.uniform(0.75, 1.1))
    seat, back = float(random.uniform(0.34, 0.48)), float(random.uniform(0.6, 1.0))
    rest, low = float(random.uniform(0.12, 0.3)), float(random.choice([0.02, 0.05, 0.14]))
    radius, number = float(random.uniform(0.02, 0.1)), int(random.choice([1, max(1, places)]))
    paint, other = color(random), color(random)
    cushion = paint if random.random() < 0.7 else other
    parts = [soft((0, width), (-depth, 0), (low, seat - 0.13), paint, 0.02)]
    parts += seat_cushions((0, width), (-depth, -rest), (seat - 0.16, seat), number, cushion, radius)
    parts.append(soft((0, width), (-0.12, 0), (low, back - 0.06), paint, 0.05))
    parts += seat_cushions((0, width), (-rest, -0.05), (seat - 0.02, back), number, cushion, radius)
    arm, arms = float(random.uniform(0.08, 0.28)), int(random.choice([0, 1, 2, 2, 2]))
    for x in ((-arm, 0.0), (width, width + arm))[:arms]:
        parts.append(soft(x, (-depth, 0), (low, seat + float(random.uniform(0.05, 0.25))), paint, radius))
    if places > 1 and random.random() < 0.4:
        reach = depth + float(random.uniform(0.4, 1.6))
        side = float(random.uniform(0.7, 1.0))
        parts.append(soft((width - side, width), (-reach, -depth), (low, seat - 0.1), paint, 0.03))
        parts.append(soft((width - side, width), (-reach, -depth), (seat - 0.14, seat), cushion, radius))
        if random.random() < 0.6:
            parts.append(soft((width, width + rest), (-reach, 0), (low, back), paint, radius))
    if low > 0.03:
        parts += [
            rod(np.array([x, y, 0]), np.array([x, y, low + 0.02]), 0.02, other)
            for x in (0.05, width - 0.05)
            for y in (-depth + 0.05, -0.05)
        ]
    for _ in range(int(random.choice([0, 0, 1, 2, 3]))):
        pillow = soft((-0.22, 0.22), (-0.07, 0.07), (-0.2, 0.2), color(random), 0.07)
        pillow.apply_transform(trimesh.transformations.euler_matrix(*random.normal(0, 0.3, 3)))
        pillow.apply_translation([random.uniform(0.2, max(width - 0.2, 0.25)), -rest - 0.08, seat + 0.17])
        parts.append(pillow)
    mesh = join(parts)
    if random.random() < 0.5:
        mesh.apply_scale([-1.0, 1.0, 1.0])
        mesh.invert()
    return mesh


def chair(random: Random) -> trimesh.Trimesh:
    """A chair: four legs, cantilever, a star with castors, or a column; shell, slats, mesh or cushion; arms or none."""
    width, depth = random.uniform([0.38, 0.38], [0.56, 0.54])
    seat, back = float(random.uniform(0.4, 0.52)), float(random.uniform(0.72, 1.15))
    paint, frame = color(random), color(random)
    x, y, base = (-width / 2, width / 2), (-depth, 0.0), int(random.integers(4))
    parts, thick = [], float(random.uniform(0.015, 0.09))
    parts.append(
        soft(x, y, (seat - thick, seat), paint, 0.03) if thick > 0.035 else box(x, y, (seat - thick, seat), paint)
    )
    if base == 0:
        parts += [
            rod(np.array([a, b, 0]), np.array([0.9 * a, b, seat - thick]), 0.016, frame)
            for a in x
            for b in (y[0] + 0.03, y[1] - 0.02)
        ]
    elif base == 1:
        for a in x:
            parts.append(rod(np.array([a, y[0], 0.015]), np.array([a, y[1], 0.015]), 0.013, frame))
            parts.append(rod(np.array([a, y[0], 0.015]), np.array([a, y[0], seat]), 0.013, frame))
    else:
        number = 5 if base == 2 else int(random.choice([4, 12]))
        for angle in np.arange(number) * 2 * np.pi / number:
            end = np.array([0.3 * np.cos(angle), 0.3 * np.sin(angle) - depth / 2, 0.05])
            parts.append(rod(end, np.array([0, -depth / 2, 0.1]), 0.02, frame, 6))
            if base == 2:
                parts.append(disc(end[0], end[1], (0, 0.06), 0.028, frame))
        parts.append(rod(np.array([0, -depth / 2, 0.08]), np.array([0, -depth / 2, seat]), 0.03, frame))
    lean, style = float(random.uniform(0.0, 0.12)), int(random.integers(4))
    rise: list[trimesh.Trimesh] = []
    gap = float(random.choice([0.0, random.uniform(0.05, 0.25)]))
    if style == 0:
        rise.append(soft(x, (-0.07, 0.0), (seat + gap, back), paint, 0.03))
    elif style == 1:
        rise.append(box(x, (-0.02, 0.0), (seat + gap, back), paint))
    elif style == 2:
        number = int(random.integers(3, 8))
        rise += [rod(np.array([a, 0, seat]), np.array([a, 0, back]), 0.01, frame) for a in np.linspace(*x, number)]
        rise.append(box(x, (-0.015, 0.015), (back - 0.08, back), paint))
    else:
        number = int(random.integers(2, 5))
        rise += [rod(np.array([a, 0, seat]), np.array([a, 0, back]), 0.014, frame) for a in x]
        rise += [box(x, (-0.012, 0.012), (h - 0.04, h), paint) for h in np.linspace(seat + 0.15, back, number)]
    if gap:
        rise.append(rod(np.array([0, 0, seat]), np.array([0, 0, back - 0.1]), 0.02, frame))
    behind = join(rise)
    shear = np.eye(4)
    shear[1, 2], shear[1, 3] = lean, -lean * seat
    behind.apply_transform(shear)
    parts.append(behind)
    if random.random() < 0.4:
        for a in x:
            parts.append(box((a - 0.025, a + 0.025), (y[0] + 0.08, y[1]), (seat + 0.18, seat + 0.22), frame))
            parts.append(rod(np.array([a, -depth / 2, seat]), np.array([a, -depth / 2, seat + 0.2]), 0.015, frame))
    return join(parts)


def stool(random: Random) -> trimesh.Trimesh:
    """A stool without a back, or a pouf."""
    height, radius, paint = float(random.uniform(0.35, 0.8)), float(random.uniform(0.14, 0.3)), color(random)
    if random.random() < 0.35:
        return soft((-radius, radius), (-radius, radius), (0, min(height, 0.5)), paint, 0.12)
    parts = [disc(0, 0, (height - 0.05, height), radius, paint)]
    return join([*parts, *legs((-radius, radius), (-radius, radius), height - 0.05, color(random), random)])


def block_of_fronts(x: Span, y: Span, z: Span, paint: np.ndarray, random: Random) -> list[trimesh.Trimesh]:
    """Return a carcass with a grid of fronts (seams between them) and handles, knobs or none, at its -y side."""
    columns = max(1, round((x[1] - x[0]) / float(random.uniform(0.35, 0.7))))
    rows = int(random.choice([1, 1, 2, 3, 4])) if z[1] - z[0] > 0.35 else 1
    front = paint if random.random() < 0.6 else color(random)
    metal, style, seam = color(random), int(random.integers(4)), float(random.uniform(0.002, 0.008))
    thick = float(random.uniform(0.008, 0.025))
    parts = [box(x, (y[0] + thick, y[1]), z, paint)]
    xs, zs = np.linspace(*x, columns + 1), np.linspace(*z, rows + 1)
    for left, right in zip(xs[:-1], xs[1:], strict=True):
        for low, high in zip(zs[:-1], zs[1:], strict=True):
            parts.append(box((left + seam, right - seam), (y[0], y[0] + thick), (low + seam, high - seam), front))
            middle = 0.5 * (left + right)
            if style == 1:
                level = high - min(0.08, 0.3 * (high - low))
                parts.append(
                    box((middle - 0.08, middle + 0.08), (y[0] - 0.03, y[0]), (level - 0.008, level + 0.008), metal)
                )
            elif style == 2:
                side = right - 0.05
                parts.append(
                    box(
                        (side - 0.008, side + 0.008),
                        (y[0] - 0.03, y[0]),
                        (0.5 * (low + high) - 0.07, 0.5 * (low + high) + 0.07),
                        metal,
                    )
                )
            elif style == 3:
                parts.append(
                    box((middle - 0.015, middle + 0.015), (y[0] - 0.025, y[0]), (high - 0.07, high - 0.04), metal)
                )
    return parts


def cabinet(random: Random) -> trimesh.Trimesh:
    """A cabinet: sideboard, chest of drawers, tall cabinet or wardrobe, on a plinth, on feet or flush."""
    tall = random.random() < 0.35
    width = float(random.uniform(0.4, 2.2))
    depth, height = (
        float(random.uniform(0.3, 0.65)),
        float(random.uniform(1.3, 2.3) if tall else random.uniform(0.4, 1.1)),
    )
    paint, foot = color(random), float(random.choice([0.0, 0.06, 0.15]))
    parts = block_of_fronts((0, width), (-depth, 0), (foot, height), paint, random)
    if foot:
        parts.append(box((0.03, width - 0.03), (-depth + 0.06, 0), (0, foot), color(random)))
    if random.random() < 0.4:
        parts.append(box((-0.015, width + 0.015), (-depth - 0.015, 0), (height, height + 0.03), color(random)))
    return join(parts)


def counter(random: Random) -> trimesh.Trimesh:
    """A run of base units under one worktop, perhaps with a sink's tap, a hob and a splashback: one thing."""
    length, depth, height = random.uniform([1.0, 0.55, 0.8], [4.0, 0.7, 0.96])
    paint, top = color(random), color(random)
    parts = block_of_fronts((0, length), (-depth, 0), (0.1, height - 0.04), paint, random)
    parts.append(box((0, length), (-depth + 0.06, 0), (0, 0.1), color(random)))
    parts.append(box((-0.01, length + 0.01), (-depth - 0.02, 0), (height - 0.04, height), top))
    if random.random() < 0.4:
        parts.append(box((0, length), (-0.02, 0), (height, height + float(random.uniform(0.05, 0.6))), color(random)))
    if random.random() < 0.4:
        x = float(random.uniform(0.3, length - 0.3))
        parts.append(rod(np.array([x, -0.1, height]), np.array([x, -0.1, height + 0.25]), 0.015, color(random)))
        parts.append(rod(np.array([x, -0.1, height + 0.25]), np.array([x, -0.3, height + 0.22]), 0.012, color(random)))
    if random.random() < 0.3:
        reach = float(random.uniform(0.6, 2.0))
        parts += block_of_fronts((0, depth), (-depth - reach, -depth), (0.1, height - 0.04), paint, random)
        parts.append(box((-0.01, depth), (-depth - reach, -depth), (height - 0.04, height), top))
    return join(parts)


def wall_cabinet(random: Random) -> trimesh.Trimesh:
    """A run of cabinets that hang on a wall."""
    length, depth, height = random.uniform([0.4, 0.25, 0.3], [3.0, 0.42, 0.95])
    return join(block_of_fronts((0, length), (-depth, 0), (0, height), color(random), random))


def shelf(random: Random) -> trimesh.Trimesh:
    """An open shelf or bookcase, filled with books and things, with or without sides and back."""
    width, depth, height = random.uniform([0.5, 0.2, 0.6], [1.8, 0.45, 2.2])
    paint, thick = color(random), float(random.uniform(0.012, 0.04))
    levels = np.linspace(float(random.uniform(0.0, 0.2)), height - thick, int(random.integers(3, 8)))
    parts = [box((0, width), (-depth, 0), (z, z + thick), paint) for z in levels]
    if random.random() < 0.75:
        parts += [box((a, a + thick), (-depth, 0), (0, height), paint) for a in (0.0, width - thick)]
    else:
        parts += [
            rod(np.array([a, b, 0]), np.array([a, b, height]), 0.015, paint, 4)
            for a in (0.01, width - 0.01)
            for b in (-depth + 0.01, -0.01)
        ]
    if random.random() < 0.6:
        parts.append(box((0, width), (-0.008, 0), (0, height), paint if random.random() < 0.5 else color(random)))
    full = float(random.random())
    for low, high in zip(levels[:-1], levels[1:], strict=True):
        x = thick
        while x < width - 0.08 and random.random() < full:
            wide, tall = float(random.uniform(0.015, 0.06)), float(random.uniform(0.4, 0.9)) * (high - low - thick)
            if random.random() < 0.2:
                wide = float(random.uniform(0.1, 0.3))
            end = min(x + wide, width - thick)
            parts.append(
                box(
                    (x, end),
                    (-depth * float(random.uniform(0.5, 0.95)), -0.02),
                    (low + thick, low + thick + tall),
                    color(random),
                )
            )
            x = end + float(random.choice([0.001, 0.001, 0.1]))
    return join(parts)


def fridge(random: Random) -> trimesh.Trimesh:
    """A fridge: one or two doors with handles, white to black."""
    width, depth, height = random.uniform([0.5, 0.5, 0.8], [0.95, 0.75, 2.0])
    paint = np.array([*np.full(3, random.choice([235, 200, 160, 40]) + random.uniform(-15, 15)), 255]).astype(np.uint8)
    split = float(random.uniform(0.3, 0.7)) * height
    handle = color(random)
    parts = [box((0, width), (-depth + 0.06, 0), (0.03, height), paint)]
    for low, high in ((0.05, split - 0.005), (split + 0.005, height)) if height > 1.2 else ((0.05, height),):
        parts.append(soft((0, width), (-depth, -depth + 0.06), (low, high), paint, 0.012))
        if random.random() < 0.7:
            parts.append(
                box((0.03, 0.055), (-depth - 0.045, -depth), (0.6 * low + 0.4 * high, 0.3 * low + 0.7 * high), handle)
            )
    return join(parts)


def bed(random: Random) -> trimesh.Trimesh:
    """A bed with mattress, blanket and pillows, its head at the wall."""
    width, length, height = random.uniform([0.8, 1.85, 0.35], [2.0, 2.2, 0.65])
    frame, sheet = color(random), color(random)
    parts = [
        box((0, width), (-length, 0), (0.08, 0.7 * height), frame),
        soft((0.02, width - 0.02), (-length + 0.02, -0.02), (0.5 * height, height), sheet, 0.05),
        soft(
            (-0.03, width + 0.03),
            (-length - 0.02, -float(random.uniform(0.5, 1.0))),
            (0.4 * height, height + 0.05),
            color(random),
            0.07,
        ),
    ]
    if random.random() < 0.7:
        parts.append(box((0, width), (-0.06, 0), (0, height + float(random.uniform(0.2, 0.7))), frame))
    for k in range(1 + (width > 1.2)):
        x = (0.1 + k * width / 2, 0.1 + k * width / 2 + min(0.7, width - 0.2))
        parts.append(soft((x[0], min(x[1], width - 0.05)), (-0.5, -0.1), (height, height + 0.14), color(random), 0.07))
    return join(parts)


def monitor(random: Random) -> trimesh.Trimesh:
    """A flat screen on a foot."""
    width = float(random.uniform(0.4, 1.4))
    height, dark = width * float(random.uniform(0.5, 0.68)), _dark(random)
    gap, foot = float(random.uniform(0.03, 0.16)), color(random)
    parts = [box((-width / 2, width / 2), (-0.03, 0.0), (gap, gap + height), dark)]
    parts.append(
        box(
            (-width / 2 + 0.015, width / 2 - 0.015),
            (-0.032, -0.03),
            (gap + 0.015, gap + height - 0.015),
            _dark(random) if random.random() < 0.6 else color(random),
        )
    )
    parts.append(box((-0.03, 0.03), (0.0, 0.03), (0, gap + 0.4 * height), foot))
    parts.append(box((-0.2 * width, 0.2 * width), (-0.12, 0.1), (0, 0.015), foot))
    return join(parts)


def wall_screen(random: Random) -> trimesh.Trimesh:
    """A television on the wall."""
    width = float(random.uniform(0.6, 1.7))
    height, deep = width * float(random.uniform(0.52, 0.62)), float(random.uniform(0.03, 0.12))
    return join(
        [
            box((0, width), (-deep, 0), (0, height), _dark(random)),
            box(
                (0.02, width - 0.02),
                (-deep - 0.002, -deep),
                (0.02, height - 0.02),
                _dark(random) if random.random() < 0.7 else color(random),
            ),
        ]
    )


def _dark(random: Random) -> np.ndarray:
    return np.array([*(np.full(3, random.uniform(5, 45)) + random.uniform(0, 6, 3)), 255]).astype(np.uint8)


def laptop(random: Random) -> trimesh.Trimesh:
    """An open laptop."""
    width, depth, paint = float(random.uniform(0.28, 0.4)), float(random.uniform(0.2, 0.28)), color(random)
    lid = box((0, width), (0, 0.008), (0, depth), paint)
    lid.apply_transform(trimesh.transformations.rotation_matrix(-float(random.uniform(0.0, 0.6)), [1, 0, 0]))
    lid.apply_translation([0, 0, 0.015])
    return join([box((0, width), (-depth, 0), (0, 0.018), paint), lid])


def plant(random: Random) -> trimesh.Trimesh:
    """A plant in a pot: a bush, a palm, a rubber tree or hanging leaves."""
    pot, wide = float(random.uniform(0.1, 0.45)), float(random.uniform(0.07, 0.25))
    crown, size = float(random.uniform(0.15, 1.4)), float(random.uniform(0.05, 0.35))
    green = np.array([random.uniform(20, 110), random.uniform(70, 180), random.uniform(15, 90)])
    parts = [disc(0, 0, (0, pot), wide * float(random.uniform(0.6, 1.0)), color(random), wide)]
    number = int(random.integers(25, 140))
    stems = random.normal(0, 1, (number, 3)) * [0.35, 0.35, 0.5]
    palm = random.random() < 0.4
    middle = np.array([0, 0, pot + (0.15 if palm else 0.5) * crown])
    roots = middle + (0.1 if palm else 0.45) * crown * stems
    roots[:, 2] = np.clip(roots[:, 2], pot * 0.7, pot + crown)
    out = stems / np.linalg.norm(stems, axis=1, keepdims=True) * [1, 1, 0.6] + [0, 0, random.uniform(-0.3, 0.9)]
    long = size * random.uniform(0.6, 1.4, (number, 1)) * (2.5 if palm else 1.0)
    tips = roots + long * out + (np.array([0, 0, -0.5]) * long if palm else 0)
    tips[:, 2] = np.maximum(tips[:, 2], 0.03)
    across = np.cross(out, random.normal(0, 1, (number, 3)))
    across *= (0.12 if palm else 0.3) * size / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-6)
    bend = 0.5 * (roots + tips) + 0.15 * long * [0, 0, 1]
    vertices = np.stack([roots, bend - across, tips, bend + across], axis=1).reshape(-1, 3)
    faces = (np.array([[0, 1, 3], [1, 2, 3]])[None] + 4 * np.arange(number)[:, None, None]).reshape(-1, 3)
    leaves = trimesh.Trimesh(vertices, faces, process=False)
    shades = np.clip(green * random.uniform(0.6, 1.4, (number, 1)), 5, 250).repeat(2, axis=0)
    paint = np.column_stack([shades, np.full(len(shades), 255)]).astype(np.uint8)
    painted(leaves, paint)
    parts.append(leaves)
    for k in range(0, number, 6):
        parts.append(rod(np.array([0, 0, 0.8 * pot]), roots[k] + 1e-3, 0.006, paint[2 * k], 4))
    return join(parts)


def lamp(random: Random) -> trimesh.Trimesh:
    """A standing lamp, or a small one for a table: foot, pole, shade; straight or with an arch."""
    height, shade = float(random.choice([random.uniform(0.3, 0.6), random.uniform(1.2, 1.9)])), color(random)
    frame, wide = color(random), float(random.uniform(0.08, 0.25))
    reach = float(random.choice([0.0, 0.0, random.uniform(0.1, 0.5)]))
    end = np.array([reach, 0, height])
    return join(
        [
            disc(0, 0, (0, 0.025), 0.5 * wide + 0.05, frame),
            rod(np.array([0, 0, 0]), np.array([0, 0, 0.85 * height]), 0.012, frame),
            rod(np.array([0, 0, 0.85 * height]), end, 0.012, frame),
            disc(
                reach, 0, (height - 0.2 * min(height, 1.0), height), wide, shade, wide * float(random.uniform(0.3, 1.0))
            ),
        ]
    )


def pendant_lamp(random: Random) -> trimesh.Trimesh:
    """A lamp for the ceiling; its upper end is at the largest z."""
    wide, drop = float(random.uniform(0.08, 0.35)), float(random.uniform(0.05, 1.0))
    tall = float(random.uniform(0.05, 0.3))
    return join(
        [
            disc(0, 0, (0, tall), wide, color(random), wide * float(random.uniform(0.1, 1.0))),
            rod(np.array([0, 0, tall - 0.01]), np.array([0, 0, tall + drop]), 0.006, color(random)),
        ]
    )


def bin_(random: Random) -> trimesh.Trimesh:
    """A waste bin, open at the top or with a lid."""
    height, wide = float(random.uniform(0.25, 0.75)), float(random.uniform(0.1, 0.22))
    body = trimesh.creation.annulus(0.94 * wide, wide, height, sections=20)
    body.apply_translation([0, 0, height / 2])
    body.vertices[:, :2] *= 0.8 + 0.2 * body.vertices[:, 2:] / height
    if random.random() < 0.4:
        body.apply_scale([1, 0.65, 1])
    painted(body, color(random))
    parts = [body, disc(0, 0, (0, 0.02), 0.7 * wide, color(random))]
    if random.random() < 0.4:
        parts.append(disc(0, 0, (height - 0.02, height + 0.03), 1.02 * wide, color(random), 0.6 * wide))
    return join(parts)


def carton(random: Random) -> trimesh.Trimesh:
    """A box on the floor, closed or open with its flaps up."""
    width, depth, height = np.exp(random.uniform(np.log(0.15), np.log(0.7), 3))
    paint, x, y = color(random), (0.0, float(width)), (-float(depth), 0.0)
    height = float(height)
    if random.random() < 0.6:
        return box(x, y, (0, height), paint)
    walls = [
        box(x, (y[0], y[0] + 0.006), (0, height), paint),
        box(x, (-0.006, 0), (0, height), paint),
        box((0, 0.006), y, (0, height), paint),
        box((x[1] - 0.006, x[1]), y, (0, height), paint),
        box(x, y, (0, 0.01), paint),
    ]
    flap = box((0, 0.006), y, (0, 0.5 * x[1]), paint)
    flap.apply_transform(trimesh.transformations.rotation_matrix(-float(random.uniform(0.2, 2.3)), [0, 1, 0]))
    flap.apply_translation([0, 0, height])
    return join([*walls, flap])


def bag(random: Random) -> trimesh.Trimesh:
    """A backpack or a bag: a bulging lump with straps."""
    width, depth, height = random.uniform([0.22, 0.12, 0.3], [0.42, 0.28, 0.6])
    paint = color(random)
    lump = soft((-width / 2, width / 2), (-depth, 0), (0, height), paint, 0.12)
    pocket = soft((-0.35 * width, 0.35 * width), (-1.35 * depth, -0.8 * depth), (0.05, 0.5 * height), paint, 0.05)
    mesh = join([lump, pocket, rod(np.array([-0.05, 0, height]), np.array([0.05, 0, height + 0.06]), 0.012, paint)])
    mesh.apply_transform(trimesh.transformations.rotation_matrix(float(random.normal(0, 0.15)), [1, 0, 0]))
    mesh.apply_translation([0, 0, -mesh.bounds[0, 2]])
    return mesh


def door(random: Random) -> trimesh.Trimesh:
    """A door: leaf in a frame, perhaps ajar, with panels or panes and a handle."""
    width, height = float(random.uniform(0.7, 1.05)), float(random.uniform(1.95, 2.15))
    if random.random() < 0.15:
        width *= 1.8
    paint, frame, edge = color(random), color(random), float(random.uniform(0.03, 0.1))
    leaf = [box((0, width), (-0.03, 0), (0, height), paint)]
    if random.random() < 0.5:
        number = int(random.integers(1, 4))
        for low, high in zip(
            np.linspace(0.1, height, number + 1)[:-1], np.linspace(0, height - 0.1, number + 1)[1:], strict=True
        ):
            if high - low > 0.15:
                leaf.append(
                    box(
                        (0.12, width - 0.12),
                        (-0.035, -0.03),
                        (low, high),
                        color(random) if random.random() < 0.5 else paint,
                    )
                )
    leaf.append(rod(np.array([width - 0.07, -0.07, 1.02]), np.array([width - 0.19, -0.07, 1.02]), 0.011, color(random)))
    leaf.append(rod(np.array([width - 0.07, -0.07, 1.02]), np.array([width - 0.07, 0.0, 1.02]), 0.011, color(random)))
    turned = join(leaf)
    if random.random() < 0.25:
        turned.apply_transform(trimesh.transformations.rotation_matrix(-float(random.uniform(0.2, 1.7)), [0, 0, 1]))
    deep = float(random.uniform(0.02, 0.06))
    return join(
        [
            turned,
            box((-edge, 0), (-deep, 0.01), (0, height), frame),
            box((width, width + edge), (-deep, 0.01), (0, height), frame),
            box((-edge, width + edge), (-deep, 0.01), (height, height + edge), frame),
        ]
    )


def window(random: Random) -> trimesh.Trimesh:
    """A window: panes that are bright, dark or the sky's colour, bars, frame, sill."""
    width, height = float(random.uniform(0.5, 3.0)), float(random.uniform(0.5, 1.9))
    frame, pane = color(random), np.array([*random.uniform(150, 255, 3), 255]).astype(np.uint8)
    if random.random() < 0.3:
        pane = color(random)
    deep, edge = float(random.uniform(0.02, 0.09)), float(random.uniform(0.03, 0.09))
    parts = [box((0, width), (-0.006, 0), (0, height), pane)]
    for x in np.linspace(0, width, 1 + max(1, round(width / float(random.uniform(0.5, 1.5))))):
        parts.append(box((x - edge / 2, x + edge / 2), (-deep, 0), (0, height), frame))
    for z in [0.0, height, *([float(random.uniform(0.3, 0.7)) * height] if random.random() < 0.3 else [])]:
        parts.append(box((-edge / 2, width + edge / 2), (-deep, 0), (z - edge / 2, z + edge / 2), frame))
    if random.random() < 0.5:
        parts.append(box((-0.1, width + 0.1), (-float(random.uniform(0.05, 0.3)), 0), (-edge, -edge / 2), frame))
    return join(parts)


def curtain(random: Random) -> trimesh.Trimesh:
    """A curtain in folds, or a blind of slats."""
    width, height, paint = float(random.uniform(0.3, 2.0)), float(random.uniform(0.8, 2.4)), color(random)
    if random.random() < 0.25:
        return join([box((0, width), (-0.03, 0), (z, z + 0.02), paint) for z in np.arange(0, height, 0.05)])
    number = int(24 * width) + 4
    x = np.linspace(0, width, number)
    fold = -0.06 - float(random.uniform(0.01, 0.06)) * np.sin(x * 2 * np.pi / float(random.uniform(0.06, 0.25)))
    low = np.column_stack([x, fold, np.zeros(number)])
    high = np.column_stack([x, 0.7 * fold - 0.02, np.full(number, height)])
    vertices = np.concatenate([low, high])
    k = np.arange(number - 1)
    faces = np.concatenate(
        [np.column_stack([k, k + 1, k + number]), np.column_stack([k + 1, k + number + 1, k + number])]
    )
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    return painted(mesh, paint)


def radiator(random: Random) -> trimesh.Trimesh:
    """A radiator: a ribbed panel or a row of columns; the vocabulary has no word for it."""
    width, height, paint = float(random.uniform(0.4, 2.0)), float(random.uniform(0.3, 0.9)), color(random)
    if random.random() < 0.5:
        paint = np.array([235, 235, 230, 255], dtype=np.uint8)
    step = float(random.choice([0.04, 0.06, 0.33]))
    parts = [
        box((a, min(a + 0.75 * step, width)), (-0.12, -0.03), (0, height), paint) for a in np.arange(0, width, step)
    ]
    return join([*parts, box((0, width), (-0.1, -0.05), (0.05, height - 0.05), paint)])


def picture(random: Random) -> trimesh.Trimesh:
    """A picture, poster or mirror on a wall: a frame, a mount, some blots of colour."""
    width, height = np.exp(random.uniform(np.log(0.15), np.log(1.4), 2))
    deep, frame = float(random.uniform(0.004, 0.04)), color(random)
    parts = [box((0, width), (-deep, 0), (0, height), frame)]
    edge = float(random.choice([0.0, 0.03])) + 0.001
    parts.append(box((edge, width - edge), (-deep - 0.001, -deep), (edge, height - edge), color(random)))
    for _ in range(int(random.integers(0, 8))):
        a, b = np.sort(random.uniform(edge, width - edge, 2)), np.sort(random.uniform(edge, height - edge, 2))
        if min(np.ptp(a), np.ptp(b)) > 0.01:
            parts.append(box((a[0], a[1]), (-deep - 0.002, -deep), (b[0], b[1]), color(random)))
    return join(parts)


def board(random: Random) -> trimesh.Trimesh:
    """A whiteboard, blackboard or pinboard."""
    width, height = random.uniform([0.8, 0.6], [2.6, 1.3])
    paint = np.array([240, 240, 242, 255], np.uint8) if random.random() < 0.6 else color(random)
    parts = [
        box((0, width), (-0.02, 0), (0, height), paint),
        box((0.2, width - 0.2), (-0.09, 0), (-0.02, 0.0), color(random)),
    ]
    for _ in range(int(random.integers(0, 10))):
        x, z = float(random.uniform(0, width - 0.25)), float(random.uniform(0, height - 0.35))
        parts.append(
            box(
                (x, x + float(random.uniform(0.05, 0.22))),
                (-0.022, -0.02),
                (z, z + float(random.uniform(0.05, 0.3))),
                color(random),
            )
        )
    return join(parts)


def wall_shelf(random: Random) -> trimesh.Trimesh:
    """A board on a wall with things on it, which are part of it here."""
    width, depth = random.uniform([0.4, 0.12], [1.6, 0.3])
    parts = [box((0, width), (-depth, 0), (0, 0.025), color(random))]
    x = 0.05
    while x < width - 0.1 and random.random() < 0.7:
        wide = float(random.uniform(0.02, 0.15))
        parts.append(
            box((x, x + wide), (-0.8 * depth, -0.02), (0.025, 0.025 + float(random.uniform(0.05, 0.3))), color(random))
        )
        x += wide + float(random.uniform(0.0, 0.1))
    return join(parts)


def bench(random: Random) -> trimesh.Trimesh:
    """A bench without a back."""
    width, depth, height = random.uniform([0.9, 0.28, 0.38], [1.8, 0.45, 0.5])
    paint = color(random)
    return join(
        [
            box((0, width), (-depth, 0), (height - 0.05, height), paint),
            *legs((0, width), (-depth, 0), height - 0.05, color(random), random),
        ]
    )


def oven(random: Random) -> trimesh.Trimesh:
    """A cooker: a box with a dark window, a bar and knobs."""
    width, depth, height = random.uniform([0.5, 0.55, 0.8], [0.9, 0.65, 0.95])
    metal = color(random)
    parts = [
        box((0, width), (-depth, 0), (0, height), color(random)),
        box((0.06, width - 0.06), (-depth - 0.012, -depth), (0.2, height - 0.25), _dark(random)),
        box((0.06, width - 0.06), (-depth - 0.05, -depth - 0.03), (height - 0.2, height - 0.18), metal),
        box((0.02, width - 0.02), (-depth + 0.02, -0.02), (height, height + 0.01), _dark(random)),
    ]
    parts += [
        rod(np.array([x, -depth - 0.03, height - 0.08]), np.array([x, -depth, height - 0.08]), 0.02, metal)
        for x in np.linspace(0.1, width - 0.1, 5)
    ]
    return join(parts)


def unknown(random: Random) -> trimesh.Trimesh:
    """Something that no word of the vocabulary fits: boxes, tubs, rods and lumps grown onto each other, up to the size
    of a cupboard. What the network calls an `object` it learned here."""
    size = float(np.exp(random.uniform(np.log(0.15), np.log(1.6))))
    parts: list[trimesh.Trimesh] = []
    where = np.array([0.0, 0.0, 0.0])
    paints = [color(random) for _ in range(3)]
    for _ in range(int(random.integers(2, 9))):
        edges = size * random.uniform(0.08, 0.7, 3)
        paint, kind = paints[int(random.integers(3))], int(random.integers(6))
        if kind <= 1:
            part = box((-edges[0] / 2, edges[0] / 2), (-edges[1] / 2, edges[1] / 2), (0, edges[2]), paint)
        elif kind == 2:
            part = soft((-edges[0] / 2, edges[0] / 2), (-edges[1] / 2, edges[1] / 2), (0, edges[2]), paint, 0.3 * size)
        elif kind == 3:
            part = disc(0, 0, (0, edges[2]), edges[0] / 2, paint, edges[1] / 2)
        elif kind == 4:
            part = rod(np.zeros(3), size * random.uniform([-0.5, -0.5, 0.1], [0.5, 0.5, 0.8]), 0.03 * size, paint)
        else:
            part = trimesh.creation.icosphere(subdivisions=2, radius=0.4 * edges[0])
            part.apply_translation([0, 0, 0.4 * edges[0]])
            painted(part, paint)
        if random.random() < 0.4:
            part.apply_transform(trimesh.transformations.random_rotation_matrix(random.random(3)))
        part.apply_translation(where)
        parts.append(part)
        grown = part.vertices[int(random.integers(len(part.vertices)))]
        where = np.array([*grown[:2], max(0.0, grown[2] - 0.05 * size)])
    mesh = join(parts)
    mesh.apply_translation([0, 0, -mesh.bounds[0, 2]])
    return mesh


@dataclass(frozen=True)
class Maker:
    """A kind of furniture: its class, how it is drawn, where it stands or hangs, how common it is."""

    class_name: str
    make: Callable[[Random], trimesh.Trimesh]
    where: Where
    share: float = 1.0
    heights: Span = (0.0, 0.0)
    """Where its lower edge hangs [m]."""


MAKERS = (
    Maker("table", table, "floor", 2.2),
    Maker("desk", desk, "wall_floor", 1.0),
    Maker("sofa", sofa, "wall_floor", 1.6),
    Maker("sofa", sofa, "floor", 0.8),
    Maker("chair", chair, "floor", 2.5),
    Maker("stool", stool, "floor", 0.6),
    Maker("bench", bench, "floor", 0.2),
    Maker("cabinet", cabinet, "wall_floor", 2.0),
    Maker("cabinet", counter, "wall_floor", 1.2),
    Maker("wall_cabinet", wall_cabinet, "wall", 1.4, (1.25, 1.7)),
    Maker("shelf", shelf, "wall_floor", 1.2),
    Maker("fridge", fridge, "wall_floor", 0.6),
    Maker("bed", bed, "wall_floor", 0.6),
    Maker("plant", plant, "floor", 1.6),
    Maker("lamp", lamp, "floor", 0.6),
    Maker("pendant_lamp", pendant_lamp, "ceiling", 0.6),
    Maker("bin", bin_, "floor", 0.6),
    Maker("box", carton, "floor", 0.8),
    Maker("backpack", bag, "floor", 0.5),
    Maker("oven", oven, "wall_floor", 0.4),
    Maker("monitor", wall_screen, "wall", 0.9, (0.7, 1.6)),
    Maker("picture", picture, "wall", 1.8, (0.8, 1.7)),
    Maker("board", board, "wall", 0.5, (0.7, 1.1)),
    Maker("wall_shelf", wall_shelf, "wall", 0.5, (0.9, 1.8)),
    Maker("object", unknown, "floor", 1.6),
    Maker("object", radiator, "wall", 1.0, (0.06, 0.2)),
    Maker("object", unknown, "wall", 0.4, (0.3, 1.6)),
    Maker("door", door, "wall", 1.6, (0.0, 0.001)),
    Maker("window", window, "wall", 1.6, (0.3, 1.1)),
    Maker("curtain", curtain, "wall", 0.8, (0.02, 0.4)),
)
SMALL_MAKERS = (
    Maker("monitor", monitor, "floor", 1.0),
    Maker("laptop", laptop, "floor", 0.6),
    Maker("plant", plant, "floor", 0.5),
    Maker("lamp", lamp, "floor", 0.5),
    Maker("box", carton, "floor", 0.4),
    Maker("object", unknown, "floor", 1.2),
)
"""What stands on tables and cabinets beside the small things of the library; made smaller where it is too large."""
