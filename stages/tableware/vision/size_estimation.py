"""Dishes of unknown size: circles fitted to the upper edges of what stands on the table, told apart by their shape.

A thing is a dish when its upper edge is a circle and what is within it lies lower. A narrow tall one is a cup, a wide
one a bowl, a flat one a plate; everything else is reported as unknown with its extent. Utensils are not looked for:
of unknown size they are not told from other slender things.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scenewright.stages.tableware.vision.detections import Detection
from scenewright.stages.tableware.vision.height_map import TALLEST, HeightMap
from scenewright.stages.tableware.world.items import Kind, dish_measures

LEAST_HEIGHT, LEAST_AREA = 0.010, 0.0006
"""What stands on the table rises over the first [m] on more than the second [m^2]."""
LEVELS = (0.110, 0.085, 0.065, 0.045, 0.030, LEAST_HEIGHT)
"""Heights [m] over which pieces are looked at."""
ROUGH = 3.0
"""Multiple of the table's roughness: less is a wave in the depth."""
AROUND = 0.012
"""What is this near to a dish belongs to it: handles, what flies about its edge [m]."""
DRAWS = 200
"""Triples of points through which circles are laid; by eye."""
NEAR = 0.0035
"""Points this near to a circle are on it [m]."""
LEAST_TRIED, SURE_ROUND = 0.30, 0.70
"""Shares of a circle's directions from which it is looked at, and from which more adds nothing to the confidence."""
RADII = (0.028, 0.160)
"""Least and largest radius of a dish [m]."""
HOLLOW_SHARE = 0.4
"""What is inside of a dish's edge lies lower than it by `hollow` or by this share of its height, whichever is less."""


@dataclass(frozen=True)
class Limits:
    """What counts as a dish. The defaults were set while looking at nine real frames (docs/results/tidy_detect.md)."""

    least_round: float = 0.40
    """Share of a circle's directions in which the upper edge must lie on it."""
    edge_band: float = 0.012
    """The upper edge lies within this of the greatest height [m]: dishes seen from the side are noisy."""
    hollow: float = 0.020
    """[m]"""
    slimmest: float = 10.0
    """Greatest height over rim radius: what is slimmer is no cup but the corner of a box, or a bottle."""


DEFAULT = Limits()


def estimated_dishes(heights: HeightMap, seed: int = 0, limits: Limits = DEFAULT) -> tuple[Detection, ...]:
    """Return what stands on the table, dishes with their measures in `size`, the rest as unknown. No two stacked ones
    are told apart: a stack is one thing."""
    random = np.random.default_rng([seed, 74])
    inside = heights.workspace()
    measured = inside & heights.valid
    result: list[Detection] = []
    covered = np.zeros(inside.shape, dtype=np.uint8)
    # What is joined low down, by what hides between things, comes apart higher up: levels from the top down, and what
    # is a dish at one is left out of the lower ones.
    for level in LEVELS:
        high = (measured & (heights.smooth > max(level, ROUGH * heights.roughness)) & (covered == 0)).astype(np.uint8)
        for window, of_piece in _pieces(high, heights):
            dish = _dish(heights, window, of_piece, limits, random)
            if dish is not None:
                result.append(dish)
                assert dish.size is not None
                u, v = heights.pixel(dish.position[0], dish.position[1], dish.lip)
                reach = (dish.size.rim_radius + AROUND) * float(heights.scale(dish.lip))
                cv2.circle(covered, (int(u), int(v)), int(reach), 1, -1)
    result = _apart(result)
    low = max(LEAST_HEIGHT, ROUGH * heights.roughness)
    unexplained = (((measured & (heights.smooth > low)) | (heights.tall & inside)) & (covered == 0)).astype(np.uint8)
    for window, of_piece in _pieces(unexplained, heights):
        tall = heights.tall[window][of_piece].mean() > 0.05
        known_heights = heights.smooth[window][of_piece & heights.valid[window]]
        height = TALLEST if tall or len(known_heights) == 0 else float(np.percentile(known_heights, 97))
        result.append(
            _unknown(heights, window, of_piece, height, f"taller than {TALLEST:.2f} m" if tall else "unknown object")
        )
    return tuple(result)


def _apart(dishes: list[Detection]) -> list[Detection]:
    """Return dishes less those whose middle is within one that is surer."""
    distinct: list[Detection] = []
    for dish in sorted(dishes, key=lambda dish: -dish.confidence):
        (x, y, _), apart = dish.position, True
        for earlier in distinct:
            reach = earlier.size.rim_radius if earlier.size is not None else 0.0
            apart &= bool(np.hypot(x - earlier.position[0], y - earlier.position[1]) > reach)
        if apart:
            distinct.append(dish)
    return distinct


def _pieces(mask: np.ndarray, heights: HeightMap) -> list[tuple[tuple[slice, slice], np.ndarray]]:
    """Return (window, (h, w) bool) of each connected piece of a mask (h, w) uint8 that is large enough."""
    mask = cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    mask = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((7, 7), np.uint8))
    count, labels, boxes, _ = cv2.connectedComponentsWithStats(mask)
    result = []
    for label in range(1, count):
        left, top, width, height, area = boxes[label]
        if area >= LEAST_AREA * float(heights.scale(0.05)) ** 2:
            window = (slice(top, top + height), slice(left, left + width))
            result.append((window, labels[window] == label))
    return result


def _dish(
    heights: HeightMap, window: tuple[slice, slice], own: np.ndarray, limits: Limits, random: np.random.Generator
) -> Detection | None:
    """Return the dish whose upper edge a piece over `level` [m] holds, or None."""
    smooth, valid = heights.smooth[window], heights.valid[window] & own
    if np.count_nonzero(valid) < 20:
        return None
    corner = np.array([window[1].start, window[0].start], dtype=float)
    greatest = float(np.percentile(smooth[valid], 97))
    edge = (valid & (smooth > greatest - limits.edge_band)).astype(np.uint8)
    circle = _circle(edge, float(heights.scale(greatest)), random)
    if circle is None or circle[3] < limits.least_round:
        return None
    u, v, radius, share = circle
    columns, rows = np.meshgrid(np.arange(own.shape[1]) - u, np.arange(own.shape[0]) - v)
    within = (np.hypot(columns, rows) < 0.55 * radius) & heights.valid[window]
    floor = float(np.median(smooth[within])) if np.count_nonzero(within) > 10 else 0.0
    if greatest - floor < min(limits.hollow, HOLLOW_SHARE * greatest):
        return None
    rim = radius / float(heights.scale(greatest))
    kind: Kind
    if greatest < 0.035:
        kind = "plate"
    elif rim < 0.060 and 0.7 * rim < greatest <= limits.slimmest * rim:
        kind = "cup"
    elif greatest < 1.6 * rim:
        kind = "bowl"
    else:
        return None
    x, y = heights.world(u + corner[0], v + corner[1], greatest)
    reasons = ["size estimated"]
    if share < SURE_ROUND:
        reasons.append("partly hidden")
    confidence = 0.5 + 0.4 * min(1.0, max(0.0, share - DEFAULT.least_round) / (SURE_ROUND - DEFAULT.least_round))
    size = dish_measures(greatest, rim)
    return Detection(
        kind=kind,
        position=(float(x), float(y), 0.0),
        lip=greatest,
        confidence=confidence,
        unsure=tuple(reasons),
        size=size,
    )


def _unknown(heights: HeightMap, window: tuple[slice, slice], own: np.ndarray, height: float, reason: str) -> Detection:
    middle = window[1].start + 0.5 * own.shape[1], window[0].start + 0.5 * own.shape[0]
    x, y = heights.world(middle[0], middle[1], height)
    extent = 0.5 * float(np.hypot(*own.shape)) / float(heights.scale(height))
    return Detection(
        kind=None, position=(float(x), float(y), 0.0), lip=height, confidence=0.0, extent=extent, unsure=(reason,)
    )


def _circle(edge: np.ndarray, scale: float, random: np.random.Generator) -> tuple[float, float, float, float] | None:
    """Return (u, v, radius [px], share of directions) of the circle around an upper edge (h, w), or None.

    Circles through three outline points are drawn (RANSAC); the one whose points lie in most directions is refitted to
    the outermost by least squares."""
    contours, _ = cv2.findContours(edge, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    points = np.concatenate([contour[:, 0, :] for contour in contours]).astype(np.float64) if contours else np.empty(0)
    if len(points) < 20:
        return None
    best, share = None, 0.0
    for _ in range(DRAWS):
        circle = _through(points[random.choice(len(points), 3, replace=False)])
        if circle is None or not RADII[0] * scale < circle[2] < RADII[1] * scale:
            continue
        share_of_circle = _share(points, circle, scale)
        if share_of_circle > share:
            best, share = circle, share_of_circle
    if best is None or share < LEAST_TRIED:
        return None
    outer = _outermost(points, best, scale)
    system = np.column_stack([outer, np.ones(len(outer))])
    a, b, c = np.linalg.lstsq(system, (outer**2).sum(axis=1), rcond=None)[0]
    radius = float(np.sqrt(max(c + 0.25 * (a * a + b * b), 1e-9)))
    if abs(radius - best[2]) > 3.0 * NEAR * scale:
        return (*best, share)
    return 0.5 * float(a), 0.5 * float(b), radius, share


def _outermost(points: np.ndarray, circle: tuple[float, float, float], scale: float) -> np.ndarray:
    """Return the farthest point near a circle in each of 72 directions: the outline of a ring with gaps runs along its
    inner side too."""
    offset = points - np.array(circle[:2])
    reach = np.hypot(offset[:, 0], offset[:, 1])
    near_circle = np.abs(reach - circle[2]) < 2.5 * NEAR * scale
    points, reach, offset = points[near_circle], reach[near_circle], offset[near_circle]
    direction = np.floor((np.arctan2(offset[:, 1], offset[:, 0]) / (2.0 * np.pi) + 0.5) * 72.0).astype(int) % 72
    order = np.argsort(-reach)
    return points[order[np.unique(direction[order], return_index=True)[1]]]


def _through(points: np.ndarray) -> tuple[float, float, float] | None:
    system = 2.0 * (points[1:] - points[0])
    if abs(np.linalg.det(system)) < 1e-6:
        return None
    u, v = np.linalg.solve(system, (points[1:] ** 2).sum(axis=1) - (points[0] ** 2).sum())
    return float(u), float(v), float(np.hypot(*(points[0] - (u, v))))


def _share(points: np.ndarray, circle: tuple[float, float, float], scale: float) -> float:
    """Return the share of 72 directions around a circle's centre in which a point lies on it."""
    offset = points - np.array(circle[:2])
    near_circle = np.abs(np.hypot(offset[:, 0], offset[:, 1]) - circle[2]) < NEAR * scale
    directions = (
        np.floor((np.arctan2(offset[near_circle, 1], offset[near_circle, 0]) / (2.0 * np.pi) + 0.5) * 72.0).astype(int)
        % 72
    )
    return len(np.unique(directions)) / 72.0
