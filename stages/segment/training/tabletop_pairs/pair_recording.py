"""Which pairs of patches grouping meets in a labelled frame, and which of them are one object: what scorers learn from.

Drives the product's `Agglomeration` from outside.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.stages.kit.formats.mosd_frames import CAMERA, LabelledFrame
from scenewright.stages.segment.backends.objects.grouping import Agglomeration, PairScorer
from scenewright.stages.segment.backends.objects.segmentation import ObjectSettings, Pieces, cut_pieces


@dataclass(frozen=True)
class RecordedPairs:
    """Features (N, F) float32 of the pairs looked at, and their answers (N,) int8: 1 one object, 0 two, -1 unknown (a
    patch mostly off the labelled objects)."""

    features: np.ndarray
    answers: np.ndarray


def pairs_of_frame(
    frame: LabelledFrame, scorer: PairScorer, by_truth: float, random: np.random.Generator
) -> RecordedPairs:
    """Return the pairs that grouping by `scorer` meets in a frame, the share `by_truth` of the joints by the truth."""
    settings = ObjectSettings()
    pieces = cut_pieces(frame.color, frame.depth, CAMERA, settings)
    return record_pairs(pieces, frame.objects, scorer, settings.threshold, by_truth, random)


def record_pairs(
    pieces: Pieces,
    objects: np.ndarray,
    scorer: PairScorer,
    threshold: float,
    by_truth: float,
    random: np.random.Generator,
) -> RecordedPairs:
    """Join pieces and record every pair on the way. `objects` (H, W) int32: true object of every pixel, 0 none.

    The share `by_truth` of the joints follows the truth, the rest the scorer: later pairs are then those that it meets.
    """
    groups = pieces.groups
    count = len(groups.group_of) - 1
    truth = majority_owner(pieces.labels, objects[pieces.patches.window], count)
    follows_truth = random.random(count + 1) < by_truth
    work = Agglomeration(groups, scorer)
    features, answers = [], []
    for follows in follows_truth:
        pairs, rows = work.score()
        first, second = truth[pairs[:, 0]], truth[pairs[:, 1]]
        features.append(rows)
        answers.append(np.where((first > 0) & (second > 0), first == second, -1).astype(np.int8))
        same = (truth[:, None] == truth[None, :]) & (truth[:, None] > 0)
        score, kept, removed = work.best(same if follows else None)
        if score == -np.inf or (score <= threshold and not follows):
            break
        if truth[kept] != truth[removed] and groups.sums[kept, 0] < groups.sums[removed, 0]:
            truth[kept] = truth[removed]
        work.join(kept, removed)
    return RecordedPairs(np.concatenate(features), np.concatenate(answers))


def majority_owner(labels: np.ndarray, truth: np.ndarray, count: int) -> np.ndarray:
    """Return (count + 1,) the true object that has most pixels of every patch of `labels`, 0 for none."""
    width = int(truth.max(initial=0)) + 1
    table = np.bincount((labels * width + truth).ravel(), minlength=(count + 1) * width).reshape(count + 1, width)
    owner: np.ndarray = table.argmax(axis=1)
    owner[0] = 0
    return owner
