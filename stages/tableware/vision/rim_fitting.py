"""Fits a circle to where heights fall off around a place: compiled, because dozens of places are tried a frame."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scenewright.stages.kit.compiled import compiled

DIRECTIONS = 96
"""Directions in which the fall of a rim is looked for; by eye."""
WINDOW = 14
"""Pixels on either side of the expected circle that are searched."""
LEAST_STEP = 0.006
"""A lip stands this much [m] over what is outside of it."""
CREST = 0.012
"""The height before a fall may differ this much [m] from the lip's."""
_ANGLES = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
"""Angles [rad] of these directions."""
RAYS = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)], axis=1)
"""The same as unit vectors (DIRECTIONS, 2)."""


@compiled
def _profiles(smooth: np.ndarray, u: float, v: float, radius: float, rays: np.ndarray, profile: np.ndarray) -> None:
    """Write heights along each ray, from WINDOW pixels inside of the circle to WINDOW outside, into (D, 2 W + 1)."""
    rows, columns = smooth.shape
    for k in range(len(rays)):
        for step in range(profile.shape[1]):
            reach = radius + step - WINDOW
            x = min(max(u + rays[k, 0] * reach, 0.0), columns - 1.001)
            y = min(max(v + rays[k, 1] * reach, 0.0), rows - 1.001)
            column, row = int(x), int(y)
            a, b = x - column, y - row
            upper = (1.0 - a) * smooth[row, column] + a * smooth[row, column + 1]
            lower = (1.0 - a) * smooth[row + 1, column] + a * smooth[row + 1, column + 1]
            profile[k, step] = (1.0 - b) * upper + b * lower


@compiled
def _outer_edges(profile: np.ndarray, lip: float, falls: np.ndarray, edge: np.ndarray) -> int:
    """Write per direction whether a fall from the lip is there, and its offset from the circle [px]: the outermost
    one. Returns how many."""
    level = lip - LEAST_STEP
    count = 0
    for k in range(len(profile)):
        falls[k] = False
        for step in range(profile.shape[1] - 2, -1, -1):
            inner_height, outer_height = profile[k, step], profile[k, step + 1]
            if inner_height >= level > outer_height:
                crest = max(inner_height, profile[k, step - 1]) if step > 0 else inner_height
                if abs(crest - lip) < CREST:
                    falls[k] = True
                    edge[k] = step - WINDOW + min(1.0, (inner_height - level) / max(inner_height - outer_height, 1e-6))
                    count += 1
                    break
    return count


@compiled
def _circle_shift(edge: np.ndarray, kept: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """Return (du, dv, dr) [px] of the least-squares circle through the kept edges: normal equations, Cramer's rule."""
    n = np.zeros((3, 3))
    right = np.zeros(3)
    row = np.ones(3)
    for k in range(len(edge)):
        if kept[k]:
            row[0], row[1] = rays[k, 0], rays[k, 1]
            for i in range(3):
                right[i] += row[i] * edge[k]
                for j in range(3):
                    n[i, j] += row[i] * row[j]
    for i in range(3):
        n[i, i] += 1e-6
    c0 = n[1, 1] * n[2, 2] - n[1, 2] * n[2, 1]
    c1 = n[1, 2] * n[2, 0] - n[1, 0] * n[2, 2]
    c2 = n[1, 0] * n[2, 1] - n[1, 1] * n[2, 0]
    determinant = n[0, 0] * c0 + n[0, 1] * c1 + n[0, 2] * c2
    inverse = np.empty((3, 3))
    inverse[0, 0], inverse[1, 0], inverse[2, 0] = c0, c1, c2
    inverse[0, 1] = n[0, 2] * n[2, 1] - n[0, 1] * n[2, 2]
    inverse[1, 1] = n[0, 0] * n[2, 2] - n[0, 2] * n[2, 0]
    inverse[2, 1] = n[0, 1] * n[2, 0] - n[0, 0] * n[2, 1]
    inverse[0, 2] = n[0, 1] * n[1, 2] - n[0, 2] * n[1, 1]
    inverse[1, 2] = n[0, 2] * n[1, 0] - n[0, 0] * n[1, 2]
    inverse[2, 2] = n[0, 0] * n[1, 1] - n[0, 1] * n[1, 0]
    shift = np.zeros(3)
    for i in range(3):
        for j in range(3):
            shift[i] += inverse[i, j] * right[j] / determinant
    return shift


class SoughtLip(NamedTuple):
    """A lip of `rim_radius` [m] between heights `low` and `high` [m], seen with a focal length [px] from
    `camera_height` [m]."""

    rim_radius: float
    low: float
    high: float
    focal: float
    camera_height: float


@compiled
def fit_circle(
    smooth: np.ndarray, u: float, v: float, sought: SoughtLip, rays: np.ndarray
) -> tuple[float, float, float, float, float]:
    """Return (u, v [px], lip [m], support 0..1, radius [px]) of a lip near pixel (u, v); support is 0 where heights do
    not bear one out."""
    rim_radius, low, high, focal, camera_height = sought
    count = len(rays)
    profile = np.empty((count, 2 * WINDOW + 1))
    falls, fits = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
    edge, crests = np.zeros(count), np.empty(count)
    lip, support, radius = 0.5 * (low + high), 0.0, 0.0
    nothing = (u, v, lip, 0.0, 0.0)
    for turn in range(4):
        radius = focal / (camera_height - lip) * rim_radius
        _profiles(smooth, u, v, radius, rays, profile)
        if turn < 2:
            usable = 0
            for k in range(count):
                crest = profile[k, 4:-4].max()
                if low < crest < high:
                    crests[usable] = crest
                    usable += 1
            if usable < 0.3 * count:
                return nothing
            lip = float(np.median(crests[:usable]))
            if turn == 0:
                continue
        if _outer_edges(profile, lip, falls, edge) < 0.3 * count:
            return nothing
        fits[:] = falls
        shift = np.zeros(3)
        limit = 6.0 if turn < 2 else 2.5
        for _ in range(4):
            shift = _circle_shift(edge, fits, rays)
            total = 0
            for k in range(count):
                residual = edge[k] - rays[k, 0] * shift[0] - rays[k, 1] * shift[1] - shift[2]
                fits[k] = falls[k] and abs(residual) < limit
                total += fits[k]
            if total < 0.25 * count:
                return nothing
            support = total / count
        if abs(shift[2]) > 6.0 and turn > 1:
            return nothing
        u, v = u + shift[0], v + shift[1]
    return u, v, lip, support, radius
