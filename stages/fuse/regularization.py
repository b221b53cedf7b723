"""Keeping the map consistent: merging segment labels that share voxels, then split instances (Han 2024, eq. 2.5)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from stages.fuse.counts import TripleCounts


class MergedLabels:
    """Which label each label was merged into. The older label (the smaller number) stays."""

    def __init__(self) -> None:
        self._parents = [0]

    def new(self) -> int:
        """Make the next label and return it; the first is 1."""
        self._parents.append(len(self._parents))
        return self._parents[-1]

    def root(self, label: int) -> int:
        """Return the label that `label` is part of."""
        while self._parents[label] != label:
            label = self._parents[label]
        return label

    def merge(self, first: int, second: int) -> tuple[int, int] | None:
        """Merge two labels; return (removed, kept), or None when they are one already."""
        kept, removed = sorted((self.root(first), self.root(second)))
        if kept == removed:
            return None
        self._parents[removed] = kept
        return removed, kept

    def table(self) -> np.ndarray:
        """Return (L + 1,) int32: the root of every label 0 .. L."""
        return np.array([self.root(label) for label in range(len(self._parents))], dtype=np.int32)


@dataclass
class SharedSegments:
    """In how many frame segments each pair of global segment labels was seen together (Grinvald 2019)."""

    frames: dict[tuple[int, int], int] = field(default_factory=dict)

    def observe(self, groups: Iterable[list[int]]) -> None:
        """Count every pair within each group: the labels that fill enough of one frame segment."""
        for group in groups:
            for pair in combinations(sorted(group), 2):
                self.frames[pair] = self.frames.get(pair, 0) + 1

    def due(self, minimum_frames: int) -> list[tuple[int, int]]:
        """Return the pairs that were seen together in at least `minimum_frames`, ascending."""
        return sorted(pair for pair, count in self.frames.items() if count >= minimum_frames)

    def forget(self, pair: tuple[int, int]) -> None:
        """Drop the count of a pair."""
        self.frames.pop(pair, None)

    def rename(self, removed: int, kept: int) -> None:
        """Move the counts of label `removed` to `kept`."""
        for first, second in [pair for pair in self.frames if removed in pair]:
            count = self.frames.pop((first, second))
            other = first if second == removed else second
            if other != kept:
                pair = (min(other, kept), max(other, kept))
                self.frames[pair] = self.frames.get(pair, 0) + count


def may_merge(first: int, second: int, counts: TripleCounts, things: frozenset[int]) -> bool:
    """Whether two segment labels may be one: not when they stand for different things.

    A geometric segment that runs over two objects in a few frames would otherwise join them for good. Labels that were
    never predicted, and labels of the same (class, instance), may always merge; two stuff classes may not either.
    """
    one, two = counts.best(first), counts.best(second)
    if one is None or two is None or one == two:
        return True
    return one[0] == two[0] and one[0] not in things


def merge_segments(
    shared: SharedSegments,
    labels: MergedLabels,
    counts: TripleCounts,
    things: frozenset[int],
    *,
    minimum_frames: int,
    guarded: bool,
) -> int:
    """Merge segment labels that were seen together often enough; return how many were removed.

    `guarded` refuses merges across different things (`may_merge`); without it this is the rule of the thesis.
    """
    merged = 0
    for pair in shared.due(minimum_frames):
        first, second = labels.root(pair[0]), labels.root(pair[1])
        if first != second and guarded and not may_merge(first, second, counts, things):
            shared.forget(pair)
            continue
        shared.forget(pair)
        done = labels.merge(first, second)
        if done is not None:
            removed, kept = done
            counts.merge_segments(removed, kept)
            shared.rename(removed, kept)
            merged += 1
    return merged


def shared_share(counts: TripleCounts, class_id: int, first: int, second: int) -> tuple[int, int]:
    """Return both sums of eq. 2.5 for two instance labels of a class: over the segment labels that both were counted
    on, and over all."""
    common = total = 0
    for row in counts.by_segment.values():
        one, two = row.get((class_id, first), 0), row.get((class_id, second), 0)
        total += one + two
        if one > 0 and two > 0:
            common += one + two
    return common, total


def merge_instances(
    counts: TripleCounts, things: frozenset[int], *, threshold: float, minimum_count: int
) -> list[tuple[int, int]]:
    """Merge instance labels of one class (eq. 2.5) until none is due; return the (removed, kept) pairs in order.

    Things merge when the count on common segment labels is at least `threshold` of the count of both, and above
    `minimum_count` (the floor of the published code); other classes merge on any common label. The newer label (the
    larger number) goes into the older.
    """
    done = []
    while (pair := _due_pair(counts, things, threshold, minimum_count)) is not None:
        kept, removed = pair
        counts.merge_instances(removed, kept)
        done.append((removed, kept))
    return done


def _due_pair(
    counts: TripleCounts, things: frozenset[int], threshold: float, minimum_count: int
) -> tuple[int, int] | None:
    candidates: set[tuple[int, int, int]] = set()
    for row in counts.by_segment.values():
        by_class: dict[int, list[int]] = {}
        for class_id, instance in row:
            by_class.setdefault(class_id, []).append(instance)
        for class_id, instances in by_class.items():
            candidates.update((class_id, *pair) for pair in combinations(sorted(instances), 2))
    for class_id, first, second in sorted(candidates):
        common, total = shared_share(counts, class_id, first, second)
        if class_id not in things or (common >= threshold * total and common > minimum_count):
            return first, second
    return None
