"""Keeping the map consistent: merging segment labels that share voxels, then split instances (Han 2024, eq. 2.5)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from itertools import combinations

import numpy as np
from scenewright.stages.fuse.counts import TripleCounts

Pair = tuple[int, int]
"""(smaller label, larger label)"""


NONE: Counter[int] = Counter()
"""The counts of a label that was never seen apart; not to be changed."""


class MergedLabels:
    """Which label each label was merged into. The older label (the smaller number) stays."""

    def __init__(self) -> None:
        self._roots = np.zeros(64, dtype=np.int32)
        self._count = 1

    def new(self) -> int:
        """Make the next label and return it; the first is 1."""
        if self._count == len(self._roots):
            self._roots = np.concatenate([self._roots, np.zeros_like(self._roots)])
        self._roots[self._count] = self._count
        self._count += 1
        return self._count - 1

    def root(self, label: int) -> int:
        """Return the label that `label` is part of."""
        return int(self._roots[label])

    def merge(self, first: int, second: int) -> tuple[int, int] | None:
        """Merge two labels; return (removed, kept), or None when they are one already."""
        kept, removed = sorted((self.root(first), self.root(second)))
        if kept == removed:
            return None
        used = self._roots[: self._count]
        used[used == removed] = kept
        return removed, kept

    def table(self) -> np.ndarray:
        """Return (L + 1,) int32: the root of every label 0 .. L."""
        return self._roots[: self._count].copy()


class PairEvidence:
    """How often two labels were seen as one (`together`), and how often as two in one frame (`apart`).

    Of global segment labels: lying in one frame segment (Grinvald 2019), or matched to different ones. Of global
    instance labels: on the segments of one frame instance, or of different ones. To be read, and changed by the methods
    alone.
    """

    def __init__(self) -> None:
        self.together: dict[Pair, int] = {}
        self.apart: dict[int, Counter[int]] = {}
        """`apart[a][b]` and `apart[b][a]`: nearly every two labels of a frame, so both ways, without pairs as keys."""
        self._pairs: dict[int, set[Pair]] = {}
        """The pairs of `together` that each label is in."""
        self._open: set[Pair] = set()
        """Pairs that may be due: those that gained since `due` last looked, and those that it found."""
        self._rule: tuple[int, bool] | None = None

    def observe(self, groups: Iterable[Iterable[tuple[int, int]]], matched: Iterable[int]) -> None:
        """Count one frame: `groups` holds the pairs of labels that were seen as one, by segment or instance of the
        frame; `matched` all labels of the frame. Pairs that were seen as one are not counted as apart."""
        pairs_together = [pair for group in groups for pair in group]
        for pair in pairs_together:
            self._increase(pair, 1)
        labels = list(dict.fromkeys(matched))
        for label in labels:
            row = self.apart.setdefault(label, Counter())
            row.update(labels)
            row.pop(label)
        present = set(labels)
        for first, second in set(pairs_together):
            if first in present and second in present:
                self._decrease(first, second)
                self._decrease(second, first)
        for label in labels:
            if not self.apart[label]:
                del self.apart[label]

    def due(self, minimum_frames: int, *, contested: bool) -> list[tuple[int, int]]:
        """Return the pairs that were seen as one at least `minimum_frames` times, ascending; if `contested`, only those
        that were less often apart."""
        if self._rule != (minimum_frames, contested):
            self._rule, self._open = (minimum_frames, contested), set(self.together)
        # Being apart more often makes no pair due, so a pair that was not due is not until it is seen as one again.
        self._open = {pair for pair in self._open if self._is_due(pair, minimum_frames, contested)}
        return sorted(self._open)

    def met(self, label: int) -> Iterator[int]:
        """Yield the labels that some frame showed with a label, as one or as two; some of them twice."""
        yield from self.apart.get(label, ())
        for first, second in self._pairs.get(label, ()):
            yield second if first == label else first

    def forget(self, label: int) -> None:
        """Drop all counts of a label."""
        for pair in self._pairs.pop(label, ()):
            self._pairs[pair[0] if pair[1] == label else pair[1]].discard(pair)
            self._open.discard(pair)
            del self.together[pair]
        for neighbour in self.apart.pop(label, ()):
            row = self.apart[neighbour]
            row.pop(label)
            if not row:
                del self.apart[neighbour]

    def rename(self, removed: int, kept: int) -> None:
        """Move the counts of label `removed` to `kept`."""
        for pair in sorted(self._pairs.pop(removed, ())):
            partner = pair[0] if pair[1] == removed else pair[1]
            self._pairs[partner].discard(pair)
            self._open.discard(pair)
            count = self.together.pop(pair)
            if partner != kept:
                self._increase((min(partner, kept), max(partner, kept)), count)
        moved = self.apart.pop(removed, NONE)
        kept_row = self.apart.setdefault(kept, Counter())
        for partner, count in moved.items():
            row = self.apart[partner]
            row.pop(removed)
            if partner != kept:
                row[kept] = row.get(kept, 0) + count
                kept_row[partner] = kept_row.get(partner, 0) + count
        if not kept_row:
            del self.apart[kept]

    def _is_due(self, pair: Pair, minimum_frames: int, contested: bool) -> bool:
        count = self.together.get(pair, 0)
        if count < minimum_frames:
            return False
        return not contested or self.apart.get(pair[0], NONE).get(pair[1], 0) < count

    def _increase(self, pair: Pair, amount: int) -> None:
        self.together[pair] = self.together.get(pair, 0) + amount
        for label in pair:
            self._pairs.setdefault(label, set()).add(pair)
        self._open.add(pair)

    def _decrease(self, first: int, second: int) -> None:
        row = self.apart[first]
        row[second] -= 1
        if not row[second]:
            row.pop(second)


def pairs_of_one_class(labels: Iterable[int], class_id: int, counts: TripleCounts) -> list[Pair]:
    """Return the pairs of global labels whose merging a frame segment of class `class_id` (0: background) speaks for,
    if it knows what it sees.

    Ours: a label that was predicted before takes part only if its class is the frame segment's. A geometric segment
    that runs from a cupboard onto the floor then joins nothing, however often it is seen.
    """
    best = {label: counts.best(label) for label in labels}
    if class_id == 0:
        taking_part = [label for label, leading in best.items() if leading is None]
    else:
        taking_part = [label for label, leading in best.items() if leading is None or leading[0] in (0, class_id)]
    return list(combinations(sorted(taking_part), 2))


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
    rows = [counts.by_segment[s] for s in counts.segments(class_id, first) & counts.segments(class_id, second)]
    common = sum(row[class_id, first] + row[class_id, second] for row in rows)
    return common, counts.total(class_id, first) + counts.total(class_id, second)


def merge_instances(
    counts: TripleCounts, things: frozenset[int], *, threshold: float, minimum_count: int
) -> list[tuple[int, int]]:
    """Merge instance labels of one class (eq. 2.5) until none is due; return the (removed, kept) pairs in order.

    Things merge when the count on common segment labels is at least `threshold` of the count of both, and above
    `minimum_count` (the floor of the published code); other classes merge on any common label. The newer label (the
    larger number) goes into the older.
    """
    done = []
    rule = ("eq. 2.5", things, threshold, minimum_count)
    # What two labels have in common grows only on segments where something was counted since the last call.
    changed = counts.take_changed(rule)
    while (pair := _due_pair(counts, changed, things, threshold, minimum_count)) is not None:
        kept, removed = pair
        counts.merge_instances(removed, kept)
        done.append((removed, kept))
        changed |= counts.take_changed(rule)
    return done


def merge_stuff(counts: TripleCounts, things: frozenset[int]) -> list[tuple[int, int]]:
    """Merge all instance labels of every class that is not countable; return the (removed, kept) pairs.

    Ours: within a frame a stuff class has one instance only (section 2.3.1), so the map has one too, although pieces of
    floor on both sides of a table never share a segment label.
    """
    done = []
    for class_id in sorted(counts.instances_of().keys() - things):
        kept, *others = sorted(counts.instances_of()[class_id])
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
    counts: TripleCounts, changed: set[int], things: frozenset[int], threshold: float, minimum_count: int
) -> tuple[int, int] | None:
    """Return the first pair that is due among those that share one of the `changed` segment labels, or None."""
    candidates: set[tuple[int, int, int]] = set()
    for segment in changed:
        by_class: dict[int, list[int]] = {}
        for class_id, instance in counts.by_segment.get(segment, ()):
            by_class.setdefault(class_id, []).append(instance)
        for class_id, instances in by_class.items():
            candidates.update((class_id, *pair) for pair in combinations(sorted(instances), 2))
    for class_id, first, second in sorted(candidates):
        common, total = shared_share(counts, class_id, first, second)
        if class_id not in things or (common >= threshold * total and common > minimum_count):
            return first, second
    return None
