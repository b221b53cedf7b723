"""Fork or spoon: the outline that fits better, and whether the head shows tines in depth and in colour.

The three are weighed by logistic regression, fitted to the 700 utensils of tuning seeds 0 to 59 of tiers 1 to 3; what
cannot be seen of the head adds nothing.
"""

from __future__ import annotations

from math import exp

import cv2
import numpy as np
from scenewright.stages.tableware.vision.height_map import HeightMap
from scenewright.stages.tableware.vision.tines import tine_difference
from scenewright.stages.tableware.vision.utensil_finding import Bar
from scenewright.stages.tableware.world.items import DishSizes, Kind

RANGE = 0.006
"""Heights are cut to this much above and below the utensil's underside [m]: floors of dishes are far below."""
LEAST_CONTRAST = 15.0
"""Grey levels between a handle and what is beside it; less is noise."""
SHIFTS = (0.0, 0.005, -0.005)
"""A spoon is 10 mm shorter: where the head ends may be off by half of that [m]."""
WEIGHTS: dict[str, tuple[float, float, float]] = {"table": (26.8, 1.7, 2.2), "dish": (26.1, 1.6, 4.6)}
"""Weights of the outlines' difference in score, of the tines' height [mm] and of their colour over the contrast, less
MIDDLE."""
MIDDLE: dict[str, tuple[float, float, float]] = {"table": (0.0, 1.3, 0.3), "dish": (0.0, 1.3, 0.3)}
"""Features at which fork and spoon are equally likely, of utensils on the table and on a dish."""


def kind_features(
    bar: Bar, heights: HeightMap, z: float, hidden: np.ndarray, sizes: DishSizes
) -> tuple[float, float, float]:
    """Return (fork's score less spoon's, height of tines over gaps [mm], their difference in grey over the handle's);
    NaN where the head is not seen. `z` [m] is the height of the utensil's underside; `hidden` (h, w) bool: where dishes
    are seen in its place."""
    pose, scale = bar.poses["fork"], float(heights.scale(z))
    u, v, angle = pose[1:4]
    along = np.array([np.cos(angle), np.sin(angle)])
    reach = int(0.12 * scale)
    left, top = max(0, int(u) - reach), max(0, int(v) - reach)
    window = (slice(top, max(top + 2, int(v) + reach)), slice(left, max(left + 2, int(u) + reach)))
    if min(heights.raw[window].shape) < 2:
        return bar.poses["fork"][0] - bar.poses["spoon"][0], float("nan"), float("nan")
    high = np.where(heights.valid[window], np.clip(heights.raw[window] - np.float32(z - RANGE), 0, 2 * RANGE), -1.0)
    gray = cv2.cvtColor(np.ascontiguousarray(heights.color[window]), cv2.COLOR_RGB2GRAY).astype(np.float32)
    high[hidden[window]] = gray[hidden[window]] = -1.0
    handle = np.outer(np.linspace(-0.075, 0.01, 40) * scale, along) + np.array([u - left, v - top])
    aside = 0.012 * scale * np.array([-along[1], along[0]])
    tone = _sample(gray, handle)
    contrast = float(np.median(tone - 0.5 * (_sample(gray, handle + aside) + _sample(gray, handle - aside))))
    sign = 1.0 if contrast > 0.0 else -1.0
    places = [(u - left + shift * scale * along[0], v - top + shift * scale * along[1]) for shift in SHIFTS]
    steps = [tine_difference(high, (x, y, angle), scale, sizes["fork"]) for x, y in places]
    tones = [tine_difference(gray, (x, y, angle), scale, sizes["fork"], sign) for x, y in places]
    difference = bar.poses["fork"][0] - bar.poses["spoon"][0]
    return difference, 1e3 * _most(steps), _most(tones) / max(abs(contrast), LEAST_CONTRAST)


def _most(values: list[float]) -> float:
    measured = [value for value in values if not np.isnan(value)]
    return max(measured) if measured else float("nan")


def _sample(image: np.ndarray, points: np.ndarray) -> np.ndarray:
    columns = np.clip(np.rint(points[:, 0]).astype(int), 0, image.shape[1] - 1)
    rows = np.clip(np.rint(points[:, 1]).astype(int), 0, image.shape[0] - 1)
    return np.asarray(image[rows, columns])


def fork_chance(features: tuple[float, float, float], place: str) -> float:
    """Return the chance 0..1 that a utensil with these features is a fork; `place` is `table` or `dish`."""
    logit = sum(
        weight * (feature - middle)
        for weight, feature, middle in zip(WEIGHTS[place], _clip_features(features), MIDDLE[place], strict=True)
        if not np.isnan(feature)
    )
    return 1.0 / (1.0 + exp(-min(max(logit, -30.0), 30.0)))


def _clip_features(features: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return features within what was seen while the weights were fitted: one odd pixel decides nothing."""
    low, high = (-1.0, -1.0, -0.5), (1.0, 4.0, 1.5)
    return tuple(float(np.clip(f, *ends)) for f, ends in zip(features, zip(low, high, strict=True), strict=True))  # type: ignore[return-value]


def told_apart(bar: Bar, chance: float) -> Bar:
    """Return the bar as the likelier kind, at that kind's own best pose."""
    kind: Kind = "fork" if chance >= 0.5 else "spoon"
    score, u, v, angle, visible = bar.poses[kind]
    return Bar(kind, u, v, angle, score, visible, bar.poses)
