"""Joining patches to objects: the most certain pair first, features taken anew after every joint.

Agglomeration with a scorer that sees whole groups (after Nunez-Iglesias et al. 2013, "Machine learning of hierarchical
clustering to segment 2D and 3D images"): a hull, a histogram or a common plane says more of three faces of a box than
of two of their pixels.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numba import njit

from stages.segment.backends.objects.boosting import Trees, score_rows
from stages.segment.backends.objects.hulls import convex_hull, hull_content
from stages.segment.backends.objects.pairs import CONTENT_STEP, COUNT, HIDING_MARGIN, inverse_plane, pair_features
from stages.segment.backends.objects.regions import Regions
from stages.segment.backends.objects.rules import rule_score

LARGEST_GAP = 3.0
"""Groups that do not touch are a pair when their hulls' corners are closer than this times the root of the pixels of
the smaller one ..."""
SMALLEST_APART = 250.0
"""... and both have at least so many pixels."""


@njit(cache=True)
def _candidate(a: int, b: int, sums: np.ndarray, borders: np.ndarray, boxes: np.ndarray) -> bool:
    if borders[a, b, 0] > 0:
        return True
    smaller = min(sums[a, 0], sums[b, 0])
    if smaller < SMALLEST_APART:
        return False
    across = max(0.0, max(boxes[a, 0], boxes[b, 0]) - min(boxes[a, 2], boxes[b, 2]))
    down = max(0.0, max(boxes[a, 1], boxes[b, 1]) - min(boxes[a, 3], boxes[b, 3]))
    return np.hypot(across, down) < LARGEST_GAP * np.sqrt(smaller)


@njit(cache=True)
def _own_behind(hull: np.ndarray, k: int, sums: np.ndarray, groups: np.ndarray, inverse: np.ndarray) -> float:
    plane, residual = inverse_plane(sums[k])
    own, hidden, missing, behind = hull_content(
        hull, groups, inverse, k, k, plane, HIDING_MARGIN + 2 * residual, CONTENT_STEP
    )
    return behind / max(1.0, own + hidden + missing + behind)


@njit(cache=True)
def _agglomerate(
    sums: np.ndarray,
    colors: np.ndarray,
    heights: np.ndarray,
    perimeters: np.ndarray,
    borders: np.ndarray,
    corners: np.ndarray,
    starts: np.ndarray,
    groups: np.ndarray,
    inverse: np.ndarray,
    trees: tuple[np.ndarray, np.ndarray, np.ndarray, float],
    rules: np.ndarray,
    threshold: float,
    truth: np.ndarray,
    exploration: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (group of every patch (N + 1,), features of every pair looked at, its truth: 1 same, 0 other, -1 unknown).

    The scorer is `trees` (boosting.Trees) or, where they are empty, `rules` (rules.rule_table). With `truth` (N + 1,)
    the true object of every patch, features are recorded, and `exploration` (N + 1,) random numbers below the share of
    joints that follow the truth instead of the scorer.
    """
    count = len(sums) - 1
    learned = trees[0].shape[0] > 0
    recording = truth.shape[0] > 0
    group_of = np.arange(count + 1)
    alive = np.ones(count + 1, dtype=np.bool_)
    alive[0] = False
    hulls = [corners[starts[max(k, 1)] : starts[max(k, 1) + 1]].copy() for k in range(count + 1)]
    boxes = np.zeros((count + 1, 4))
    own_behind = np.zeros(count + 1)
    for k in range(1, count + 1):
        boxes[k, 0], boxes[k, 1] = hulls[k][:, 0].min(), hulls[k][:, 1].min()
        boxes[k, 2], boxes[k, 3] = hulls[k][:, 0].max(), hulls[k][:, 1].max()
        own_behind[k] = _own_behind(hulls[k], k, sums, groups, inverse)
    scores = np.full((count + 1, count + 1), -np.inf)
    records = np.empty((1024 if recording else 0, COUNT), dtype=np.float32)
    answers = np.empty(1024 if recording else 0, dtype=np.int8)
    recorded = 0
    fresh = -1  # the group whose pairs are to be scored; -1: all
    for round_number in range(count + 1):
        for a in range(1, count + 1):
            if not alive[a]:
                continue
            for b in range(a + 1, count + 1):
                if not alive[b] or not (fresh == -1 or a == fresh or b == fresh):
                    continue
                if not _candidate(a, b, sums, borders, boxes):
                    scores[a, b] = -np.inf
                    continue
                row = pair_features(
                    a,
                    b,
                    sums,
                    colors,
                    heights,
                    perimeters,
                    borders[a, b],
                    hulls[a],
                    hulls[b],
                    own_behind,
                    groups,
                    inverse,
                )
                scores[a, b] = score_rows(row, trees) if learned else rule_score(row, rules)
                if recording:
                    if recorded == len(records):
                        more = np.empty((2 * recorded, COUNT), dtype=np.float32)
                        more[:recorded] = records
                        records = more
                        more_answers = np.empty(2 * recorded, dtype=np.int8)
                        more_answers[:recorded] = answers
                        answers = more_answers
                    records[recorded] = row
                    known = truth[a] > 0 and truth[b] > 0
                    answers[recorded] = (1 if truth[a] == truth[b] else 0) if known else -1
                    recorded += 1
        best, first, second = -np.inf, 0, 0
        by_truth = recording and exploration[round_number] < 0.5
        for a in range(1, count + 1):
            if alive[a]:
                for b in range(a + 1, count + 1):
                    if alive[b] and scores[a, b] > best:
                        if by_truth and not (truth[a] == truth[b] and truth[a] > 0):
                            continue
                        best, first, second = scores[a, b], a, b
        if best == -np.inf or (best <= threshold and not by_truth):
            break
        alive[second] = False
        if recording and truth[first] != truth[second]:
            truth[first] = truth[first] if sums[first, 0] >= sums[second, 0] else truth[second]
        for k in range(1, count + 1):
            if group_of[k] == second:
                group_of[k] = first
        sums[first] += sums[second]
        colors[first] += colors[second]
        heights[first] += heights[second]
        perimeters[first] += perimeters[second] - 2 * borders[first, second, 0]
        for k in range(1, count + 1):
            if k != first and k != second and alive[k]:
                borders[first, k] += borders[second, k]
                borders[k, first] += borders[k, second]
        joined = np.empty((len(hulls[first]) + len(hulls[second]), 2))
        joined[: len(hulls[first])] = hulls[first]
        joined[len(hulls[first]) :] = hulls[second]
        hulls[first] = convex_hull(joined)
        boxes[first, 0], boxes[first, 1] = hulls[first][:, 0].min(), hulls[first][:, 1].min()
        boxes[first, 2], boxes[first, 3] = hulls[first][:, 0].max(), hulls[first][:, 1].max()
        rows, columns = groups.shape
        for v in range(max(0, int(boxes[second, 1])), min(rows, int(boxes[second, 3]) + 1)):
            for u in range(max(0, int(boxes[second, 0])), min(columns, int(boxes[second, 2]) + 1)):
                if groups[v, u] == second:
                    groups[v, u] = first
        own_behind[first] = _own_behind(hulls[first], first, sums, groups, inverse)
        scores[second, :] = -np.inf
        scores[:, second] = -np.inf
        fresh = first
    return group_of, records[:recorded], answers[:recorded]


@dataclass
class Recording:
    """What training needs of one frame: which pairs were looked at, and which of them are one object."""

    truth: np.ndarray
    """(H, W) int32 true object of every pixel of the image, 0 none."""
    random: np.random.Generator
    by_truth: float
    """This share of the joints follows the truth, the rest the scorer: later pairs are then those that it meets."""
    features: np.ndarray = field(default_factory=lambda: np.zeros((0, COUNT), dtype=np.float32))
    answers: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int8))
    """1 one object, 0 two, -1 unknown (a patch mostly off the labelled objects)."""


def group_patches(
    regions: Regions,
    labels: np.ndarray,
    inverse: np.ndarray,
    trees: Trees,
    rules: np.ndarray,
    threshold: float,
    window: tuple[slice, slice],
    recording: Recording | None = None,
) -> np.ndarray:
    """Return the group (N + 1,) of every patch: the number of one of its patches.

    `regions` are used up; `labels` (H, W) int32 patches; `inverse` (H, W) [1/m]. Pairs are joined while the best of
    them scores more than `threshold`, by `trees` or, where these are empty, by `rules` (rules.rule_table). With
    `recording` the pairs that were looked at are written into it; its truth is of the whole image, everything else of
    this `window`.
    """
    count = len(regions.sums) - 1
    truth = np.zeros(0, dtype=np.int64)
    exploration = np.ones(count + 1)
    if recording is not None:
        truth = majority_owner(labels, recording.truth[window], count)
        exploration = np.where(recording.random.random(count + 1) < recording.by_truth, 0.0, 1.0)
    group_of, features, answers = _agglomerate(
        regions.sums,
        regions.colors,
        regions.heights,
        regions.perimeters,
        regions.borders,
        regions.corners,
        regions.corner_starts,
        labels.copy(),
        inverse,
        trees,
        rules,
        threshold,
        truth,
        exploration,
    )
    if recording is not None:
        recording.features, recording.answers = features, answers
    return np.asarray(group_of)


def majority_owner(labels: np.ndarray, truth: np.ndarray, count: int) -> np.ndarray:
    """Return (count + 1,) the true object that has most pixels of every patch of `labels`, 0 for none."""
    width = int(truth.max(initial=0)) + 1
    table = np.bincount((labels * width + truth).ravel(), minlength=(count + 1) * width).reshape(count + 1, width)
    owner: np.ndarray = table.argmax(axis=1)
    owner[0] = 0
    return owner
