"""What a segmenter gets wrong: how often, for how long, and draws that can be asked for again.

A network that takes a kettle for a cup takes it for one in the next frame as well; votes mend nothing there. So an
error is drawn once for a thing, once for a thing and a region of views, or anew in every frame. Which of the three a
thing has is drawn too, in shares that give two sights of a thing the correlation that was measured: of two sights from
one region, and from two. Maps, plans and the mobile agent have the same model; its rates are data
(data/errors/segmenters.toml, docs/results/real.md).
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import atan2, pi

import numpy as np
from pydantic import TypeAdapter
from scenewright.schemas.outside import LARGEST_SETTINGS, file_toml
from scenewright.schemas.places import data_file

RATES_NAME = "errors/segmenters.toml"
RATES_FILE = data_file(RATES_NAME)
NEVER_SEEN = 5.0
"""Weight of what all wrong names are, beside those of a class, in sights: a class that was rarely seen is confused as
others are."""
SECTORS = 8
"""Regions of views around a thing, of a camera that is carried about."""
NEAR = 1.5
"""Distance within which all views of a thing are one region [m]."""


class Luck:
    """Draws that are the same whenever they are asked for."""

    def __init__(self, seed: int) -> None:
        self._seed = seed

    def uniform(self, *key: object) -> float:
        """Return the number in [0, 1) of a key."""
        text = repr((self._seed, *map(str, key)))
        digest = hashlib.blake2b(text.encode(), digest_size=8).digest()
        return int.from_bytes(digest, "big") / 2**64

    def happens(self, rate: float, *key: object) -> bool:
        """Return whether the number of a key is below a rate: what happens at a rate happens at every higher one."""
        return self.uniform(*key) < rate

    def choice(self, weights: Mapping[str, float], *key: object) -> str:
        """Return one of the names of `weights`, each as likely as its weight says; at least one is positive."""
        reach = np.cumsum(list(weights.values()))
        return list(weights)[int(np.searchsorted(reach, self.uniform(*key) * reach[-1], side="right"))]


@dataclass(frozen=True)
class Alike:
    """How alike an error is in two sights of one thing: correlation from one region of views, and from two."""

    same_region: float
    other_region: float

    def key(self, luck: Luck, error: str, thing: object, region: object, frame: int) -> tuple[object, ...]:
        """Return what an error of a thing is drawn by: once for good, by region, or by frame."""
        kind = luck.uniform("kind", error, thing)
        if kind < self.other_region:
            return error, thing
        return (error, thing, region) if kind < self.same_region else (error, thing, region, "frame", frame)


@dataclass(frozen=True)
class SegmenterRates:
    """What a segmenter gets wrong. Rates are of the sights of things that the errors before left whole, in the order of
    the fields; that of `false_masks` is a frame."""

    missed: float
    merged: float
    """Two things in one mask."""
    split: float
    """One thing in two masks."""
    wrong_name: float
    false_masks: float
    boundary: float
    """Standard deviation of where masks end [pixels at a width of 640], drawn anew in every frame."""
    missed_alike: Alike
    """Of what is missed, merged, split or false."""
    name_alike: Alike
    confusion: Mapping[str, Mapping[str, int]] = field(default_factory=dict)
    """True class -> wrong class -> sights."""
    false_names: Mapping[str, int] = field(default_factory=dict)

    def times(self, factor: float) -> SegmenterRates:
        """Return the rates multiplied by a factor, as far as a rate of a sight can be: to 1."""
        shares = {name: min(1.0, factor * getattr(self, name)) for name in ("missed", "merged", "split", "wrong_name")}
        return replace(self, **shares, false_masks=factor * self.false_masks, boundary=factor * self.boundary)


def segmenter_rates(segmenter: str) -> SegmenterRates:
    """Return the rates of a segmenter in data/errors/segmenters.toml. Raises KeyError for one that is not there, and
    BadInput or ValidationError for a file that is damaged."""
    told = TypeAdapter(dict[str, SegmenterRates]).validate_python(file_toml(RATES_FILE, LARGEST_SETTINGS))[segmenter]
    merged, split = told.merged / (1 - told.missed), told.split / (1 - told.missed - told.merged)
    return replace(told, merged=merged, split=split)


def quarter_turn(eye: Sequence[float], at: Sequence[float]) -> int:
    """Return the quarter turn, 0 to 3, from which something at a position is looked at: a region of views of a robot
    that stops before it looks. The first two numbers of both count [m]."""
    return int(((atan2(eye[1] - at[1], eye[0] - at[0]) + pi / 4) % (2 * pi)) // (pi / 2)) % 4


def view_region(camera: np.ndarray, points: np.ndarray) -> tuple[int, int]:
    """Return from where a thing is looked at: the eighth of a turn in which the camera (3,) stands around the middle of
    what is seen of it, points (N, 3) [m] in a world whose z is up, and whether it is near (1) or far (0)."""
    away = np.asarray(camera, float) - np.median(points, axis=0)
    eighth = int(np.floor((np.arctan2(away[1], away[0]) + np.pi) / (2 * np.pi) * SECTORS)) % SECTORS
    return eighth, int(np.linalg.norm(away) < NEAR)


class SegmenterErrors:
    """The errors of one segmenter in one room, of things that are told apart by whatever is given as `thing`.

    `classes`: names that it may give.
    """

    def __init__(self, rates: SegmenterRates, luck: Luck, classes: Collection[str]) -> None:
        self.rates, self.luck, self.classes = rates, luck, tuple(classes)

    def strikes(self, error: str, thing: object, region: object, frame: int = 0) -> bool:
        """Return whether an error, `missed`, `merged` or `split`, happens to a thing in a frame from a region of
        views."""
        key = self.rates.missed_alike.key(self.luck, error, thing, region, frame)
        return self.luck.happens(getattr(self.rates, error), *key)

    def misses(self, thing: object, region: object, frame: int = 0) -> bool:
        """Return whether a thing is not made out, where there are no masks that say which of two things were merged."""
        return any(self.strikes(error, thing, region, frame) for error in ("missed", "merged"))

    def name_of(self, thing: object, true_class: str, region: object, frame: int = 0) -> str:
        """Return the class that a thing is given."""
        key = self.rates.name_alike.key(self.luck, "name", thing, region, frame)
        wrong = self._wrong_names(true_class)
        if not wrong or not self.luck.happens(self.rates.wrong_name, *key):
            return true_class
        return self.luck.choice(wrong, "which", *key)

    def _wrong_names(self, true_class: str) -> dict[str, float]:
        """Return the classes that a thing may be taken for, with their weights: as was counted, else all alike."""
        every: Counter[str] = Counter()
        for row in self.rates.confusion.values():
            every.update(row)
        own = self.rates.confusion.get(true_class, {})
        counted = {
            name: own.get(name, 0) + NEVER_SEEN * every[name] / every.total()
            for name in sorted(every)
            if name != true_class and name in self.classes
        }
        return counted or {name: 1.0 for name in self.classes if name != true_class}
