"""Semi-global matching, what goes before it and what comes after, on pairs whose disparities are known."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.disparity.consistency import confidence_of, left_right_difference, same_surface
from scenewright.stages.disparity.search_range import search_range, usual_range
from scenewright.stages.disparity.semi_global import Effort, SemiGlobalSettings, match
from scenewright.stages.disparity.subpixel import UNLOCKED, smoothed, unlocked
from scenewright.stages.kit.stereo.disparity_map import depth_of

from tests.unit.disparity.pairs import BASELINE, BOX_DISPARITY, CAMERA, pair

LEFT, RIGHT, TRUTH, SEEN = pair()


@pytest.mark.parametrize("effort", ["low", "medium", "high"])
def test_a_box_before_a_wall_is_found_to_a_fraction_of_a_pixel(effort: Effort) -> None:
    found = match(LEFT, RIGHT, SemiGlobalSettings(effort=effort))
    both = found.known & SEEN
    error = np.abs(found.disparity - TRUTH)
    assert both.sum() > 0.85 * SEEN.sum()
    assert np.median(error[both]) < 0.15 and (error[both] > 2).mean() < 0.02


def test_hidden_places_get_no_disparity_or_little_confidence() -> None:
    found = match(LEFT, RIGHT)
    inside = ~SEEN & (np.arange(CAMERA.width) > 30)
    assert found.confidence[inside].mean() < 0.25 < 0.6 < found.confidence[SEEN].mean()
    assert (found.confidence[~found.known] == 0).all() and (found.confidence <= 1).all()


def test_refining_brings_it_nearer_to_the_truth() -> None:
    both = [match(LEFT, RIGHT, SemiGlobalSettings(refine=refine)) for refine in (False, True)]
    errors = [np.median(np.abs(one.disparity - TRUTH)[one.known & SEEN]) for one in both]
    assert errors[1] < 0.9 * errors[0]


def test_confident_pixels_are_right_more_often() -> None:
    left, right, truth, _ = pair(noise=12.0, seed=5)
    found = match(left, right)
    wrong = np.abs(found.disparity - truth)[found.known] > 1
    sure = found.confidence[found.known]
    upper = sure >= np.median(sure)
    assert wrong[upper].mean() < 0.5 * wrong[~upper].mean()


def test_the_search_range_holds_every_disparity_and_not_much_more() -> None:
    low, levels = search_range(LEFT[..., 0], RIGHT[..., 0])
    assert low <= TRUTH.min() and BOX_DISPARITY < low + levels <= 64 and levels % 16 == 0


def test_the_usual_range_is_where_most_of_a_pair_lies() -> None:
    low, high = usual_range(LEFT[..., 0], RIGHT[..., 0])
    assert low == pytest.approx(TRUTH.min(), abs=1.5) and high == pytest.approx(BOX_DISPARITY, abs=1.5)
    assert usual_range(np.full((80, 120), 90, np.uint8), np.full((80, 120), 90, np.uint8)) == (0.0, 0.0)


def test_a_pair_without_a_match_is_searched_wholly_and_gives_nothing() -> None:
    blank = np.full((80, 120, 3), 90, np.uint8)
    assert search_range(blank[..., 0], blank[..., 0]) == (0, 64)
    random = np.random.default_rng(3)
    noise = [random.integers(0, 256, (80, 120, 3), np.uint8) for _ in range(2)]
    assert match(noise[0], noise[1]).known.mean() < 0.1


def test_eyes_of_different_sizes_are_refused() -> None:
    with pytest.raises(ValueError, match="different sizes"):
        match(LEFT, RIGHT[:-1])


def test_left_right_difference_is_the_closed_form() -> None:
    left, right = np.full((1, 8), np.nan, np.float32), np.full((1, 8), np.nan, np.float32)
    left[0, 5], right[0, 3] = 2.25, 2.0  # agrees to a quarter
    left[0, 7] = 3.0  # points to column 4, where the right eye has nothing
    left[0, 1] = 2.0  # points outside
    difference = left_right_difference(left, right)
    assert difference[0, 5] == pytest.approx(0.25)
    assert np.isinf(np.delete(difference[0], 5)).all()


def test_confidence_falls_with_disagreement_blankness_and_steps() -> None:
    flat = np.full((40, 40), 10.0, np.float32)
    textured = np.random.default_rng(0).integers(0, 255, (40, 40), np.uint8)
    agree, apart = np.zeros((40, 40), np.float32), np.ones((40, 40), np.float32)
    assert confidence_of(agree, flat, textured).min() > 0.9
    assert confidence_of(apart, flat, textured).max() < 0.5
    assert confidence_of(agree, flat, np.full((40, 40), 7, np.uint8)).max() == 0
    step = flat.copy()
    step[:, 20:] = 20.0
    share = same_surface(step)
    assert share[20, 19] == pytest.approx(10 / 16) and share[20, 5] == 1


def test_the_pull_to_whole_pixels_is_undone_symmetrically() -> None:
    sixteenths = np.arange(160, dtype=np.float32) / 16
    moved = unlocked(sixteenths[None])[0]
    assert (np.diff(moved) >= 0).all() and moved[::16] == pytest.approx(np.arange(10))
    assert moved[3] == pytest.approx(UNLOCKED[3]) and moved[13] == pytest.approx(1 - UNLOCKED[3])
    assert np.isnan(unlocked(np.array([[np.nan]], np.float32))).all()


def test_smoothing_keeps_steps_and_holes() -> None:
    random = np.random.default_rng(1)
    truth = np.where(np.arange(60) < 30, 10.0, 20.0) * np.ones((40, 1))
    noisy = (truth + random.normal(0, 0.2, truth.shape)).astype(np.float32)
    noisy[10:14, 10:14] = np.nan
    smooth = smoothed(noisy)
    assert np.isnan(smooth[10:14, 10:14]).all() and np.isfinite(smooth).sum() == np.isfinite(noisy).sum()
    assert np.nanstd(smooth - truth) < 0.6 * np.nanstd(noisy - truth) and np.nanmax(np.abs(smooth - truth)) < 1
    assert np.isnan(smoothed(np.full((4, 4), np.nan, np.float32))).all()


def test_depth_is_the_closed_form() -> None:
    depth = depth_of(np.array([[11.0, np.nan, 0.0, -3.0]], np.float32), CAMERA, BASELINE)
    np.testing.assert_allclose(depth, [[CAMERA.fx * BASELINE / 11.0, 0, 0, 0]], rtol=1e-6)
