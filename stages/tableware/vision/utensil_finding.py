"""Forks and spoons: bars in a map of what is item and what is not, told apart by their outlines.

The map (h, w) holds 1 where something of a utensil's colour or height is, -1 where it is not, 0 where it is unknown (in
or behind a dish). A bar's place comes from moments of a lone blob, else from box sums over turned maps; then each
outline (fork, spoon, either way round) is shifted and turned until it covers most and its border least.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from numba import njit

from stages.tableware.world.dish_shapes import utensil_parts
from stages.tableware.world.items import MEASURES, UTENSILS, Kind

ANGLE_STEP = 4.0
"""Of the search for bars [degrees]."""
BAR_SHARE = 0.62
"""Least cover of a thin bar."""
LEAST_SCORE = 0.55
"""Cover of an outline less that of its border, each -1..1 and halved: 1 is perfect."""


@dataclass(frozen=True)
class Bar:
    """A utensil in the map: kind, centre [px], direction of the head in the image [rad], score 0..1, margin over the
    other kind."""

    kind: Kind
    u: float
    v: float
    angle: float
    score: float
    margin: float


@cache
def _outline(kind: Kind) -> tuple[np.ndarray, np.ndarray]:
    """Return points (N, 2) [m] within a utensil's plan and (M, 2) in a border 2 to 5 mm around it."""
    measures = MEASURES[kind]
    step = 0.0015
    x, y = np.meshgrid(
        np.arange(-0.5 * measures.length - 0.006, 0.5 * measures.length + 0.006, step), np.arange(-0.015, 0.0151, step)
    )
    inside = np.zeros(x.shape, dtype=np.uint8)
    for stations, low, high in utensil_parts(measures, kind == "fork"):
        within = (x >= stations[0]) & (x <= stations[-1])
        inside |= (within & (y >= np.interp(x, stations, low)) & (y <= np.interp(x, stations, high))).astype(np.uint8)
    near = cv2.dilate(inside, np.ones((3, 3), np.uint8))
    border = (cv2.dilate(inside, np.ones((7, 7), np.uint8)) > 0) & (near == 0)
    # A fork's gaps are two pixels wide, and blurred: they say nothing.
    gaps = (x > 0.5 * measures.length - 0.040) & (np.abs(y) < 0.5 * measures.width) & (x < 0.5 * measures.length)
    border &= ~(gaps & (kind == "fork"))
    points = np.stack([x, y], axis=2)
    return points[inside > 0][::3], points[border][::3]


@njit(cache=True)
def _scores(
    map_: np.ndarray,
    inside: np.ndarray,
    border: np.ndarray,
    scale: float,
    u: np.ndarray,
    v: np.ndarray,
    angle: np.ndarray,
) -> np.ndarray:
    """Return (N,) scores of an outline at N poses: half the difference of the mean map in it and around it.

    Image rows go down where world y goes up.
    """
    result = np.zeros(len(u))
    for k in range(len(u)):
        cos, sin = scale * np.cos(angle[k]), scale * np.sin(angle[k])
        for part in range(2):
            points = inside if part == 0 else border
            total, known = 0, 0
            for i in range(len(points)):
                column = int(u[k] + points[i, 0] * cos + points[i, 1] * sin + 0.5)
                row = int(v[k] + points[i, 0] * sin - points[i, 1] * cos + 0.5)
                if 0 <= column < map_.shape[1] and 0 <= row < map_.shape[0]:
                    value = map_[row, column]
                    total += value
                    known += value != 0
            mean = total / max(known, 1)
            result[k] += 0.5 * mean if part == 0 else -0.5 * mean
    return result


def _best_pose(
    map_: np.ndarray, kind: Kind, scale: float, start: tuple[float, float, float], steps: tuple[float, float, float]
) -> tuple[float, float, float, float]:
    """Return (score, u, v, angle) of the best of 45 poses around a start; steps along, across [px], turn [rad]."""
    along, across, turn = (
        step * grid.reshape(-1)
        for step, grid in zip(steps, np.meshgrid(np.arange(-2, 3), np.arange(-1, 2), np.arange(-1, 2)), strict=True)
    )
    cos, sin = np.cos(start[2]), np.sin(start[2])
    columns, rows = start[0] + along * cos - across * sin, start[1] + along * sin + across * cos
    scores = _scores(map_, *_outline(kind), scale, columns, rows, start[2] + turn)
    k = int(np.argmax(scores))
    return float(scores[k]), float(columns[k]), float(rows[k]), float(start[2] + turn[k])


def fit_utensil(map_: np.ndarray, scale: float, u: float, v: float, angle: float) -> Bar:
    """Return the best outline near a bar's centre [px] and direction [rad]; `scale` in pixels per metre."""
    found = []
    for kind in UTENSILS:
        pose = max(_best_pose(map_, kind, scale, (u, v, angle + flip), (6.0, 2.0, 0.05)) for flip in (0.0, np.pi))
        for steps in ((2.0, 1.0, 0.02), (1.0, 0.5, 0.008)):
            pose = _best_pose(map_, kind, scale, pose[1:], steps)
        found.append((pose, kind))
    found.sort(reverse=True)
    (score, u, v, angle), kind = found[0]
    return Bar(kind, u, v, angle, score, score - found[1][0][0])


def search_bars(map_: np.ndarray, scale: float, most: int) -> list[Bar]:
    """Return up to `most` utensils of a map (h, w) that lie touching, crossing or partly unknown, best first."""
    rest = map_.astype(np.float32)
    bars: list[Bar] = []
    for _ in range(most):
        start = _best_bar(rest, scale)
        if start is None:
            break
        bar = fit_utensil(map_, scale, *start)
        erase_bar(rest, bar, scale)
        if bar.score >= LEAST_SCORE:
            bars.append(bar)
    return bars


def erase_bar(map_: np.ndarray, bar: Bar, scale: float) -> None:
    """Set a map to unknown, in place, where a bar lies."""
    half = 0.5 * MEASURES[bar.kind].length * scale
    dx, dy = half * np.cos(bar.angle), half * np.sin(bar.angle)
    ends = [(int(round(bar.u + s * dx)), int(round(bar.v + s * dy))) for s in (-1.0, 1.0)]
    cv2.line(map_, ends[0], ends[1], 0.0, max(3, int(1.35 * MEASURES[bar.kind].width * scale)))


def _best_bar(map_: np.ndarray, scale: float) -> tuple[float, float, float] | None:
    """Return (u, v, angle) of the thin bar that covers most of the map, or None where none covers enough."""
    if min(map_.shape) > 8:
        small = (map_.shape[1] // 2, map_.shape[0] // 2)
        map_ = np.sign(cv2.resize(map_, small, interpolation=cv2.INTER_AREA))
        half = _turned_best(map_, 0.5 * scale)
        return None if half is None else (2.0 * half[0] + 0.5, 2.0 * half[1] + 0.5, half[2])
    return None


def _turned_best(map_: np.ndarray, scale: float) -> tuple[float, float, float] | None:
    length, width = int(0.150 * scale) | 1, max(3, int(0.006 * scale) | 1)
    if np.count_nonzero(map_ > 0) < 0.35 * length * width:
        return None
    side = int(np.ceil(np.hypot(*map_.shape))) + 2
    center = (0.5 * (map_.shape[1] - 1), 0.5 * (map_.shape[0] - 1))
    best = (BAR_SHARE, 0.0, 0.0, 0.0)
    positive = np.stack([(map_ > 0).astype(np.float32), (map_ != 0).astype(np.float32)], axis=2)
    for degrees in np.arange(0.0, 180.0, ANGLE_STEP):
        turn = cv2.getRotationMatrix2D(center, float(degrees), 1.0)
        turn = np.array(turn, dtype=np.float64)
        turn[:, 2] = turn[:, 2] + 0.5 * (side - 1) - np.array(center)
        turned = cv2.warpAffine(positive, turn, (side, side), flags=cv2.INTER_NEAREST)
        sums = cv2.boxFilter(turned, -1, (length, width), borderType=cv2.BORDER_CONSTANT)
        share = np.where(sums[..., 1] > 0.45, sums[..., 0] / np.maximum(sums[..., 1], 1e-6), 0.0)
        share *= 0.7 + 0.3 * sums[..., 1]
        k = int(np.argmax(share))
        row, column = divmod(k, side)
        if share[row, column] > best[0]:
            back = cv2.invertAffineTransform(turn)
            u, v = back @ np.array([column, row, 1.0])
            best = (float(share[row, column]), float(u), float(v), float(np.deg2rad(degrees)))
    return None if best[0] <= BAR_SHARE else best[1:]
