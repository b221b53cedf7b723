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
SURE_ROUND = 0.70
"""Share of a circle's directions from which more adds nothing to the confidence."""
RADII = (0.028, 0.160)
"""Least and largest radius of a dish [m]."""
NARROW = 0.060
"""A dish of a lesser radius [m] is a cup, or a small bowl, but no plate."""
DIRECTIONS = 72
"""Around a circle's middle."""
TOPS, STEP = 3, 0.012
"""Heights at which a piece's upper edge is looked for: its highest, and, that much lower [m] each, under what stands in
a dish."""
HALF = 0.5
"""A wall seen from outside shows at most this share of its round: an edge under something else has to show more."""
INNER, SEEN_INSIDE, ON_RIM = 0.55, 0.25, 0.10
"""Share of a radius within which a dish's floor is looked for. Where something stands in it, this share of that is seen
beside it, and no more of the dish's area lies over its rim."""
HELD = 0.01
"""Share of a dish's area that rises over its upper edge from which on something is in it."""
HOLDS = "holds an unknown object"
"""Such a dish is no dish to grasp or to stack: nothing is left of its confidence."""
TALL_INSIDE = 0.05
"""Share of a circle's area that may be taller than anything on the table is; more of it, and the edge is where heights
are cut off."""
HOLLOW_SHARE = 0.4
"""What is inside of a dish's edge lies lower than it by `hollow` or by this share of its height, whichever is less."""


@dataclass(frozen=True)
class Limits:
    """What counts as a dish. The defaults were set while looking at nine real frames (docs/results/tidy.md)."""

    least_round: float = 0.35
    """Share of a circle's directions in which the upper edge must lie on it, times the share of the edge's outline that
    lies on or in it: handles and neighbours do not."""
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
    found: list[tuple[float, Detection]] = []
    covered = np.zeros(inside.shape, dtype=np.uint8)
    # What is joined low down, by what hides between things, comes apart higher up: levels from the top down, and what
    # is surely a dish at one is left out of the lower ones.
    for level in LEVELS:
        high = (measured & (heights.smooth > max(level, ROUGH * heights.roughness)) & (covered == 0)).astype(np.uint8)
        for window, of_piece in _pieces(high, heights):
            share, dish = _dish(heights, window, of_piece, limits, random)
            if dish is not None:
                found.append((share, dish))
                if share > HALF:
                    _cover(covered, heights, dish)
    result = _apart(found)
    for dish in result:
        _cover(covered, heights, dish)
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


def _reach(dish: Detection) -> float:
    """Return how far from a dish's middle is what belongs to it [m]."""
    return AROUND + (dish.size.rim_radius if dish.size is not None else 0.0)


def _cover(covered: np.ndarray, heights: HeightMap, dish: Detection) -> None:
    """Mark (h, w) uint8 what belongs to a dish."""
    u, v = heights.pixel(dish.position[0], dish.position[1], dish.lip)
    cv2.circle(covered, (int(u), int(v)), int(_reach(dish) * float(heights.scale(dish.lip))), 1, -1)


def _apart(found: list[tuple[float, Detection]]) -> list[Detection]:
    """Return dishes less those whose middle is within one of which more is seen; `found`: how much, and the dish."""
    distinct: list[Detection] = []
    for _, dish in sorted(found, key=lambda one: -one[0]):
        if all(
            np.hypot(*np.subtract(dish.position, other.position)[:2]) > _reach(other) - AROUND for other in distinct
        ):
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
) -> tuple[float, Detection | None]:
    """Return the dish whose upper edge a piece over `level` [m] holds, or None, and the share of its round that shows.

    The edge is what is highest, or, where something stands in the dish, what is highest without that. Of several edges
    that are a dish's the one counts whose circle is seen best and has most of the edge in it.
    """
    smooth, known = heights.smooth[window], heights.valid[window] & own
    best, share, most = None, 0.0, 0.0
    rest = known
    for _ in range(TOPS):
        if np.count_nonzero(rest) < 20:
            break
        greatest = float(np.percentile(smooth[rest], 97))
        edge = (rest & (smooth > greatest - limits.edge_band)).astype(np.uint8)
        circle = _circle(edge, float(heights.scale(greatest)), random)
        if circle is not None and circle[3] * circle[4] > most:
            dish = _dish_of(heights, window, known & ~rest, greatest, circle, limits)
            if dish is not None:
                best, share, most = dish, circle[3], circle[3] * circle[4]
        rest = rest & (smooth <= greatest - STEP)
    return share, best


def _dish_of(
    heights: HeightMap,
    window: tuple[slice, slice],
    above: np.ndarray,
    greatest: float,
    circle: tuple[float, float, float, float, float],
    limits: Limits,
) -> Detection | None:
    """Return the dish whose upper edge is a circle of a window at a height [m], or None; `above` (h, w) bool is what
    of the piece is higher."""
    u, v, radius, share, inside = circle
    smooth, area = heights.smooth[window], np.pi * radius**2
    columns, rows = np.meshgrid(np.arange(smooth.shape[1]) - u, np.arange(smooth.shape[0]) - v)
    off = np.hypot(columns, rows) / radius
    # What is below the table was seen past its edge, and is no floor of a dish.
    within = (off < INNER) & heights.valid[window] & ~above & (smooth > -LEAST_HEIGHT)
    beside = np.count_nonzero(within)
    floor = float(np.median(smooth[within])) if beside > 10 else 0.0
    cut_off = np.count_nonzero(heights.tall[window] & (off < 1.0)) > TALL_INSIDE * area
    if share * inside < limits.least_round or greatest - floor < min(limits.hollow, HOLLOW_SHARE * greatest) or cut_off:
        return None
    on_rim = np.count_nonzero(above & (off > 0.8) & (off < 1.2))
    if above.any() and (share < HALF or beside < SEEN_INSIDE * INNER**2 * area or on_rim > ON_RIM * area):
        return None
    rim = radius / float(heights.scale(greatest))
    kind: Kind
    if greatest < 0.035 and rim < NARROW:
        return None
    if greatest < 0.035:
        kind = "plate"
    elif rim < NARROW and 0.7 * rim < greatest <= limits.slimmest * rim:
        kind = "cup"
    elif greatest < 1.6 * rim:
        kind = "bowl"
    else:
        return None
    x, y = heights.world(u + window[1].start, v + window[0].start, greatest)
    reasons = ["size estimated"]
    if share < SURE_ROUND:
        reasons.append("partly hidden")
    surely = max(0.0, share * inside - DEFAULT.least_round) / (SURE_ROUND - DEFAULT.least_round)
    confidence = 0.5 + 0.4 * min(1.0, surely)
    over_lip = heights.valid[window] & (smooth > greatest + 0.5 * STEP) & (off < 0.8)
    holds = np.count_nonzero(over_lip) > HELD * area
    if holds:
        reasons.append(HOLDS)
    return Detection(
        kind=kind,
        position=(float(x), float(y), 0.0),
        lip=greatest,
        confidence=0.0 if holds else confidence,
        unsure=tuple(reasons),
        size=dish_measures(greatest, rim),
    )


def _unknown(heights: HeightMap, window: tuple[slice, slice], own: np.ndarray, height: float, reason: str) -> Detection:
    middle = window[1].start + 0.5 * own.shape[1], window[0].start + 0.5 * own.shape[0]
    x, y = heights.world(middle[0], middle[1], height)
    extent = 0.5 * float(np.hypot(*own.shape)) / float(heights.scale(height))
    return Detection(
        kind=None, position=(float(x), float(y), 0.0), lip=height, confidence=0.0, extent=extent, unsure=(reason,)
    )


def _circle(
    edge: np.ndarray, scale: float, random: np.random.Generator
) -> tuple[float, float, float, float, float] | None:
    """Return (u, v, radius [px], share of directions, share of the outline in it) of the circle around an upper edge
    (h, w), or None.

    Circles through three outline points are drawn (RANSAC); the one whose points lie in most directions is refitted to
    the outermost by least squares."""
    contours, _ = cv2.findContours(edge, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    points = np.concatenate([contour[:, 0, :] for contour in contours]).astype(np.float64) if contours else np.empty(0)
    if len(points) < 20:
        return None
    circles = _through(points[random.integers(len(points), size=(DRAWS, 3))])
    circles = circles[(circles[:, 2] > RADII[0] * scale) & (circles[:, 2] < RADII[1] * scale)]
    if len(circles) == 0:
        return None
    best = circles[np.multiply(*_shares(points, circles, scale)).argmax()]
    outer = _outermost(points, best, scale)
    system = np.column_stack([outer, np.ones(len(outer))])
    a, b, c = np.linalg.lstsq(system, (outer**2).sum(axis=1), rcond=None)[0]
    radius = float(np.sqrt(max(c + 0.25 * (a * a + b * b), 1e-9)))
    if abs(radius - best[2]) <= 3.0 * NEAR * scale:
        best = np.array([0.5 * a, 0.5 * b, radius])
    if not RADII[0] * scale < best[2] < RADII[1] * scale:
        return None
    share, inside = (float(value[0]) for value in _shares(points, best[None], scale))
    return float(best[0]), float(best[1]), float(best[2]), share, inside


def _outermost(points: np.ndarray, circle: np.ndarray, scale: float) -> np.ndarray:
    """Return the farthest point near a circle in each direction: the outline of a ring with gaps runs along its inner
    side too."""
    offset = points - circle[:2]
    reach = np.hypot(offset[:, 0], offset[:, 1])
    near_circle = np.abs(reach - circle[2]) < 2.5 * NEAR * scale
    points, reach, direction = points[near_circle], reach[near_circle], _directions(offset[near_circle])
    order = np.argsort(-reach)
    return points[order[np.unique(direction[order], return_index=True)[1]]]


def _through(points: np.ndarray) -> np.ndarray:
    """Return (N, 3) middles and radii of the circles through three points each (N, 3, 2), of those that have one."""
    system = 2.0 * (points[:, 1:] - points[:, :1])
    points, system = (rows[np.abs(np.linalg.det(system)) > 1e-6] for rows in (points, system))
    squares = (points**2).sum(axis=2)
    middles = np.linalg.solve(system, (squares[:, 1:] - squares[:, :1])[..., None])[..., 0]
    return np.column_stack([middles, np.linalg.norm(points[:, 0] - middles, axis=1)])


def _directions(offset: np.ndarray) -> np.ndarray:
    """Return in which of the directions around a middle offsets (..., 2) lie."""
    turn = np.arctan2(offset[..., 1], offset[..., 0]) / (2.0 * np.pi) + 0.5
    return np.floor(turn * DIRECTIONS).astype(int) % DIRECTIONS


def _shares(points: np.ndarray, circles: np.ndarray, scale: float) -> tuple[np.ndarray, np.ndarray]:
    """Return of circles (N, 3) the share (N,) of the directions around the middle in which a point lies on it, and the
    share (N,) of the points that lie on or in it."""
    offset = points - circles[:, None, :2]
    outside = np.hypot(offset[..., 0], offset[..., 1]) - circles[:, 2:]
    row, column = np.nonzero(np.abs(outside) < NEAR * scale)
    met = np.zeros((len(circles), DIRECTIONS), dtype=bool)
    met[row, _directions(offset[row, column])] = True
    return met.mean(axis=1), (outside < 2.0 * NEAR * scale).mean(axis=1)
