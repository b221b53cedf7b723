"""Items from above: a dish is a disc, a utensil a bar with round ends; how far apart two of them are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, hypot, sin

import numpy as np
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.tableware.world.items import TABLE_SIDES, Item

POINT = tuple[float, float]


@dataclass(frozen=True)
class Footprint:
    """Everything within `radius` of a segment, world frame [m]; a disc when both ends are one."""

    start: POINT
    end: POINT
    radius: float

    @property
    def on_table(self) -> bool:
        """Whether no part of it hangs over the table's edge."""
        half_x, half_y = TABLE_SIDES[0] / 2 - self.radius, TABLE_SIDES[1] / 2 - self.radius
        return all(abs(x) <= half_x and abs(y) <= half_y for x, y in (self.start, self.end))


def footprint(item: Item, x: float | None = None, y: float | None = None, yaw: float | None = None) -> Footprint:
    """Return an item's footprint where it is, or with another centre [m] or yaw [rad]."""
    x = item.position[0] if x is None else x
    y = item.position[1] if y is None else y
    if item.is_dish:
        return Footprint((x, y), (x, y), item.measures.rim_radius)
    yaw = item.yaw if yaw is None else yaw
    half = (item.measures.length - item.measures.width) / 2
    dx, dy = half * cos(yaw), half * sin(yaw)
    return Footprint((x - dx, y - dy), (x + dx, y + dy), item.measures.width / 2)


def swept_disc(item: Item, x: float, y: float) -> Footprint:
    """Return what a dish covers on a straight way from where it is to (x, y) [m]."""
    return Footprint((item.position[0], item.position[1]), (x, y), item.measures.rim_radius)


def gap(first: Footprint, second: Footprint) -> float:
    """Return the distance [m] between two footprints, negative when they overlap."""
    return _segment_distance(first.start, first.end, second.start, second.end) - first.radius - second.radius


def overlapped(places: Sequence[Footprint], others: Sequence[Footprint]) -> np.ndarray:
    """Return for places (P,) and others (N,) who overlaps whom: `gap` below zero, (P, N) bool."""
    return _overlaps(_as_rows(places), _as_rows(others))


def _as_rows(prints: Sequence[Footprint]) -> np.ndarray:
    return np.array([(*print_.start, *print_.end, print_.radius) for print_ in prints], dtype=np.float64).reshape(-1, 5)


@compiled
def _overlaps(places, others):  # type: ignore[no-untyped-def]
    result = np.zeros((len(places), len(others)), np.bool_)
    for i in range(len(places)):
        for k in range(len(others)):
            reach = places[i, 4] + others[k, 4]
            result[i, k] = _square_distance(places[i], others[k]) < reach * reach
    return result


@compiled
def _square_distance(first, second):  # type: ignore[no-untyped-def]
    """Square of the distance of two segments (x, y, x, y, ...)."""
    ax, ay, bx, by = first[0], first[1], first[2], first[3]
    cx, cy, dx, dy = second[0], second[1], second[2], second[3]
    c_side, d_side = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax), (bx - ax) * (dy - ay) - (by - ay) * (dx - ax)
    a_side, b_side = (dx - cx) * (ay - cy) - (dy - cy) * (ax - cx), (dx - cx) * (by - cy) - (dy - cy) * (bx - cx)
    if c_side * d_side < 0.0 and a_side * b_side < 0.0:
        return 0.0
    return min(
        _square_to_segment(ax, ay, cx, cy, dx, dy),
        _square_to_segment(bx, by, cx, cy, dx, dy),
        _square_to_segment(cx, cy, ax, ay, bx, by),
        _square_to_segment(dx, dy, ax, ay, bx, by),
    )


@compiled
def _square_to_segment(px, py, ax, ay, bx, by):  # type: ignore[no-untyped-def]
    dx, dy = bx - ax, by - ay
    square = dx * dx + dy * dy
    along = 0.0
    if square > 0.0:
        along = min(1.0, max(0.0, ((px - ax) * dx + (py - ay) * dy) / square))
    x, y = px - ax - along * dx, py - ay - along * dy
    return x * x + y * y


def _segment_distance(a: POINT, b: POINT, c: POINT, d: POINT) -> float:
    if _cross(a, b, c, d):
        return 0.0
    return min(_to_segment(a, c, d), _to_segment(b, c, d), _to_segment(c, a, b), _to_segment(d, a, b))


def _to_segment(p: POINT, a: POINT, b: POINT) -> float:
    dx, dy = b[0] - a[0], b[1] - a[1]
    square = dx * dx + dy * dy
    along = 0.0
    if square > 0.0:
        along = min(1.0, max(0.0, ((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / square))
    return hypot(p[0] - a[0] - along * dx, p[1] - a[1] - along * dy)


def _side(a: POINT, b: POINT, p: POINT) -> float:
    return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])


def _cross(a: POINT, b: POINT, c: POINT, d: POINT) -> bool:
    return _side(a, b, c) * _side(a, b, d) < 0.0 and _side(c, d, a) * _side(c, d, b) < 0.0
