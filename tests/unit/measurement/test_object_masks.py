"""Overlap and boundary measures of object masks against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.kit.measurement.object_masks import boundary_of, disk_kernel, score_object_masks

SHAPE = (120, 160)
"""Diagonal 200: boundaries are dilated by one pixel."""


def rectangles(*boxes: tuple[int, int, int, int]) -> np.ndarray:
    """Labels 1.. of (top, left, bottom, right)."""
    labels = np.zeros(SHAPE, dtype=np.int32)
    for k, (top, left, bottom, right) in enumerate(boxes, start=1):
        labels[top:bottom, left:right] = k
    return labels


def test_the_truth_scores_one_whatever_its_numbers_are() -> None:
    truth = rectangles((10, 10, 40, 50), (60, 20, 90, 90))
    score = score_object_masks(truth, np.where(truth == 1, 7, np.where(truth == 2, 3, 0)))
    assert (score.overlap.f, score.boundary.f, score.right_count, score.recalled_share) == (1.0, 1.0, True, 1.0)


def test_overlap_of_a_shifted_rectangle() -> None:
    truth, found = rectangles((10, 10, 50, 50)), rectangles((10, 20, 50, 60))
    score = score_object_masks(truth, found)
    assert score.overlap.precision == pytest.approx(0.75)
    assert score.overlap.recall == pytest.approx(0.75)
    assert score.overlap.f == pytest.approx(0.75)
    assert score.recalled_share == 0.0  # not over 0.75


def test_a_split_object_keeps_its_larger_part_alone() -> None:
    truth, found = rectangles((10, 10, 50, 50)), rectangles((10, 10, 50, 40), (10, 40, 50, 50))
    score = score_object_masks(truth, found)
    assert score.overlap.precision == pytest.approx(0.75)  # the smaller part has no partner and counts below
    assert score.overlap.recall == pytest.approx(0.75)
    assert (score.found_count, score.true_count, score.right_count) == (2, 1, False)


def test_the_matching_is_the_best_of_all_not_greedy() -> None:
    truth = np.zeros(SHAPE, dtype=np.int32)
    truth[0, :60], truth[0, 60:100] = 1, 2
    found = np.zeros(SHAPE, dtype=np.int32)
    found[0, 5:100], found[0, :5] = 1, 2
    # F of the pairs: 110/155, 80/135 for the large one, 10/65 and 0 for the small one. Greedily 0.710 + 0, at best
    # 0.593 + 0.154, which shares 40 + 5 pixels.
    score = score_object_masks(truth, found)
    assert score.overlap.recall == pytest.approx(0.45)
    assert score.overlap.precision == pytest.approx(0.45)


def test_boundary_of_a_rectangle_is_as_long_as_stated() -> None:
    edge = boundary_of(rectangles((10, 20, 30, 50)) == 1)
    # Rows 9..29 of columns 19..49 with the inside taken out: the pixels of which a lower or right neighbour differs.
    assert edge.sum() == 21 * 31 - 19 * 29
    assert not edge[:9].any() and not edge[30:].any()


def test_boundary_forgives_the_dilation_and_no_more() -> None:
    truth = rectangles((30, 30, 90, 110))
    assert score_object_masks(truth, rectangles((31, 30, 91, 110))).boundary.f == 1.0
    shifted = score_object_masks(truth, rectangles((33, 30, 93, 110))).boundary
    # The two sides fit, the two others (80 of 280 pixels each) but for their ends do not.
    assert shifted.f == pytest.approx(1 - 160 / 280, abs=0.04)


def test_missed_and_invented_objects_count() -> None:
    truth = rectangles((10, 10, 30, 30))
    nothing = np.zeros(SHAPE, dtype=np.int32)
    assert score_object_masks(truth, nothing).overlap.f == 0.0
    assert score_object_masks(nothing, truth).overlap.f == 0.0
    assert score_object_masks(nothing, nothing).boundary.f == 1.0
    assert score_object_masks(nothing, nothing).right_count


def test_the_disk_is_round() -> None:
    assert disk_kernel(1).sum() == 5
    assert disk_kernel(3).sum() == 29


def test_shapes_must_agree() -> None:
    with pytest.raises(ValueError, match="one shape"):
        score_object_masks(np.zeros((4, 4), int), np.zeros((4, 5), int))
