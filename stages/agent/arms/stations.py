"""Base poses before furniture, and spots on it."""

from __future__ import annotations

from math import atan2, ceil, cos, hypot, pi, sin

from scenewright.stages.agent.goals import NEAR_MIDDLE
from scenewright.stages.agent.scene_map import Item, SceneMap, quarter
from scenewright.stages.agent.senses import Base, Position, SeenFurniture

APART = 0.35
"""Distance between neighbouring base poses along an edge [m]; by eye."""
FINE = 0.03
"""Distance between positions around a middle, and of one from the rim of what is known to stand near [m]; by eye."""
RING = 0.5
"""Share of the radius of a small carrier at which things are put on it; by eye."""
BEHIND_EDGE, ONE_BOARD, COMFORT = 0.13, 0.15, 0.8
"""Distance of a spot in a shelf from its front, height over a board within which things are on it, and the height that
the arm likes [m]; by eye."""
INSIDE = 0.2
"""Distance of a spot from the edge over which it is placed [m]; by eye."""


def facing(x: float, y: float, at: tuple[float, ...]) -> Base:
    """Return the base pose at a point [m] that faces a position."""
    return Base(x, y, atan2(at[1] - y, at[0] - x))


def middles(piece: SeenFurniture, off: float) -> list[Base]:
    """Return the four base poses before the middles of the sides, `off` [m] from them."""
    (x, y), (w, d) = piece.centre, (piece.size[0] / 2 + off, piece.size[1] / 2 + off)
    return [facing(*p, piece.centre) for p in ((x, y - d), (x, y + d), (x - w, y), (x + w, y))]


def corners(piece: SeenFurniture) -> list[tuple[float, float]]:
    """Return the four corners of furniture [m]."""
    (x, y), (w, d) = piece.centre, piece.size
    return [(x + i * w / 2, y + j * d / 2) for i in (-1, 1) for j in (-1, 1)]


def around(piece: SeenFurniture, off: float, apart: float = APART) -> list[Base]:
    """Return base poses along all four sides, `off` [m] from them and `apart` [m]; around what is small from eight
    sides, and of an open shelf along its front alone."""
    (x, y), (w, d) = piece.centre, piece.size
    if max(w, d) < APART:
        far = max(w, d) / 2 + off
        return [facing(x + far * cos(k * pi / 4), y + far * sin(k * pi / 4), (x, y)) for k in range(8)]
    poses = []
    for length, across, turned in ((w, d, False), (d, w, True)):
        count = max(1, ceil(length / apart))
        for k in range(count):
            along = (k + 0.5) / count * length - length / 2
            for side in (-1, 1):
                out = side * (across / 2 + off)
                px, py = (x + out, y + along) if turned else (x + along, y + out)
                look = (x, y + along) if turned else (x + along, y)
                poses.append(facing(px, py, look))
    return [pose for pose in poses if _before_opening(piece, pose)]


def _before_opening(piece: SeenFurniture, pose: Base) -> bool:
    if piece.open_to is None:
        return True
    out = cos(piece.open_to), sin(piece.open_to)
    depth = (abs(out[0]) * piece.size[0] + abs(out[1]) * piece.size[1]) / 2
    return (pose.x - piece.centre[0]) * out[0] + (pose.y - piece.centre[1]) * out[1] > depth


def drivable(scene: SceneMap, base: Base, poses: list[Base]) -> list[tuple[float, Base]]:
    """Return the poses that the robot can get to with the way [m], the nearest first."""
    lengths = [(scene.obstacles.way(base, (p.x, p.y)), p) for p in poses if scene.obstacles.fits(p.x, p.y)]
    return sorted(((length, p) for length, p in lengths if length < float("inf")), key=lambda pair: pair[0])


def spots(scene: SceneMap, place: str, base: Base, apart: float = 0.18, inside: float = INSIDE) -> list[Position]:
    """Return positions on furniture, `apart` [m] and `inside` [m] from its edges, that are free as far as is known, the
    nearest to the base first."""
    piece = scene.furniture[place]
    if piece.levels and piece.open_to is not None:
        return _spots_in_shelf(scene, place, piece, piece.open_to, apart)
    steps = [
        [c - s / 2 + inside + k * apart for k in range(max(1, int((s - 2 * inside) / apart) + 1))]
        for c, s in zip(piece.centre, piece.size, strict=True)
    ]
    occupied = [(i.position, i.radius) for i in scene.items.values() if i.place == place]
    free = [
        (x, y, piece.height + 0.02)
        for x in steps[0]
        for y in steps[1]
        if all(hypot(x - p[0], y - p[1]) > r + 0.1 for p, r in occupied)
    ]
    return sorted(free, key=lambda p: hypot(p[0] - base.x, p[1] - base.y))


def _spots_in_shelf(scene: SceneMap, place: str, piece: SeenFurniture, open_to: float, apart: float) -> list[Position]:
    """Return positions near the front of a shelf's boards that are free as far as is known, those first that the arm
    gets to best. `open_to`: heading out of it [rad]."""
    out, along = (cos(open_to), sin(open_to)), (-sin(open_to), cos(open_to))
    depth, width = (sum(abs(a) * s for a, s in zip(axis, piece.size, strict=True)) for axis in (out, along))
    before, count = depth / 2 - min(BEHIND_EDGE, depth / 2), max(0, int((width / 2 - INSIDE) / apart))
    free = []
    for level in sorted(piece.levels, key=lambda level: abs(level - COMFORT)):
        lying = [i for i in scene.items.values() if i.place == place and abs(i.position[2] - level) < ONE_BOARD]
        for k in sorted(range(-count, count + 1), key=abs):
            x, y = (c + before * o + k * apart * a for c, o, a in zip(piece.centre, out, along, strict=True))
            if all(hypot(x - i.position[0], y - i.position[1]) > i.radius + 0.1 for i in lying):
                free.append((x, y, level + 0.02))
    return free


def spots_on(scene: SceneMap, carrier: Item) -> list[Position]:
    """Return positions within a small carrier, those that nothing known lies near first."""
    x, y, z = carrier.position
    far = RING * carrier.radius
    ring = [(x + far * cos(k * pi / 3), y + far * sin(k * pi / 3), z) for k in range(6)]
    positions = [i.position for i in scene.items.values() if i.key != carrier.key and i.place == carrier.place]
    clearance = {p: min((hypot(p[0] - q[0], p[1] - q[1]) for q in positions), default=1.0) for p in ring}
    return sorted(ring, key=lambda p: -round(clearance[p], 2))


def spots_near(scene: SceneMap, place: str, middle: Position) -> list[Position]:
    """Return positions around a middle that are free as far as is known, the nearest first; the middle if none is."""
    x, y, z = middle
    steps = [k * FINE for k in range(-3, 4)]
    occupied = [(i.position, i.radius) for i in scene.items.values() if i.place == place]
    free = [
        (x + dx, y + dy, z)
        for dx in steps
        for dy in steps
        if hypot(dx, dy) <= NEAR_MIDDLE - FINE
        and all(hypot(x + dx - p[0], y + dy - p[1]) > r + FINE for p, r in occupied)
    ]
    return sorted(free, key=lambda p: hypot(p[0] - x, p[1] - y)) or [middle]


def other_sides(scene: SceneMap, place: str, base: Base, seen: set[int], off: float) -> list[tuple[float, Base]]:
    """Return the base poses before furniture from quarters from which it was not looked at, the nearest first."""
    piece = scene.furniture[place]
    poses = [p for p in around(piece, off) if quarter(p, piece.centre) not in seen]
    return drivable(scene, base, poses)
