"""Left-right consistency: a match counts when the right image, matched by itself, points back to where it came from.

Confidence is the product of three numbers between 0 and 1: how well the two directions agree; how much the picture
changes along the row there (on a blank wall every disparity fits as well as any other); and which share of the pixels
around lies on the same surface (beside a step of depth the nearer surface is drawn too wide, and looks sure of itself
there as its edge is a strong one).
"""

from __future__ import annotations

import cv2
import numpy as np

AGREEMENT = 0.75
"""Difference of the two directions [px] at which confidence has fallen to 0.61 (one standard deviation)."""
TEXTURE_WINDOW = 7
"""Pixels of the square over which the change along the row is measured."""
TEXTURE_HALF = 0.6
"""Change along the row [grey levels a pixel, rms] at which the texture alone gives 0.5."""
SAME_SURFACE = 1.5
"""Difference of disparities [px] up to which two pixels count as one surface."""
DEVIATIONS = np.array([2.67, 2.08, 1.40, 0.99, 0.71, 0.53, 0.43, 0.34, 0.27, 0.22, 0.22], np.float32)
"""Standard deviation of a disparity of confidence 0, 0.1 ... 1 [px]: what 68 % of the errors stay under (four generated
rooms with noisy pictures, 7.8 million pixels)."""
AROUND = tuple((dx, dy) for r in (4, 8) for dx in (-r, 0, r) for dy in (-r, 0, r) if (dx, dy) != (0, 0))
"""Places around a pixel (columns, rows) whose disparities are compared with its own."""


def left_right_difference(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return |left disparity - right disparity of the place it points to| (H, W) float32 [px].

    `left` and `right` (H, W) are positive disparities of the left and of the right image, NaN where there is none;
    the difference is infinite where one of the two is missing or the match lies outside of the picture.
    """
    width = left.shape[1]
    matched = np.isfinite(left)
    column = np.rint(np.arange(width) - np.where(matched, left, 0.0)).astype(np.int64)
    inside = matched & (column >= 0) & (column < width)
    back = np.take_along_axis(right, np.clip(column, 0, width - 1), axis=1)
    difference = np.abs(np.where(matched, left, 0.0) - back)
    return np.where(inside & np.isfinite(difference), difference, np.inf).astype(np.float32)


def confidence_of(difference: np.ndarray, disparity: np.ndarray, gray: np.ndarray) -> np.ndarray:
    """Return the confidence (H, W) float32 of disparities (H, W) [px, NaN unknown] whose two directions differ by
    `difference` (H, W) [px]; `gray` (H, W) uint8 is the left picture."""
    agreement = np.exp(-0.5 * (np.minimum(difference, 1e3) / AGREEMENT) ** 2)
    along = (cv2.Sobel(gray, cv2.CV_32F, 1, 0, ksize=3) / 8.0).astype(np.float32)
    change = cv2.boxFilter(along * along, cv2.CV_32F, (TEXTURE_WINDOW, TEXTURE_WINDOW))
    texture = change / (change + TEXTURE_HALF**2)
    sure = agreement * texture * same_surface(disparity)
    return np.where(np.isfinite(difference) & np.isfinite(disparity), sure, 0.0).astype(np.float32)


def deviation_of(confidence: np.ndarray) -> np.ndarray:
    """Return the standard deviation (H, W) float32 [px] of disparities of a confidence (H, W), 0 to 1."""
    return np.interp(confidence, np.linspace(0, 1, len(DEVIATIONS)), DEVIATIONS).astype(np.float32)


def same_surface(disparity: np.ndarray) -> np.ndarray:
    """Return the share (H, W) float32 of the places AROUND each pixel whose disparity is known and near its own;
    places outside of the picture count as those at its border."""
    reach = max(max(abs(dx), abs(dy)) for dx, dy in AROUND)
    height, width = disparity.shape
    padded = cv2.copyMakeBorder(disparity.astype(np.float32), *(reach,) * 4, cv2.BORDER_REPLICATE)
    count = np.zeros(disparity.shape, np.float32)
    for dx, dy in AROUND:
        shifted = padded[reach + dy : reach + dy + height, reach + dx : reach + dx + width]
        count += np.abs(shifted - disparity) <= SAME_SURFACE
    return count / len(AROUND)
