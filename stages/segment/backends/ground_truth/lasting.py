"""Errors of true masks that last, at the rates of real segmenters on real frames.

A network that takes a kettle for a cup takes it for one in the next frame as well; votes mend nothing there. So an
error is drawn once for a thing, once for a thing and a region of views (`view_region`), or anew in every frame, and
which of the three a thing has is drawn too, in shares that give two sights of a thing the correlation that was
measured: of two sights from one region, and from two. False masks lie on places of floor and walls, and stay there.

Rates: data/errors/segmenters.toml, docs/results/gap.md.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from pydantic import TypeAdapter
from scenewright.schemas.outside import LARGEST_SETTINGS, file_toml
from scenewright.schemas.places import data_file
from scenewright.stages.kit.rendering.segmenter_errors import Alike, Luck, view_region
from scenewright.stages.segment.backends.ground_truth.corruption import displace_boundaries, merge, touching_things
from scenewright.stages.segment.panoptic import PanopticFrame, PanopticMask

RATES_FILE = data_file("errors/segmenters.toml")
CELL = 0.5
"""Edge of the cubes of which each is one place for a false mask [m]."""
FALSE_RADIUS = (0.1, 0.3)
"""**Assumed**: size of false masks [m]."""
LEAST_CELL_PIXELS = 400
"""Pixels of a place from which on it is in view, at 640 pixels of width."""
BOUNDARY = 2.4
"""**Assumed**: standard deviation of boundaries [pixels at 640 width], drawn anew in every frame."""
NEVER_SEEN = 5.0
"""Weight of what all wrong names are, beside those of a class, in sights: a class that was rarely seen is confused as
others are."""


@dataclass(frozen=True)
class LastingRates:
    """What a segmenter gets wrong. Rates are of the sights of things that the errors before left whole; that of
    `false_masks` is a frame."""

    missed: float
    merged: float
    split: float
    wrong_name: float
    false_masks: float
    missed_alike: Alike
    name_alike: Alike
    confusion: Mapping[str, Mapping[str, int]]
    """True class -> wrong class -> sights."""
    false_names: Mapping[str, int]


def measured_rates(segmenter: str) -> LastingRates:
    """Return the rates of a segmenter in data/errors/segmenters.toml. Raises BadInput or ValidationError for a file
    that is damaged."""
    told = TypeAdapter(dict[str, LastingRates]).validate_python(file_toml(RATES_FILE, LARGEST_SETTINGS))[segmenter]
    merged, split = told.merged / (1 - told.missed), told.split / (1 - told.missed - told.merged)
    return replace(told, merged=merged, split=split)


@dataclass(frozen=True)
class View:
    """Where the pixels of a frame are."""

    points: np.ndarray
    """(H, W, 3) [m], world."""
    seen: np.ndarray
    """(H, W) bool: whether there is a point."""
    camera: np.ndarray
    """(3,) [m], world."""
    frame: int


class LastingErrors:
    """The errors of one segmenter in one room.

    `seed` names the draw; `classes`: name -> id of those that may be given; ids of masks are below `first_free`.
    """

    def __init__(self, rates: LastingRates, seed: int, classes: Mapping[str, int], first_free: int) -> None:
        self._rates, self._luck, self._classes, self._free = rates, Luck(seed), classes, first_free
        self._names = {number: name for name, number in classes.items()}

    def spoil(self, true: PanopticFrame, view: View) -> PanopticFrame:
        """Return the frame with masks missed, merged, split, of wrong names, and false ones, in this order.

        Masks keep their ids; new ones get higher ones, the same in every frame.
        """
        ids, masks, rates = true.ids.copy(), dict(true.masks), self._rates
        things = {k: (true.ids == k) & view.seen for k, mask in sorted(masks.items()) if mask.is_thing}
        regions = {k: view_region(view.camera, view.points[own]) for k, own in things.items() if own.any()}

        def struck(error: str, rate: float, alike: Alike) -> list[int]:
            keys = {k: alike.key(self._luck, error, k, region, view.frame) for k, region in regions.items()}
            return [k for k, key in keys.items() if k in masks and self._luck.happens(rate, *key)]

        for k in struck("missed", rates.missed, rates.missed_alike):
            ids[ids == k] = 0
            del masks[k]
        for k in struck("merged", rates.merged, rates.missed_alike):
            beside = touching_things(ids, masks, k)
            if beside:  # that with the longest border takes its pixels
                merge(ids, masks, k, max(beside, key=lambda other: (beside[other], other)))
        for k in struck("split", rates.split, rates.missed_alike):
            self._split(ids, masks, k, view)
        for k in struck("name", rates.wrong_name, rates.name_alike):
            key = rates.name_alike.key(self._luck, "name", k, regions[k], view.frame)
            wrong = self._luck.choice(self._wrong_names(self._names[masks[k].class_id]), "which", *key)
            for part in {k, self._free + k} & set(masks):
                masks[part] = replace(masks[part], class_id=self._classes[wrong])
        self._false_masks(ids, masks, true, view)
        random = np.random.default_rng([int(self._luck.uniform("edges") * 2**32), view.frame])
        ids = displace_boundaries(ids, BOUNDARY * ids.shape[1] / 640, random)
        present = set(np.unique(ids).tolist())
        return PanopticFrame(ids=ids, masks={k: mask for k, mask in masks.items() if k in present})

    def _split(self, ids: np.ndarray, masks: dict[int, PanopticMask], number: int, view: View) -> None:
        """Cut the mask by an upright plane of the room through the middle of what is seen of it."""
        own = (ids == number) & view.seen
        if not own.any():
            return
        angle = np.pi * self._luck.uniform("cut", number)
        along = view.points[own][:, :2] @ np.array([np.cos(angle), np.sin(angle)])
        far = np.zeros_like(own)
        far[own] = along > np.median(along)
        ids[far] = self._free + number
        masks[self._free + number] = masks[number]

    def _wrong_names(self, true: str) -> dict[str, float]:
        """Return the classes that a thing of class `true` may be taken for, with their weights."""
        every: Counter[str] = Counter()
        for row in self._rates.confusion.values():
            every.update(row)
        own = self._rates.confusion.get(true, {})
        return {
            name: own.get(name, 0) + NEVER_SEEN * every[name] / every.total()
            for name in sorted(every)
            if name != true and name in self._classes
        }

    def _false_masks(self, ids: np.ndarray, masks: dict[int, PanopticMask], true: PanopticFrame, view: View) -> None:
        """Put masks of things where floor and walls are: in places that every frame agrees on."""
        things = [k for k, mask in true.masks.items() if mask.is_thing]
        bare = view.seen & (true.ids > 0) & ~np.isin(true.ids, things)
        cells, which = np.unique(np.floor(view.points[bare] / CELL).astype(int), axis=0, return_inverse=True)
        least = LEAST_CELL_PIXELS * (ids.shape[1] / 640) ** 2
        large = [k for k, count in enumerate(np.bincount(which.ravel(), minlength=len(cells))) if count >= least]
        names = {k: count for k, count in sorted(self._rates.false_names.items()) if k in self._classes}
        for k in large:
            cell = tuple(int(v) for v in cells[k])
            middle = np.median(view.points[bare][which.ravel() == k], axis=0)
            region = view_region(view.camera, middle[None])
            key = self._rates.missed_alike.key(self._luck, "false", cell, region, view.frame)
            if not self._luck.happens(self._rates.false_masks / len(large), *key):
                continue
            low, high = FALSE_RADIUS
            radius = low + (high - low) * self._luck.uniform("radius", cell)
            near = bare & (np.linalg.norm(view.points - (np.array(cell) + 0.5) * CELL, axis=2) < radius + CELL / 2)
            name = self._luck.choice(names, "false name", cell)
            number = 2 * self._free + int(self._luck.uniform("number", cell) * 2**20)
            ids[near] = number
            masks[number] = PanopticMask(self._classes[name], True)
