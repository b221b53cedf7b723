"""Left-right consistency: a match counts when the right image, matched by itself, points back to where it came from.

Confidence is the product of two numbers between 0 and 1: how well the two directions agree, and how much the picture
changes along the row there (on a blank wall every disparity fits as well as any other).
"""

from __future__ import annotations

import cv2
import numpy as np

AGREEMENT = 0.75
"""Difference of the two directions [px] at which confidence has fallen to 0.61 (one standard deviation)."""
TEXTURE_WINDOW = 7
"""Pixels of the square over which the change along the row is measured."""
TEXTURE_HALF = 1.5
"""Change along the row [grey levels a pixel, rms] at which the texture alone gives 0.5: about what noise of two grey
levels makes of a blank wall."""


def left_right_difference(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return |left disparity - right disparity of the place it points to| (H, W) float32 [px].

    `left` and `right` (H, W) are positive disparities of the left and of the right image, NaN where there is none;
    the difference is infinite where one of the two is missing or the match lies outside of the picture.
    """
    width = left.shape[1]
    known = np.isfinite(left)
    column = np.rint(np.arange(width) - np.where(known, left, 0.0)).astype(np.int64)
    inside = known & (column >= 0) & (column < width)
    back = np.take_along_axis(right, np.clip(column, 0, width - 1), axis=1)
    difference = np.abs(np.where(known, left, 0.0) - back)
    return np.where(inside & np.isfinite(difference), difference, np.inf).astype(np.float32)


def confidence_of(difference: np.ndarray, gray: np.ndarray) -> np.ndarray:
    """Return the confidence (H, W) float32 of matches whose two directions differ by `difference` (H, W) [px]; `gray`
    (H, W) uint8 is the left picture."""
    agreement = np.exp(-0.5 * (np.minimum(difference, 1e3) / AGREEMENT) ** 2)
    along = cv2.Sobel(gray, cv2.CV_32F, 1, 0, ksize=3) / 8.0
    change = np.sqrt(cv2.boxFilter(along * along, cv2.CV_32F, (TEXTURE_WINDOW, TEXTURE_WINDOW)))
    texture = change**2 / (change**2 + TEXTURE_HALF**2)
    return np.where(np.isfinite(difference), agreement * texture, 0.0).astype(np.float32)
