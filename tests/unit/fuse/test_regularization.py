"""The triple-wise count (2.4, 2.6) and both stages of regularisation (shared voxels, 2.5) in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.fuse.counts import TripleCounts
from scenewright.stages.fuse.merging import SharedSegment
from scenewright.stages.fuse.parameters import FuseParameters
from scenewright.stages.fuse.regularization import (
    MergedLabels,
    PairEvidence,
    merge_evident_instances,
    merge_instances,
    merge_segments,
    merge_stuff,
    pairs_of_one_class,
    shared_share,
)
from scenewright.stages.fuse.separate import Separate
from scenewright.stages.fuse.thesis import Thesis

from tests.unit.fuse.test_association import CHAIR, TABLE, counted

WALL = 2
THINGS = frozenset({CHAIR, TABLE})


def test_counts_add_up_and_sort() -> None:
    counts = TripleCounts()
    for triple in [(2, CHAIR, 1), (1, TABLE, 3), (2, CHAIR, 1)]:
        counts.add(*triple)
    arrays = counts.as_arrays()
    assert {name: values.tolist() for name, values in arrays.items()} == {
        "segment": [1, 2],
        "class_id": [TABLE, CHAIR],
        "instance": [3, 1],
        "count": [1, 2],
    }
    assert counts.instances(2, CHAIR) == {1: 2} and counts.instances(2, TABLE) == {}
    empty = TripleCounts().as_arrays()
    assert all(len(values) == 0 for values in empty.values())


def test_best_is_class_first_then_instance() -> None:
    # Instance 9 has the largest single count, but the class of the others has the larger sum.
    counts = counted((1, TABLE, 9, 5), (1, CHAIR, 1, 3), (1, CHAIR, 2, 4))
    assert counts.best(1) == (CHAIR, 2)
    assert counts.best(7) is None


def test_ties_go_to_the_smaller_number() -> None:
    assert counted((1, TABLE, 1, 3), (1, CHAIR, 8, 3)).best(1) == (CHAIR, 8)
    assert counted((1, CHAIR, 8, 3), (1, CHAIR, 2, 3)).best(1) == (CHAIR, 2)


def test_equation_2_5_in_closed_form() -> None:
    # Common: label 1 (6 + 5). All: label 1, label 2 (4 of p1), label 3 (7 of p2). 11 of 22.
    counts = counted((1, CHAIR, 1, 6), (1, CHAIR, 2, 5), (2, CHAIR, 1, 4), (3, CHAIR, 2, 7), (3, TABLE, 2, 90))
    assert shared_share(counts, CHAIR, 1, 2) == (11, 22)
    assert merge_instances(counts, THINGS, threshold=0.51, minimum_count=10) == []
    assert merge_instances(counts, THINGS, threshold=0.5, minimum_count=11) == [], "the floor is above, not at"
    assert merge_instances(counts, THINGS, threshold=0.5, minimum_count=10) == [(2, 1)]
    assert counts.by_segment[1] == {(CHAIR, 1): 11} and counts.by_segment[3] == {(CHAIR, 1): 7, (TABLE, 1): 90}


def test_only_the_same_class_merges() -> None:
    counts = counted((1, CHAIR, 1, 50), (1, TABLE, 2, 50))
    assert merge_instances(counts, THINGS, threshold=0.1, minimum_count=0) == []


def test_stuff_merges_on_any_common_label() -> None:
    counts = counted((1, WALL, 3, 1), (1, WALL, 7, 1), (2, WALL, 3, 99), (3, WALL, 8, 5))
    assert merge_instances(counts, THINGS, threshold=0.5, minimum_count=10) == [(7, 3)]
    assert merge_stuff(counts, THINGS) == [(8, 3)], "ours: one instance a stuff class"


def test_merges_go_on_until_none_is_due() -> None:
    counts = counted((1, CHAIR, 1, 20), (1, CHAIR, 2, 20), (2, CHAIR, 2, 20), (2, CHAIR, 3, 20))
    assert merge_instances(counts, THINGS, threshold=0.5, minimum_count=10) == [(2, 1), (3, 1)]
    assert counts.by_segment == {1: {(CHAIR, 1): 40}, 2: {(CHAIR, 1): 40}}


def test_merged_labels_keep_the_older() -> None:
    labels = MergedLabels()
    assert [labels.new() for _ in range(4)] == [1, 2, 3, 4]
    assert labels.merge(4, 2) == (4, 2) and labels.merge(4, 1) == (2, 1) and labels.merge(2, 4) is None
    assert labels.table().tolist() == [0, 1, 1, 3, 1]
    assert labels.table().dtype == np.int32


def test_segments_merge_after_enough_frames() -> None:
    labels, shared = MergedLabels(), PairEvidence()
    for _ in range(3):
        labels.new()
    counts = counted((1, CHAIR, 1, 2), (3, CHAIR, 1, 5))
    for frame in range(3):
        assert merge_segments(shared, labels, counts, minimum_frames=3, contested=False) == [], f"before frame {frame}"
        shared.observe([[(1, 3)], [(2, 3)]] if frame == 0 else [[(1, 3)]], [])
    assert merge_segments(shared, labels, counts, minimum_frames=3, contested=False) == [(3, 1)]
    assert counts.by_segment == {1: {(CHAIR, 1): 7}}
    assert shared.together == {(1, 2): 1}, "what 3 shared with 2 is now 1's"


def test_contested_pairs_need_a_majority() -> None:
    shared = PairEvidence()
    for _ in range(3):
        shared.observe([[(1, 2)]], [1, 2])
    for _ in range(3):
        shared.observe([], [2, 1])
    assert shared.due(3, contested=False) == [(1, 2)] and shared.due(3, contested=True) == []
    shared.observe([[(1, 2)]], [1, 2])
    assert shared.due(3, contested=True) == [(1, 2)]


@pytest.mark.parametrize(
    ("class_id", "expected"),
    [
        (CHAIR, [(1, 4)]),  # the chair and what was never predicted
        (TABLE, [(2, 4)]),
        (0, []),  # a background segment joins nothing that was predicted
    ],
)
def test_which_labels_a_frame_segment_speaks_for(class_id: int, expected: list[tuple[int, int]]) -> None:
    counts = counted((1, CHAIR, 1, 5), (2, TABLE, 2, 5))
    assert pairs_of_one_class([4, 1, 2], class_id, counts) == expected


def test_background_joins_what_was_never_predicted() -> None:
    assert pairs_of_one_class([3, 4], 0, TripleCounts()) == [(3, 4)]


@pytest.mark.parametrize("rule", [Thesis, Separate])
def test_the_baselines_join_all_that_lies_in_one_segment(rule: type[Thesis] | type[Separate]) -> None:
    merging = rule(FuseParameters(), frozenset({CHAIR, TABLE}))
    merging.counts.add(1, CHAIR, 1, 5)
    merging.counts.add(2, TABLE, 2, 5)
    merging.observe_segments([SharedSegment(0, [4, 1, 2])], [1, 2, 4])
    assert set(merging.shared.together) == {(1, 2), (1, 4), (2, 4)} and not merging.shared.apart


def test_instances_that_frames_saw_as_one() -> None:
    counts = counted((1, CHAIR, 1, 50), (2, CHAIR, 2, 50), (3, CHAIR, 3, 50))
    evidence = PairEvidence()
    evidence.observe([[(1, 2)]], [1, 2, 3])
    evidence.observe([[(1, 2)], [(2, 3)]], [1, 2, 3])
    assert merge_instances(counts, THINGS, threshold=0.5, minimum_count=10) == [], "equation 2.5 cannot see it"
    assert merge_evident_instances(evidence, counts, minimum_frames=2) == [(2, 1)]
    assert counts.by_segment[2] == {(CHAIR, 1): 50} and counts.by_segment[3] == {(CHAIR, 3): 50}
