"""Masks of one frame that are answers for one thing: which belong together, their mean, and which lie in another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

SAME = 0.5
"""IoU over which two masks of different runs or networks are one thing."""
NESTED = 0.7
"""Share of a mask over which it lies in another."""


@dataclass(frozen=True)
class BoxedMask:
    """A mask and where it lies, so that masks that lie apart are not compared."""

    mask: np.ndarray
    """(H, W) bool."""

    @cached_property
    def box(self) -> tuple[int, int, int, int]:
        """First row, row after the last, first column, column after the last; zeros when it is empty."""
        rows, columns = np.flatnonzero(self.mask.any(axis=1)), np.flatnonzero(self.mask.any(axis=0))
        return (int(rows[0]), int(rows[-1]) + 1, int(columns[0]), int(columns[-1]) + 1) if len(rows) else (0, 0, 0, 0)

    @cached_property
    def area(self) -> int:
        """Pixels."""
        return int(np.count_nonzero(self.mask))

    def shared(self, other: BoxedMask) -> int:
        """Return how many pixels both have."""
        low, high = np.maximum(self.box, other.box), np.minimum(self.box, other.box)
        window = (slice(low[0], high[1]), slice(low[2], high[3]))
        if high[1] <= low[0] or high[3] <= low[2]:
            return 0
        return int(np.count_nonzero(self.mask[window] & other.mask[window]))

    def overlap(self, other: BoxedMask) -> float:
        """Return the intersection over union with another mask."""
        shared = self.shared(other)
        return shared / max(self.area + other.area - shared, 1)


def groups_of(masks: Sequence[BoxedMask], scores: Sequence[float]) -> list[list[int]]:
    """Return the indices of masks that are answers for one thing, the best scored first in each group.

    The best scored mask that is left leads a group; those whose IoU with it is over SAME belong to it. Of equal scores
    the smaller index goes first, so that networks whose scores take few values give the same groups every time.
    """
    groups: list[list[int]] = []
    for k in sorted(range(len(masks)), key=lambda k: (-scores[k], k)):
        overlaps = [masks[group[0]].overlap(masks[k]) for group in groups]
        best = int(np.argmax(overlaps)) if overlaps else -1
        if best >= 0 and overlaps[best] > SAME:
            groups[best].append(k)
        else:
            groups.append([k])
    return groups


def mean_mask(masks: Sequence[BoxedMask], scores: Sequence[float]) -> BoxedMask:
    """Return the pixels that masks with at least half of the sum of the scores have."""
    if len(masks) == 1:
        return masks[0]
    total = np.zeros(masks[0].mask.shape, dtype=np.float32)
    for boxed, score in zip(masks, scores, strict=True):
        total[boxed.mask] += score
    # Sums of single precision: half of the whole must not fail by its last digit.
    return BoxedMask(total >= 0.5 * sum(scores) - 1e-6)


def not_nested(masks: Sequence[BoxedMask], scores: Sequence[float], classes: Sequence[int]) -> list[int]:
    """Return the indices, ascending, without the weaker of two masks of one class of which one lies in the other."""
    kept: list[int] = []
    for k in sorted(range(len(masks)), key=lambda k: (-scores[k], k)):
        same = (masks[other] for other in kept if classes[other] == classes[k])
        if not any(masks[k].shared(other) > NESTED * min(masks[k].area, other.area) for other in same):
            kept.append(k)
    return sorted(kept)
