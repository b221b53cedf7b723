"""How many pixels the labels of two images share, and where each label lies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.stages.kit.compiled import compiled


def overlap_table(geometric: np.ndarray, panoptic: np.ndarray) -> np.ndarray:
    """Return the number of pixels (n + 1, m + 1) that geometric label j and panoptic id i share, labels from 0."""
    table = np.zeros((int(geometric.max(initial=0)) + 1, int(panoptic.max(initial=0)) + 1), dtype=np.int64)
    _count(geometric.ravel(), panoptic.ravel(), table)
    return table


@compiled
def _count(first: np.ndarray, second: np.ndarray, table: np.ndarray) -> None:
    for k in range(len(first)):
        table[first[k], second[k]] += 1


@dataclass(frozen=True)
class LabelPixels:
    """Where each label of an image lies, so that nobody has to search the image for one label after another."""

    order: np.ndarray
    """(H W,) int64 pixels in the order of the flattened image, label after label, each label's ascending."""
    starts: np.ndarray
    """(n + 2,) int64: where in `order` each label 0..n begins; last its length."""

    def of(self, label: int) -> np.ndarray:
        """Return the pixels (N,) of a label 0..n, ascending."""
        return self.order[self.starts[label] : self.starts[label + 1]]


def pixels_of_labels(labels: np.ndarray) -> LabelPixels:
    """Return where each label of an image (H, W) int32 >= 0 lies."""
    starts = np.concatenate([[0], np.cumsum(np.bincount(labels.ravel(), minlength=1))]).astype(np.int64)
    order = np.empty(labels.size, dtype=np.int64)
    _place(labels.ravel(), starts[:-1].copy(), order)
    return LabelPixels(order, starts)


@compiled
def _place(labels: np.ndarray, next_place: np.ndarray, order: np.ndarray) -> None:
    for k in range(len(labels)):
        order[next_place[labels[k]]] = k
        next_place[labels[k]] += 1
