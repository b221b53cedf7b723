"""The thread as a position-based rope (Mueller et al. 2007): one chain of particles of equal spacing.

Distance constraints both ways along the chain, a little resistance to bending, contact with pad and ridge with
friction, with the drivers' shafts and jaws as capsules, and of the thread with itself. Quasi-static: damped Verlet
steps along the paths that its ends are led on. Thread passes a hole in the tissue by changing the rest length.
"""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.kit.geometry.transforms import wrapped

PARTICLES = 48
"""Particles of the rope; by eye."""
THREAD_RADIUS = 0.00019
"""Half the thickness of a 2-0 thread [m]."""
GRAVITY_STEP = 4.0e-5
"""How far a free particle falls in one step [m]."""
DAMPING, ITERATIONS, PAD_FRICTION, BENDING = 0.85, 10, 0.5, 0.08
"""Share of a particle's motion that it keeps, sweeps of a step, share of a motion that the pad holds back, and share of
a bend that a step straightens; by eye."""


@compiled
def drape(
    points: np.ndarray,
    rest: np.ndarray,
    first: np.ndarray,
    last: np.ndarray,
    hold_first: bool,
    capsules: np.ndarray,
    half_width: float,
    height: float,
) -> None:
    """Lead the rope `points` (N, 3) [m], changed in place, through K steps.

    `rest` (K,) is its whole length, `first` and `last` (K, 3) where its ends are, `hold_first` whether the first is
    held at all; `capsules` (K, M, 7): two ends and a radius [m] (a radius of zero: none).
    """
    count = len(points)
    before = points.copy()
    for step in range(len(rest)):
        length = rest[step] / (count - 1)
        for i in range(count):
            for k in range(3):
                moved = (points[i, k] - before[i, k]) * DAMPING
                before[i, k] = points[i, k]
                points[i, k] += moved
            points[i, 2] -= GRAVITY_STEP
        apart_from_itself(points, length)
        for sweep in range(ITERATIONS):
            for k in range(3):
                if hold_first:
                    points[0, k] = first[step, k]
                points[count - 1, k] = last[step, k]
            for at in range(count - 1):
                i = at if sweep % 2 == 0 else count - 2 - at
                dx = points[i + 1, 0] - points[i, 0]
                dy = points[i + 1, 1] - points[i, 1]
                dz = points[i + 1, 2] - points[i, 2]
                d = np.sqrt(dx * dx + dy * dy + dz * dz) + 1e-12
                a = 0.0 if (i == 0 and hold_first) else 1.0
                b = 0.0 if i + 1 == count - 1 else 1.0
                if a + b > 0.0:
                    s = (d - length) / d / (a + b)
                    points[i, 0] += a * s * dx
                    points[i, 1] += a * s * dy
                    points[i, 2] += a * s * dz
                    points[i + 1, 0] -= b * s * dx
                    points[i + 1, 1] -= b * s * dy
                    points[i + 1, 2] -= b * s * dz
            for i in range(1, count - 1):
                for k in range(3):
                    points[i, k] += BENDING * (0.5 * (points[i - 1, k] + points[i + 1, k]) - points[i, k])
            for i in range(count - 1):
                if points[i, 2] < height:
                    contact(points, before, i, half_width, height)
            for m in range(capsules.shape[1]):
                if capsules[step, m, 6] > 0.0:
                    push_out(points, capsules, step, m)
        for k in range(3):
            if hold_first:
                points[0, k] = first[step, k]
            points[count - 1, k] = last[step, k]


@compiled
def contact(points: np.ndarray, before: np.ndarray, i: int, half_width: float, height: float) -> None:
    """Keep particle i out of pad and ridge; what touches keeps part of its place along the surface (friction)."""
    touched = False
    x, z = points[i, 0], points[i, 2]
    value = (x / half_width) ** 2 + (max(z, 0.0) / height) ** 2
    if value < 1.0 and z > -height:
        scale = 1.0 / np.sqrt(max(value, 1e-6))
        points[i, 0] = x * scale
        points[i, 2] = max(z, 0.0) * scale
        touched = True
    if points[i, 2] < THREAD_RADIUS:
        points[i, 2] = THREAD_RADIUS
        touched = True
    if touched:
        for k in range(2):
            points[i, k] += PAD_FRICTION * (before[i, k] - points[i, k]) / ITERATIONS


@compiled
def push_out(points: np.ndarray, capsules: np.ndarray, step: int, m: int) -> None:
    """Move the particles inside capsule m of a step to its surface."""
    x, y, z = capsules[step, m, 0], capsules[step, m, 1], capsules[step, m, 2]
    ax, ay, az = capsules[step, m, 3] - x, capsules[step, m, 4] - y, capsules[step, m, 5] - z
    radius = capsules[step, m, 6]
    square = ax * ax + ay * ay + az * az + 1e-15
    for i in range(len(points) - 1):
        px, py, pz = points[i, 0] - x, points[i, 1] - y, points[i, 2] - z
        share = min(1.0, max(0.0, (px * ax + py * ay + pz * az) / square))
        ox, oy, oz = px - share * ax, py - share * ay, pz - share * az
        d2 = ox * ox + oy * oy + oz * oz
        if d2 < radius * radius:
            d = np.sqrt(d2) + 1e-12
            s = (radius - d) / d
            points[i, 0] += ox * s
            points[i, 1] += oy * s
            points[i, 2] += oz * s


@compiled
def apart_from_itself(points: np.ndarray, length: float) -> None:
    """Push segments of the rope that run into each other apart, ends by their shares (once a step)."""
    count = len(points)
    near = (2.0 * length) ** 2
    least = 2.0 * THREAD_RADIUS
    for i in range(1, count - 2):
        for j in range(i + 3, count - 2):
            dx, dy, dz = points[i, 0] - points[j, 0], points[i, 1] - points[j, 1], points[i, 2] - points[j, 2]
            if dx * dx + dy * dy + dz * dz > near:
                continue
            s, t = nearest_shares(points, i, j)
            gx = gap(points, i, j, s, t, 0)
            gy = gap(points, i, j, s, t, 1)
            gz = gap(points, i, j, s, t, 2)
            d = np.sqrt(gx * gx + gy * gy + gz * gz) + 1e-12
            if d < least:
                for k in range(3):
                    push = 0.5 * (least - d) * gap(points, i, j, s, t, k) / d
                    points[i, k] += push * (1.0 - s)
                    points[i + 1, k] += push * s
                    points[j, k] -= push * (1.0 - t)
                    points[j + 1, k] -= push * t


@compiled
def gap(points: np.ndarray, i: int, j: int, s: float, t: float, k: int) -> float:
    """Return component k from the point at share t of segment j to the one at share s of segment i."""
    on_i = points[i, k] + s * (points[i + 1, k] - points[i, k])
    return on_i - points[j, k] - t * (points[j + 1, k] - points[j, k])


@compiled
def nearest_shares(points: np.ndarray, i: int, j: int) -> tuple[float, float]:
    """Return where along segments i and j (shares 0 to 1) they are nearest (Ericson 2005, section 5.1.9)."""
    uu, vv, uv, uw, vw = 1e-18, 1e-18, 0.0, 0.0, 0.0
    for k in range(3):
        u, v, w = points[i + 1, k] - points[i, k], points[j + 1, k] - points[j, k], points[i, k] - points[j, k]
        uu += u * u
        vv += v * v
        uv += u * v
        uw += u * w
        vw += v * w
    bottom = uu * vv - uv * uv
    s = min(1.0, max(0.0, (uv * vw - uw * vv) / bottom)) if bottom > 1e-18 else 0.0
    t = (uv * s + vw) / vv
    if t < 0.0:
        t = 0.0
        s = min(1.0, max(0.0, -uw / uu))
    elif t > 1.0:
        t = 1.0
        s = min(1.0, max(0.0, (uv - uw) / uu))
    return s, t


def line(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return a straight rope (PARTICLES, 3) between two points (3,)."""
    return start + np.linspace(0.0, 1.0, PARTICLES)[:, None] * (end - start)


def winding(points: np.ndarray, foot: np.ndarray, direction: np.ndarray, reach: float = 0.03) -> float:
    """Return how many turns the rope (N, 3) makes about the first `reach` metres of a line from `foot` (3,)."""
    away = points - foot
    height = away @ direction
    across = away - height[:, None] * direction
    helper = np.eye(3)[np.argmin(np.abs(direction))]
    first = np.cross(direction, helper)
    first /= np.linalg.norm(first)
    angle = np.arctan2(across @ np.cross(direction, first), across @ first)
    change = wrapped(np.diff(angle))
    beside = (height[1:] > 0.0) & (height[1:] < reach) & (np.linalg.norm(across[1:], axis=1) < 0.012)
    return float(abs(change[beside].sum()) / (2 * np.pi))
