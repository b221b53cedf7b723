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
class PairEvidence:
    """How often two labels were seen as one (`together`), and how often as two in one frame (`apart`).

    Of global segment labels: lying in one frame segment (Grinvald 2019), or matched to different ones. Of global
    instance labels: on the segments of one frame instance, or of different ones. Keys: (smaller label, larger label).
    """

    together: dict[tuple[int, int], int] = field(default_factory=dict)
    apart: dict[tuple[int, int], int] = field(default_factory=dict)

    def observe(self, groups: Iterable[Iterable[tuple[int, int]]], matched: Iterable[int]) -> None:
        """Count one frame: `groups` holds the pairs of labels that were seen as one, by segment or instance of the
        frame; `matched` all labels of the frame. Pairs that were seen as one are not counted as apart."""
        seen = [pair for group in groups for pair in group]
        for pair in seen:
            self.together[pair] = self.together.get(pair, 0) + 1
        for pair in set(combinations(sorted(matched), 2)) - set(seen):
            self.apart[pair] = self.apart.get(pair, 0) + 1

    def due(self, minimum_frames: int, *, contested: bool) -> list[tuple[int, int]]:
        """Return the pairs that were seen as one at least `minimum_frames` times, ascending; if `contested`, only those
        that were less often apart."""
        return sorted(
            pair
            for pair, count in self.together.items()
            if count >= minimum_frames and not (contested and self.apart.get(pair, 0) >= count)
        )

    def rename(self, removed: int, kept: int) -> None:
        """Move the counts of label `removed` to `kept`."""
        for counts in (self.together, self.apart):
            for pair in [pair for pair in counts if removed in pair]:
                count = counts.pop(pair)
                other = pair[0] if pair[1] == removed else pair[1]
                if other != kept:
                    renamed = (min(other, kept), max(other, kept))
                    counts[renamed] = counts.get(renamed, 0) + count


def label_pairs(labels: list[int], class_id: int, counts: TripleCounts, *, guarded: bool) -> list[tuple[int, int]]:
    """Return the pairs of global labels whose merging a frame segment of class `class_id` (0: background) speaks for.

    Without `guarded` these are all pairs, as in the thesis. `guarded` asks that the frame segment knows what it sees: a
    label that was predicted before takes part only if its class is the frame segment's. A geometric segment that runs
    from a cupboard onto the floor then joins nothing, however often it is seen.
    """
    if guarded:
        best = {label: counts.best(label) for label in labels}
        labels = [label for label, known in best.items() if (known[0] if known else 0) in (0, class_id)]
        if class_id == 0:
            labels = [label for label in labels if best[label] is None]
    return list(combinations(sorted(labels), 2))


def merge_segments(
    shared: PairEvidence, labels: MergedLabels, counts: TripleCounts, *, minimum_frames: int, contested: bool
) -> list[tuple[int, int]]:
    """Merge segment labels that lay together often enough, counts included; return the (removed, kept) pairs."""
    merged = []
    for pair in shared.due(minimum_frames, contested=contested):
        done = labels.merge(*pair)
        if done is not None:
            removed, kept = done
            counts.merge_segments(removed, kept)
            shared.rename(removed, kept)
            merged.append(done)
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


def merge_stuff(counts: TripleCounts, things: frozenset[int]) -> list[tuple[int, int]]:
    """Merge all instance labels of every class that is not countable; return the (removed, kept) pairs.

    Ours: within a frame a stuff class has one instance only (section 2.3.1), so the map has one too, although pieces of
    floor on both sides of a table never share a segment label.
    """
    by_class: dict[int, set[int]] = {}
    for row in counts.by_segment.values():
        for class_id, instance in row:
            if class_id not in things:
                by_class.setdefault(class_id, set()).add(instance)
    done = []
    for class_id in sorted(by_class):
        kept, *others = sorted(by_class[class_id])
        for removed in others:
            counts.merge_instances(removed, kept)
            done.append((removed, kept))
    return done


def merge_evident_instances(
    evidence: PairEvidence, counts: TripleCounts, *, minimum_frames: int
) -> list[tuple[int, int]]:
    """Merge instance labels that frames saw as one instance at least `minimum_frames` times, and less often as two.

    Ours, beside eq. 2.5: an object whose parts were first seen in different frames gets a label for each part; eq. 2.5
    never joins them when the parts are separate segments of which one was seen alone for long. Returns (removed, kept).
    """
    done: list[tuple[int, int]] = []
    while due := evidence.due(minimum_frames, contested=True):
        kept, removed = due[0]
        counts.merge_instances(removed, kept)
        evidence.rename(removed, kept)
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
