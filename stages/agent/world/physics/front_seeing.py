"""From what a look at furniture showed of handles, doors and drawers to the fronts that the robot believes in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import atan2

import numpy as np
from scenewright.schemas.base import as_vector
from scenewright.stages.agent.world.physics.eyes import Surface
from scenewright.stages.agent.world.physics.fronts import (
    BEHIND_BAR,
    HALF_BAR,
    LEAF,
    NARROWEST,
    OF_EITHER,
    PARTS,
    WITH_DRAWERS,
    WITH_LEAVES,
    Front,
    edges,
)
from scenewright.stages.agent.world.physics.head import SHELVES
from scenewright.stages.kit.geometry.transforms import apply, inverse, transform_from_yaw
from scenewright.stages.kit.motion.doors import body_from_moved

INNER, SHOWS_INSIDE = 0.08, 0.3
"""Distance from the outside from which on something is inside of furniture [m], and the least share of a shelf's front
through which something was seen there; by eye."""
BOARD_SHARE = 0.3
"""Share of the fullest height's cubes from which on another height is a board's; by eye."""
FRONT_CELL = 0.04
"""Edge of a cell of a front in which that is told [m], as large as those in which furniture is kept."""
OPEN = 1.5
"""How far what has no leaf counts as open [rad]."""
Box = tuple[np.ndarray, np.ndarray]
STANDS_OUT = 0.08
"""A drawer this far before its furniture stands open [m]; by eye."""
AJAR = 0.5
"""A door of which such a share is before its furniture stands open; by eye."""
TURNED = 0.3
"""Least angle of a door that stands open [rad]; by eye."""
AT_CORNER = 0.15
"""The hinge of a door that stands open is this near to a corner of its furniture [m]; by eye."""
MOST_OF_FACE = 0.55
"""A door that stands open and was seen to be wider than this share of its side is alone there; by eye."""
NARROW_EDGE, BAR_LENGTH = 0.06, 0.2
"""Where a handle that was not seen is believed to be: its distance from the edge, and its length [m]; by eye."""
BESIDE = 0.15
"""What is farther from furniture is of its neighbour [m]; by eye."""
LIES_OVER = 0.05
"""A handle is on the panel that it lies before, or no farther than this beside [m]; by eye."""


def fronts_seen(name: str, label: str, box: Box, surfaces: Sequence[Surface], base: np.ndarray) -> list[Front]:
    """Return the fronts of furniture in a box (3,), (3,) of the map by what a look at it from a base pose (3,) showed:
    what stands open first, else the topmost first. A fridge's or a dresser's one handle is of all that was seen; of
    several, and of other furniture's, each is of the panel that it lies before."""
    handles = [s for s in surfaces if s.label == PARTS[0]]
    panels = [s for s in surfaces if s.label in PARTS[1:]]
    fronts = []
    if label in (*OF_EITHER, *WITH_LEAVES):
        opened = [(panel, _standing_open(name, label, box, panel, handles)) for panel in panels]
        fronts = [front for _, front in opened if front is not None]
        panels = [panel for panel, front in opened if front is None]
    gripped: dict[int, Surface] = {}
    for handle in (s for s in handles if _beside(s, box)):
        before = [k for k, panel in enumerate(panels) if _beside(panel, box) and _lies_before(handle, panel)]
        best = min(before, key=lambda k: float(np.ptp(panels[k].points[:, 2])), default=None)
        if best is not None and (best not in gripped or len(handle.points) > len(gripped[best].points)):
            gripped[best] = handle
    if not fronts and len(gripped) < (1 if label in OF_EITHER else 2):
        front = front_seen(name, label, box, surfaces, base)
        return [] if front is None else [front]
    for k, handle in gripped.items():
        front = front_seen(name, label, box, [handle, panels[k]], base, several=True)
        fronts += [] if front is None else [front]
    return sorted(fronts, key=lambda front: (front.value == 0, -front.bar[1][2]))


def open_shelf(name: str, label: str, box: Box, points: np.ndarray, base: np.ndarray) -> Front | None:
    """Return the open side, towards a base pose (3,), of a shelf in a box of which points (N, 3) were seen; None where
    little of its inside was: it is shut, or a plain block."""
    if label not in SHELVES:
        return None
    (low, high), across = box, int((box[1] - box[0])[:2].argmin())
    normal = np.zeros(2)
    normal[across] = 1.0 if base[across] > (low + high)[across] / 2 else -1.0
    levels = levels_seen(box, points)
    if len(levels) < 2 and _seen_through(box, points, across, normal[across]) < SHOWS_INSIDE:
        return None
    frame = transform_from_yaw(atan2(normal[1], normal[0]), np.array([*((low + high)[:2] / 2), 0.0]))
    depth, width, top = (float(value) for value in ((high - low)[across], (high - low)[1 - across], high[2]))
    corner = (depth / 2, width / 2, LEAF)
    panel = (-width / 2, width / 2, LEAF, top)
    bar = (corner, corner)
    return Front(name, label, frame, (depth, width, top), panel, bar, False, OPEN, leafless=True, levels=levels)


def levels_seen(box: Box, points: np.ndarray) -> tuple[float, ...]:
    """Return the heights [m] of the boards of a shelf in a box of which points (N, 3) were seen, one a cube: those at
    which most of them lie, its sides and what is near its front and back aside."""
    low, high = box
    within = np.all((points[:, :2] > low[:2] + INNER) & (points[:, :2] < high[:2] - INNER), axis=1)
    heights, counts = np.unique(np.round(points[within, 2], 3), return_counts=True)
    levels: list[list[tuple[float, int]]] = []
    for height, count in zip(heights.tolist(), counts.tolist(), strict=True):
        if count < BOARD_SHARE * counts.max():
            continue
        if levels and height - levels[-1][-1][0] < 1.5 * FRONT_CELL:
            levels[-1].append((height, count))
        else:
            levels.append([(height, count)])
    return tuple(round(sum(h * n for h, n in level) / sum(n for _, n in level), 3) for level in levels)


def _seen_through(box: Box, points: np.ndarray, across: int, side: float) -> float:
    """Return the share of a front's cells, its edges aside, in which points (N, 3) lie inside of furniture and none on
    its front: at the upper (`side` 1) or lower (-1) end of an axis."""
    low, high = box
    axes = [1 - across, 2]
    within = np.all((points[:, axes] > low[axes] + INNER) & (points[:, axes] < high[axes] - INNER), axis=1)
    behind = (high[across] - points[:, across] if side > 0 else points[:, across] - low[across]) > INNER
    cells = np.rint(points[:, axes] / FRONT_CELL).astype(int)
    on_front = set(map(tuple, cells[within & ~behind].tolist()))
    inside = set(map(tuple, cells[within & behind].tolist())) - on_front
    return len(inside) / max(1, len(inside) + len(on_front))


def _beside(surface: Surface, box: Box) -> bool:
    """Whether the middle of a surface is over the floor of furniture, or not far beside it."""
    return bool(np.all((surface.middle > box[0] - BESIDE)[:2] & (surface.middle < box[1] + BESIDE)[:2]))


def _lies_before(handle: Surface, panel: Surface) -> bool:
    """Whether a handle is before a panel, or not far beside it, in height and along its wider side."""
    wide = int((panel.high - panel.low)[:2].argmax())
    return all(panel.low[k] - LIES_OVER < handle.middle[k] < panel.high[k] + LIES_OVER for k in (wide, 2))


def front_seen(
    name: str, label: str, box: Box, surfaces: Sequence[Surface], base: np.ndarray, *, several: bool = False
) -> Front | None:
    """Return the front of furniture in a box (3,), (3,) of the map by what a look at it from a base pose (3,) showed;
    None without a handle, or where a side was looked at: of a door that shows an edge, its handle sticks out beyond.
    `several`: there are other fronts, and this one is no larger than it was seen."""
    handles = [s.points for s in surfaces if s.label == "handle"]
    panels = [s.points for s in surfaces if s.label in PARTS[1:]]
    if not handles:
        return None
    low, high = box
    handle, panel = max(handles, key=len), panels[0] if several else max([*panels, _facing(box, base)], key=len)
    across = int(np.ptp(np.percentile(panel[:, :2], (5, 95), axis=0), axis=0).argmin())
    normal = np.zeros(2)
    normal[across] = 1.0 if base[across] > np.median(panel[:, across]) else -1.0
    middle, half_depth, half_width = (low + high) / 2, (high - low)[across] / 2, (high - low)[1 - across] / 2
    slides = label in WITH_DRAWERS or (label in OF_EITHER and any(s.label == PARTS[2] for s in surfaces))
    frame = transform_from_yaw(atan2(normal[1], normal[0]), np.array([*middle[:2], 0.0]))
    in_frame = apply(inverse(frame), panel)
    if not panels:
        in_frame[:, 0] = np.percentile(apply(inverse(frame), handle)[:, 0], 95) - 2 * HALF_BAR - BEHIND_BAR
    plane = float(np.median(in_frame[:, 0]))
    (y0, y1), (z0, z1) = edges(in_frame[:, 1:]), edges(in_frame[:, :0:-1])
    if y1 - y0 < NARROWEST:
        return None
    out = plane - half_depth if slides and label in OF_EITHER and plane > half_depth + STANDS_OUT else 0.0
    plane -= out
    left, right = -half_width, half_width
    if slides and not several:  # wider than a picture, perhaps
        y0, y1 = min(y0, -half_width), max(y1, half_width)
    shift = np.eye(4)
    shift[:2, 3] = (plane - half_depth) / 2, (y0 + y1) / 2  # the back is where the box ends
    frame, half_depth, half_width = frame @ shift, (half_depth + plane) / 2, (y1 - y0) / 2
    bar = apply(inverse(frame), handle) - (out, 0.0, 0.0)
    whole = (float(left - shift[1, 3]), float(right - shift[1, 3])) if several else None
    bar = bar[bar[:, 0] > half_depth + BEHIND_BAR / 2]  # what is farther back is the panel seen beside the bar
    if len(bar) < 5:
        return None
    handle_low, handle_high = np.percentile(bar, 5, axis=0), np.percentile(bar, 95, axis=0)
    if abs(handle_low[1] + handle_high[1]) / 2 > half_width:
        return None  # seen past an edge: it is on another side
    handle_low[0] = handle_high[0] - 2 * HALF_BAR
    extent = (-half_width, half_width, z0 if slides or several else LEAF, min(z1, float(high[2])))
    size = (float(2 * half_depth), float(2 * half_width), float(high[2]))
    bars = (tuple(handle_low.tolist()), tuple(handle_high.tolist()))
    return Front(name, label, frame, size, extent, bars, slides, out, across=whole)


def _facing(box: tuple[np.ndarray, np.ndarray], base: np.ndarray) -> np.ndarray:
    """Return points (N, 3) of the side of a box that faces a base pose (3,): few, for where no panel was seen."""
    (low, high), across = box, int(np.argmax(np.maximum(box[0] - base, base - box[1])[:2]))
    grid = np.stack(np.meshgrid(*np.linspace(low, high, 12).T, indexing="ij"), -1)
    side = grid.take(-1 if base[across] > high[across] else 0, axis=across)
    return side.reshape(-1, 3)


def _standing_open(name: str, label: str, box: Box, panel: Surface, handles: Sequence[Surface]) -> Front | None:
    """Return the front of a door that stands open: a panel, most of which is before the box, of which one end is near a
    corner of it; None for any other panel."""
    low, high = box
    points = panel.points
    outside = np.any((points[:, :2] < low[:2] - LEAF) | (points[:, :2] > high[:2] + LEAF), axis=1)
    if panel.label != PARTS[1] or outside.mean() < AJAR:
        return None
    middle = np.median(points[:, :2], axis=0)
    along = np.linalg.svd((points[:, :2] - middle)[:: max(1, len(points) // 2000)], full_matrices=False)[2][0]
    reach = np.percentile((points[:, :2] - middle) @ along, (2, 98))
    ends = middle + reach[:, None] * along
    corners = np.array([(x, y) for x in (low[0], high[0]) for y in (low[1], high[1])])
    away = np.linalg.norm(ends[:, None] - corners[None], axis=2)
    end, corner = np.unravel_index(int(away.argmin()), away.shape)
    if away[end, corner] > AT_CORNER:
        return None
    hinge, leaf = corners[corner], ends[1 - end] - ends[end]
    length = float(np.linalg.norm(leaf))
    centre = (low + high)[:2] / 2
    best: tuple[float, np.ndarray, np.ndarray] | None = None
    for axis in (0, 1):  # the two sides that meet there: the leaf turned less out of the one that it belongs to
        normal, shut = np.zeros(2), np.zeros(2)
        normal[axis] = np.sign(hinge[axis] - centre[axis])
        shut[1 - axis] = np.sign(centre[1 - axis] - hinge[1 - axis])
        turned = atan2(float(leaf @ normal), float(leaf @ shut))
        if turned > 0 and (best is None or turned < best[0]):
            best = (turned, normal, shut)
    if best is None or best[0] < TURNED or length < NARROWEST:
        return None
    turned, normal, shut = best
    across = int(np.abs(normal).argmax())
    face = float((high - low)[1 - across])
    one_wide = label in WITH_LEAVES or length > MOST_OF_FACE * face  # a near look shows no whole panel
    length = face if one_wide else face / 2
    frame = transform_from_yaw(atan2(normal[1], normal[0]), np.array([*(hinge + shut * length / 2), 0.0]))
    depth = float((high - low)[across])
    frame[:2, 3] -= normal * depth / 2
    side = 1.0 if float(inverse(frame)[1, :2] @ hinge + inverse(frame)[1, 3]) > 0 else -1.0
    z0, z1 = edges(points[:, :0:-1])[0], float(high[2])
    whole = sorted(float(inverse(frame)[1, :2] @ c + inverse(frame)[1, 3]) for c in corners)
    at_edge = -side * (length / 2 - NARROW_EDGE)
    bar_low = np.array([depth / 2 + BEHIND_BAR, at_edge - HALF_BAR, (z0 + z1) / 2 - BAR_LENGTH / 2])
    bar_high = np.array([depth / 2 + BEHIND_BAR + 2 * HALF_BAR, at_edge + HALF_BAR, (z0 + z1) / 2 + BAR_LENGTH / 2])
    size = (depth, length, float(high[2]))
    panel_extent = (-length / 2, length / 2, z0, z1)
    bar = (as_vector(bar_low), as_vector(bar_high))
    front = Front(name, label, frame, size, panel_extent, bar, False, turned, across=(whole[0], whole[-1]))
    for handle in handles:
        shut_bar = apply(inverse(frame @ body_from_moved(front.joint, turned)), handle.points)
        low_bar, high_bar = np.percentile(shut_bar, 5, axis=0), np.percentile(shut_bar, 95, axis=0)
        if abs(float(low_bar[1] + high_bar[1])) / 2 < length / 2 and z0 < (low_bar[2] + high_bar[2]) / 2 < z1:
            front = replace(front, bar=(as_vector(low_bar), as_vector(high_bar)))
    return front
