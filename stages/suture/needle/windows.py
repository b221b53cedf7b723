"""The part of each eye's mask that an estimator of the needle looks at."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scenewright.stages.suture.needle.observation import NeedleObservation

MARGIN = 40
"""Room around the mask in the window [px]; by eye."""


@dataclass(frozen=True)
class EyeMask:
    """A window of one eye's mask: `mask`, `hidden` (a driver may hide the needle), `thread`, each (h, w)
    bool, and the window's first column and row."""

    mask: np.ndarray
    hidden: np.ndarray
    thread: np.ndarray
    column: int
    row: int

    @property
    def corner(self) -> np.ndarray:
        """First column and row (2,), float."""
        return np.array([float(self.column), float(self.row)])

    def distance(self) -> np.ndarray:
        """Return each pixel's distance (h, w) float32 [px] to the mask."""
        return np.asarray(cv2.distanceTransform((~self.mask).astype(np.uint8), cv2.DIST_L2, 3))

    def some_pixels(self, count: int, random: np.random.Generator) -> np.ndarray:
        """Return `count` pixels (P, 2) (column, row) of the mask in the whole image."""
        rows, columns = np.nonzero(self.mask)
        chosen = random.integers(0, len(rows), count) if len(rows) else np.empty(0, dtype=int)
        return np.stack([columns[chosen], rows[chosen]], axis=1) + self.corner


def needle_masks(observation: NeedleObservation) -> tuple[np.ndarray, np.ndarray]:
    """Return both eyes' masks (H, W) of the needle without what is known to be thread."""
    return (
        _without(observation.left_mask, observation.left_thread),
        _without(observation.right_mask, observation.right_thread),
    )


def windows(observation: NeedleObservation) -> tuple[EyeMask, EyeMask]:
    """Return both eyes' windows: all of the needle's mask with a margin. Each mask must have a pixel."""
    left, right = needle_masks(observation)
    return (
        _window(left, observation.left_thread, observation.left_hidden),
        _window(right, observation.right_thread, observation.right_hidden),
    )


def _without(mask: np.ndarray, thread: np.ndarray | None) -> np.ndarray:
    return mask if thread is None else mask & ~thread


def _window(mask: np.ndarray, thread: np.ndarray | None, hidden: np.ndarray | None) -> EyeMask:
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    top, bottom = max(int(rows[0]) - MARGIN, 0), min(int(rows[-1]) + MARGIN, mask.shape[0])
    left, right = max(int(columns[0]) - MARGIN, 0), min(int(columns[-1]) + MARGIN, mask.shape[1])
    crop = np.s_[top:bottom, left:right]
    # a smoothed mask has no single pixels and no single holes
    soft = cv2.GaussianBlur(mask[crop].astype(np.float32), (3, 3), 0.7)
    nothing = np.zeros(soft.shape, dtype=bool)
    of_thread = nothing if thread is None else np.ascontiguousarray(thread[crop])
    covered = nothing if hidden is None else np.ascontiguousarray(hidden[crop])
    return EyeMask(soft >= 0.5, covered, of_thread, left, top)
