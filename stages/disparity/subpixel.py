"""Disparities between whole pixels: undoing the pull towards whole numbers, smoothing within a surface.

OpenCV's semi-global matcher lays a parabola through three costs. Its costs (Birchfield and Tomasi, PAMI 1998) forgive
half a pixel by design, so the parabola is too flat and its minimum is pulled towards the whole pixel: on pictures whose
true disparities are spread evenly, several times more estimates end near a whole number than half-way. The pull
depends on the distance from the whole pixel alone, so that a table undoes it.
"""

from __future__ import annotations

import cv2
import numpy as np

UNLOCKED = np.array([0.0, 0.102, 0.165, 0.229, 0.291, 0.352, 0.418, 0.465, 0.5])
"""Distance from the nearest whole pixel that an estimate at 0, 1/16 ... 8/16 px stands for: the median of the true one
over the pixels of a generated room with noisy pictures (seed 100, four frames, 48,000 pixels an entry; the sign of the
first is not known, so that it is 0)."""
REACH = 5
"""Diameter of the window of the smoothing [px]."""
SAME_SURFACE = 0.7
"""Standard deviation of the difference of disparities [px] within which two pixels count as one surface."""
FAR_OFF = 50.0
"""A hole counts as a disparity so far under all others that it has no weight [px]."""


def unlocked(disparity: np.ndarray) -> np.ndarray:
    """Return disparities (H, W) float32 without their pull towards whole pixels; NaN stays NaN."""
    whole_pixels = np.rint(disparity)
    offset = disparity - whole_pixels
    grid = np.arange(len(UNLOCKED)) / 16.0
    moved = np.interp(np.abs(np.nan_to_num(offset)), grid, UNLOCKED)
    return (whole_pixels + np.sign(offset) * moved).astype(np.float32)


def smoothed(disparity: np.ndarray) -> np.ndarray:
    """Return disparities (H, W) float32 averaged with near ones of the same surface (a bilateral filter on the
    disparity itself); holes stay holes and add nothing, steps stay steps."""
    matched = np.isfinite(disparity)
    if not matched.any():
        return disparity
    filled = np.where(matched, disparity, disparity[matched].min() - FAR_OFF).astype(np.float32)
    result = cv2.bilateralFilter(filled, REACH, SAME_SURFACE, REACH / 2, borderType=cv2.BORDER_REPLICATE)
    return np.where(matched, result, np.nan).astype(np.float32)
