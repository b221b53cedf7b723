"""Where a needle might be: circles of the known radius through points that both eyes, or the disparity, give.

A row of a rectified pair meets the needle at the same points in both eyes. The middles of the masks' runs in one row
are known to a fraction of a pixel, where a dense disparity of shiny wire is not; each pair of runs is a candidate
point, right or wrong. Where these give no circle, because the wire lies along the rows, the ends of longer runs do:
they are the same places in both eyes too, though an error of the row moves them by more. Circles through three points
of any kind are kept when their radius is near the needle's, and scored on both masks: how much of the best half circle
lies on mask, and how much of the mask it explains.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.suture.needle.windows import EyeMask
from scenewright.stages.suture.rig import NEEDLE_RADIUS, NeedlePose, StereoRig

NEAREST, FARTHEST = 0.04, 0.80
"""Depths [m] between which a needle may lie; by eye."""
TRIPLES = 6000
"""Triples of points through which circles are laid; by eye."""
SCORED_ROWS, SCORED_DISPARITY = 1200, 300
"""Circles that are scored, of those through points of rows and of those through points of the disparity; by eye."""
LONGEST_RUN = 16
"""Longest run of mask in a row that is taken for the wire's width [px]; by eye."""
DIFFERENT = np.radians(12.0), 0.0025, np.radians(60.0)
"""Two starts differ if their planes [rad], centres [m] or the directions of their arcs' middles [rad] do by this."""
CLOSE = 3.0
"""Mask within this many pixels beyond the wire's half width of the curve counts as on it."""


def starts(
    rig: StereoRig,
    eyes: tuple[EyeMask, EyeMask],
    points: np.ndarray,
    count: int,
    sampled: int,
    random: np.random.Generator,
) -> list[NeedlePose]:
    """Return up to `count` poses that are not alike, best first; either end may be the tip.

    `points` (N, 3) [m] are the disparity's; circles are scored on `sampled` pixels of each mask.
    """
    distances = (eyes[0].distance(), eyes[1].distance())
    pixels = (eyes[0].some_pixels(sampled, random), eyes[1].some_pixels(sampled, random))
    scores, poses = [], []
    for (centres, normals), most in (
        (_row_circles(rig, eyes, random), SCORED_ROWS),
        (_circles_through(points, np.ones(len(points)), TRIPLES, random), SCORED_DISPARITY),
    ):
        scored, posed = _score_halves(rig, eyes, distances, pixels, centres[:most], normals[:most])
        scores.append(scored)
        poses.append(posed)
    ordered = np.concatenate(poses)[np.argsort(-np.concatenate(scores), kind="stable")]
    distinct: list[np.ndarray] = []
    for pose in ordered:
        if all(_differ(pose, earlier) for earlier in distinct):
            distinct.append(pose)
        if len(distinct) == count:
            break
    return [NeedlePose(pose) for pose in distinct]


def _differ(pose: np.ndarray, other: np.ndarray) -> bool:
    """Whether plane, centre or the direction of the arc's middle differ between two poses (4, 4)."""
    plane, middle = abs(float(pose[:3, 2] @ other[:3, 2])), float(pose[:3, 1] @ other[:3, 1])
    far = float(np.linalg.norm(pose[:3, 3] - other[:3, 3]))
    return plane < np.cos(DIFFERENT[0]) or far > DIFFERENT[1] or middle < np.cos(DIFFERENT[2])


@compiled
def _runs(mask: np.ndarray, longest: int) -> np.ndarray:
    """Return (R, 3), row, column and kind of the runs of mask: 0 for the middle of one of at most `longest` pixels, 1
    and 2 for the left and the right end of a longer one."""
    runs = []
    for row in range(mask.shape[0]):
        start = -1
        for column in range(mask.shape[1] + 1):
            inside = column < mask.shape[1] and mask[row, column]
            if inside and start < 0:
                start = column
            elif not inside and start >= 0:
                if column - start <= longest:
                    runs.append((float(row), 0.5 * (start + column - 1), 0.0))
                else:
                    runs.append((float(row), float(start), 1.0))
                    runs.append((float(row), float(column - 1), 2.0))
                start = -1
    result = np.empty((len(runs), 3))
    for index, entry in enumerate(runs):
        result[index, 0], result[index, 1], result[index, 2] = entry
    return result


def _row_circles(
    rig: StereoRig, eyes: tuple[EyeMask, EyeMask], random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return centres (C, 3) and unit normals (C, 3) of circles through points that both eyes see in one row."""
    centres, normals = _circles_through(*_row_points(rig, eyes, ends=False), TRIPLES, random)
    if len(centres) == 0:
        centres, normals = _circles_through(*_row_points(rig, eyes, ends=True), TRIPLES, random)
    return centres, normals


def _row_points(rig: StereoRig, eyes: tuple[EyeMask, EyeMask], ends: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return candidate points (N, 3) [m], pairs of runs in one row of both eyes between NEAREST and FARTHEST, and how
    often (N,) to draw each: less where many lie on one piece of the left mask, so that small pieces are not missed.
    `ends`: pairs of the left or the right ends of long runs too."""
    left, right = (_runs(eye.mask, LONGEST_RUN) for eye in eyes)
    if not ends:
        left, right = left[left[:, 2] == 0.0], right[right[:, 2] == 0.0]
    _, labels = cv2.connectedComponents(eyes[0].mask.astype(np.uint8))
    piece = labels[left[:, 0].astype(int), left[:, 1].astype(int)] if len(left) else np.empty(0, dtype=int)
    left, right = left + [eyes[0].row, eyes[0].column, 0], right + [eyes[1].row, eyes[1].column, 0]
    first = np.searchsorted(right[:, 0], left[:, 0], side="left")
    last = np.searchsorted(right[:, 0], left[:, 0], side="right")
    counts = last - first
    if counts.sum() == 0:
        return np.empty((0, 3)), np.empty(0)
    of_left = np.repeat(np.arange(len(left)), counts)
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    of_right = np.repeat(first, counts) + within
    disparity = left[of_left, 1] - right[of_right, 1]
    reach = rig.focal * rig.baseline
    keep = (disparity > reach / FARTHEST) & (disparity < reach / NEAREST) & (left[of_left, 2] == right[of_right, 2])
    of_piece = piece[of_left][keep]
    often = 1.0 / np.sqrt(np.bincount(of_piece)[of_piece])
    return rig.triangulate(left[of_left][keep][:, 1::-1], disparity[keep]), often


def _circles_through(
    points: np.ndarray, often: np.ndarray, count: int, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return centres (C, 3) and unit normals (C, 3) of circles of the needle's radius through about three of
    `points`, each of which is drawn as `often` as it says.

    Only triples whose own circle has a radius within 35 % of the needle's are used; the needle's circle keeps their
    plane and their middle point.
    """
    if len(points) < 3:
        return np.empty((0, 3)), np.empty((0, 3))
    drawn = np.searchsorted(np.cumsum(often) / often.sum(), random.random((count, 3)))
    triples = np.minimum(drawn, len(points) - 1)
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


class _BothMasks(NamedTuple):
    """What circles are scored on: focal length, principal point and baseline (4,); each eye's distances [px] to its
    mask, where it may be hidden, first columns and rows (2, 2), and some of each mask's pixels (P, 2)."""

    camera: np.ndarray
    distances: tuple[np.ndarray, np.ndarray]
    hidden: tuple[np.ndarray, np.ndarray]
    corners: np.ndarray
    pixels: tuple[np.ndarray, np.ndarray]


@compiled(fastmath=True)
def _score(centre: np.ndarray, normal: np.ndarray, masks: _BothMasks, pose: np.ndarray) -> float:
    """Return 0..2: share of the best half circle that lies on mask, plus share of the mask that it explains; write that
    half circle's pose (3, 4)."""
    camera, distances, hidden, corners, pixels = masks
    count = 60
    columns, rows, good = np.empty((2, count)), np.empty((2, count)), np.zeros((2, count))
    width = 0.0005 * camera[0] / max(centre[2], 0.01)
    # any two directions in the plane
    u, v = np.empty(3), np.empty(3)
    if abs(normal[0]) < 0.7:
        u[0], u[1], u[2] = 0.0, -normal[2], normal[1]
    else:
        u[0], u[1], u[2] = normal[2], 0.0, -normal[0]
    u /= np.sqrt(u[0] ** 2 + u[1] ** 2 + u[2] ** 2)
    v[0] = normal[1] * u[2] - normal[2] * u[1]
    v[1] = normal[2] * u[0] - normal[0] * u[2]
    v[2] = normal[0] * u[1] - normal[1] * u[0]
    for station in range(count):
        angle = 2 * np.pi * station / count
        a, b = 0.012 * np.cos(angle), 0.012 * np.sin(angle)
        x = centre[0] + a * u[0] + b * v[0]
        y = centre[1] + a * u[1] + b * v[1]
        z = max(centre[2] + a * u[2] + b * v[2], 0.01)
        for eye in range(2):
            columns[eye, station] = camera[0] * (x - eye * camera[3]) / z + camera[1]
            rows[eye, station] = camera[0] * y / z + camera[2]
            column = int(columns[eye, station] + 0.5) - int(corners[eye, 0])
            row = int(rows[eye, station] + 0.5) - int(corners[eye, 1])
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
        near_pixels = 0
        reach = (width + CLOSE) ** 2
        for index in range(len(pixels[eye])):
            for k in range(half):
                station = (at + k) % count
                du = columns[eye, station] - pixels[eye][index, 0]
                dv = rows[eye, station] - pixels[eye][index, 1]
                if du * du + dv * dv < reach:
                    near_pixels += 1
                    break
        explained += near_pixels / max(len(pixels[eye]), 1)
    turn = 2 * np.pi * at / count
    for i in range(3):
        pose[i, 0] = np.cos(turn) * u[i] + np.sin(turn) * v[i]
        pose[i, 1] = np.cos(turn) * v[i] - np.sin(turn) * u[i]
        pose[i, 2], pose[i, 3] = normal[i], centre[i]
    return best / (2.0 * half) + 0.5 * explained


@compiled
def _scores(centres: np.ndarray, normals: np.ndarray, masks: _BothMasks, poses: np.ndarray, scores: np.ndarray) -> None:
    for index in range(len(centres)):
        scores[index] = _score(centres[index], normals[index], masks, poses[index])


def _score_halves(
    rig: StereoRig,
    eyes: tuple[EyeMask, EyeMask],
    distances: tuple[np.ndarray, np.ndarray],
    pixels: tuple[np.ndarray, np.ndarray],
    centres: np.ndarray,
    normals: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return how well (C,) each circle's best half explains both masks, 0 to 2, and that half's pose (C, 4, 4).

    `distances` are each window's distances [px] to its mask, `pixels` (P, 2) some of each mask's pixels (column, row).
    """
    camera = np.array([rig.focal, rig.centre[0], rig.centre[1], rig.baseline])
    corners = np.array([[eyes[0].column, eyes[0].row], [eyes[1].column, eyes[1].row]], dtype=float)
    hidden = (eyes[0].hidden, eyes[1].hidden)
    poses, scores = np.tile(np.eye(4), (len(centres), 1, 1)), np.empty(len(centres))
    _scores(centres, normals, _BothMasks(camera, distances, hidden, corners, pixels), poses, scores)
    return scores, poses
