"""Training samples of the small network: crops of shapes, rooms and needles, seen by two eyes that differ."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from scenewright.stages.disparity.training.raft_stereo.kept_pairs import NEEDLE, KeptPair, kept
from scenewright.stages.disparity.training.raft_stereo.shapes import shapes_pair

HEIGHT, WIDTH = 128, 256
LEAST, LARGEST = 1.0, 96.0
"""Disparities that are learned [px]; others in a crop count as unknown."""
TEXTURES = 60
"""Textures that scenes are drawn with. By eye."""
Sample = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Left and right (HEIGHT, WIDTH, 3) uint8, disparity (HEIGHT, WIDTH) float32 [px], NaN where it does not count."""


class Kept:
    """Kept pairs, read once."""

    def __init__(self, stems: list[Path]) -> None:
        self.stems = stems
        self._read: dict[int, KeptPair] = {}

    def any(self, random: np.random.Generator) -> KeptPair:
        """Return one of the pairs."""
        index = int(random.integers(len(self.stems)))
        if index not in self._read:
            self._read[index] = kept(self.stems[index])
        return self._read[index]


def shapes_sample(bank: list[np.ndarray], random: np.random.Generator) -> Sample:
    """Return a changed pair of random shapes."""
    left, right, disparity = shapes_pair(bank, random, HEIGHT, WIDTH)
    return (*two_eyes(left, right, random), counted(disparity))


def kept_sample(pair: KeptPair, random: np.random.Generator) -> Sample:
    """Return a changed crop of a kept pair, made smaller by chance; the right eye's crop lies further left, so that
    the least disparity of the crop is small, as a matcher that knows where its search begins sees it."""
    scale = float(random.uniform(1.0, 1.6))
    rows, columns = min(int(HEIGHT * scale), pair.left.shape[0]), min(int(WIDTH * scale), pair.left.shape[1])
    top, left_edge = _place(pair, rows, columns, random)
    part = (slice(top, top + rows), slice(left_edge, left_edge + columns))
    disparity = pair.disparity[part]
    known = disparity[np.isfinite(disparity)]
    lowest = float(np.percentile(known, 1)) if len(known) else 0.0
    shift = int(min(max(0.0, lowest - random.uniform(2, 28)), left_edge))
    right = pair.right[part[0], left_edge - shift : left_edge - shift + columns]
    size = (WIDTH, HEIGHT)
    eyes = [
        cv2.resize(picture, size, interpolation=cv2.INTER_AREA).astype(np.float32)
        for picture in (pair.left[part], right)
    ]
    small = cv2.resize(disparity - shift, size, interpolation=cv2.INTER_NEAREST) * (WIDTH / columns)
    return (*two_eyes(eyes[0], eyes[1], random), counted(small))


def _place(pair: KeptPair, rows: int, columns: int, random: np.random.Generator) -> tuple[int, int]:
    """Return the upper left corner of a crop, in two of three crops about the needle where there is one."""
    height, width = pair.left.shape[:2]
    farthest = float(np.nanpercentile(pair.disparity[::8, ::8], 1))
    high = np.array([height - rows, width - columns])
    low = np.array([0, min(farthest, high[1])])  # further left the right picture has nothing
    needle = np.argwhere(pair.bodies == NEEDLE)
    if len(needle) and random.random() < 2 / 3:
        middle = needle[int(random.integers(len(needle)))] - random.uniform(0.2, 0.8, 2) * [rows, columns]
    else:
        middle = random.uniform(low, high + 1)
    top, left_edge = np.clip(middle.astype(int), low.astype(int), high)
    return int(top), int(left_edge)


def counted(disparity: np.ndarray) -> np.ndarray:
    """Return disparities (H, W) float32 with NaN where they are not learned: out of reach, or outside of the right
    picture."""
    with np.errstate(invalid="ignore"):
        inside = np.arange(disparity.shape[1]) - disparity >= 0
        return np.where(inside & (disparity >= LEAST) & (disparity <= LARGEST), disparity, np.nan).astype(np.float32)


def two_eyes(left: np.ndarray, right: np.ndarray, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return both pictures (H, W, 3) float32, 0 to 255, as two cameras record them: light, colour and gamma of both and
    of each, rows that differ by a part of a pixel, blur, noise; uint8."""
    gain, gamma = random.uniform(0.7, 1.3, 3) * random.uniform(0.6, 1.3), np.exp(random.normal(0, 0.25))
    noise, blur = random.uniform(0, 5), random.uniform(-0.6, 0.9)
    found = []
    for which, picture in enumerate((left, right)):
        if which == 1 and random.random() < 0.5:
            turn, rows = random.normal(0, 0.0008), random.normal(0, 0.3)
            matrix = np.array([[1, 0, 0], [turn, 1, rows - turn * WIDTH / 2]])
            picture = cv2.warpAffine(picture, matrix, picture.shape[1::-1], borderMode=cv2.BORDER_REPLICATE)
        if blur + 0.15 * which > 0.35:
            picture = cv2.GaussianBlur(picture, (0, 0), blur + 0.15 * which)
        own_gamma = gamma * np.exp(random.normal(0, 0.05))
        own_gain = gain * np.exp(random.normal(0, 0.05) + random.normal(0, 0.02, 3))
        table = (255 * (np.arange(256) / 255) ** own_gamma)[:, None] * own_gain + random.normal(0, 3)
        levels = np.clip(np.rint(picture), 0, 255).astype(np.uint8)
        seen = np.stack([table.astype(np.float32)[levels[..., k], k] for k in range(3)], axis=2)
        seen += noise * random.standard_normal(seen.shape, dtype=np.float32)
        found.append(np.clip(np.rint(seen), 0, 255).astype(np.uint8))
    return found[0], found[1]
