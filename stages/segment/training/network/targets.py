"""What the heads are to say: classes, centres and offsets of a label image (Cheng et al. 2020, section 3.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

IGNORED = 255
"""Class value of pixels that the class loss does not look at."""
SOME_THING = "*"
"""Name of an instance in a real frame that somebody outlined and nobody named: its class is not taught."""
SIGMA = 2.0
"""Standard deviation of a centre's bump [output pixels]; smaller for the smallest instances."""
SMALL_AREA, SMALL_WEIGHT = 220, 3.0
"""Pixels of instances under this area [output pixels] count this many times in the class loss."""


@dataclass(frozen=True)
class Targets:
    """All at the resolution of the heads, (h, w)."""

    classes: np.ndarray
    """uint8 index of the class, IGNORED where there is none."""
    weight: np.ndarray
    """float32 weight in the class loss."""
    centres: np.ndarray
    """float32 heat map in 0..1."""
    offsets: np.ndarray
    """(2, h, w) float32 rows, columns to the centre of the pixel's instance [output pixels]."""
    things: np.ndarray
    """bool: pixels of things, where the offsets count."""
    told: np.ndarray
    """bool: pixels of which somebody knows what they are, where the heat map counts."""


def make_targets(labels: np.ndarray, class_of_label: np.ndarray, thing_of_label: np.ndarray) -> Targets:
    """Return the targets of an image of labels (h, w).

    `class_of_label` (L,) gives the class index of every label, IGNORED for what has none (label 0); `thing_of_label`
    (L,) bool, whether it is one thing. A centre is the mean of the visible pixels of an instance.
    """
    height, width = labels.shape
    classes = class_of_label[labels].astype(np.uint8)
    present = np.flatnonzero(np.bincount(labels.ravel(), minlength=len(class_of_label)))
    offsets = np.zeros((2, height, width), dtype=np.float32)
    centres = np.zeros((height, width), dtype=np.float32)
    weight = np.ones((height, width), dtype=np.float32)
    things = np.zeros((height, width), dtype=bool)
    for label in present:
        if not thing_of_label[label]:
            continue
        rows, columns = np.nonzero(labels == label)
        row, column = rows.mean(), columns.mean()
        things[rows, columns] = True
        offsets[0, rows, columns] = row - rows
        offsets[1, rows, columns] = column - columns
        if len(rows) < SMALL_AREA:
            weight[rows, columns] = SMALL_WEIGHT
        sigma = min(SIGMA, max(1.0, 0.3 * np.sqrt(len(rows))))
        reach = int(np.ceil(3 * sigma))
        top, left = max(0, round(row) - reach), max(0, round(column) - reach)
        bottom, right = min(height, round(row) + reach + 1), min(width, round(column) + reach + 1)
        y, x = np.mgrid[top:bottom, left:right]
        bump = np.exp(-((y - row) ** 2 + (x - column) ** 2) / (2 * sigma**2)).astype(np.float32)
        centres[top:bottom, left:right] = np.maximum(centres[top:bottom, left:right], bump)
    return Targets(classes, weight, centres, offsets, things, (classes != IGNORED) | things)
