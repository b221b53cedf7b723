"""What on the table differs from it in colour; shadows do not count."""

from __future__ import annotations

import cv2
import numpy as np
from scenewright.stages.tableware.vision.height_map import HeightMap

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
LEAST_RISE, PLAIN_RISE, MOST_RISE = 0.0005, 0.0020, 0.012
"""What looks unlike the table is a shadow where it rises less than the first [m], mean over 5 x 5 pixels; what rises
over the second is no table whatever its colour; the third is where heights are cut."""
NEAR_DISH = 9
"""Heights in a square of this side [px] around a dish's pixels are mixed with its own."""


def unlike_table(heights: HeightMap, covered: np.ndarray) -> np.ndarray:
    """Return (h, w) bool: pixels outside of `covered` (h, w) that look unlike the table around them."""
    color = cv2.GaussianBlur(heights.color, (3, 3), 0.7)
    gray = cv2.cvtColor(color, cv2.COLOR_RGB2GRAY)
    table = ((np.abs(heights.smooth) < 0.008) & ~covered).astype(np.uint8)
    some = gray[::4, ::4][table[::4, ::4] > 0]
    tone = float(np.median(some)) if len(some) else float(np.median(gray))
    usual = table & cv2.inRange(gray, 0.5 * tone - 4.0, 1.6 * tone + 8.0)
    small = (gray.shape[1] // 8, gray.shape[0] // 8)
    weight = cv2.resize(usual.astype(np.float32), small, interpolation=cv2.INTER_AREA)
    light = cv2.resize(cv2.multiply(gray, usual, dtype=cv2.CV_32F), small, interpolation=cv2.INTER_AREA)
    blur = [cv2.GaussianBlur(part, (0, 0), 6.0) for part in (light, weight)]
    local = np.where(blur[1] > 0.02, blur[0] / np.maximum(blur[1], 1e-4), tone).astype(np.float32)
    around = cv2.resize(np.clip(local, 0.0, 255.0).astype(np.uint8), gray.shape[::-1], interpolation=cv2.INTER_LINEAR)
    plain = np.where(covered, around, gray)
    kernel = np.ones((BROADEST, BROADEST), np.uint8)
    # Saturating arithmetic of 8-bit images: each comparison is a difference that is left over.
    dark = cv2.subtract(cv2.morphologyEx(plain, cv2.MORPH_CLOSE, kernel), plain)
    dark = cv2.subtract(dark, _share(around, DARK_LINE, LEAST_DIFFERENCE))
    dark = cv2.min(dark, cv2.subtract(_share(around, DARKER), gray))
    bright = cv2.subtract(plain, cv2.morphologyEx(plain, cv2.MORPH_OPEN, kernel))
    bright = cv2.subtract(bright, _share(around, BRIGHT_LINE, LEAST_DIFFERENCE))
    bright = cv2.min(bright, cv2.subtract(gray, _share(around, BRIGHTER)))
    unlike = cv2.max(dark, bright) > 0
    red, green, blue = cv2.split(color)
    spread = cv2.subtract(cv2.max(cv2.max(red, green), blue), cv2.min(cv2.min(red, green), blue))
    usual_spread = float(np.median(spread[::4, ::4][usual[::4, ::4] > 0])) if usual[::4, ::4].any() else 0.0
    unlike |= spread > usual_spread + CHROMA
    return unlike & ~covered


def _share(image: np.ndarray, factor: float, least: float = 0.0) -> np.ndarray:
    """Return an 8-bit image times a factor, saturated, nowhere below `least`."""
    levels = np.clip(np.rint(np.arange(256) * factor), least, 255.0).astype(np.uint8)
    return np.asarray(cv2.LUT(np.asarray(image, dtype=np.uint8), levels))


def rising(heights: HeightMap, unlike: np.ndarray, covered: np.ndarray) -> np.ndarray:
    """Return (h, w) bool: `unlike` (h, w) less what does not rise over the table, plus what does; by colour alone where
    there is too little depth."""
    cut = np.clip(heights.raw, np.float32(-0.004), np.float32(MOST_RISE))
    count = cv2.boxFilter(heights.valid.astype(np.uint8), cv2.CV_32F, (5, 5), normalize=False)
    mean = cv2.boxFilter(cut, -1, (5, 5), normalize=False) / np.maximum(count, 1.0)
    near_dish = cv2.dilate(covered.astype(np.uint8), np.ones((NEAR_DISH, NEAR_DISH), np.uint8)) > 0
    plain = (mean > PLAIN_RISE) & (mean < 0.7 * MOST_RISE) & (count >= 16.0) & ~near_dish
    return np.asarray(((unlike & ~((count >= 9.0) & (mean < LEAST_RISE))) | plain) & ~covered)
