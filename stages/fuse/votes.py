"""What the masks of all frames said of a surface: its segment labels know how often, and how surely."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Votes:
    """By segment label and class the sum of the scores of all masks, and in how many frames each label was seen."""

    scores: Mapping[int, Mapping[int, float]]
    looks: Mapping[int, int]

    def share(self, segments: np.ndarray, classes: Iterable[int]) -> np.ndarray:
        """Return the score (N,), 0..1 a look, that masks of these classes gave surface of these labels (N,)."""
        wanted = frozenset(classes)
        table = np.zeros(int(segments.max(initial=0)) + 1)
        for label in np.unique(segments).tolist():
            total = sum(score for c, score in self.scores.get(label, {}).items() if c in wanted)
            table[label] = min(total / max(1, self.looks.get(label, 0)), 1.0)
        return np.asarray(table[segments])

    def own_share(self, segments: np.ndarray, class_id: np.ndarray) -> np.ndarray:
        """Return the score (N,), 0..1 a look, that masks of its own class (N,) gave the surface."""
        result = np.zeros(len(segments))
        for c in np.unique(class_id[class_id > 0]).tolist():
            of_class = class_id == c
            result[of_class] = self.share(segments[of_class], [c])
        return result
