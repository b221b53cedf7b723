"""Which segments are one thing: what frames said of pairs, weighed together."""

from __future__ import annotations

from itertools import combinations

from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.stages.fuse.class_scores import ClassScores
from scenewright.stages.fuse.counts import TripleCounts
from scenewright.stages.fuse.partition import (
    APART_WEIGHT,
    LEAST_WEIGHT,
    NOTHING,
    attach_unseen_pairs,
    group_segments,
    group_things,
    leading_class,
    name_groups,
    pair_weights,
)
from scenewright.stages.fuse.regularization import PairEvidence

CABINET, BOX, WALL, OBJECT = 5, 9, 2, 40
THINGS = frozenset({CABINET, BOX})


def seen(*frames: list[list[int]]) -> PairEvidence:
    """Evidence of frames, each a list of instances, each a list of segment labels."""
    evidence = PairEvidence()
    for instances in frames:
        pairs = [list(combinations(sorted(labels), 2)) for labels in instances]
        evidence.observe(pairs, {label for labels in instances for label in labels})
    return evidence


def scored(counts: TripleCounts) -> dict[int, dict[int, float]]:
    """Scores of masks that are all sure of their class."""
    scores = ClassScores()
    for segment, row in counts.by_segment.items():
        for (class_id, _), count in row.items():
            scores.add(segment, class_id, float(count))
    return scores.by_segment


def counted(*triples: tuple[int, int, int, int]) -> TripleCounts:
    counts = TripleCounts()
    for segment, class_id, instance, amount in triples:
        counts.add(segment, class_id, instance, amount)
    return counts


def test_frames_that_saw_two_outweigh_a_mask_that_covered_both() -> None:
    two = seen(*[[[1], [2]]] * 5, *[[[1, 2]]] * 6)
    assert pair_weights([1, 2], two) == {1: {2: 6 - 5 * APART_WEIGHT}, 2: {1: 6 - 5 * APART_WEIGHT}}
    assert group_segments(pair_weights([1, 2], two), {}) == [[1], [2]]
    one = seen(*[[[1], [2]]] * 2, *[[[1, 2]]] * 6)
    assert group_segments(pair_weights([1, 2], one), {}) == [[1, 2]]
    single = seen([[1, 2]])
    assert group_segments(pair_weights([1, 2], single), {}) == [[1], [2]], "one frame decides nothing"


def test_sums_decide_between_groups_and_classes_forbid() -> None:
    # 2 and 3 are one in most frames by themselves, but not what 2 belongs to and 3.
    evidence = seen(*[[[1, 2], [3]]] * 8, *[[[2, 3]]] * 14)
    assert group_segments(pair_weights([2, 3], evidence), {}) == [[2, 3]]
    assert group_segments(pair_weights([1, 2, 3], evidence), {}) == [[1, 2], [3]]
    chain = seen(*[[[1, 2]]] * 5, *[[[2, 3]]] * 4)
    assert group_segments(pair_weights([1, 2, 3], chain), {1: CABINET, 2: 0, 3: BOX}) == [[1, 2], [3]]
    assert group_segments(pair_weights([1, 2, 3], chain), {1: CABINET, 2: 0, 3: 0}) == [[1, 2, 3]]


def test_segments_that_no_frame_showed_together_follow_their_instance_label() -> None:
    counts = counted((1, CABINET, 7, 9), (2, CABINET, 7, 3), (3, CABINET, 7, 2))
    evidence = seen([[1], [3]])
    assert attach_unseen_pairs([[1], [2], [3]], evidence, counts) == [[1, 2], [3]]


def test_two_cabinets_that_share_a_label_become_two() -> None:
    counts = counted((1, CABINET, 15, 26), (2, CABINET, 15, 17), (2, CABINET, 54, 13), (3, WALL, 4, 50), (2, BOX, 3, 1))
    evidence = seen(*[[[1], [2]]] * 13, *[[[1, 2]]] * 5)
    grouping = group_things(counts, evidence, THINGS, {15: 0b1110, 54: 0b0011, 4: 0b1, 3: 0b100}, scores=scored(counts))
    # The group with more predictions chooses first, and most of its own say 15; the other one gets a new label.
    assert grouping.best == {1: (CABINET, 55), 2: (CABINET, 15)}
    assert grouping.counts.by_segment[1] == {(CABINET, 55): 26}
    assert grouping.counts.by_segment[2] == {(CABINET, 15): 30, (BOX, 15): 1}
    assert grouping.counts.by_segment[3] == {(WALL, 4): 50}, "stuff keeps its label"


def test_stuff_that_hardly_anybody_predicted_is_nothing() -> None:
    counts = counted((1, WALL, 4, 2), (1, CABINET, 7, 1), (2, WALL, 4, 3), (3, CABINET, 7, 1))
    best = group_things(counts, PairEvidence(), THINGS, {}, minimum_votes=3, scores=scored(counts)).best
    assert best == {1: NOTHING, 3: (CABINET, 7)}, "segment 2 keeps what equation 2.6 says"


def test_a_group_takes_the_class_of_most_predictions_and_a_new_label_when_its_own_are_gone() -> None:
    counts = counted((1, CABINET, 7, 9), (2, BOX, 8, 2), (3, CABINET, 7, 4))
    grouping = name_groups([[1, 2], [3]], counts, THINGS, {7: 0b11, 8: 0b100}, scored(counts))
    assert grouping.best == {1: (CABINET, 7), 2: (CABINET, 7), 3: (CABINET, 9)}
    assert grouping.seen_in[9] == 0b11 and grouping.seen_in[7] == 0b11


def test_a_named_class_goes_before_object_unless_it_is_a_stray() -> None:
    assert leading_class({CABINET: 3.0, BOX: 2.0}, OBJECT) == CABINET
    assert leading_class({BOX: 2.0, CABINET: 2.0}, OBJECT) == CABINET, "ties go to the smaller number"
    assert leading_class({OBJECT: 8.0, BOX: 2.0}, OBJECT) == BOX
    assert leading_class({OBJECT: 8.1, BOX: 1.9}, OBJECT) == OBJECT
    assert leading_class({OBJECT: 1.0}, OBJECT) == OBJECT
    assert leading_class({}, OBJECT) == leading_class({}, None) == 0


def test_a_mask_that_is_hardly_sure_says_less() -> None:
    counts = counted((1, CABINET, 7, 6), (1, BOX, 8, 4))
    scores = {1: {CABINET: 6 * 0.3, BOX: 4 * 0.9}}
    assert group_things(counts, PairEvidence(), THINGS, {}, scores=scores).best == {1: (BOX, 8)}
    assert group_things(counts, PairEvidence(), THINGS, {}, scores=scored(counts)).best == {1: (CABINET, 7)}


def test_what_was_not_recognised_joins_what_was() -> None:
    """Class `object` is no class that could speak against merging."""
    counts = counted((1, CABINET, 7, 6), (2, OBJECT, 8, 6))
    grouping = group_things(counts, seen(*[[[1, 2]]] * 4), THINGS | {OBJECT}, {}, scores=scored(counts), unnamed=OBJECT)
    assert grouping.best == {1: (CABINET, 7), 2: (CABINET, 7)}
    boxes = counted((1, CABINET, 7, 6), (2, BOX, 8, 6))
    grouping = group_things(boxes, seen(*[[[1, 2]]] * 4), THINGS, {}, scores=scored(boxes), unnamed=OBJECT)
    assert grouping.best == {1: (CABINET, 7), 2: (BOX, 8)}


def test_scores_move_with_their_segment() -> None:
    scores = ClassScores()
    for segment, class_id, score in ((1, BOX, 0.5), (2, BOX, 0.25), (2, CABINET, 1.0)):
        scores.add(segment, class_id, score)
    scores.merge_segments(2, 1)
    scores.merge_segments(9, 1)
    assert scores.by_segment == {1: {BOX: 0.75, CABINET: 1.0}}


@settings(max_examples=60, deadline=None)
@given(st.lists(st.lists(st.lists(st.integers(1, 6), max_size=3), max_size=3), max_size=12))
def test_groups_cover_every_segment_once_and_the_order_of_frames_does_not_matter(frames: list[list[list[int]]]) -> None:
    disjoint = []
    for instances in frames:
        used: set[int] = set()
        kept = []
        for labels in instances:
            kept.append(sorted(set(labels) - used))
            used |= set(labels)
        disjoint.append(kept)
    forward = group_segments(pair_weights(range(1, 7), seen(*disjoint)), {})
    backward = group_segments(pair_weights(range(1, 7), seen(*reversed(disjoint))), {})
    assert forward == backward
    assert sorted(label for group in forward for label in group) == [1, 2, 3, 4, 5, 6]
    weights = pair_weights(range(1, 7), seen(*disjoint))
    for first, second in combinations(forward, 2):
        assert sum(weights[a].get(b, 0) for a in first for b in second) < LEAST_WEIGHT
