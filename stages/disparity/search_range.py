"""How far apart matches can lie: looked for on a small copy of the pair, so that the full one searches no more."""

from __future__ import annotations

import cv2
import numpy as np

STEP = 16
"""OpenCV's matcher takes ranges that are multiples of this [px]."""
SMALL_WIDTH = 240
"""Width of the small copy at most [px]."""
SHARE = 0.002
"""Share of the small copy's known pixels that may lie beyond either end of the range."""
MARGIN = 0.1
"""The range is widened by this share of its upper end on both sides, and by two pixels of the small copy."""
LARGEST_SHARE = 0.5
"""Disparities over this share of the picture's width are not looked for."""


def search_range(left: np.ndarray, right: np.ndarray) -> tuple[int, int]:
    """Return (lowest disparity, number of disparities) [px] that the pair (H, W) uint8 needs; the number is a multiple
    of 16, the lowest is not negative. A pair without a match gets the whole range."""
    width = left.shape[1]
    factor = max(1, -(-width // SMALL_WIDTH))
    small = [shrunken(picture, factor) for picture in (left, right)]
    reach = int(LARGEST_SHARE * small[0].shape[1])
    levels = STEP * max(1, -(-reach // STEP))
    disparities = small_disparities(small[0], small[1], levels)
    if len(disparities) < 50:
        return 0, STEP * max(1, -(-int(LARGEST_SHARE * width) // STEP))
    lowest, highest = np.quantile(disparities, [SHARE, 1 - SHARE]) * factor
    margin = MARGIN * highest + 2 * factor
    low = max(0, int(np.floor(lowest - margin)))
    high = min(int(np.ceil(highest + margin)) + 1, int(LARGEST_SHARE * width) + STEP)
    return low, STEP * max(1, -(-(high - low) // STEP))


def usual_range(left: np.ndarray, right: np.ndarray) -> tuple[float, float]:
    """Return the 3rd and the 97th percentile of the disparities [px] that the small copies of a pair (H, W) uint8
    show, (0, 0) without any: where most of the pair lies, while `search_range` holds what is rare too."""
    factor = max(1, -(-left.shape[1] // SMALL_WIDTH))
    small = [shrunken(picture, factor) for picture in (left, right)]
    disparities = small_disparities(
        small[0], small[1], STEP * max(1, -(-int(LARGEST_SHARE * small[0].shape[1]) // STEP))
    )
    if len(disparities) < 50:
        return 0.0, 0.0
    low, high = np.percentile(disparities, [3, 97]) * factor
    return float(low), float(high)


def shrunken(picture: np.ndarray, factor: int) -> np.ndarray:
    """Return a picture (H, W) uint8 whose pixels are the means of squares of `factor` pixels."""
    if factor == 1:
        return picture
    height, width = picture.shape
    return cv2.resize(picture, (max(1, width // factor), max(1, height // factor)), interpolation=cv2.INTER_AREA)


def small_disparities(left: np.ndarray, right: np.ndarray, levels: int) -> np.ndarray:
    """Return the disparities (N,) [px] of the pixels that semi-global matching with OpenCV's own checks is sure of."""
    matcher = cv2.StereoSGBM.create(
        minDisparity=0,
        numDisparities=levels,
        blockSize=3,
        P1=72,
        P2=288,
        disp12MaxDiff=1,
        preFilterCap=31,
        uniquenessRatio=15,
        speckleWindowSize=30,
        speckleRange=2,
        mode=cv2.StereoSGBM_MODE_SGBM_3WAY,
    )
    padded = [cv2.copyMakeBorder(picture, 0, 0, levels, 0, cv2.BORDER_REPLICATE) for picture in (left, right)]
    disparity = matcher.compute(*padded)[:, levels:].astype(np.float32) / 16.0
    return disparity[disparity > 0]
