"""Loop closure: which key frames show the same place, and how they lie to each other.

A candidate becomes an edge only after registration (features, then dense alignment) and after the alignment the other
way round has found the same motion.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from schemas.scene_parts import Camera
from stages.kit.geometry.transforms import apply, inverse
from stages.poses.alignment import Alignment, align
from stages.poses.features import ransac_motion
from stages.poses.places import PlaceIndex, fern_likeness
from stages.poses.pose_graph import Edge
from stages.poses.pyramid import Pyramid
from stages.poses.rigid_motion import angle_of, between, distance_of
from stages.poses.tracking import KeyFrame, Limits

SYSTEMATIC = np.array([0.0015] * 3 + [0.003] * 3)
"""Errors that do not average out over pixels (lens, depth scale): standard deviations [rad] and [m]."""
LEAST_FEATURES = 15
"""Feature matches that must agree before dense alignment is tried."""
LEAST_WORDS = 0.02
LEAST_FERNS = 0.55
RETURN_DISTANCE, RETURN_ANGLE = 0.02, math.radians(1.0)
"""Alignment there and back must end within this."""
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


def with_systematic_error(information: np.ndarray) -> np.ndarray:
    """Return the information (6, 6) after adding the errors that more pixels do not reduce."""
    spread = np.linalg.inv(information + 1e-3 * np.eye(6)) + np.diag(SYSTEMATIC**2)
    result = np.linalg.inv(spread)
    return 0.5 * (result + result.T)


def edge_of(target: int, source: int, alignment: Alignment, *, switchable: bool) -> Edge:
    """Return the edge of an alignment between two key frames."""
    information = with_systematic_error(alignment.information)
    return Edge(target, source, alignment.target_from_source, information, switchable)


def place_candidates(
    keys: list[KeyFrame], random: np.random.Generator, *, per_key: int, least_gap: int
) -> list[tuple[int, int]]:
    """Return pairs (earlier, later) of key frames that look alike, the most alike first for each later one.

    Neighbours of one part (fewer than `least_gap` key frames apart) are no candidates.
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
        ranked = numbers[allowed][np.argsort(-scores[allowed], kind="stable")]
        pairs += [(int(earlier), later) for earlier in ranked[:per_key]]
    return pairs


def overlap_candidates(
    keys: list[KeyFrame],
    world_from_key: np.ndarray,
    camera: Camera,
    linked: Iterable[tuple[int, int]],
    *,
    per_key: int,
    least_overlap: float = 0.35,
) -> list[tuple[int, int]]:
    """Return pairs (earlier, later), not yet `linked`, that should see the same surface where they stand.

    `world_from_key` is (N, 4, 4). Pairs of different parts of the graph must not be asked for. For each later key
    frame the candidates are spread: the best ones that are no neighbours of one that was taken.
    """
    taken = set(linked)
    pairs = []
    for later in range(2, len(keys)):
        shares = []
        for earlier in range(later - 1):
            guess = between(world_from_key[earlier], world_from_key[later])
            shares.append((seen_share(keys[earlier], keys[later], guess, camera), earlier))
        chosen: list[int] = []
        for share, earlier in sorted(shares, key=lambda entry: (-entry[0], entry[1])):
            if share < least_overlap or len(chosen) >= per_key:
                break
            if any(abs(earlier - other) < 2 for other in chosen):
                continue
            chosen.append(earlier)
        pairs += [(earlier, later) for earlier in chosen if (earlier, later) not in taken]
    return pairs


def seen_share(target: KeyFrame, source: KeyFrame, target_from_source: np.ndarray, camera: Camera) -> float:
    """Return the share of what `source` saw that lies in the view of `target` at a depth it could see (0 to 1).

    Views whose axes differ by more than 75 degrees share nothing that could be aligned.
    """
    if target_from_source[2, 2] < math.cos(math.radians(75)) or not len(source.sparse_points):
        return 0.0
    points = apply(target_from_source, source.sparse_points)
    z = np.maximum(points[:, 2], 1e-6)
    u = camera.fx * points[:, 0] / z + camera.cx
    v = camera.fy * points[:, 1] / z + camera.cy
    near = (points[:, 2] > 0.2) & (points[:, 2] < 3 * max(target.median_depth, 0.5))
    return float((near & (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)).mean())


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
            return self._verified(target, source, match.target_from_source, "place")
        return self._verified(target, source, np.eye(4), "place")

    def by_position(self, target: int, source: int, guess: np.ndarray) -> Loop | None:
        """Register two key frames that should see the same where they are now."""
        loop = self._verified(target, source, guess, "overlap")
        if loop is None:
            return None
        moved = between(guess, loop.alignment.target_from_source)
        near = distance_of(moved) <= LARGEST_CORRECTION[0] and angle_of(moved) <= LARGEST_CORRECTION[1]
        return loop if near else None

    def _verified(self, target: int, source: int, guess: np.ndarray, found_by: FoundBy) -> Loop | None:
        first, second = self._pyramids(target), self._pyramids(source)
        coarsest = None if found_by == "place" else 1
        there = align(first, second, guess, use_color=self._use_color, coarsest=coarsest)
        if not self._limits.good(there):
            return None
        back = align(second, first, inverse(there.target_from_source), use_color=self._use_color, coarsest=0)
        if not self._limits.good(back):
            return None
        turn = there.target_from_source @ back.target_from_source
        if distance_of(turn) > RETURN_DISTANCE or angle_of(turn) > RETURN_ANGLE:
            return None
        return Loop(target, source, there, found_by)
