"""How many pixels the labels of two images share."""

from __future__ import annotations

import numpy as np


def overlap_table(geometric: np.ndarray, panoptic: np.ndarray) -> np.ndarray:
    """Return the number of pixels (n + 1, m + 1) that geometric label j and panoptic id i share, labels from 0."""
    rows, columns = int(geometric.max(initial=0)) + 1, int(panoptic.max(initial=0)) + 1
    flat = geometric.ravel().astype(np.int64) * columns + panoptic.ravel()
    return np.bincount(flat, minlength=rows * columns).reshape(rows, columns)
