"""Round things in a photograph without depth: ellipses with edges all around. Heights are unknown, and so is how far
anything is away; nothing can be planned from this.

Edges are joined to contours, an ellipse is fitted to each, and counts when edges lie on it in most directions. Its kind
follows from its width where the picture's width on the table is given, by the nearest of the known rims.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scenewright.stages.tableware.world.items import STANDARD, DishSizes, Kind

WIDTH = 960
"""Pictures are looked at in this width [px]."""
CANNY = (40.0, 110.0)
"""Lower and upper threshold of the edges [grey levels]; by eye."""
LEAST_POINTS, LEAST_AXIS, MOST_AXIS = 30, 0.035, 0.5
"""Points of a contour; greater axis of an ellipse over the picture's width."""
FLATTEST = 0.25
"""Least ratio of smaller to greater axis."""
LEAST_SLOPE, ALIGNED = 6.0, 0.90
"""Tone's change across an edge [levels/px], and cosine of its angle to the ellipse's normal."""
LEAST_SUPPORT = 0.8
"""Share of 72 directions with such an edge within 2 px."""
SAME = 0.4
"""Ellipses whose boxes overlap by this share of the smaller are one thing."""


@dataclass(frozen=True)
class Outline:
    """A round thing: box (left, top, right, bottom) [px], kind where the scale is known, confidence 0..1."""

    kind: Kind | None
    box: tuple[float, float, float, float]
    confidence: float
    unsure: tuple[str, ...]


def find_outlines(
    color: np.ndarray, picture_width: float | None = None, sizes: DishSizes = STANDARD
) -> tuple[Outline, ...]:
    """Return the round things of a photograph (H, W, 3) uint8, surest first; `picture_width` [m] is how much of the
    table the picture's width shows."""
    factor = WIDTH / color.shape[1]
    small = cv2.resize(color, (WIDTH, max(1, round(color.shape[0] * factor))), interpolation=cv2.INTER_AREA)
    gray = cv2.bilateralFilter(cv2.cvtColor(small, cv2.COLOR_RGB2GRAY), 7, 30.0, 5.0)
    edges = cv2.Canny(gray, *CANNY)
    smooth = cv2.GaussianBlur(gray, (0, 0), 1.5)
    slopes = np.stack([cv2.Sobel(smooth, cv2.CV_32F, *axis, scale=0.25) for axis in ((1, 0), (0, 1))], axis=2)
    closed = cv2.morphologyEx(edges, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    contours, _ = cv2.findContours(closed, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    outlines: list[Outline] = []
    for contour in contours:
        if len(contour) < LEAST_POINTS:
            continue
        for points in (contour, cv2.convexHull(contour)):
            if len(points) < 5:
                continue
            (u, v), axes, degrees = cv2.fitEllipse(points)
            great, little = max(axes), min(axes)
            if not LEAST_AXIS * WIDTH < great < MOST_AXIS * WIDTH or little < FLATTEST * great:
                continue
            support, box = _support(slopes, (u, v), (axes[0], axes[1]), degrees)
            if support >= LEAST_SUPPORT:
                kind, reasons = _kind(great, picture_width, sizes)
                left, top, right, bottom = (float(value / factor) for value in box)
                outlines.append(Outline(kind, (left, top, right, bottom), 0.5 * support, reasons))
    return tuple(_apart(outlines))


def _support(
    slopes: np.ndarray, center: tuple[float, float], axes: tuple[float, float], degrees: float
) -> tuple[float, tuple[float, float, float, float]]:
    """Return the share of directions in which the picture's tone changes across the ellipse, and more across than
    along it, and the ellipse's box (left, top, right, bottom). `slopes` (H, W, 2) are the tone's."""
    angles = 2.0 * np.pi * np.arange(72) / 72
    turn = np.deg2rad(degrees)
    cos, sin = np.cos(turn), np.sin(turn)
    along, across = 0.5 * axes[0] * np.cos(angles), 0.5 * axes[1] * np.sin(angles)
    u, v = center[0] + along * cos - across * sin, center[1] + along * sin + across * cos
    outward = np.column_stack([np.cos(angles) / axes[0], np.sin(angles) / axes[1]])
    outward /= np.linalg.norm(outward, axis=1)[:, None]
    normal = np.column_stack([outward[:, 0] * cos - outward[:, 1] * sin, outward[:, 0] * sin + outward[:, 1] * cos])
    agreed = np.zeros(72, dtype=bool)
    for reach in (-2.0, -1.0, 0.0, 1.0, 2.0):
        columns = np.rint(u + reach * normal[:, 0]).astype(int)
        rows = np.rint(v + reach * normal[:, 1]).astype(int)
        inside = (columns >= 0) & (rows >= 0) & (columns < slopes.shape[1]) & (rows < slopes.shape[0])
        slope = slopes[np.where(inside, rows, 0), np.where(inside, columns, 0)]
        size = np.linalg.norm(slope, axis=1)
        agreed |= inside & (size > LEAST_SLOPE) & (np.abs((slope * normal).sum(axis=1)) > ALIGNED * size)
    return float(agreed.mean()), (float(u.min()), float(v.min()), float(u.max()), float(v.max()))


def _kind(great: float, picture_width: float | None, sizes: DishSizes) -> tuple[Kind | None, tuple[str, ...]]:
    if picture_width is None:
        return None, ("heights unknown", "size unknown")
    radius = 0.5 * great / WIDTH * picture_width
    kind = min(sizes.dishes, key=lambda kind: abs(np.log(radius / sizes[kind].rim_radius)))
    return kind, ("heights unknown", "size from the image's width")


def _apart(outlines: list[Outline]) -> list[Outline]:
    distinct: list[Outline] = []
    for outline in sorted(outlines, key=lambda outline: (-round(outline.confidence, 2), -_area(outline.box))):
        if all(_overlap(outline.box, earlier.box) < SAME for earlier in distinct):
            distinct.append(outline)
    return distinct


def _area(box: tuple[float, float, float, float]) -> float:
    return max(0.0, box[2] - box[0]) * max(0.0, box[3] - box[1])


def _overlap(a: tuple[float, float, float, float], b: tuple[float, float, float, float]) -> float:
    common = (max(a[0], b[0]), max(a[1], b[1]), min(a[2], b[2]), min(a[3], b[3]))
    return _area(common) / max(min(_area(a), _area(b)), 1e-9)
