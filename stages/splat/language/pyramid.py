"""Squares of a picture in several sizes, each with the vector of an encoder (Srinivas 2024, section 9.3; LERF 3.2)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scenewright.stages.kit.open_words.encoder import Encoder

LEVELS = 7
"""Number of sizes of squares."""
SMALLEST, LARGEST = 0.10, 0.45
"""Sides of the squares, over the height of the picture."""
STRIDE = 0.5
"""Way from one square to the next, over the side."""


@dataclass(frozen=True)
class Level:
    """The squares of one size."""

    share: float
    """Side over the height of the picture."""
    centers: tuple[np.ndarray, np.ndarray]
    """Rows (R,) and columns (C,) of the middles [px], ascending."""
    vectors: np.ndarray
    """(R, C, width) float32."""

    def at(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Return (N, width): vectors between the four nearest middles, bilinear, at pixels (N,)."""
        (r, wr), (c, wc) = (
            _between(middles, each) for middles, each in zip(self.centers, (rows, columns), strict=True)
        )
        result = np.zeros((len(rows), self.vectors.shape[2]), np.float32)
        for dr in (0, 1):
            for dc in (0, 1):
                weight = np.abs(1 - dr - wr) * np.abs(1 - dc - wc)
                last = (len(self.centers[0]) - 1, len(self.centers[1]) - 1)
                result += weight[:, None] * self.vectors[np.minimum(r + dr, last[0]), np.minimum(c + dc, last[1])]
        return result


def _between(middles: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the middle before each place, and how far (0 to 1) it is on the way to the next."""
    before = np.clip(np.searchsorted(middles, places, side="right") - 1, 0, max(len(middles) - 2, 0))
    after = np.minimum(before + 1, len(middles) - 1)
    step = np.maximum(middles[after] - middles[before], 1e-6)
    return before, np.clip((places - middles[before]) / step, 0.0, 1.0).astype(np.float32)


def pyramid(color: np.ndarray, encoder: Encoder, smallest: float = SMALLEST, largest: float = LARGEST) -> list[Level]:
    """Return the levels of a picture (H, W, 3) uint8, whose sides over its height go from `smallest` to `largest`."""
    height, width = color.shape[:2]
    plans, crops = [], []
    for share in np.linspace(smallest, largest, LEVELS):
        side = max(4, min(round(share * height), height, width))
        tops, lefts = _starts(height, side), _starts(width, side)
        plans.append((float(share), side, tops, lefts))
        for top in tops:
            for left in lefts:
                crop = color[top : top + side, left : left + side]
                crops.append(cv2.resize(crop, (encoder.side, encoder.side), interpolation=cv2.INTER_AREA))
    vectors, levels, at = encoder.pictures(np.stack(crops)), [], 0
    for share, side, tops, lefts in plans:
        count = len(tops) * len(lefts)
        vectors_of_level = vectors[at : at + count].reshape(len(tops), len(lefts), -1)
        middles = tuple(starts + (side - 1) / 2 for starts in (tops, lefts))
        levels.append(Level(share, (middles[0], middles[1]), vectors_of_level))
        at += count
    return levels


def _starts(length: int, side: int) -> np.ndarray:
    """Return the first pixels of squares that cover a length, STRIDE apart, the last at its end."""
    count = 1 + int(np.ceil((length - side) / (STRIDE * side)))
    return np.linspace(0, length - side, count).round().astype(int)
