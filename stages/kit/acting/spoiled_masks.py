"""True masks of a picture as a segmenter tells them: missed, merged, cut, with wrong names, false ones, worn edges.

False masks lie on places of floor and walls, and stay there. Which errors happen for how long: errors.py.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

import cv2
import numpy as np
from scenewright.stages.kit.acting.errors import SegmenterErrors, view_region

BOUNDARY_WAVELENGTH = 24
"""Pixels at a width of 640 between the points at which boundary displacement is drawn."""
CELL = 0.5
"""Edge of the cubes of which each is one place for a false mask [m]."""
FALSE_RADIUS = (0.1, 0.3)
"""**Assumed**: size of false masks [m]."""
LEAST_CELL_PIXELS = 400
"""Pixels of a place from which on it is in view, at 640 pixels of width."""


@dataclass(frozen=True)
class MaskView:
    """Where the pixels of a picture are, and from where it was taken."""

    points: np.ndarray
    """(H, W, 3) [m], world."""
    seen: np.ndarray
    """(H, W) bool: whether there is a point."""
    bare: np.ndarray
    """(H, W) bool: floor, walls and ceiling."""
    camera: np.ndarray
    """(3,) [m], world."""
    frame: int
    keys: Mapping[int, object] = field(default_factory=dict)
    """Mask -> what its errors are drawn by; its own number where it has none."""
    regions: Mapping[int, object] = field(default_factory=dict)
    """Mask -> region of views; empty: as `view_region` says."""


def spoiled(
    ids: np.ndarray, things: Mapping[int, str], view: MaskView, errors: SegmenterErrors, first_free: int
) -> tuple[np.ndarray, dict[int, str]]:
    """Return masks (H, W) and the classes of those of things with errors, in the order of `SegmenterRates`.

    `ids` (H, W) int: masks that do not overlap, below `first_free`; `things`: mask -> class; other masks stay as they
    are but for their edges. Masks keep their numbers; new ones get higher ones, the same in every frame.
    """
    ids, names, rates = ids.copy(), dict(things), errors.rates
    own = {k: (ids == k) & view.seen for k in sorted(things)}
    regions = dict(view.regions) or {k: view_region(view.camera, view.points[o]) for k, o in own.items() if o.any()}
    keys = {k: view.keys.get(k, k) for k in regions}

    def struck(error: str) -> list[int]:
        return [k for k in regions if k in names and errors.strikes(error, keys[k], regions[k], view.frame)]

    for k in struck("missed"):
        ids[ids == k] = 0
        del names[k]
    for k in struck("merged"):
        beside = touching(ids, names, k)
        if beside:  # that with the longest border takes its pixels
            ids[ids == k] = max(beside, key=lambda other: (beside[other], other))
            del names[k]
    for k in struck("split"):
        far = _far_half(ids == k, view, np.pi * errors.luck.uniform("cut", keys[k]))
        ids[far] = first_free + k
        if far.any():
            names[first_free + k] = names[k]
    for k in [k for k in regions if k in names]:
        name = errors.name_of(keys[k], names[k], regions[k], view.frame)
        for part in {k, first_free + k} & set(names):
            names[part] = name
    if rates.false_masks > 0:
        _false_masks(ids, names, view, errors, first_free)
    if rates.boundary > 0:
        random = np.random.default_rng([int(errors.luck.uniform("edges") * 2**32), view.frame])
        ids = displace_boundaries(ids, rates.boundary * ids.shape[1] / 640, random)
    present = set(np.unique(ids).tolist())
    return ids, {k: name for k, name in names.items() if k in present}


def touching(ids: np.ndarray, things: Collection[int], number: int) -> dict[int, int]:
    """Return the things that touch a mask (within two pixels), by rising number, each with its pixels there."""
    own = (ids == number).astype(np.uint8)
    around = (cv2.dilate(own, np.ones((5, 5), np.uint8)) != 0) & (own == 0)
    found = zip(*np.unique(ids[around], return_counts=True), strict=True)
    return {int(i): int(count) for i, count in found if int(i) in things}


def displace_boundaries(ids: np.ndarray, deviation: float, random: np.random.Generator) -> np.ndarray:
    """Return ids (H, W) resampled through a smooth random displacement of standard deviation `deviation` [pixels]
    per axis: boundaries wander, labels stay whole."""
    height, width = ids.shape
    spacing = max(2.0, BOUNDARY_WAVELENGTH * width / 640)
    coarse = (int(np.ceil(height / spacing)) + 3, int(np.ceil(width / spacing)) + 3)
    v, u = np.mgrid[0:height, 0:width].astype(np.float32)
    shift = []
    for _ in range(2):
        drawn = random.standard_normal(coarse).astype(np.float32)
        smooth = cv2.remap(drawn, u / spacing + 1, v / spacing + 1, cv2.INTER_CUBIC)
        shift.append(smooth / max(float(smooth.std()), 1e-6) * deviation)
    source_u = np.clip(np.rint(u + shift[0]), 0, width - 1).astype(np.intp)
    source_v = np.clip(np.rint(v + shift[1]), 0, height - 1).astype(np.intp)
    return ids[source_v, source_u]


def _far_half(mask: np.ndarray, view: MaskView, angle: float) -> np.ndarray:
    """Return (H, W) bool: the mask beyond an upright plane of the room at an angle [rad], through the middle of what
    is seen of it."""
    own = mask & view.seen
    far = np.zeros_like(own)
    if own.any():
        along = view.points[own][:, :2] @ np.array([np.cos(angle), np.sin(angle)])
        far[own] = along > np.median(along)
    return far


def _false_masks(
    ids: np.ndarray, names: dict[int, str], view: MaskView, errors: SegmenterErrors, first_free: int
) -> None:
    """Put masks of things where floor and walls are: in places that every frame agrees on."""
    rates, luck = errors.rates, errors.luck
    bare = view.seen & view.bare
    cells, which = np.unique(np.floor(view.points[bare] / CELL).astype(int), axis=0, return_inverse=True)
    least = LEAST_CELL_PIXELS * (ids.shape[1] / 640) ** 2
    large = [k for k, count in enumerate(np.bincount(which.ravel(), minlength=len(cells))) if count >= least]
    false_names = {k: count for k, count in sorted(rates.false_names.items()) if k in errors.classes}
    for k in large if false_names else ():
        cell = tuple(int(v) for v in cells[k])
        middle = np.median(view.points[bare][which.ravel() == k], axis=0)
        key = rates.missed_alike.key(luck, "false", cell, view_region(view.camera, middle[None]), view.frame)
        if not luck.happens(rates.false_masks / len(large), *key):
            continue
        low, high = FALSE_RADIUS
        radius = low + (high - low) * luck.uniform("radius", cell)
        near = bare & (np.linalg.norm(view.points - (np.array(cell) + 0.5) * CELL, axis=2) < radius + CELL / 2)
        number = 2 * first_free + int(luck.uniform("number", cell) * 2**20)
        ids[near] = number
        names[number] = luck.choice(false_names, "false name", cell)
