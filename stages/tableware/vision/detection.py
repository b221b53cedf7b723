"""Tableware in one overhead RGB-D image: dishes and stacks from depth, utensils from colour and depth.

    detections = detect(color, depth, overhead_camera())

Dishes are found by their lips, whose heights say how many stand in one another; utensils on dishes lie at a lip's
height, utensils on the table differ from it in colour and rise over it by their thickness. What is left over and stands
out is reported as unknown. Every item has a confidence and the reasons for doubt.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from stages.tableware.vision.detections import Detection
from stages.tableware.vision.foreground import unlike_table
from stages.tableware.vision.height_map import HeightMap, height_map
from stages.tableware.vision.rim_finding import Rim, find_rims, overlapping
from stages.tableware.vision.stack_reading import LIP_TOLERANCE, Stack, read_stacks
from stages.tableware.vision.utensil_finding import LEAST_SCORE, Bar, fit_utensil, search_bars
from stages.tableware.world.items import MEASURES, TABLE_SIDES, UTENSILS
from stages.tableware.world.overhead import OverheadCamera

UTENSIL_AREA = 0.00158
"""Plan area of a fork or a spoon [m^2]."""
BAND = 0.006
"""A utensil on a dish lies within this of the lip's height [m]."""
LEAST_DEPTH, MOST_GLARE = 0.45, 0.10
"""Shares of a lip's pixels with depth, and of a dish's pixels at full white, at which there is doubt."""
FLAT = 0.0020
"""What looks unlike the table and rises less than this [m] is a shadow or a mark, and nothing to clear."""
LEAST_RELIEF = 0.0008
"""A utensil rises this much over the table [m], on average over its plan."""
UNKNOWN_HEIGHT, UNKNOWN_AREA = 0.010, 0.00035
"""What rises over the first [m] on more than the second [m^2] without being an item is unknown."""


def detect(color: np.ndarray, depth: np.ndarray, camera: OverheadCamera) -> tuple[Detection, ...]:
    """Return the items in an image; what carries another comes before it.

    `color` (H, W, 3) uint8, `depth` (H, W) z-depth [m], 0 where unknown. An empty table gives an empty tuple. Raises
    BadInput when there is no depth, its scale is wrong, or the images do not fit the camera.
    """
    heights = height_map(color, depth, camera)
    rims = find_rims(heights)
    crossed = {id(rims[index]) for index in overlapping(rims)}
    stacks = read_stacks(rims)
    covered = np.zeros(heights.smooth.shape, dtype=np.uint8)
    for index, stack in enumerate(stacks):
        _cover(covered, heights, stack, index + 1)
    found: list[Detection] = []
    for index, stack in enumerate(stacks):
        carrier = len(found) + len(stack.kinds) - 1
        found.extend(_dishes(stack, heights, crossed, len(found)))
        for level, bar in enumerate(_on_stack(heights, stack, covered, index + 1)):
            z = stack.top + level * MEASURES[bar.kind].height
            found.append(_utensil(bar, heights, z, carrier))
            carrier = len(found) - 1
            _cover_bar(covered, heights, bar, z)
    hidden = covered > 0
    unlike = unlike_table(heights, cv2.dilate(covered, np.ones((5, 5), np.uint8)) > 0) & _workspace(heights)
    bars, strange = _on_table(heights, unlike, hidden)
    for bar in bars:
        here = np.array(heights.world(np.float64(bar.u), np.float64(bar.v), 0.0))
        below = [k for k, other in enumerate(found) if other.on is None and other.kind in UTENSILS
                 and np.hypot(*(here - other.position[:2])) < 0.012]  # fmt: skip
        z = MEASURES[bar.kind].height if below else 0.0
        found.append(_utensil(bar, heights, z, below[0] if below else None))
        _cover_bar(covered, heights, bar, z)
    found.extend(_unknown(heights, covered, strange))
    return tuple(_outside(one) for one in found)


def _cover(covered: np.ndarray, heights: HeightMap, stack: Stack, label: int) -> None:
    """Write a label where dishes are seen, in place: discs of their outer radius at several heights."""
    for kind, foot in zip(stack.kinds, stack.feet, strict=True):
        measures = MEASURES[kind]
        for share in (0.0, 0.25, 0.5, 0.75, 1.0):
            z = foot + share * measures.height
            u, v = heights.pixel(np.float64(stack.x), np.float64(stack.y), z)
            radius = float(heights.scale(z)) * measures.outer_radius(share * measures.height) + 2.0
            cv2.circle(covered, (int(round(float(u))), int(round(float(v)))), int(round(radius)), label, -1)


def _cover_bar(covered: np.ndarray, heights: HeightMap, bar: Bar, z: float) -> None:
    half = 0.5 * MEASURES[bar.kind].length * float(heights.scale(z))
    dx, dy = half * np.cos(bar.angle), half * np.sin(bar.angle)
    ends = [(int(round(bar.u + s * dx)), int(round(bar.v + s * dy))) for s in (-1.0, 1.0)]
    cv2.line(covered, ends[0], ends[1], 255, int(1.5 * MEASURES[bar.kind].width * float(heights.scale(z))))


def _workspace(heights: HeightMap) -> np.ndarray:
    """Return (h, w) bool: the table top in the image, less two pixels."""
    mask = np.zeros(heights.smooth.shape, dtype=bool)
    (left, right), (bottom, top) = heights.pixel(
        np.array([-0.5, 0.5]) * TABLE_SIDES[0], np.array([-0.5, 0.5]) * TABLE_SIDES[1], 0.0
    )
    mask[max(0, int(top) + 3) : int(bottom) - 1, max(0, int(left) + 3) : int(right) - 1] = True
    return mask


def _dishes(stack: Stack, heights: HeightMap, crossed: set[int], first: int) -> list[Detection]:
    """Return the dishes of a stack from the lowest up; those under one of their own kind are hidden."""
    result = []
    rims = {rim.kind: rim for rim in stack.rims}
    for level, (kind, foot) in enumerate(zip(stack.kinds, stack.feet, strict=True)):
        rim = rims[kind]
        hidden = level + 1 < len(stack.kinds) and stack.kinds[level + 1] == kind
        confidence, reasons = _doubt(rim, stack, heights)
        if id(rim) in crossed:
            confidence, reasons = 0.5 * confidence, (*reasons, "overlapping rims")
        at = (stack.x, stack.y) if hidden else (rim.x, rim.y)
        result.append(
            Detection(
                kind=kind, position=(*at, foot), lip=foot + MEASURES[kind].height, hidden=hidden,
                on=first + level - 1 if level else None, confidence=confidence * (0.9 if hidden else 1.0),
                unsure=reasons,
            )
        )  # fmt: skip
    return result


def _doubt(rim: Rim, stack: Stack, heights: HeightMap) -> tuple[float, tuple[str, ...]]:
    """Return the confidence 0..1 in a rim and the reasons for doubt."""
    reasons = []
    confidence = min(1.0, rim.support / 0.65) * float(np.exp(-0.5 * (stack.misfit / LIP_TOLERANCE) ** 2))
    if rim.depth_share < LEAST_DEPTH:
        reasons.append("no depth")
        confidence *= rim.depth_share / LEAST_DEPTH
    if stack.misfit > LIP_TOLERANCE:
        reasons.append("a stack of unknown height")
    u, v = (float(value) for value in heights.pixel(np.float64(rim.x), np.float64(rim.y), rim.lip))
    radius = 0.7 * MEASURES[rim.kind].rim_radius * float(heights.scale(rim.lip))
    part = heights.color[max(0, int(v - radius)) : int(v + radius) + 1, max(0, int(u - radius)) : int(u + radius) + 1]
    bright = part.min(axis=2) if part.size else np.zeros((1, 1))
    if float((bright >= 253).mean()) > MOST_GLARE and float(np.median(bright)) < 250:
        reasons.append("glare")
        confidence *= 0.7
    return confidence, tuple(reasons)


def _on_stack(heights: HeightMap, stack: Stack, covered: np.ndarray, label: int) -> list[Bar]:
    """Return utensils that lie across the uppermost lip, the lowest first; places in the map's pixels at its height."""
    top = MEASURES[stack.kinds[-1]]
    z = stack.top + 0.002
    scale = float(heights.scale(z))
    u, v = (float(value) for value in heights.pixel(np.float64(stack.x), np.float64(stack.y), z))
    reach = int(0.112 * scale)
    left, up = max(0, int(u) - reach), max(0, int(v) - reach)
    window = (slice(up, max(up, int(v) + reach)), slice(left, max(left, int(u) + reach)))
    part, owner = heights.smooth[window], covered[window]
    if part.size == 0:
        return []
    rows, columns = np.mgrid[up : up + part.shape[0], left : left + part.shape[1]]
    distance = np.hypot(columns - u, rows - v) / scale
    # The gaps between tines show what is below: the highest of three by three closes them.
    high = np.abs(cv2.dilate(part, np.ones((3, 3), np.uint8)) - z) < BAND
    within = distance < top.inner_radius(top.height) - 0.010
    if high[within].sum() < 0.9 * top.inner_radius(top.height) * 0.006 * scale**2:
        return []
    map_ = np.where(high, 1, -1).astype(np.int8)
    map_[(distance > top.inner_radius(top.height) - 0.007) & (distance < top.rim_radius + 0.004)] = 0
    map_[(owner != label) & (owner > 0)] = 0
    map_[(part > z + BAND)] = 0
    bars = [replace(bar, u=bar.u + left, v=bar.v + up) for bar in search_bars(map_, scale, 2)]
    return sorted(bars, key=lambda bar: _mean_height(heights, bar, z))


def _axis(heights: HeightMap, bar: Bar, z: float, share: float = 0.94) -> tuple[np.ndarray, np.ndarray]:
    """Return pixel columns and rows along a bar's middle line."""
    half = 0.5 * share * MEASURES[bar.kind].length * float(heights.scale(z))
    along = np.linspace(-half, half, 60)
    columns = np.clip(np.rint(bar.u + along * np.cos(bar.angle)).astype(int), 0, heights.smooth.shape[1] - 1)
    rows = np.clip(np.rint(bar.v + along * np.sin(bar.angle)).astype(int), 0, heights.smooth.shape[0] - 1)
    return columns, rows


def _mean_height(heights: HeightMap, bar: Bar, z: float) -> float:
    columns, rows = _axis(heights, bar, z)
    return float(np.median(heights.smooth[rows, columns]))


def _utensil(bar: Bar, heights: HeightMap, z: float, on: int | None) -> Detection:
    """Return a utensil whose underside is at height z [m]; its grasp is the highest place along its axis."""
    thick = MEASURES[bar.kind].height
    x, y = heights.world(np.float64(bar.u), np.float64(bar.v), z + thick)
    columns, rows = _axis(heights, bar, z)
    along = np.convolve(heights.smooth[rows, columns], np.full(9, 1.0 / 9.0), mode="valid")
    k = int(np.argmax(along)) + 4
    grasp = heights.world(np.float64(columns[k]), np.float64(rows[k]), z + thick)
    reasons = []
    confidence = min(1.0, bar.score / 0.85)
    if heights.valid[rows, columns].mean() < LEAST_DEPTH:
        reasons.append("no depth")
    if bar.margin < 0.015:
        reasons.append("fork or spoon")
        confidence *= 0.8
    yaw = float(np.arctan2(np.sin(-bar.angle), np.cos(-bar.angle)))
    return Detection(
        kind=bar.kind, position=(float(x), float(y), z), yaw=yaw, lip=z + thick, on=on,
        grasp=(float(grasp[0]), float(grasp[1]), float(along.max())), confidence=confidence, unsure=tuple(reasons),
    )  # fmt: skip


def _relief(heights: HeightMap, bar: Bar) -> float:
    """Return how much higher [m] the heights along a bar are than beside it."""
    columns, rows = _axis(heights, bar, 0.0)
    aside = 0.022 * float(heights.scale(0.0))
    du, dv = -np.sin(bar.angle) * aside, np.cos(bar.angle) * aside
    beside = []
    for sign in (-1.0, 1.0):
        c = np.clip(np.rint(columns + sign * du).astype(int), 0, heights.smooth.shape[1] - 1)
        r = np.clip(np.rint(rows + sign * dv).astype(int), 0, heights.smooth.shape[0] - 1)
        values = heights.smooth[r, c]
        beside.append(values[np.abs(values) < 0.008])
    ground = np.concatenate(beside)
    return float(heights.smooth[rows, columns].mean() - (ground.mean() if len(ground) else 0.0))


def _on_table(heights: HeightMap, unlike: np.ndarray, hidden: np.ndarray) -> tuple[list[Bar], np.ndarray]:
    """Return the utensils on the table, and (h, w) bool of what looks unlike the table and is none."""
    scale = float(heights.scale(0.003))
    whole = UTENSIL_AREA * scale**2
    count, labels, boxes, centers = cv2.connectedComponentsWithStats(unlike.astype(np.uint8), connectivity=8)
    bars: list[Bar] = []
    strange = np.zeros(unlike.shape, dtype=bool)
    margin = int(0.05 * scale)
    for label in range(1, count):
        left, top, width, height, area = boxes[label]
        if area < 0.25 * whole:
            continue
        window = (
            slice(max(0, top - margin), top + height + margin),
            slice(max(0, left - margin), left + width + margin),
        )
        own = labels[window] == label
        map_ = np.where(own, 1, -1).astype(np.int8)
        map_[hidden[window] | ((labels[window] > 0) & ~own)] = 0
        corner = (window[1].start, window[0].start)
        rows, columns = np.nonzero(own)
        spread = np.cov(np.stack([columns, rows]).astype(np.float64))
        values, vectors = np.linalg.eigh(spread)
        lone = area < 1.4 * whole and values[0] < 0.02 * values[1] and np.sqrt(12.0 * values[1]) > 0.11 * scale
        found: list[Bar] = []
        if lone:
            angle = float(np.arctan2(vectors[1, 1], vectors[0, 1]))
            bar = fit_utensil(map_, scale, float(columns.mean()), float(rows.mean()), angle)
            found = [bar] if bar.score >= LEAST_SCORE else []
        if not found:
            found = search_bars(map_, scale, min(5, int(area / whole + 1.5)))
        if not found and area > UNKNOWN_AREA * scale**2 and heights.smooth[window][own].mean() > FLAT:
            strange[window] |= own
        if heights.valid[window][own].mean() > LEAST_DEPTH:
            # The rim of a shadow may be as slender as a utensil; it does not rise over the table.
            local = [replace(bar, u=bar.u + corner[0], v=bar.v + corner[1]) for bar in found]
            found = [bar for bar, there in zip(found, local, strict=True) if _relief(heights, there) > LEAST_RELIEF]
        bars.extend(replace(bar, u=bar.u + corner[0], v=bar.v + corner[1]) for bar in found)
    return bars, strange


def _unknown(heights: HeightMap, covered: np.ndarray, strange: np.ndarray) -> list[Detection]:
    """Return what stands out and is no item that was found."""
    around = cv2.dilate(covered, np.ones((13, 13), np.uint8)) > 0
    high = ((heights.smooth > UNKNOWN_HEIGHT) & ~around & _workspace(heights)).astype(np.uint8)
    high = cv2.morphologyEx(high, cv2.MORPH_OPEN, np.ones((5, 5), np.uint8))
    count, labels, boxes, _ = cv2.connectedComponentsWithStats(high | (strange & ~around).astype(np.uint8))
    result = []
    for label in range(1, count):
        left, top, width, height, area = boxes[label]
        inside = labels[top : top + height, left : left + width] == label
        tall = float(np.percentile(heights.smooth[top : top + height, left : left + width][inside], 90))
        scale = float(heights.scale(max(0.0, tall)))
        if area < UNKNOWN_AREA * scale**2:
            continue
        x, y = heights.world(np.float64(left + 0.5 * width), np.float64(top + 0.5 * height), tall)
        result.append(
            Detection(
                kind=None, position=(float(x), float(y), 0.0), lip=max(0.0, tall), confidence=0.0,
                extent=0.5 * float(np.hypot(width, height)) / scale, unsure=("unknown object",),
            )
        )  # fmt: skip
    return result


def _outside(one: Detection) -> Detection:
    """Return a detection with the doubt that its middle, or a dish's rim, is not over the workspace."""
    reach = MEASURES[one.kind].rim_radius if one.kind is not None else 0.0
    over = [abs(one.position[axis]) + reach - 0.5 * TABLE_SIDES[axis] for axis in (0, 1)]
    if max(over) > 0.006:
        return replace(one, unsure=(*one.unsure, "outside of the workspace"), confidence=0.5 * one.confidence)
    return one
