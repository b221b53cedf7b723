"""Regularisation that only looks at what changed, against one that looks at everything, over random frames."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.stages.fuse.counts import TripleCounts
from scenewright.stages.fuse.regularization import (
    MergedLabels,
    PairEvidence,
    merge_evident_instances,
    merge_instances,
    merge_segments,
    merge_stuff,
)

THINGS = frozenset({1, 2})
WALL = 3


def both_ways(counts: dict[tuple[int, int], int]) -> dict[int, dict[int, int]]:
    rows: dict[int, dict[int, int]] = {}
    for (first, second), count in counts.items():
        rows.setdefault(first, {})[second] = rows.setdefault(second, {})[first] = count
    return rows


class Plain:
    """The same rules over plain dictionaries: every pair and every segment is looked at each time."""

    def __init__(self) -> None:
        self.rows: dict[int, dict[tuple[int, int], int]] = {}
        self.parents: dict[int, int] = {}
        self.together: dict[tuple[int, int], int] = {}
        self.apart: dict[tuple[int, int], int] = {}

    def root(self, label: int) -> int:
        while self.parents.get(label, label) != label:
            label = self.parents[label]
        return label

    def add(self, segment: int, class_id: int, instance: int, amount: int) -> None:
        row = self.rows.setdefault(segment, {})
        row[class_id, instance] = row.get((class_id, instance), 0) + amount

    def observe(self, groups: list[list[tuple[int, int]]], matched: list[int]) -> None:
        seen = [pair for group in groups for pair in group]
        for pair in seen:
            self.together[pair] = self.together.get(pair, 0) + 1
        for pair in set(combinations(sorted(set(matched)), 2)) - set(seen):
            self.apart[pair] = self.apart.get(pair, 0) + 1

    def due(self, least: int, contested: bool) -> list[tuple[int, int]]:
        return sorted(
            p for p, n in self.together.items() if n >= least and not (contested and self.apart.get(p, 0) >= n)
        )

    def rename(self, removed: int, kept: int) -> None:
        for counts in (self.together, self.apart):
            for pair in [pair for pair in counts if removed in pair]:
                count = counts.pop(pair)
                other = pair[0] if pair[1] == removed else pair[1]
                if other != kept:
                    renamed = (min(other, kept), max(other, kept))
                    counts[renamed] = counts.get(renamed, 0) + count

    def merge_segments(self, least: int, contested: bool) -> list[tuple[int, int]]:
        merged = []
        for first, second in self.due(least, contested):
            kept, removed = sorted((self.root(first), self.root(second)))
            if kept != removed:
                self.parents[removed] = kept
                for (class_id, instance), count in self.rows.pop(removed, {}).items():
                    self.add(kept, class_id, instance, count)
                self.rename(removed, kept)
                merged.append((removed, kept))
        return merged

    def merge(self, removed: int, kept: int) -> None:
        for row in self.rows.values():
            for class_id, _ in [key for key in row if key[1] == removed]:
                row[class_id, kept] = row.get((class_id, kept), 0) + row.pop((class_id, removed))

    def merge_instances(self, threshold: float, least: int) -> list[tuple[int, int]]:
        done = []
        while (pair := self._first_due(threshold, least)) is not None:
            self.merge(pair[1], pair[0])
            done.append((pair[1], pair[0]))
        return done

    def _first_due(self, threshold: float, least: int) -> tuple[int, int] | None:
        keys = {key for row in self.rows.values() for key in row}
        for (one, first), (two, second) in combinations(sorted(keys), 2):
            if one != two:
                continue
            rows = [(row.get((one, first), 0), row.get((one, second), 0)) for row in self.rows.values()]
            common = sum(a + b for a, b in rows if a and b)
            total = sum(a + b for a, b in rows)
            if (common and one not in THINGS) or (common >= threshold * total and common > least):
                return first, second
        return None

    def merge_stuff(self) -> list[tuple[int, int]]:
        done = []
        for class_id in sorted({c for row in self.rows.values() for c, _ in row} - THINGS):
            kept, *others = sorted({p for row in self.rows.values() for c, p in row if c == class_id})
            for removed in others:
                self.merge(removed, kept)
                done.append((removed, kept))
        return done


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.booleans(), st.integers(1, 3), st.integers(0, 4))
def test_random_frames_give_what_looking_at_everything_gives(
    seed: int, ours: bool, least_frames: int, least_count: int
) -> None:
    random = np.random.default_rng(seed)
    plain, counts, labels, shared, evidence = Plain(), TripleCounts(), MergedLabels(), PairEvidence(), PairEvidence()
    evident = Plain()
    for _ in range(9):
        labels.new()
    for frame in range(30):
        visible = sorted({labels.root(int(label)) for label in random.integers(1, 10, 4)})
        pairs = list(combinations(visible, 2))
        groups = [[pair] for pair in pairs if random.random() < 0.25]
        shared.observe(groups, visible if ours else [])
        plain.observe(groups, visible if ours else [])
        for label in visible:
            class_id, instance = int(random.choice([1, 2, WALL])), int(random.integers(1, 8))
            counts.add(label, class_id, instance)
            plain.add(label, class_id, instance, 1)
        instances = sorted(set(random.integers(1, 8, 3).tolist()))
        seen_as_one = [[pair] for pair in combinations(instances, 2) if random.random() < 0.3]
        evidence.observe(seen_as_one, instances)
        evident.observe(seen_as_one, instances)
        assert merge_segments(
            shared, labels, counts, minimum_frames=least_frames, contested=ours
        ) == plain.merge_segments(least_frames, ours)
        if frame % 4 == 3:
            if ours:
                assert merge_stuff(counts, THINGS) == plain.merge_stuff()
                expected = []
                while due := evident.due(least_frames + 2, True):
                    plain.merge(due[0][1], due[0][0])
                    evident.rename(due[0][1], due[0][0])
                    expected.append((due[0][1], due[0][0]))
                assert merge_evident_instances(evidence, counts, minimum_frames=least_frames + 2) == expected
            # The rule changes once: then everything has to be looked at again.
            threshold = 0.9 if frame < 15 else 0.6
            found = merge_instances(counts, THINGS, threshold=threshold, minimum_count=least_count)
            assert found == plain.merge_instances(threshold, least_count)
        assert counts.by_segment == plain.rows
        assert shared.together == plain.together and shared.apart == both_ways(plain.apart)
        assert labels.table().tolist() == [plain.root(label) for label in range(10)]


def test_totals_follow_merges() -> None:
    counts = TripleCounts()
    for segment, class_id, instance, amount in [(1, 1, 4, 3), (2, 1, 4, 2), (2, 1, 5, 7), (3, 2, 5, 1)]:
        counts.add(segment, class_id, instance, amount)
    counts.merge_segments(2, 1)
    assert counts.total(1, 4) == 5 and counts.segments(1, 4) == {1} and counts.segments(1, 5) == {1}
    counts.merge_instances(5, 4)
    assert counts.total(1, 4) == 12 and counts.total(1, 5) == 0 and counts.total(2, 4) == 1
    assert counts.segments(2, 4) == {3} and counts.segments(1, 5) == set()
    assert counts.instances_of() == {1: {4}, 2: {4}}


def test_many_labels_have_roots() -> None:
    labels = MergedLabels()
    for _ in range(500):
        labels.new()
    for label in range(2, 501, 2):
        labels.merge(label, label - 1)
    assert labels.table().tolist() == [0, *(label - 1 + label % 2 for label in range(1, 501))]
