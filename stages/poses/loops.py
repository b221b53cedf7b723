"""Loop closure: which key frames show the same place, and how they lie to each other.

A candidate becomes an edge only after registration (features, then dense alignment) and after the alignment the other
way round has found the same motion.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scenewright.stages.kit.registration.alignment import Alignment
from scenewright.stages.kit.registration.pairs import Limits, agreed
from scenewright.stages.kit.registration.pyramid import Pyramid
from scenewright.stages.kit.registration.rigid_motion import angle_of, between, distance_of
from scenewright.stages.poses.features import ransac_motion
from scenewright.stages.poses.places import PlaceIndex, fern_likeness
from scenewright.stages.poses.tracking import KeyFrame

LEAST_FEATURES = 15
"""Feature matches that must agree before dense alignment is tried."""
LEAST_WORDS = 0.02
"""Least likeness by words of two key frames that may show one place; by eye."""
LEAST_FERNS = 0.55
"""Least share of ferns that agree between two key frames that may show one place; by eye."""
LARGEST_CORRECTION = (0.4, math.radians(20.0))
"""A pair that was chosen for where it should be must not move farther than this."""
PYRAMIDS = 24
"""Key frames whose images are held."""
FoundBy = Literal["place", "overlap"]
"""Whether a pair was tried because of how it looks or of where it should be."""


@dataclass(frozen=True)
class Loop:
    """A verified pair of key frames."""

    target: int
    source: int
    alignment: Alignment
    found_by: FoundBy


class PyramidCache:
    """Pyramids of the key frames, read again on demand; the least recently used is dropped."""

    def __init__(self, load: Callable[[int], Pyramid]) -> None:
        self._load = load
        self._held: OrderedDict[int, Pyramid] = OrderedDict()

    def __call__(self, key: int) -> Pyramid:
        """Return the pyramid of a key frame."""
        if key in self._held:
            self._held.move_to_end(key)
        else:
            self._held[key] = self._load(key)
            if len(self._held) > PYRAMIDS:
                self._held.popitem(last=False)
        return self._held[key]


def place_candidates(
    keys: list[KeyFrame],
    random: np.random.Generator,
    *,
    per_key: int,
    least_gap: int,
    near: Callable[[int], np.ndarray] | None = None,
) -> list[tuple[int, int]]:
    """Return pairs (earlier, later) of key frames that look alike, the most alike first for each later one.

    Neighbours of one part (fewer than `least_gap` key frames apart) are no candidates; nor is what `near`, asked for a
    later key frame, denies of those before it (K,).
    """
    if len(keys) < 2:
        return []
    index = PlaceIndex(random)
    for key in keys:
        index.add(key.features.descriptors)
    codes = np.array([key.fern_code for key in keys])
    parts = np.array([key.part for key in keys])
    pairs = []
    for later in range(1, len(keys)):
        numbers = np.arange(later)
        if len(keys[later].features.descriptors):
            scores, least = index.scores(later)[:later], LEAST_WORDS
        else:
            scores, least = fern_likeness(codes[later], codes[:later]), LEAST_FERNS
        allowed = (scores >= least) & ((parts[:later] != parts[later]) | (later - numbers >= least_gap))
        if near is not None:
            allowed &= near(later)
        ranked = numbers[allowed][np.argsort(-scores[allowed], kind="stable")]
        pairs += [(int(earlier), later) for earlier in ranked[:per_key]]
    return pairs


class Verifier:
    """Registers candidates and says which are loops."""

    def __init__(
        self, keys: list[KeyFrame], pyramids: PyramidCache, limits: Limits, use_color: bool, random: np.random.Generator
    ) -> None:
        self._keys, self._pyramids, self._limits = keys, pyramids, limits
        self._use_color, self._random = use_color, random

    def by_appearance(self, target: int, source: int) -> Loop | None:
        """Register two key frames that look alike, without a guess where they are."""
        first, second = self._keys[target].features, self._keys[source].features
        if len(first.descriptors) and len(second.descriptors):
            match = ransac_motion(first, second, self._random)
            if match is None or match.inliers < LEAST_FEATURES:
                return None
            return self._verify(target, source, match.target_from_source, "place")
        return self._verify(target, source, np.eye(4), "place")

    def by_position(self, target: int, source: int, guess: np.ndarray) -> Loop | None:
        """Register two key frames that should see the same where they are now."""
        loop = self._verify(target, source, guess, "overlap")
        if loop is None:
            return None
        moved = between(guess, loop.alignment.target_from_source)
        is_small = distance_of(moved) <= LARGEST_CORRECTION[0] and angle_of(moved) <= LARGEST_CORRECTION[1]
        return loop if is_small else None

    def _verify(self, target: int, source: int, guess: np.ndarray, found_by: FoundBy) -> Loop | None:
        first, second = self._pyramids(target), self._pyramids(source)
        coarsest = None if found_by == "place" else 1
        alignment = agreed(first, second, guess, self._limits, use_color=self._use_color, coarsest=coarsest)
        return None if alignment is None else Loop(target, source, alignment, found_by)
