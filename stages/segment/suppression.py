"""Which of overlapping boxes of one class stay."""

from __future__ import annotations

import numpy as np


def overlap_of_boxes(box: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """Return the intersection over union (N,) of one box (4,) with boxes (N, 4)."""
    low, high = np.maximum(box[:2], boxes[:, :2]), np.minimum(box[2:], boxes[:, 2:])
    shared = np.clip(high - low, 0, None).prod(axis=1)
    area = np.clip(boxes[:, 2:] - boxes[:, :2], 0, None).prod(axis=1)
    box_area = float(np.clip(box[2:] - box[:2], 0, None).prod())
    return shared / np.maximum(box_area + area - shared, 1e-9)


def suppress(boxes: np.ndarray, scores: np.ndarray, classes: np.ndarray, overlap: float) -> np.ndarray:
    """Return the indices kept by greedy non-maximum suppression per class, best first (ties: smaller index first).

    A box goes when its IoU with a better one of its class is over `overlap`.
    """
    order = np.lexsort((np.arange(len(scores)), -scores))
    chosen: list[int] = []
    for index in order:
        same = [other for other in chosen if classes[other] == classes[index]]
        if not same or overlap_of_boxes(boxes[index], boxes[same]).max() <= overlap:
            chosen.append(int(index))
    return np.array(chosen, dtype=int)
