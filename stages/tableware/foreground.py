"""What on the table differs from it in colour; shadows do not count."""

from __future__ import annotations

import cv2
import numpy as np

from stages.tableware.height_map import HeightMap

DARKER, BRIGHTER = 0.82, 1.25
"""Grey against the table's nearby, beyond which it may be no table."""
DARK_LINE, BRIGHT_LINE = 0.13, 0.5
"""What a closing or an opening takes away, against the table's grey nearby: shadows are broader than utensils."""
LEAST_DIFFERENCE = 10.0
"""Grey levels; noise on a dark table is a large share of little."""
BROADEST = 21
"""A utensil is narrower than this [px]."""
CHROMA = 40.0
"""Distance of the colour, grey taken off, from the table's [levels]."""


def unlike_table(heights: HeightMap, covered: np.ndarray) -> np.ndarray:
    """Return (h, w) bool: pixels outside of `covered` (h, w) that look unlike the table around them."""
    color = cv2.GaussianBlur(heights.color, (3, 3), 0.7)
    gray = cv2.cvtColor(color, cv2.COLOR_RGB2GRAY)
    table = ((np.abs(heights.smooth) < 0.008) & ~covered).astype(np.uint8)
    tone = float(np.median(gray[table > 0])) if table.any() else float(np.median(gray))
    usual = table & cv2.inRange(gray, 0.5 * tone - 4.0, 1.6 * tone + 8.0)
    small = (gray.shape[1] // 8, gray.shape[0] // 8)
    weight = cv2.resize(usual.astype(np.float32), small, interpolation=cv2.INTER_AREA)
    light = cv2.resize(gray.astype(np.float32) * usual, small, interpolation=cv2.INTER_AREA)
    blur = [cv2.GaussianBlur(part, (0, 0), 6.0) for part in (light, weight)]
    local = np.where(blur[1] > 0.02, blur[0] / np.maximum(blur[1], 1e-4), tone).astype(np.float32)
    around = cv2.resize(local, gray.shape[::-1], interpolation=cv2.INTER_LINEAR)
    level = gray.astype(np.float32)
    plain = np.where(covered, around, level).clip(0.0, 255.0).astype(np.uint8)
    kernel = np.ones((BROADEST, BROADEST), np.uint8)
    dark = cv2.morphologyEx(plain, cv2.MORPH_BLACKHAT, kernel).astype(np.float32)
    bright = cv2.morphologyEx(plain, cv2.MORPH_TOPHAT, kernel).astype(np.float32)
    unlike = (level < DARKER * around) & (dark > np.maximum(DARK_LINE * around, LEAST_DIFFERENCE))
    unlike |= (level > BRIGHTER * around) & (bright > np.maximum(BRIGHT_LINE * around, LEAST_DIFFERENCE))
    spread = color.max(axis=2).astype(np.int16) - color.min(axis=2)
    usual_spread = float(np.median(spread[::4, ::4][usual[::4, ::4] > 0])) if usual[::4, ::4].any() else 0.0
    unlike |= spread > usual_spread + CHROMA
    return unlike & ~covered
