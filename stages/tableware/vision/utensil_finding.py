"""Forks and spoons: bars in a map of what is item and what is not, told apart by their outlines.

The map (h, w) holds 1 where something of a utensil's colour or height is, -1 where it is not, 0 where it is unknown (in
or behind a dish). A bar's place comes from moments of a lone blob, else from a Hough transform; then each outline
(fork, spoon, either way round) is shifted and turned until it covers most and its border least.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.tableware.vision.bar_search import bar_candidates
from scenewright.stages.tableware.world.dish_shapes import utensil_parts
from scenewright.stages.tableware.world.items import DishSizes, Kind

LEAST_SCORE = 0.55
"""Cover of an outline less that of its border, each -1..1 and halved: 1 is perfect."""
LEAST_VISIBLE = 0.40
"""Share of an outline's points that are known."""
UNKNOWN_WEIGHT = 0.5
"""Unknown points of an outline count as this much of a point that is half item and half not: an outline gains nothing
by sliding to where nothing is known."""
LEAST_VOTES = 1.5
"""Votes per pixel of length under which a bar is not tried: a utensil that is wholly seen has about six."""
GOOD_SCORE = 0.75
"""No further candidate is tried from here."""
STARTS = 4
"""Candidate bars that are fitted before the best is taken."""


Pose = tuple[float, float, float, float, float]
"""(score, u [px], v [px], angle [rad], share that is known)"""


@dataclass(frozen=True)
class Bar:
    """A utensil in the map: kind, centre [px], direction of the head in the image [rad], score 0..1, share that is
    known; the best poses as either kind."""

    kind: Kind
    u: float
    v: float
    angle: float
    score: float
    visible: float
    poses: dict[Kind, Pose]


@cache
def outline(kind: Kind, sizes: DishSizes) -> tuple[np.ndarray, np.ndarray]:
    """Return points (N, 2) [m] within a utensil's plan and (M, 2) in a border 2 to 5 mm around it."""
    measures = sizes[kind]
    step = 0.0015
    x, y = np.meshgrid(
        np.arange(-0.5 * measures.length - 0.006, 0.5 * measures.length + 0.006, step), np.arange(-0.015, 0.0151, step)
    )
    inside = np.zeros(x.shape, dtype=np.uint8)
    for stations, low, high in utensil_parts(measures, kind == "fork"):
        within = (x >= stations[0]) & (x <= stations[-1])
        inside |= (within & (y >= np.interp(x, stations, low)) & (y <= np.interp(x, stations, high))).astype(np.uint8)
    dilated = cv2.dilate(inside, np.ones((3, 3), np.uint8))
    border = (cv2.dilate(inside, np.ones((7, 7), np.uint8)) > 0) & (dilated == 0)
    # A fork's gaps are two pixels wide, and blurred: here they say nothing.
    gaps = (x > 0.5 * measures.length - 0.040) & (np.abs(y) < 0.5 * measures.width) & (x < 0.5 * measures.length)
    border &= ~(gaps & (kind == "fork"))
    points = np.stack([x, y], axis=2)
    return points[inside > 0][::3], points[border][::3]


@compiled
def _scores(
    map_: np.ndarray,
    inside: np.ndarray,
    border: np.ndarray,
    scale: float,
    u: np.ndarray,
    v: np.ndarray,
    angle: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return (N,) scores of an outline at N poses, half the difference of the mean map in it and around it, and (N,)
    shares of the outline that are known.

    Image rows go down where world y goes up.
    """
    result, visible = np.zeros(len(u)), np.zeros(len(u))
    for k in range(len(u)):
        cos, sin = scale * np.cos(angle[k]), scale * np.sin(angle[k])
        for part in range(2):
            points = inside if part == 0 else border
            total, measured = 0, 0
            for i in range(len(points)):
                column = int(u[k] + points[i, 0] * cos + points[i, 1] * sin + 0.5)
                row = int(v[k] + points[i, 0] * sin - points[i, 1] * cos + 0.5)
                if 0 <= column < map_.shape[1] and 0 <= row < map_.shape[0]:
                    value = map_[row, column]
                    total += value
                    measured += value != 0
            mean = total / max(measured + UNKNOWN_WEIGHT * (len(points) - measured), 1.0)
            result[k] += 0.5 * mean if part == 0 else -0.5 * mean
            if part == 0:
                visible[k] = measured / len(points)
    return result, visible


def _best_pose(
    map_: np.ndarray,
    kind: Kind,
    scale: float,
    start: tuple[float, float, float],
    steps: tuple[float, float, float],
    far: int,
    sizes: DishSizes,
) -> Pose:
    """Return the best of 9 (2 far + 1) poses around a start; steps along, across [px], turn [rad]."""
    along, across, turn = (step * grid for step, grid in zip(steps, _grid(far), strict=True))
    cos, sin = np.cos(start[2]), np.sin(start[2])
    columns, rows = start[0] + along * cos - across * sin, start[1] + along * sin + across * cos
    scores, visible = _scores(map_, *outline(kind, sizes), scale, columns, rows, start[2] + turn)
    k = int(np.argmax(scores))
    return float(scores[k]), float(columns[k]), float(rows[k]), float(start[2] + turn[k]), float(visible[k])


@cache
def _grid(far: int) -> tuple[np.ndarray, ...]:
    fine_steps = np.arange(-1, 2)
    return tuple(part.reshape(-1) for part in np.meshgrid(np.arange(-far, far + 1), fine_steps, fine_steps))


def fit_utensil(map_: np.ndarray, scale: float, start: tuple[float, float, float], sizes: DishSizes) -> Bar:
    """Return the best outline near a bar's centre (u, v) [px] and direction [rad]; `scale` in pixels per metre."""
    u, v, angle = start
    fitted: list[tuple[Pose, Kind]] = []
    part = _scores(map_, *outline("spoon", sizes), scale, np.array([u]), np.array([v]), np.array([angle]))[1][0] < 0.9
    for kind in sizes.utensils:
        pose = max(
            _best_pose(map_, kind, scale, (u, v, angle + flip), (6.0, 2.0, 0.05), 6 if part else 2, sizes)
            for flip in (0.0, np.pi)
        )
        for steps in ((2.0, 1.0, 0.02), (1.0, 0.5, 0.008)):
            pose = _best_pose(map_, kind, scale, pose[1:4], steps, 2, sizes)
        fitted.append((pose, kind))
    fitted.sort(reverse=True)
    (score, u, v, angle, visible), kind = fitted[0]
    return Bar(kind, u, v, angle, score, visible, {kind: pose for pose, kind in fitted})


def search_bars(map_: np.ndarray, scale: float, most: int, sizes: DishSizes) -> list[Bar]:
    """Return up to `most` utensils of a map (h, w) that lie touching, crossing or partly unknown, best first."""
    unexplained = map_.copy()
    bars: list[Bar] = []
    if not sizes.utensils:
        return bars
    length = sizes["spoon"].length * scale
    for _ in range(most):
        rows, columns = np.nonzero(unexplained > 0)
        if len(rows) < 0.25 * length * 0.008 * scale:
            break
        best: Bar | None = None
        for start in bar_candidates(rows, columns, length, STARTS):
            if start[0] < LEAST_VOTES * length or (best is not None and best.score > GOOD_SCORE):
                break
            bar = fit_utensil(unexplained, scale, (float(start[1]), float(start[2]), float(start[3])), sizes)
            if best is None or bar.score > best.score:
                best = bar
        if best is None or best.score < LEAST_SCORE or best.visible < LEAST_VISIBLE:
            break
        bars.append(best)
        erase_bar(unexplained, best, scale, sizes)
    return bars


def erase_bar(map_: np.ndarray, bar: Bar, scale: float, sizes: DishSizes) -> None:
    """Set a map to unknown, in place, where a bar lies."""
    half = 0.5 * sizes[bar.kind].length * scale
    dx, dy = half * np.cos(bar.angle), half * np.sin(bar.angle)
    ends = [(int(round(bar.u + s * dx)), int(round(bar.v + s * dy))) for s in (-1.0, 1.0)]
    cv2.line(map_, ends[0], ends[1], 0, max(3, int(1.35 * sizes[bar.kind].width * scale)))
