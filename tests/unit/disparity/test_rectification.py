"""Rows of both eyes: the turn that explains them, and undoing it."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scenewright.stages.disparity.rectification import (
    check_rows,
    fitted_turn,
    matched_features,
    row_shift,
    straightened,
)
from scenewright.stages.kit.geometry.cameras import intrinsic_matrix

from tests.unit.disparity.pairs import CAMERA, pair

PITCH, ROLL = 0.012, -0.02


def turned(picture: np.ndarray, pitch: float, roll: float) -> np.ndarray:
    """Return what an eye sees that is turned by these angles: the homography of the rotation, exactly."""
    rotation = cv2.Rodrigues(np.array([pitch, 0.0, 0.0]))[0] @ cv2.Rodrigues(np.array([0.0, 0.0, -roll]))[0]
    matrix = intrinsic_matrix(CAMERA)
    homography = matrix @ rotation.T @ np.linalg.inv(matrix)
    return cv2.warpPerspective(picture, homography, (CAMERA.width, CAMERA.height), borderMode=cv2.BORDER_REFLECT)


def test_the_turn_is_found_although_some_matches_are_wrong() -> None:
    random = np.random.default_rng(0)
    points = random.uniform([0, 0], [CAMERA.width, CAMERA.height], (300, 2))
    rows = row_shift(points, PITCH, ROLL, CAMERA) + random.normal(0, 0.2, 300)
    rows[:60] = random.uniform(-8, 8, 60)
    assert fitted_turn(points, rows, CAMERA) == pytest.approx((PITCH, ROLL), abs=6e-4)


def test_a_rectified_pair_is_called_so() -> None:
    left, right, _, _ = pair()
    found = check_rows([matched_features(left[..., 0], right[..., 0])], CAMERA)
    assert found.checked and found.matches > 100
    assert found.error < 0.3 and found.negative_share < 0.05 and 8 < found.median_disparity < 25


def test_swapped_eyes_have_negative_disparities() -> None:
    left, right, _, _ = pair()
    assert check_rows([matched_features(right[..., 0], left[..., 0])], CAMERA).negative_share > 0.9


def test_a_turned_eye_is_measured_and_turned_back() -> None:
    left, right, _, _ = pair(noise=0.0)
    bad = turned(right, PITCH, ROLL)
    found = check_rows([matched_features(left[..., 0], bad[..., 0])], CAMERA)
    assert found.error > 1.5 and found.corrected_error < 0.35
    back = straightened(bad, found.pitch, found.roll, CAMERA)
    again = check_rows([matched_features(left[..., 0], back[..., 0])], CAMERA)
    assert again.error < 0.35
    inner = (slice(20, -20), slice(20, -20))
    assert np.abs(back.astype(float) - right)[inner].mean() < 0.25 * np.abs(bad.astype(float) - right)[inner].mean()


def test_too_few_features_give_no_verdict() -> None:
    blank = np.full((60, 80), 100, np.uint8)
    found = check_rows([matched_features(blank, blank)], CAMERA)
    assert not found.checked and found.matches == 0
    assert not check_rows([], CAMERA).checked
