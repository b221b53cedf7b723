"""Do both eyes see a point in the same row? Measured with features that match, and put right where a small turn of one
eye explains it.

In a rectified pair a point is seen in one row. A turn of the right eye about its axes by small angles (pitch about x,
yaw about y, roll about z) moves the row of a pixel (x, y), counted from the principal point in focal lengths, by
fy * (pitch * (1 + y^2) - yaw * x * y - roll * x): pitch and roll are seen well, yaw hardly, and it changes the
disparity by far more than the row, so it is not estimated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scenewright.schemas.scene_parts import Camera

FEATURES = 1500
"""Most SIFT features of an image; by eye."""
MATCH_RATIO = 0.8
"""The best match must be this much nearer than the second (Lowe, IJCV 2004, section 7.1)."""
LARGEST_ROW_SHARE = 0.05
"""Matches further apart than this share of the height are mistakes, as long as fewer than half are."""
LEAST_MATCHES = 40
"""Fewer say nothing."""
INLIER_ROWS = 1.5
"""Rows [px] within which a match agrees with a fitted turn."""
ITERATIONS = 20
"""Steps of reweighted least squares; by eye."""


@dataclass(frozen=True)
class RowCheck:
    """What matched features of some pairs of one camera tell of their rows."""

    matches: int
    checked: bool
    """Whether there were enough matches for a verdict."""
    offset: float = 0.0
    """Median of right row minus left row [px]."""
    error: float = 0.0
    """Median of |right row - left row| [px]."""
    error_90: float = 0.0
    """90th percentile of it [px]."""
    pitch: float = 0.0
    roll: float = 0.0
    """Turn of the right eye that explains the rows best [rad]."""
    corrected_error: float = 0.0
    """Median distance of the rows when that turn is undone [px]."""
    negative_share: float = 0.0
    """Share of the matches, of those in one row, that lie further right in the right picture: near 1, the eyes are
    swapped."""
    median_disparity: float = 0.0
    """Of the same matches [px]."""


def matched_features(left: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return positions (N, 2) and (N, 2) [px] of features of two pictures (H, W) uint8 that are each other's best
    match, in whatever rows."""
    detector = cv2.SIFT.create(nfeatures=FEATURES)
    points, descriptors = [], []
    for picture in (left, right):
        features, described = detector.detectAndCompute(picture, None)
        if described is None or len(features) < 2:
            return np.zeros((0, 2)), np.zeros((0, 2))
        points.append(np.array([point.pt for point in features]))
        descriptors.append(described)
    matcher = cv2.BFMatcher(cv2.NORM_L2)
    back = {pair.queryIdx: pair.trainIdx for pair in matcher.match(descriptors[1], descriptors[0])}
    pairs = [
        (best.queryIdx, best.trainIdx)
        for best, second in matcher.knnMatch(descriptors[0], descriptors[1], k=2)
        if best.distance < MATCH_RATIO * second.distance and back.get(best.trainIdx) == best.queryIdx
    ]
    if not pairs:
        return np.zeros((0, 2)), np.zeros((0, 2))
    chosen = np.array(pairs)
    return points[0][chosen[:, 0]], points[1][chosen[:, 1]]


def check_rows(pairs: Sequence[tuple[np.ndarray, np.ndarray]], camera: Camera) -> RowCheck:
    """Return the verdict over matched positions [(N, 2) left, (N, 2) right] [px] of several frames of one camera. When
    most matches lie in rows far apart, no turn is fitted."""
    left = np.concatenate([np.zeros((0, 2)), *[first for first, _ in pairs]])
    right = np.concatenate([np.zeros((0, 2)), *[second for _, second in pairs]])
    rows = right[:, 1] - left[:, 1]
    in_reach = np.abs(rows) <= LARGEST_ROW_SHARE * camera.height
    if len(rows) >= LEAST_MATCHES and in_reach.mean() < 0.5:
        error = float(np.median(np.abs(rows)))
        error_90 = float(np.percentile(np.abs(rows), 90))
        return RowCheck(len(rows), True, float(np.median(rows)), error, error_90, corrected_error=error)
    left, right, rows = left[in_reach], right[in_reach], rows[in_reach]
    if len(left) < LEAST_MATCHES:
        return RowCheck(len(left), False)
    pitch, roll = fitted_turn(right, rows, camera)
    residual = rows - row_shift(right, pitch, roll, camera)
    aligned = np.abs(residual) <= max(INLIER_ROWS, 3 * float(np.median(np.abs(residual))))
    disparity = (left - right)[aligned, 0]
    return RowCheck(
        matches=len(left),
        checked=True,
        offset=float(np.median(rows)),
        error=float(np.median(np.abs(rows))),
        error_90=float(np.percentile(np.abs(rows), 90)),
        pitch=pitch,
        roll=roll,
        corrected_error=float(np.median(np.abs(residual))),
        negative_share=float((disparity < -0.5).mean()),
        median_disparity=float(np.median(disparity)),
    )


def row_shift(points: np.ndarray, pitch: float, roll: float, camera: Camera) -> np.ndarray:
    """Return by how many rows (N,) [px] a turned right eye sees points lower, at its pixels (N, 2); angles [rad]."""
    x, y = (points[:, 0] - camera.cx) / camera.fx, (points[:, 1] - camera.cy) / camera.fy
    return camera.fy * (pitch * (1 + y * y) - roll * x)


def fitted_turn(points: np.ndarray, rows: np.ndarray, camera: Camera) -> tuple[float, float]:
    """Return (pitch, roll) [rad] that explain the row differences (N,) [px] at the right eye's pixels (N, 2) best, by
    least squares whose weights fall with the residual (Geman and McClure), as some matches are wrong."""
    x, y = (points[:, 0] - camera.cx) / camera.fx, (points[:, 1] - camera.cy) / camera.fy
    system = camera.fy * np.stack([1 + y * y, -x], axis=1)
    solution = np.array([np.median(rows) / camera.fy, 0.0])
    for _ in range(ITERATIONS):
        residual = rows - system @ solution
        scale = max(0.2, 1.48 * float(np.median(np.abs(residual))))
        weight = 1.0 / (1.0 + (residual / (2 * scale)) ** 2) ** 2
        solution = np.linalg.lstsq(system * np.sqrt(weight)[:, None], rows * np.sqrt(weight), rcond=None)[0]
    return float(solution[0]), float(solution[1])


def straightened(right: np.ndarray, pitch: float, roll: float, camera: Camera) -> np.ndarray:
    """Return the right picture (H, W[, 3]) uint8 as an eye without this turn [rad] sees it (first order in the
    angles)."""
    height, width = right.shape[:2]
    column, row = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    x, y = (column - camera.cx) / camera.fx, (row - camera.cy) / camera.fy
    lower = camera.fy * (pitch * (1 + y * y) - roll * x)
    sideways = camera.fx * (pitch * x * y + roll * y)
    return cv2.remap(
        right,
        (column + sideways).astype(np.float32),
        (row + lower).astype(np.float32),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
