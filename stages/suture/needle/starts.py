"""Where a needle might be: circles of the known radius through points that both eyes, or the disparity, give.

A row of a rectified pair meets the needle at the same points in both eyes. The middles of the masks' runs in one row
are known to a fraction of a pixel, where a dense disparity of shiny wire is not; each pair of runs is a candidate
point, right or wrong. Circles through three points of either kind are kept when their radius is near the needle's, and
scored on both masks: how much of the best half circle lies on mask, and how much of the mask it explains.
"""

from __future__ import annotations

import numba
import numpy as np

from stages.suture.needle.refine import EyeMask
from stages.suture.rig import NEEDLE_RADIUS, StereoRig

NEAREST, FARTHEST = 0.04, 0.80
TRIPLES = 4000
SCORED = 400
STATIONS = 60
CLOSE = 3.0
"""Mask within this many pixels beyond the wire's half width of the curve counts as on it."""


@numba.njit(cache=True)
def _runs(soft: np.ndarray, longest: int) -> np.ndarray:
    """Return (R, 2): row and middle column of the runs of mask (soft >= 0.5) of at most `longest` pixels."""
    found = []
    for row in range(soft.shape[0]):
        start = -1
        for column in range(soft.shape[1] + 1):
            inside = column < soft.shape[1] and soft[row, column] >= 0.5
            if inside and start < 0:
                start = column
            elif not inside and start >= 0:
                if column - start <= longest:
                    found.append((float(row), 0.5 * (start + column - 1)))
                start = -1
    result = np.empty((len(found), 2))
    for index, pair in enumerate(found):
        result[index, 0], result[index, 1] = pair
    return result


def row_points(rig: StereoRig, eyes: tuple[EyeMask, EyeMask]) -> np.ndarray:
    """Return candidate points (N, 3) [m]: pairs of runs in one row of both eyes, between NEAREST and FARTHEST."""
    left, right = _runs(eyes[0].soft, 16), _runs(eyes[1].soft, 16)
    left, right = left + [eyes[0].row, eyes[0].column], right + [eyes[1].row, eyes[1].column]
    first = np.searchsorted(right[:, 0], left[:, 0], side="left")
    last = np.searchsorted(right[:, 0], left[:, 0], side="right")
    counts = last - first
    if counts.sum() == 0:
        return np.empty((0, 3))
    of_left = np.repeat(np.arange(len(left)), counts)
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    of_right = np.repeat(first, counts) + within
    disparity = left[of_left, 1] - right[of_right, 1]
    reach = rig.focal * rig.baseline
    keep = (disparity > reach / FARTHEST) & (disparity < reach / NEAREST)
    return rig.triangulate(left[of_left][keep][:, ::-1], disparity[keep])


def circles_through(points: np.ndarray, count: int, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return centres (C, 3) and unit normals (C, 3) of circles of the needle's radius through about three of `points`.

    Only triples whose own circle has a radius within 35 % of the needle's are used; the needle's circle keeps their
    plane and their middle point.
    """
    if len(points) < 3:
        return np.empty((0, 3)), np.empty((0, 3))
    triples = random.integers(0, len(points), (count, 3))
    a, b, c = points[triples[:, 0]], points[triples[:, 1]], points[triples[:, 2]]
    ab, ac = b - a, c - a
    normal = np.cross(ab, ac)
    squared = (normal**2).sum(axis=1)
    ab2, ac2 = (ab**2).sum(axis=1), (ac**2).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        offset = (ac2[:, None] * np.cross(normal, ab) + ab2[:, None] * np.cross(ac, normal)) / (2 * squared)[:, None]
        radius = np.linalg.norm(offset, axis=1)
    spread = np.sqrt(np.minimum(np.minimum(ab2, ac2), ((c - b) ** 2).sum(axis=1)))
    keep = np.isfinite(radius) & (np.abs(radius / NEEDLE_RADIUS - 1.0) < 0.35) & (spread > 0.3 * NEEDLE_RADIUS)
    a, b, c, offset, radius, normal, squared = (x[keep] for x in (a, b, c, offset, radius, normal, squared))
    # slide the centre so that the known radius fits the triple's mean
    centre = a + offset
    inward = (a + b + c) / 3.0 - centre
    inward /= np.linalg.norm(inward, axis=1, keepdims=True) + 1e-12
    centre = centre + inward * (radius - NEEDLE_RADIUS)[:, None] * 0.7
    return centre, normal / np.sqrt(squared)[:, None]


def frame_of(normal: np.ndarray) -> np.ndarray:
    """Return a right-handed frame (3, 3) whose third column is the unit `normal` (3,)."""
    helper = np.array([1.0, 0.0, 0.0]) if abs(normal[0]) < 0.7 else np.array([0.0, 1.0, 0.0])
    u = np.cross(helper, normal)
    u /= np.linalg.norm(u)
    return np.stack([u, np.cross(normal, u), normal], axis=1)


@numba.njit(cache=True, fastmath=True)
def _score(
    frame: np.ndarray,
    centre: np.ndarray,
    shift: np.ndarray,
    camera: np.ndarray,
    distances: tuple[np.ndarray, np.ndarray],
    hidden: tuple[np.ndarray, np.ndarray],
    corners: np.ndarray,
    pixels: tuple[np.ndarray, np.ndarray],
) -> float:
    """Return 0..2: share of the best half circle that lies on mask, plus share of the mask that it explains."""
    count = 60
    columns, rows, good = np.empty((2, count)), np.empty((2, count)), np.zeros((2, count))
    width = 0.0005 * camera[0] / max(centre[2], 0.01)
    for station in range(count):
        angle = 2 * np.pi * station / count
        a, b = 0.012 * np.cos(angle), 0.012 * np.sin(angle)
        x = centre[0] + a * frame[0, 0] + b * frame[0, 1]
        y = centre[1] + a * frame[1, 0] + b * frame[1, 1]
        z = max(centre[2] + a * frame[2, 0] + b * frame[2, 1], 0.01)
        for eye in range(2):
            u = camera[0] * (x - eye * camera[3]) / z + camera[1] + eye * shift[0]
            v = camera[0] * y / z + camera[2] + eye * shift[1]
            columns[eye, station], rows[eye, station] = u, v
            column, row = int(u + 0.5) - int(corners[eye, 0]), int(v + 0.5) - int(corners[eye, 1])
            distance = distances[eye]
            if 0 <= column < distance.shape[1] and 0 <= row < distance.shape[0]:
                if hidden[eye][row, column]:
                    good[eye, station] = 0.4
                else:
                    good[eye, station] = max(1.0 - distance[row, column] / 5.0, 0.0)
    half = count // 2 + 1
    window = 0.0
    for station in range(half):
        window += good[0, station] + good[1, station]
    best, at = window, 0
    for station in range(1, count):
        last, new = station - 1, (station + half - 1) % count
        window += good[0, new] + good[1, new] - good[0, last] - good[1, last]
        if window > best:
            best, at = window, station
    explained = 0.0
    for eye in range(2):
        near = 0
        reach = (width + 3.0) ** 2
        for index in range(len(pixels[eye])):
            for k in range(half):
                station = (at + k) % count
                du = columns[eye, station] - pixels[eye][index, 0]
                dv = rows[eye, station] - pixels[eye][index, 1]
                if du * du + dv * dv < reach:
                    near += 1
                    break
        explained += near / max(len(pixels[eye]), 1)
    return best / (2.0 * half) + 0.5 * explained


def score(
    rig: StereoRig,
    frame: np.ndarray,
    centre: np.ndarray,
    shift: np.ndarray,
    distances: tuple[np.ndarray, np.ndarray],
    eyes: tuple[EyeMask, EyeMask],
    pixels: tuple[np.ndarray, np.ndarray],
) -> float:
    """Return how well (0..2) the circle explains both masks.

    `distances` are each window's distances [px] to its mask, `pixels` (P, 2) some of each mask's pixels (column, row).
    """
    camera = np.array([rig.focal, rig.centre[0], rig.centre[1], rig.baseline])
    corners = np.array([[eyes[0].column, eyes[0].row], [eyes[1].column, eyes[1].row]], dtype=float)
    hidden = (eyes[0].hidden, eyes[1].hidden)
    return float(_score(np.ascontiguousarray(frame), centre, shift, camera, distances, hidden, corners, pixels))
