"""Needle poses in seeded views without pictures: masks with the errors of a learned mask, noisy disparity."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.suture.evaluation.judgement import judged
from scenewright.stages.suture.masks import spoiled_masks
from scenewright.stages.suture.needle.estimate import estimate
from scenewright.stages.suture.world.corruption import noisy_disparity
from scenewright.stages.suture.world.sampling import seen_scene

from tests.quality.limits import misses

pytestmark = pytest.mark.slow

VIEWS = 24
FIRST_SEED = 7000
DISPARITY_NOISE = 1.0  # px
CALIBRATION_ERROR = 0.15  # px

AT_LEAST = {"answered": 19, "right": 18}
AT_MOST = {"swapped": 0, "median_centre_error_mm": 0.242, "median_normal_error_deg": 0.32}


def figures() -> dict[str, float]:
    """Return how many needles were answered for, how many of these were right, and how far off."""
    answers = []
    for seed in range(FIRST_SEED, FIRST_SEED + VIEWS):
        _, view = seen_scene(seed, calibration_error=CALIBRATION_ERROR)
        masks, random = spoiled_masks(view.left, view.right, seed)
        observation = masks.observation(view.rig, noisy_disparity(view, DISPARITY_NOISE, random))
        answers.append(judged("ours", "guard", seed, view, estimate(observation), 0.0))
    given = [answer for answer in answers if answer.answered]
    return {
        "answered": len(given),
        "right": sum(answer.right for answer in given),
        "swapped": sum(answer.swapped for answer in given),
        "median_centre_error_mm": float(np.median([answer.centre_error_mm for answer in given])),
        "median_normal_error_deg": float(np.median([answer.normal_error_deg for answer in given])),
    }


def test_needles_are_found() -> None:
    assert not misses(figures(), AT_LEAST, AT_MOST)
