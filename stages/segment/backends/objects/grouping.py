"""Joining patches to objects: the most certain pair first, features taken anew after every joint.

Agglomeration with a scorer that sees whole groups (after Nunez-Iglesias et al. 2013, "Machine learning of hierarchical
clustering to segment 2D and 3D images"): a hull, a histogram or a common plane says more of three faces of a box than
of two of their pixels. Training (tabletop-pairs) drives the same `Agglomeration` to see which pairs it meets.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.segment.backends.objects.boosting import Trees, score_rows
from scenewright.stages.segment.backends.objects.groups import Groups
from scenewright.stages.segment.backends.objects.rules import rule_score

PairScorer = Callable[[np.ndarray], np.ndarray]
"""Features (P, COUNT) float32 of pairs -> how certainly each is one object (P,)."""


def by_trees(trees: Trees) -> PairScorer:
    """Return the scorer of trained trees."""
    return lambda features: np.asarray(_by_trees(features, trees))


def by_rules(table: np.ndarray) -> PairScorer:
    """Return the scorer of a table of rules (rules.rule_table)."""
    return lambda features: np.asarray(_by_rules(features, table))


class Agglomeration:
    """Groups and the scores of their pairs; whoever drives it says which pair is joined next."""

    def __init__(self, groups: Groups, scorer: PairScorer) -> None:
        self.groups = groups
        self._scorer = scorer
        count = len(groups.group_of)
        self._scores = np.full((count, count), -np.inf)

    def score(self) -> tuple[np.ndarray, np.ndarray]:
        """Score the pairs that are new since the last joint; return them and their features (Groups.fresh_pairs)."""
        pairs, features = self.groups.fresh_pairs()
        self._scores[pairs[:, 0], pairs[:, 1]] = self._scorer(features)
        return pairs, features

    def best(self, admitted: np.ndarray | None = None) -> tuple[float, int, int]:
        """Return the best score and its pair, the first of several; -inf when there is none. `admitted` (N + 1, N + 1)
        bool: pairs that may be returned."""
        scores = self._scores if admitted is None else np.where(admitted, self._scores, -np.inf)
        flat_index = int(scores.argmax())
        first, second = divmod(flat_index, len(scores))
        return float(scores[first, second]), first, second

    def join(self, first: int, second: int) -> None:
        """Join a pair; its scores, and those of the larger group, are void."""
        self.groups.join(first, second)
        for group in (first, second):
            self._scores[group, :] = self._scores[:, group] = -np.inf


def group_patches(groups: Groups, scorer: PairScorer, threshold: float) -> np.ndarray:
    """Return the group (N + 1,) of every patch, once no pair scores more than `threshold`."""
    work = Agglomeration(groups, scorer)
    while True:
        work.score()
        score, first, second = work.best()
        if score <= threshold:
            return groups.group_of
        work.join(first, second)


@compiled
def _by_trees(features: np.ndarray, trees: tuple[np.ndarray, np.ndarray, np.ndarray, float]) -> np.ndarray:
    scores = np.empty(len(features))
    for k in range(len(features)):
        scores[k] = score_rows(features[k], trees)
    return scores


@compiled
def _by_rules(features: np.ndarray, table: np.ndarray) -> np.ndarray:
    scores = np.empty(len(features))
    for k in range(len(features)):
        scores[k] = rule_score(features[k], table)
    return scores
