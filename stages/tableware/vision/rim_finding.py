"""Rims of dishes from heights: every height edge votes for the centres that its own height and a known radius allow.

A Hough transform (Duda & Hart 1972; votes along the gradient as Kimme, Ballard & Sklansky 1975) whose radius in pixels
is no unknown, because depth says how far the edge is away; then the circle is fitted to where the height falls off.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scenewright.stages.tableware.vision.height_map import HeightMap
from scenewright.stages.tableware.vision.possible_stacks import lip_range
from scenewright.stages.tableware.vision.rim_fitting import RAYS, SoughtLip, fit_circle
from scenewright.stages.tableware.vision.rim_votes import cast_votes
from scenewright.stages.tableware.world.items import DishSizes, Kind

LEAST_SLOPE = 0.0012
"""Least slope of an edge [m/px]; by eye."""
LEAST_VOTES, LEAST_SUPPORT = 0.22, 0.42
"""Shares of the circumference that must vote, and that the fitted circle must explain."""


@dataclass(frozen=True)
class Rim:
    """A lip that was found: centre [m], height of the lip [m], share of directions that agree, share with depth."""

    kind: Kind
    x: float
    y: float
    lip: float
    support: float
    depth_share: float


def find_rims(heights: HeightMap, sizes: DishSizes) -> list[Rim]:
    """Return the rims of all kinds that `sizes` have, surest first, none twice."""
    if not sizes.dishes:
        return []
    low, high = (np.array([lip_range(kind, sizes)[end] for kind in sizes.dishes]) for end in (0, 1))
    votes = cast_votes(
        cv2.GaussianBlur(heights.smooth, (0, 0), 2.0),
        heights.smooth,
        np.array([sizes[kind].rim_radius for kind in sizes.dishes]),
        low,
        high,
        heights.focal[0],
        heights.camera_height,
        LEAST_SLOPE,
    )
    distinct: list[Rim] = []
    for kind, votes_of_kind in zip(sizes.dishes, votes, strict=True):
        rims = [
            fitted
            for u0, v0 in _peaks(votes_of_kind, heights, sizes[kind].rim_radius)
            if (fitted := fit_rim(heights, kind, u0, v0, sizes)) is not None
        ]
        for rim in sorted(rims, key=lambda rim: -rim.support):
            apart = 1.2 * sizes[kind].rim_radius
            if all(
                rim.kind != earlier.kind or np.hypot(rim.x - earlier.x, rim.y - earlier.y) > apart
                for earlier in distinct
            ):
                distinct.append(rim)
    return distinct


def _peaks(votes: np.ndarray, heights: HeightMap, rim_radius: float) -> list[tuple[float, float]]:
    """Return places [px] where votes (at half resolution) gather, most votes first. A pixel of edge votes once."""
    gathered = np.asarray(cv2.boxFilter(votes, -1, (7, 7), normalize=False), dtype=np.float32)
    circumference = 2.0 * np.pi * float(heights.scale(0.05)) * rim_radius
    peaks = []
    apart = int(0.5 * rim_radius * float(heights.scale(0.05)) * 0.6)
    for _ in range(16):
        _, most, _, (column, row) = cv2.minMaxLoc(gathered)
        if most < LEAST_VOTES * circumference:
            break
        peaks.append((2.0 * column + 0.5, 2.0 * row + 0.5))
        cv2.circle(gathered, (column, row), apart, 0.0, -1)
    return peaks


def fit_rim(heights: HeightMap, kind: Kind, u: float, v: float, sizes: DishSizes) -> Rim | None:
    """Return the rim of a kind near pixel (u, v), or None where heights do not bear it out."""
    measures = sizes[kind]
    low, high = lip_range(kind, sizes)
    sought = SoughtLip(measures.rim_radius, low, high, heights.focal[0], heights.camera_height)
    u, v, lip, support, radius = fit_circle(heights.smooth, u, v, sought, RAYS)
    if support < LEAST_SUPPORT:
        return None
    wall = (measures.rim_radius - measures.inner_radius(measures.height)) * float(heights.scale(lip))
    lip, share = _lip_height(heights, u, v, radius - 0.5 * wall, lip)
    x, y = heights.world(np.float64(u), np.float64(v), lip)
    return Rim(kind, float(x), float(y), lip, support, share)


def _lip_height(heights: HeightMap, u: float, v: float, radius: float, lip: float) -> tuple[float, float]:
    """Return the mean height [m] of the pixels on the lip that lie near the first estimate, and the share of pixels
    there that have depth."""
    around = u + RAYS[:, 0] * radius, v + RAYS[:, 1] * radius
    rows = np.clip(np.rint(around[1]).astype(int), 0, heights.raw.shape[0] - 1)
    columns = np.clip(np.rint(around[0]).astype(int), 0, heights.raw.shape[1] - 1)
    valid = heights.valid[rows, columns]
    values = heights.raw[rows, columns][valid]
    for band in (0.008, 0.005):
        near_lip = values[np.abs(values - lip) < band]
        if len(near_lip) < 8:
            break
        lip = float(near_lip.mean())
    return lip, float(valid.mean())


def overlapping(rims: list[Rim], sizes: DishSizes) -> set[int]:
    """Return the indices of rims that cross another at like height: they cannot both be where they seem to be."""
    crossed: set[int] = set()
    for (i, a), (j, b) in ((p, q) for k, p in enumerate(enumerate(rims)) for q in list(enumerate(rims))[k + 1 :]):
        distance = np.hypot(a.x - b.x, a.y - b.y)
        radii = sizes[a.kind].rim_radius, sizes[b.kind].rim_radius
        if abs(radii[0] - radii[1]) + 0.006 < distance < sum(radii) - 0.006 and abs(a.lip - b.lip) < 0.008:
            crossed |= {i, j}
    return crossed
