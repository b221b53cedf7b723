"""A needle's radius that nobody told."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scenewright.stages.suture.masks import spoiled_masks
from scenewright.stages.suture.needle.estimate import estimate
from scenewright.stages.suture.needle.radius import as_if_usual, in_metres
from scenewright.stages.suture.needle.radius_fit import Radius, estimate_without_radius, fitted_radius, together
from scenewright.stages.suture.rig import NEEDLE_RADIUS, TWO_CAMERAS
from scenewright.stages.suture.world.sampling import seen_scene

from tests.unit.suture.needle_cases import observed, pose_at


@pytest.mark.parametrize("factor", [1.0, 0.7])
def test_a_radius_is_found_with_the_pose(factor: float) -> None:
    """The masks of the usual needle are those of a smaller one before eyes as much nearer to each other."""
    radius = factor * NEEDLE_RADIUS
    seen = replace(
        observed(pose_at()), disparity=None, rig=replace(TWO_CAMERAS, baseline=factor * TWO_CAMERAS.baseline)
    )
    answer, found = estimate_without_radius(seen)
    assert found is not None and answer.pose is not None and not answer.abstained
    assert found.metres == pytest.approx(radius, rel=0.02)
    assert abs(found.metres - radius) < 4 * found.deviation < 0.1 * radius
    assert answer.pose.centre == pytest.approx(factor * pose_at().centre, abs=0.02 * 0.4)
    rig = as_if_usual(seen.rig, radius)
    told = in_metres(estimate(replace(seen, rig=rig)), radius)
    spread, known = (np.trace(one.covariance[:3, :3]) for one in (answer, told))
    assert spread > known, "a radius that is not known makes the distance less sure"


@pytest.mark.parametrize("side", [-1, 1])
def test_masks_too_wide_or_too_thin_are_no_larger_or_smaller_needle(side: int) -> None:
    """A wire that is a quarter wider in the masks would be a needle a quarter larger, did the fit not ask for both."""
    seen = replace(observed(pose_at()), disparity=None)
    change, kernel = (cv2.dilate, cv2.erode)[side < 0], np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], np.uint8)
    left, right = (change(mask.astype(np.uint8), kernel) > 0 for mask in (seen.left_mask, seen.right_mask))
    found = fitted_radius(replace(seen, left_mask=left, right_mask=right))
    assert found is not None
    assert abs(found.metres - NEEDLE_RADIUS) < min(0.01 * NEEDLE_RADIUS, 2 * found.deviation)


@pytest.mark.parametrize("seed", [313, 327, 351])
@pytest.mark.slow
def test_the_deviation_holds_the_error(seed: int) -> None:
    """Tuning views whose radius was off by three to four of its deviations before growth and rivals were in them."""
    _, view = seen_scene(seed, calibration_error=0.15)
    masks, _ = spoiled_masks(view.left, view.right, seed)
    found = fitted_radius(masks.observation(view.rig, None), seed)
    assert found is not None and abs(found.metres - NEEDLE_RADIUS) < 2 * found.deviation < 0.2 * NEEDLE_RADIUS


def test_nothing_is_fitted_to_nothing() -> None:
    seen = observed(pose_at())
    blank = replace(seen, left_mask=np.zeros_like(seen.left_mask))
    assert fitted_radius(blank) is None
    answer, found = estimate_without_radius(blank)
    assert found is None and answer.abstained


def test_frames_say_more_together_but_for_what_they_share() -> None:
    one, other = Radius(0.010, 0.0002), Radius(0.011, 0.0004)
    both = together([one, other])
    assert both.metres == pytest.approx((0.010 * 4 + 0.011) / 5)
    assert 0.5 * 0.0002 < both.deviation < 0.0003
    many = together([one] * 1000)
    assert many.deviation == pytest.approx(0.5 * one.deviation, rel=0.01)


def test_a_frame_that_shows_half_a_needle_is_left_out() -> None:
    seen, half = Radius(0.012, 0.0002), Radius(0.009, 0.0003)
    assert together([seen, half, seen, seen]) == together([seen] * 3)
    assert together([half]).metres == pytest.approx(half.metres)
