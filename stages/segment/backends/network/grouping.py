"""From the heads to masks: pixels of things join the centre that their offset points at (Cheng et al. 2020, 3.3).

The heads speak at half of the input's size. A pixel of the full image takes the mask of that one of the output pixels
around it whose depth is nearest to its own, so that masks end where depth jumps.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.segment.backends.network.features import STRIDE
from scenewright.stages.segment.panoptic import PanopticFrame, PanopticMask


@dataclass(frozen=True)
class GroupingSettings:
    """Constants of the grouping."""

    centre_threshold: float = 0.15
    """Peaks of the heat map under this are no instances."""
    peak_window: int = 9
    """A centre is the largest value in a window this wide [output pixels]."""
    largest_number: int = 200
    """Centres that are kept, best first."""
    minimum_pixels: int = 12
    """Smaller masks are dropped [output pixels]."""
    score_threshold: float = 0.3
    """Masks whose mean probability of their class is under this are not named: stuff is dropped, a thing becomes an
    `object`."""


@dataclass(frozen=True)
class Named:
    """Class of a logit."""

    class_id: int
    is_thing: bool


def group(
    logits: np.ndarray,
    heat: np.ndarray,
    offsets: np.ndarray,
    classes: tuple[Named, ...],
    settings: GroupingSettings | None = None,
    unnamed: int | None = None,
) -> PanopticFrame:
    """Return masks at the resolution of the heads.

    `logits` (C, h, w), `heat` (h, w), `offsets` (2, h, w) rows and columns [output pixels]. Stuff: one mask a class.
    Things: every pixel whose likeliest class is a thing goes to the centre nearest to where its offset points; the mask
    takes the thing class with the largest sum of probabilities over its pixels, and its score is the mean of them.
    Where that is under the threshold, as when a chair might as well be a sofa, the mask is still that of a thing: it
    gets the class with the index `unnamed`, or is dropped when that is None.
    """
    settings = settings or GroupingSettings()
    probability = _softmax(logits)
    likeliest = probability.argmax(axis=0)
    thing = np.array([entry.is_thing for entry in classes])
    ids = np.zeros(likeliest.shape, dtype=np.int32)
    masks: dict[int, PanopticMask] = {}

    def add(mask: np.ndarray, index: int) -> None:
        score = float(probability[index][mask].mean())
        if score < settings.score_threshold:
            if unnamed is None or not classes[index].is_thing:
                return
            index = unnamed
        if mask.sum() >= settings.minimum_pixels:
            number = len(masks) + 1
            ids[mask] = number
            masks[number] = PanopticMask(classes[index].class_id, classes[index].is_thing, min(score, 1.0))

    for index in np.flatnonzero(~thing):
        mask = likeliest == index
        if mask.any():
            add(mask, int(index))
    of_things = thing[likeliest]
    owner = assign_to_centres(of_things, offsets, find_centres(heat, of_things, settings))
    for number in range(1, int(owner.max(initial=0)) + 1):
        mask = owner == number
        if mask.any():
            sums = np.where(thing, probability[:, mask].sum(axis=1), -1.0)
            add(mask, int(sums.argmax()))
    return PanopticFrame(ids, masks)


def _softmax(logits: np.ndarray) -> np.ndarray:
    raised = np.exp(logits - logits.max(axis=0, keepdims=True))
    return raised / raised.sum(axis=0, keepdims=True)


def find_centres(heat: np.ndarray, allowed: np.ndarray, settings: GroupingSettings) -> np.ndarray:
    """Return (N, 2) rows and columns of the peaks of a heat map (h, w), best first.

    A peak is the largest value of its window, over the threshold, and on or beside a pixel of a thing (`allowed`,
    (h, w) bool): the centre of a ring lies beside it.
    """
    window = np.ones((settings.peak_window, settings.peak_window), np.uint8)
    near_allowed = cv2.dilate(allowed.astype(np.uint8), window) > 0
    peak = (heat >= cv2.dilate(heat, window)) & (heat > settings.centre_threshold) & near_allowed
    peaks = np.argwhere(peak)
    order = np.argsort(-heat[peak], kind="stable")[: settings.largest_number]
    return peaks[order]


@compiled
def assign_to_centres(allowed: np.ndarray, offsets: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """Return (h, w) int32: 1 + number of the centre nearest to pixel + offset, where allowed; 0 elsewhere.

    `allowed` (h, w) bool, `offsets` (2, h, w), `centres` (N, 2) rows and columns.
    """
    height, width = allowed.shape
    owner = np.zeros((height, width), dtype=np.int32)
    if len(centres) == 0:
        return owner
    for row in range(height):
        for column in range(width):
            if not allowed[row, column]:
                continue
            y, x = row + offsets[0, row, column], column + offsets[1, row, column]
            best, nearest = 0, np.inf
            for k in range(len(centres)):
                distance = (centres[k, 0] - y) ** 2 + (centres[k, 1] - x) ** 2
                if distance < nearest:
                    best, nearest = k, distance
            owner[row, column] = best + 1
    return owner


@compiled
def raise_to_depth(coarse: np.ndarray, coarse_depth: np.ndarray, depth: np.ndarray, step: float) -> np.ndarray:
    """Return masks (H, W) int32 for a depth image (H, W) [m, 0 invalid] from masks (h, w) at a lower resolution.

    Coarse pixel (i, j) was named at input pixel (STRIDE i, STRIDE j); `step` is the width of an input pixel in pixels
    of the full image.

    A pixel takes the mask of one of the four coarse pixels around it: of those, the one with the smallest sum of its
    distance in coarse pixels and of its depth difference in units of 2 % of the depth. Where either has no depth the
    distance alone decides. `coarse_depth` (h, w) is the depth that the coarse pixels were named at.
    """
    height, width = depth.shape
    rows, columns = coarse.shape
    result = np.zeros((height, width), dtype=np.int32)
    for v in range(height):
        y = ((v + 0.5) / step - 0.5) / STRIDE
        low_row = int(np.floor(y))
        for u in range(width):
            x = ((u + 0.5) / step - 0.5) / STRIDE
            low_column = int(np.floor(x))
            z = depth[v, u]
            best = np.inf
            for dv in range(2):
                row = min(rows - 1, max(0, low_row + dv))
                for du in range(2):
                    column = min(columns - 1, max(0, low_column + du))
                    cost = abs(row - y) + abs(column - x)
                    coarse_z = coarse_depth[row, column]
                    if z > 0 and coarse_z > 0:
                        cost += min(4.0, abs(coarse_z - z) / (0.02 * z))
                    if cost < best:
                        best = cost
                        result[v, u] = coarse[row, column]
    return result
