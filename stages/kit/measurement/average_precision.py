"""Average precision at one IoU threshold, in the standard forms and in the form of the thesis's code."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

RECALL_POINTS = np.linspace(0.0, 1.0, 11)
"""Levels of recall at which precision is averaged (PASCAL VOC 2007)."""


@dataclass(frozen=True)
class PrecisionRecall:
    """The precision-recall curve of one class, predictions in falling confidence."""

    precision: np.ndarray
    """(P,) precision after each prediction."""
    recall: np.ndarray
    """(P,) recall after each prediction; all 0 when nothing is true."""
    true_count: int
    matches: tuple[tuple[int, int], ...] = ()
    """(prediction row, truth column) of the true positives."""


def match_greedily(iou: np.ndarray, confidence: np.ndarray, match_iou: float = 0.5) -> list[tuple[int, int | None]]:
    """Match predictions of one class to truths in falling confidence (ties: lower row first).

    `iou` (P, T), `confidence` (P,). Each prediction takes the free truth of highest IoU if that is > `match_iou`.
    Returns (prediction row, truth column or None) in the order of processing.
    """
    iou = np.atleast_2d(np.asarray(iou, dtype=float))
    if not len(confidence):
        return []
    order = np.argsort(-np.asarray(confidence, dtype=float), kind="stable")
    free = np.ones(iou.shape[1], dtype=bool)
    result: list[tuple[int, int | None]] = []
    for row in order:
        candidates = np.where(free, iou[row], -1.0)
        best = int(np.argmax(candidates)) if len(candidates) else -1
        if best >= 0 and candidates[best] > match_iou:
            free[best] = False
            result.append((int(row), best))
        else:
            result.append((int(row), None))
    return result


def precision_recall(
    iou: np.ndarray, confidence: np.ndarray, true_count: int, match_iou: float = 0.5
) -> PrecisionRecall:
    """Return the precision-recall curve of one class. `iou` (P, T), `confidence` (P,)."""
    matched = match_greedily(np.asarray(iou, dtype=float).reshape(len(confidence), true_count), confidence, match_iou)
    hits = np.array([truth is not None for _, truth in matched], dtype=float)
    hits_so_far = np.cumsum(hits)
    predicted_count = np.arange(1, len(hits) + 1)
    recall = hits_so_far / true_count if true_count else np.zeros(len(hits))
    pairs = tuple((row, truth) for row, truth in matched if truth is not None)
    return PrecisionRecall(hits_so_far / predicted_count if len(hits) else hits_so_far, recall, true_count, pairs)


def average_precision(curve: PrecisionRecall) -> float | None:
    """Area under the interpolated curve over all recall points (Pascal VOC from 2010, COCO in the limit).

    Recall that is never reached counts with precision 0. None where nothing is true.
    """
    if curve.true_count == 0:
        return None
    if not len(curve.precision):
        return 0.0
    envelope = np.maximum.accumulate(curve.precision[::-1])[::-1]
    steps = np.diff(np.concatenate([[0.0], curve.recall]))
    return float(np.sum(steps * envelope))


def average_precision_eleven_point(curve: PrecisionRecall) -> float | None:
    """Mean interpolated precision at recall 0, 0.1, ... 1 (Pascal VOC 2007); 0 beyond the last recall reached."""
    return _eleven_point(curve, beyond_last=False)


def average_precision_thesis_code(curve: PrecisionRecall) -> float | None:
    """Eleven points as the thesis's code has it: recall points beyond the last one reached get the LAST precision.

    This inflates: one correct prediction among ten objects gives 1.0 (PROTOCOLS section 3). Kept under its own
    name, for comparison with the thesis's tables only.
    """
    return _eleven_point(curve, beyond_last=True)


def _eleven_point(curve: PrecisionRecall, beyond_last: bool) -> float | None:
    if curve.true_count == 0:
        return None
    if not len(curve.precision):
        return 0.0
    values = []
    for level in RECALL_POINTS:
        reached = curve.recall >= level - 1e-12
        if reached.any():
            values.append(float(curve.precision[reached].max()))
        else:
            values.append(float(curve.precision[-1]) if beyond_last else 0.0)
    return float(np.mean(values))


@dataclass(frozen=True)
class Candidates:
    """What one class's average precision is computed from. Those of several scenes add up: `pool`."""

    iou: np.ndarray
    """(P, T) of every prediction with every true one."""
    confidence: np.ndarray
    """(P,)"""


def pool(scenes: Sequence[Candidates]) -> Candidates:
    """Return the candidates of all scenes as those of one; predictions never match the truth of another scene."""
    rows, columns = (sum(scene.iou.shape[axis] for scene in scenes) for axis in (0, 1))
    iou = np.zeros((rows, columns))
    row = column = 0
    for scene in scenes:
        height, width = scene.iou.shape
        iou[row : row + height, column : column + width] = scene.iou
        row, column = row + height, column + width
    return Candidates(iou, np.concatenate([np.zeros(0), *(scene.confidence for scene in scenes)]))


@dataclass(frozen=True)
class ClassPrecision:
    """Average precision of one class in the three forms; None where nothing is true."""

    all_point: float | None
    eleven_point: float | None
    thesis_code: float | None
    true_count: int
    predicted_count: int
    found: int


def class_precision(candidates: Candidates, match_iou: float = 0.5) -> ClassPrecision:
    """Evaluate one class in every form."""
    curve = precision_recall(candidates.iou, candidates.confidence, candidates.iou.shape[1], match_iou)
    return ClassPrecision(
        average_precision(curve),
        average_precision_eleven_point(curve),
        average_precision_thesis_code(curve),
        curve.true_count,
        len(curve.precision),
        len(curve.matches),
    )


def mean_precision(values: list[float | None]) -> float | None:
    """Mean over the classes that have truth; None without any."""
    defined = [value for value in values if value is not None]
    return float(np.mean(defined)) if defined else None
