"""Average precision against hand-computed examples and a naive second implementation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.stages.kit.measurement.average_precision import (
    Candidates,
    PrecisionRecall,
    average_precision,
    average_precision_eleven_point,
    average_precision_thesis_code,
    class_precision,
    match_greedily,
    mean_precision,
    pool,
    precision_recall,
)


def candidates_of(hits: list[bool], true_count: int) -> Candidates:
    """Predictions of which the k-th right one hits the k-th truth, and the others nothing."""
    iou = np.zeros((len(hits), true_count))
    column = 0
    for row, hit in enumerate(hits):
        if hit:
            iou[row, column] = 0.9
            column += 1
    return Candidates(iou, -np.arange(len(hits), dtype=float))


def curve_of(hits: list[bool], true_count: int) -> PrecisionRecall:
    candidates = candidates_of(hits, true_count)
    return precision_recall(candidates.iou, candidates.confidence, true_count)


def test_one_correct_among_ten_shows_the_inflation():
    curve = curve_of([True], 10)
    assert average_precision(curve) == pytest.approx(0.1)
    assert average_precision_eleven_point(curve) == pytest.approx(2 / 11)
    assert average_precision_thesis_code(curve) == pytest.approx(1.0)


def test_hand_computed_curve():
    # hits: T F T F, three truths: precision 1, 1/2, 2/3, 1/2; recall 1/3, 1/3, 2/3, 2/3.
    curve = curve_of([True, False, True, False], 3)
    assert curve.precision == pytest.approx([1, 1 / 2, 2 / 3, 1 / 2])
    assert average_precision(curve) == pytest.approx((1 + 2 / 3) / 3)
    assert average_precision_eleven_point(curve) == pytest.approx((4 * 1 + 3 * 2 / 3) / 11)
    assert average_precision_thesis_code(curve) == pytest.approx((4 * 1 + 3 * 2 / 3 + 4 * 1 / 2) / 11)


def test_perfect_empty_and_undefined():
    perfect = class_precision(candidates_of([True] * 4, 4))
    assert (perfect.all_point, perfect.eleven_point, perfect.thesis_code) == (1.0, 1.0, 1.0)
    empty = class_precision(candidates_of([], 4))
    assert (empty.all_point, empty.eleven_point, empty.thesis_code) == (0.0, 0.0, 0.0)
    undefined = class_precision(Candidates(np.zeros((2, 0)), np.array([1.0, 2.0])))
    assert (undefined.all_point, undefined.eleven_point, undefined.thesis_code) == (None, None, None)
    assert mean_precision([1.0, None, 0.0]) == 0.5
    assert mean_precision([None]) is None


def test_pooled_scenes_share_the_ranking_but_not_the_truth():
    # The sure miss of the second scene stands before the hit of the first one: precision 0, 1/2.
    first = Candidates(np.array([[0.9]]), np.array([5.0]))
    second = Candidates(np.array([[0.1, 0.2]]), np.array([9.0]))
    pooled = pool([first, second])
    assert pooled.iou.tolist() == [[0.9, 0.0, 0.0], [0.0, 0.1, 0.2]] and pooled.confidence.tolist() == [5.0, 9.0]
    found = class_precision(pooled)
    assert (found.true_count, found.found) == (3, 1) and found.all_point == pytest.approx(1 / 3 * 1 / 2)
    assert pool([]).iou.shape == (0, 0) and class_precision(pool([])).all_point is None


def test_each_truth_is_found_once_and_the_confident_come_first():
    iou = np.array([[0.6, 0.0], [0.9, 0.7]])
    assert match_greedily(iou, np.array([2.0, 1.0])) == [(0, 0), (1, 1)]
    assert match_greedily(np.array([[0.6], [0.9]]), np.array([2.0, 1.0])) == [(0, 0), (1, None)]
    assert match_greedily(np.array([[0.5]]), np.array([1.0])) == [(0, None)]


def naive(hits: list[bool], true_count: int) -> float:
    """Area under the interpolated curve as a Riemann sum over the possible recall levels."""
    area = 0.0
    for level in range(1, true_count + 1):
        best = 0.0
        for end in range(1, len(hits) + 1):
            found = sum(hits[:end])
            if found >= level:
                best = max(best, found / end)
        area += best / true_count
    return area


@settings(max_examples=150, deadline=None)
@given(st.lists(st.booleans(), max_size=14), st.integers(0, 6))
def test_agrees_with_the_naive_form(hits, missed):
    true_count = sum(hits) + missed
    if true_count == 0:
        return
    curve = curve_of(hits, true_count)
    assert average_precision(curve) == pytest.approx(naive(hits, true_count))
    assert average_precision_thesis_code(curve) >= average_precision_eleven_point(curve) - 1e-12
