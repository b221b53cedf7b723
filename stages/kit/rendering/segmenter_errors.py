"""What a segmenter gets wrong: draws that can be asked for again, and how long an error lasts.

An error is drawn once for a thing, once for a thing and a region of views, or anew in every frame (`Alike`). Of
`SegmenterErrors`, none is drawn anew: a second picture from the same place tells nothing new, and an error stays until
the thing lies anew or is looked at from another region. A false positive is a thing that is taken for one that was
asked for. The default rates follow the failure table of Han 2024 (table 3.4: 8 false positives and 2 missed within 262
executions, of which we take 100.5 to be grasps): 5 other things in view, 3 of 8 false detections survived a look from
near by.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import atan2, pi

import numpy as np

GRASPS = 140 / 2 + 122 / 4
"""**Assumed** of the 262 executions: every second one at a table, one of four on the move."""
FALSE_POSITIVES, MISSED = 8, 2
OTHERS_IN_VIEW = 5
"""**Assumed**: things beside a sought one, each of which may be taken for it."""
STAYS_CONFUSED = 3 / 8
"""Three of eight false detections passed the look from near by and led to failure: taken as the chance that a thing
that can be confused is confused from any one region of views."""


@dataclass(frozen=True)
class SegmenterRates:
    """Chances, each per draw."""

    confusable: float = FALSE_POSITIVES / GRASPS / OTHERS_IN_VIEW / STAYS_CONFUSED
    """That a thing looks like another that is asked for."""
    confused: float = STAYS_CONFUSED
    """That such a thing is taken for it, from one region of views."""
    hidden: float = MISSED / GRASPS / 2
    """That a thing is not seen from one side, near or far. 0 where what hides a thing is simulated."""
    missed: float = MISSED / GRASPS / 2
    """That a thing is not detected from one region of views."""


def quarter_turn(eye: Sequence[float], at: Sequence[float]) -> int:
    """Return the quarter turn, 0 to 3, from which something at a position is looked at: a region of views. The first
    two numbers of both count [m]."""
    return int(((atan2(eye[1] - at[1], eye[0] - at[0]) + pi / 4) % (2 * pi)) // (pi / 2)) % 4


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


SECTORS = 8
"""Regions of views around a thing."""
NEAR = 1.5
"""Distance within which all views of a thing are one region [m]."""


def view_region(camera: np.ndarray, points: np.ndarray) -> tuple[int, int]:
    """Return from where a thing is looked at: the eighth of a turn in which the camera (3,) stands around the middle of
    what is seen of it, points (N, 3) [m] in a world whose z is up, and whether it is near (1) or far (0)."""
    away = np.asarray(camera, float) - np.median(points, axis=0)
    eighth = int(np.floor((np.arctan2(away[1], away[0]) + np.pi) / (2 * np.pi) * SECTORS)) % SECTORS
    return eighth, int(np.linalg.norm(away) < NEAR)


class SegmenterErrors:
    """The errors of one segmenter that is asked for some classes (`asked`)."""

    def __init__(self, rates: SegmenterRates, luck: Luck, asked: tuple[str, ...]) -> None:
        self._rates, self._luck, self._asked = rates, luck, asked

    def misses(self, name: str, moved: int, side: int, near: bool) -> bool:
        """Whether a thing, as it lies (`moved`), is not detected from a quarter turn (0 to 3), near or far."""
        hidden = self._luck.happens(self._rates.hidden, "hidden", name, moved, side)
        return hidden or self._luck.happens(self._rates.missed, "missed", name, moved, side, near)

    def class_of(self, name: str, true_class: str, *region: object) -> str:
        """Return the class that a thing is given in a region of views: its own, or for good another that was asked
        for."""
        others = [label for label in self._asked if label != true_class]
        if (
            others
            and self._luck.happens(self._rates.confusable, "confusable", name)
            and self._luck.happens(self._rates.confused, "confused", name, *region)
        ):
            return others[int(self._luck.uniform("taken for", name) * len(others))]
        return true_class
