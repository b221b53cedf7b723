"""Panoptic quality against hand-computed examples and a naive second implementation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.stages.kit.measurement.panoptic_quality import (
    ClassQuality,
    average_quality,
    average_quality_thesis_code,
    drop_small,
    panoptic_quality,
)

STUFF = frozenset({"floor"})


def naive(true, predicted, true_classes, predicted_classes, match_iou=0.5):
    """Equation 2.15 by sets of points, without stuff merging."""
    t_sets = {t: {k for k, v in enumerate(true) if v == t} for t in set(true) - {0}}
    void = {k for k, v in enumerate(true) if v == 0}
    p_sets = {p: {k for k, v in enumerate(predicted) if v == p} for p in set(predicted) - {0} if p in predicted_classes}
    sums = {}
    matched_p = set()
    for t, ts in t_sets.items():
        hit = None
        for p, ps in p_sets.items():
            iou = len(ts & ps) / len(ts | (ps - void))
            if iou > match_iou and true_classes[t] == predicted_classes[p]:
                hit = (p, iou)
        entry = sums.setdefault(true_classes[t], [0, 0, 0, 0.0])
        if hit:
            matched_p.add(hit[0])
            entry[0] += 1
            entry[3] += hit[1]
        else:
            entry[2] += 1
    for p, ps in p_sets.items():
        if p not in matched_p and len(ps & void) * 2 <= len(ps):
            sums.setdefault(predicted_classes[p], [0, 0, 0, 0.0])[1] += 1
    return sums


def test_hand_computed_example():
    # chair 1: points 0-9, predicted 0-7 and 2 points of the table -> IoU 8/12; table 2: points 10-19.
    true = np.array([1] * 10 + [2] * 10 + [3] * 4)
    predicted = np.array([5] * 8 + [0] * 2 + [5] * 2 + [6] * 3 + [7] * 5 + [0] * 4)
    quality = panoptic_quality(
        true, predicted, {1: "chair", 2: "table", 3: "cup"}, {5: "chair", 6: "table", 7: "sofa"}, STUFF
    )
    assert quality["chair"] == ClassQuality(1, 0, 0, 8 / 12)
    assert quality["chair"].pq == pytest.approx(2 / 3)
    assert quality["table"] == ClassQuality(0, 1, 1, 0.0)
    assert quality["sofa"] == ClassQuality(0, 1, 0, 0.0)
    assert quality["cup"] == ClassQuality(0, 0, 1, 0.0)
    # The standard average counts the missed cup, the thesis's code does not.
    assert average_quality(quality.values()).pq == pytest.approx((2 / 3) / 4)
    assert average_quality_thesis_code(quality.values()).pq == pytest.approx((2 / 3) / 3)


def test_pq_is_sq_times_rq_of_the_sums():
    quality = ClassQuality(3, 1, 2, 2.4) + ClassQuality(1, 0, 0, 0.9)
    assert quality.sq == pytest.approx(3.3 / 4)
    assert quality.rq == pytest.approx(4 / (4 + 0.5 + 1.0))
    assert quality.pq == pytest.approx(quality.sq * quality.rq)


def test_perfect_is_one_and_empty_is_zero():
    labels = np.array([1, 1, 2, 2, 3])
    classes = {1: "chair", 2: "chair", 3: "floor"}
    perfect = average_quality(panoptic_quality(labels, labels, classes, classes, STUFF).values())
    assert (perfect.pq, perfect.sq, perfect.rq) == (1.0, 1.0, 1.0)
    empty = average_quality(panoptic_quality(labels, np.zeros(5, int), classes, {}, STUFF).values())
    assert (empty.pq, empty.sq, empty.rq, empty.classes) == (0.0, 0.0, 0.0, 2)
    nothing = average_quality(panoptic_quality(np.zeros(0, int), np.zeros(0, int), {}, {}, STUFF).values())
    assert nothing.pq is None


def test_instances_of_stuff_are_one_segment():
    true = np.array([1] * 6 + [2] * 6)
    predicted = np.full(12, 9)
    quality = panoptic_quality(true, predicted, {1: "floor", 2: "floor"}, {9: "floor"}, STUFF)
    assert quality["floor"] == ClassQuality(1, 0, 0, 1.0)
    as_things = panoptic_quality(true, predicted, {1: "cup", 2: "cup"}, {9: "cup"}, STUFF)
    assert as_things["cup"] == ClassQuality(0, 1, 2, 0.0)


def test_prediction_on_void_is_no_false_positive():
    true = np.array([0] * 8 + [1] * 4)
    predicted = np.array([7] * 8 + [8] * 4)
    quality = panoptic_quality(true, predicted, {1: "cup"}, {7: "chair", 8: "cup"}, STUFF)
    assert quality == {"cup": ClassQuality(1, 0, 0, 1.0)}


def test_unique_matching_is_required():
    with pytest.raises(ValueError, match="unique"):
        panoptic_quality(np.ones(1, int), np.ones(1, int), {1: "cup"}, {1: "cup"}, STUFF, match_iou=0.3)


@settings(max_examples=150, deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 4), st.integers(0, 4)), min_size=0, max_size=40),
    st.lists(st.sampled_from(["chair", "table"]), min_size=8, max_size=8),
)
def test_agrees_with_the_naive_form(points, names):
    true = np.array([t for t, _ in points], dtype=int)
    predicted = np.array([p for _, p in points], dtype=int)
    true_classes = dict(zip(range(1, 5), names[:4], strict=True))
    predicted_classes = dict(zip(range(1, 5), names[4:], strict=True))
    got = panoptic_quality(true, predicted, true_classes, predicted_classes, STUFF)
    expected = naive(true.tolist(), predicted.tolist(), true_classes, predicted_classes)
    assert set(got) == set(expected)
    for name, (tp, fp, fn, iou) in expected.items():
        assert (got[name].true_positives, got[name].false_positives, got[name].false_negatives) == (tp, fp, fn)
        assert got[name].iou_sum == pytest.approx(iou)


def test_drop_small():
    labels = np.array([1, 1, 1, 2, 3, 3])
    assert drop_small(labels, 2).tolist() == [1, 1, 1, 0, 3, 3]
    assert drop_small(np.zeros(0, int), 2).tolist() == []
