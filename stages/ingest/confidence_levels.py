"""Recorders' confidence levels as what a sequence keeps: a standard deviation of depth.

Apple says of the levels no more than their order. The least deviation of high is what was measured of the phone's
sensor: small things to +-1 cm (Luetzenburg, Kroon and Bjork, Scientific Reports 11, 22221, 2021). That it is 1 % of the
depth from a metre on, three times as much at medium and ten times at low, is assumed: nothing published was found.
"""

from __future__ import annotations

import numpy as np

LEAST_DEVIATION = 0.01
"""Of a pixel of high confidence, however near [m]."""
SHARE_OF_DEPTH = 0.01
"""Of a pixel of high confidence, where that is more."""
TIMES = np.array([10.0, 3.0, 1.0], np.float32)
"""How much larger it is by level: low, medium, high."""


def deviation_of_levels(levels: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Return the standard deviation of depth (H, W) float32 [m], 0 where there is no depth.

    `levels` (H, W) integer: 0 low, 1 medium, 2 high, as ARKit counts; `depth` (H, W) float32 [m], 0 = invalid. Depth of
    low confidence stays depth, with a deviation of a decimetre or more. Raises ValueError for another level.
    """
    if levels.size and not (levels.min() >= 0 and levels.max() < len(TIMES)):
        raise ValueError(f"confidence is not within 0..{len(TIMES) - 1}")
    deviation = TIMES[levels] * np.maximum(np.float32(LEAST_DEVIATION), np.float32(SHARE_OF_DEPTH) * depth)
    return np.where(depth > 0, deviation, np.float32(0)).astype(np.float32)
