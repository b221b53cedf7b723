"""Utensils of an image: across the lips of dishes from heights, on the table from colour and heights."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import exp

import cv2
import numpy as np
from scenewright.stages.tableware.vision.detections import Detection
from scenewright.stages.tableware.vision.height_map import HeightMap
from scenewright.stages.tableware.vision.stack_reading import Stack
from scenewright.stages.tableware.vision.utensil_finding import (
    LEAST_SCORE,
    LEAST_VISIBLE,
    Bar,
    erase_bar,
    fit_utensil,
    outline,
    search_bars,
)
from scenewright.stages.tableware.vision.utensil_kind import fork_chance, kind_features, told_apart
from scenewright.stages.tableware.world.items import STANDARD, DishSizes

AREA_SHARE = 0.5163
"""Plan area of a fork or a spoon over its length times its width."""
LEAST_REACH, LEAST_SLENDER = 0.112, 0.6875
"""A utensil on a dish reaches this far from its middle [m]; one that is whole is longer than this share of a
spoon."""
BAND = 0.006
"""A utensil on a dish lies within this of the lip's height [m]."""
LEAST_DEPTH = 0.45
"""Share of a utensil's pixels with depth at which there is doubt."""
LEAST_RELIEF = 0.0008
"""A utensil rises this much over the table [m], on average over its plan."""
FLAT = 0.0020
"""What looks unlike the table and rises less than this [m] is a shadow or a mark, and nothing to clear."""
ROUGH = 3.0
"""Multiple of a table's measured roughness: less is a wave in the depth."""
UNKNOWN_AREA = 0.00035
"""What stands out on more than this [m^2] without being an item is unknown."""
MOST_CUT = 3
"""Utensils in two parts that are looked for."""
SURE_OF_KIND = 0.9
"""Chance of the likelier kind under which fork and spoon are in doubt."""
WEAK_LOOK = 0.3
"""Share of what a utensil's looks leave open that is lost of its confidence: on tuning tables (seeds 0 to 59 a tier)
one of 783 was wrong, and not one of those that looked worst."""
MOSTLY_SEEN = 0.7
"""Share of a utensil's plan under which it counts as partly hidden."""
SAME_PLACE = 0.012
"""Middles of utensils that lie on each other are this near [m]."""


@dataclass(frozen=True)
class SeenUtensil:
    """A bar in the map's pixels, what is known of its kind, and how much higher [m] than its surroundings it is."""

    bar: Bar
    chance: float
    """Of its kind."""
    relief: float
    """NaN where it has too little depth."""
    depth_share: float


def _read_utensil(
    bar: Bar, heights: HeightMap, z: float, place: str, hidden: np.ndarray, sizes: DishSizes
) -> SeenUtensil:
    chance = fork_chance(kind_features(bar, heights, z, hidden, sizes), place)
    bar = told_apart(bar, chance)
    return SeenUtensil(bar, max(chance, 1.0 - chance), *_relief(heights, bar, z, hidden, sizes))


def utensils_on_dish(
    heights: HeightMap, stack: Stack, covered: np.ndarray, label: int, sizes: DishSizes
) -> list[SeenUtensil]:
    """Return utensils that lie across the uppermost lip, the lowest first. `covered` (h, w) holds the labels of the
    stacks, `label` is that of this one."""
    if not sizes.utensils:
        return []
    top = stack.measures[-1]
    z = stack.top + 0.002
    scale = float(heights.scale(z))
    u, v = (float(value) for value in heights.pixel(np.float64(stack.x), np.float64(stack.y), z))
    reach = int(max(top.rim_radius, LEAST_REACH) * scale)
    left, up = max(0, int(u) - reach), max(0, int(v) - reach)
    window = (slice(up, max(up, int(v) + reach)), slice(left, max(left, int(u) + reach)))
    part, owner = heights.smooth[window], covered[window]
    if part.size == 0:
        return []
    hollow = top.inner_radius(top.height)
    inner = heights.smooth[_square(v, hollow - 0.010, scale)][:, _square(u, hollow - 0.010, scale)]
    if np.count_nonzero(np.abs(inner[::2, ::2] - np.float32(z)) < BAND) < 0.1 * hollow * 0.006 * scale**2:
        return []
    columns = np.arange(left, left + part.shape[1], dtype=np.float32) - np.float32(u)
    rows = np.arange(up, up + part.shape[0], dtype=np.float32) - np.float32(v)
    distance = np.sqrt(columns[None] ** 2 + rows[:, None] ** 2) * np.float32(1.0 / scale)
    # The gaps between tines show what is below: the highest of three by three closes them.
    high = np.abs(cv2.dilate(part, np.ones((3, 3), np.uint8)) - np.float32(z)) < BAND
    if np.count_nonzero(high & (distance < hollow - 0.010)) < 0.9 * hollow * 0.006 * scale**2:
        return []
    map_ = np.where(high, 1, -1).astype(np.int8)
    map_[(distance > hollow - 0.007) & (distance < top.rim_radius + 0.004)] = 0
    map_[(owner != label) & (owner > 0)] = 0
    map_[part > z + BAND] = 0
    bars = [_shift(bar, left, up) for bar in search_bars(map_, scale, 2, sizes)]
    nothing = np.zeros(heights.smooth.shape, dtype=bool)
    utensils = [_read_utensil(bar, heights, stack.top, "dish", nothing, sizes) for bar in bars]
    return sorted(utensils, key=lambda utensil: _middle_height(heights, utensil.bar, z, sizes))


def _square(center: float, half: float, scale: float) -> slice:
    """Return the pixels within `half` [m] of a centre [px], along one axis."""
    return slice(max(0, int(center - half * scale)), max(0, int(center + half * scale) + 1))


def _shift(bar: Bar, du: float, dv: float) -> Bar:
    poses = {
        kind: (score, u + du, v + dv, angle, visible_share)
        for kind, (score, u, v, angle, visible_share) in bar.poses.items()
    }
    return replace(bar, u=bar.u + du, v=bar.v + dv, poses=poses)


def axis_pixels(heights: HeightMap, bar: Bar, z: float, sizes: DishSizes) -> tuple[np.ndarray, np.ndarray]:
    """Return pixel columns and rows (60,) along a bar's middle line."""
    half = 0.5 * 0.94 * sizes[bar.kind].length * float(heights.scale(z))
    along = np.linspace(-half, half, 60)
    columns = np.clip(np.rint(bar.u + along * np.cos(bar.angle)).astype(int), 0, heights.smooth.shape[1] - 1)
    rows = np.clip(np.rint(bar.v + along * np.sin(bar.angle)).astype(int), 0, heights.smooth.shape[0] - 1)
    return columns, rows


def _middle_height(heights: HeightMap, bar: Bar, z: float, sizes: DishSizes) -> float:
    columns, rows = axis_pixels(heights, bar, z, sizes)
    return float(np.median(heights.smooth[rows, columns]))


def _relief(heights: HeightMap, bar: Bar, z: float, hidden: np.ndarray, sizes: DishSizes) -> tuple[float, float]:
    """Return how much higher [m] than its border a bar is, and the share of its pixels with depth, both over what is
    not `hidden` (h, w) bool; NaN where less than LEAST_DEPTH of it has depth."""
    scale = float(heights.scale(z))
    cos, sin = scale * np.cos(bar.angle), scale * np.sin(bar.angle)
    means, share = [], 0.0
    for part, points in enumerate(outline(bar.kind, sizes)):
        columns = (bar.u + points[:, 0] * cos + points[:, 1] * sin + 0.5).astype(int)
        rows = (bar.v + points[:, 0] * sin - points[:, 1] * cos + 0.5).astype(int)
        inside = (columns >= 0) & (columns < hidden.shape[1]) & (rows >= 0) & (rows < hidden.shape[0])
        columns, rows = columns[inside], rows[inside]
        visible = ~hidden[rows, columns]
        columns, rows = columns[visible], rows[visible]
        values = heights.raw[rows, columns][heights.valid[rows, columns]]
        if part == 0:
            share = len(values) / max(len(rows), 1)
        values = values[np.abs(values - z) < 0.012]
        means.append(float(values.mean()) if len(values) > 10 else float("nan"))
    return (means[0] - means[1] if share > LEAST_DEPTH else float("nan")), share


def utensils_on_table(
    heights: HeightMap, unlike: np.ndarray, hidden: np.ndarray, sizes: DishSizes
) -> tuple[list[SeenUtensil], np.ndarray]:
    """Return the utensils on the table, those below before those that lie on them, and (h, w) bool of what looks unlike
    the table and is none. `unlike` (h, w) bool: what looks like no table; `hidden` (h, w) bool: where dishes are."""
    scale = float(heights.scale(0.003))
    forklike = sizes["fork"] if sizes.utensils else STANDARD["fork"]
    utensil_area = AREA_SHARE * forklike.length * forklike.width * scale**2
    count, labels, boxes, _ = cv2.connectedComponentsWithStats(
        unlike.astype(np.uint8), connectivity=8, ltype=cv2.CV_16U
    )
    strange = np.zeros(unlike.shape, dtype=bool)
    unexplained = np.where(unlike, 1, -1).astype(np.int8)
    unexplained[hidden] = 0
    margin = int(0.05 * scale)
    utensils: list[SeenUtensil] = []
    for label in range(1, count):
        left, top, width, height, area = boxes[label]
        if area < 0.25 * utensil_area:
            continue
        window = (
            slice(max(0, top - margin), top + height + margin),
            slice(max(0, left - margin), left + width + margin),
        )
        of_component = labels[window] == label
        map_ = np.where(of_component, 1, -1).astype(np.int8)
        map_[hidden[window] | ((labels[window] > 0) & ~of_component)] = 0
        bars = _lone_bar(map_, of_component, scale, area, utensil_area, sizes)
        if not bars:
            bars = search_bars(map_, scale, min(5, int(area / utensil_area + 1.5)), sizes)
        bars = [_shift(bar, window[1].start, window[0].start) for bar in bars]
        if (
            not bars
            and area > UNKNOWN_AREA * scale**2
            and heights.smooth[window][of_component].mean() > max(FLAT, ROUGH * heights.roughness)
        ):
            strange[window] |= of_component
        utensils.extend(_that_rise(bars, heights, hidden, unexplained, scale, sizes))
    # What a dish cuts in two is found by its parts together.
    if np.count_nonzero(unexplained > 0) > LEAST_VISIBLE * 0.5 * utensil_area:
        utensils.extend(
            _that_rise(search_bars(unexplained, scale, MOST_CUT, sizes), heights, hidden, unexplained, scale, sizes)
        )
    strange &= unexplained > 0
    return sorted(utensils, key=lambda utensil: 0.0 if np.isnan(utensil.relief) else utensil.relief), strange


def _that_rise(
    bars: list[Bar], heights: HeightMap, hidden: np.ndarray, rest: np.ndarray, scale: float, sizes: DishSizes
) -> list[SeenUtensil]:
    """Return the bars that rise over the table, which the rim of a shadow as slender as a utensil does not, and set
    `rest` (h, w) to unknown where they lie, in place."""
    utensils = [_read_utensil(bar, heights, 0.0, "table", hidden, sizes) for bar in bars]
    risen = [utensil for utensil in utensils if not utensil.relief < max(LEAST_RELIEF, ROUGH * heights.roughness)]
    for utensil in risen:
        erase_bar(rest, utensil.bar, scale, sizes)
    return risen


def _lone_bar(map_: np.ndarray, own: np.ndarray, scale: float, area: int, whole: float, sizes: DishSizes) -> list[Bar]:
    """Return the one utensil that a component is, from its moments, or nothing where it is no slender blob."""
    if not sizes.utensils:
        return []
    rows, columns = np.nonzero(own)
    values, vectors = np.linalg.eigh(np.cov(np.stack([columns, rows]).astype(np.float64)))
    if (
        area > 1.4 * whole
        or not sizes.utensils
        or values[0] > 0.02 * values[1]
        or np.sqrt(12.0 * values[1]) < LEAST_SLENDER * sizes["spoon"].length * scale
    ):
        return []
    angle = float(np.arctan2(vectors[1, 1], vectors[0, 1]))
    bar = fit_utensil(map_, scale, (float(columns.mean()), float(rows.mean()), angle), sizes)
    return [bar] if bar.score >= LEAST_SCORE and bar.visible >= LEAST_VISIBLE else []


def as_detection(utensil: SeenUtensil, heights: HeightMap, z: float, on: int | None, sizes: DishSizes) -> Detection:
    """Return a utensil whose underside is at height z [m]; its grasp is the highest place along its axis."""
    bar = utensil.bar
    thick = sizes[bar.kind].height
    x, y = heights.world(np.float64(bar.u), np.float64(bar.v), z + thick)
    columns, rows = axis_pixels(heights, bar, z, sizes)
    along = np.convolve(heights.smooth[rows, columns], np.full(9, 1.0 / 9.0), mode="valid")
    k = int(np.argmax(along)) + 4
    grasp = heights.world(np.float64(columns[k]), np.float64(rows[k]), z + thick)
    reasons = []
    if utensil.depth_share < LEAST_DEPTH:
        reasons.append("no depth")
    if utensil.chance < SURE_OF_KIND:
        reasons.append("fork or spoon")
    if bar.visible < MOSTLY_SEEN:
        reasons.append("partly hidden")
    return Detection(
        kind=bar.kind,
        position=(float(x), float(y), z),
        yaw=float(np.arctan2(np.sin(-bar.angle), np.cos(-bar.angle))),
        lip=z + thick,
        on=on,
        grasp=(float(grasp[0]), float(grasp[1]), float(along.max())),
        confidence=1.0 - WEAK_LOOK * (1.0 - utensil.chance * _there(utensil)),
        unsure=tuple(reasons),
    )


def _there(utensil: SeenUtensil) -> float:
    """Return the chance 0..1 that there is a utensil at all, as it looks."""
    relief = 0.0 if np.isnan(utensil.relief) else 1e3 * utensil.relief - 2.0
    return 1.0 / (1.0 + exp(-(4.0 + 12.0 * (utensil.bar.score - 0.8) + relief + 3.0 * (utensil.bar.visible - 0.9))))
