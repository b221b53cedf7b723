"""Panoptic quality (Han 2024, equation 2.15; Kirillov 2019), and the variant that the thesis's code computes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

VOID = 0
"""Label of points that no truth is known for."""
MATCH_IOU = 0.5
"""Smallest overlap of a match (Kirillov 2019): at more than one half, matches are unique."""


@dataclass(frozen=True)
class ClassQuality:
    """Sums of equation 2.15 for one class. Add them over scenes before dividing."""

    true_positives: int = 0
    false_positives: int = 0
    false_negatives: int = 0
    iou_sum: float = 0.0
    """Sum of the IoU of the true positives."""

    def __add__(self, other: ClassQuality) -> ClassQuality:
        """Add the sums of another scene."""
        return ClassQuality(
            self.true_positives + other.true_positives,
            self.false_positives + other.false_positives,
            self.false_negatives + other.false_negatives,
            self.iou_sum + other.iou_sum,
        )

    @property
    def segments(self) -> int:
        """True and predicted segments, matched pairs once."""
        return self.true_positives + self.false_positives + self.false_negatives

    @property
    def predicted(self) -> int:
        """Predicted segments."""
        return self.true_positives + self.false_positives

    @property
    def sq(self) -> float:
        """Segmentation quality: mean IoU of the matched pairs, 0 without any."""
        return self.iou_sum / self.true_positives if self.true_positives else 0.0

    @property
    def rq(self) -> float:
        """Recognition quality: F1 of the detection, 0 without any segment."""
        weight = self.true_positives + 0.5 * self.false_positives + 0.5 * self.false_negatives
        return self.true_positives / weight if weight else 0.0

    @property
    def pq(self) -> float:
        """Panoptic quality SQ x RQ."""
        return self.sq * self.rq


def merge_stuff(
    labels: np.ndarray, classes: Mapping[int, str], stuff: frozenset[str]
) -> tuple[np.ndarray, dict[int, str]]:
    """Give all instances of a stuff class one label (the smallest of them), as [KHG19] defines stuff.

    `labels` (N,) int instance per point; labels absent from `classes` become void. Returns (N,) labels and their
    classes.
    """
    first: dict[str, int] = {}
    target: dict[int, int] = {}
    for instance in sorted(classes):
        name = classes[instance]
        target[instance] = first.setdefault(name, instance) if name in stuff else instance
    merged = np.zeros(len(labels), dtype=np.int64)
    values, inverse = np.unique(labels, return_inverse=True)
    lookup = np.array([target.get(int(v), VOID) if v != VOID else VOID for v in values], dtype=np.int64)
    if len(values):
        merged = lookup[inverse]
    return merged, {instance: classes[instance] for instance in set(target.values())}


def overlaps(true: np.ndarray, predicted: np.ndarray) -> dict[tuple[int, int], int]:
    """Count the points of every (true label, predicted label) pair that occurs. Both (N,) int."""
    if len(true) != len(predicted):
        raise ValueError(f"{len(true)} true labels and {len(predicted)} predicted labels")
    if not len(true):
        return {}
    true_values, rows = np.unique(true, return_inverse=True)
    predicted_values, columns = np.unique(predicted, return_inverse=True)
    counts = np.bincount(rows * len(predicted_values) + columns)
    return {
        (int(true_values[pair // len(predicted_values)]), int(predicted_values[pair % len(predicted_values)])): int(
            counts[pair]
        )
        for pair in np.flatnonzero(counts)
    }


def intersection_over_union(true: np.ndarray, predicted: np.ndarray) -> dict[tuple[int, int], float]:
    """Return the IoU of every overlapping pair of non-void labels, over the points whose true label is not void.

    `true`, `predicted`: (N,) int labels of the same points, 0 = void or unlabelled.
    """
    valid = true != VOID
    counts = overlaps(true[valid], predicted[valid])
    true_area: dict[int, int] = {}
    predicted_area: dict[int, int] = {}
    for (t, p), n in counts.items():
        true_area[t] = true_area.get(t, 0) + n
        predicted_area[p] = predicted_area.get(p, 0) + n
    return {(t, p): n / (true_area[t] + predicted_area[p] - n) for (t, p), n in counts.items() if p != VOID}


def panoptic_quality(
    true: np.ndarray,
    predicted: np.ndarray,
    true_classes: Mapping[int, str],
    predicted_classes: Mapping[int, str],
    stuff: frozenset[str],
    match_iou: float = MATCH_IOU,
) -> dict[str, ClassQuality]:
    """Equation 2.15 per class, over labelled points.

    `true`, `predicted`: (N,) int instance labels of the same points, 0 = void (truth) or unlabelled (prediction).
    Points of void truth count for nothing, and a predicted segment that lies on void for more than half is no
    false positive (as in the COCO panoptic evaluation). Stuff instances of one class are one segment. A pair
    matches when the classes agree and IoU > `match_iou`; at 0.5 the match is unique. A predicted label that
    `predicted_classes` does not know counts as unlabelled.
    """
    if match_iou < 0.5:
        raise ValueError(f"matching by IoU is unique only from 0.5 on, got {match_iou}")
    true, true_classes = merge_stuff(true, true_classes, stuff)
    predicted, predicted_classes = merge_stuff(predicted, predicted_classes, stuff)
    ious = intersection_over_union(true, predicted)
    matched = {
        (t, p): iou for (t, p), iou in ious.items() if iou > match_iou and true_classes[t] == predicted_classes[p]
    }
    matched_true = {t for t, _ in matched}
    matched_predicted = {p for _, p in matched}
    on_void = overlaps(true, predicted)
    sums: dict[str, list[float]] = {}
    for (t, _), iou in sorted(matched.items()):
        entry = sums.setdefault(true_classes[t], [0, 0, 0, 0.0])
        entry[0] += 1
        entry[3] += iou
    for t in _present(true):
        if t not in matched_true:
            sums.setdefault(true_classes[t], [0, 0, 0, 0.0])[2] += 1
    for p in _present(predicted):
        if p not in matched_predicted:
            void = on_void.get((VOID, p), 0)
            if void <= 0.5 * np.count_nonzero(predicted == p):
                sums.setdefault(predicted_classes[p], [0, 0, 0, 0.0])[1] += 1
    return {name: ClassQuality(int(e[0]), int(e[1]), int(e[2]), float(e[3])) for name, e in sorted(sums.items())}


def _present(labels: np.ndarray) -> list[int]:
    return [int(v) for v in np.unique(labels) if v != VOID]


@dataclass(frozen=True)
class QualityAverage:
    """Class averages; None where no class takes part."""

    pq: float | None
    sq: float | None
    rq: float | None
    classes: int


def average_quality(qualities: Iterable[ClassQuality]) -> QualityAverage:
    """Average PQ, SQ and RQ over classes with at least one true or predicted segment (missed classes count)."""
    present = [quality for quality in qualities if quality.segments]
    return _mean(present)


def average_quality_thesis_code(qualities: Iterable[ClassQuality]) -> QualityAverage:
    """Average as the thesis's code does: only over classes that were PREDICTED at least once.

    A class that is in the room and was never predicted does not lower the average (PROTOCOLS section 3, metrics).
    """
    return _mean([quality for quality in qualities if quality.predicted])


def _mean(qualities: list[ClassQuality]) -> QualityAverage:
    if not qualities:
        return QualityAverage(None, None, None, 0)
    return QualityAverage(
        float(np.mean([q.pq for q in qualities])),
        float(np.mean([q.sq for q in qualities])),
        float(np.mean([q.rq for q in qualities])),
        len(qualities),
    )


def drop_small(labels: np.ndarray, minimum_points: float) -> np.ndarray:
    """Return (N,) labels with every label of fewer than `minimum_points` points set to void (the thesis's code)."""
    values, inverse, counts = np.unique(labels, return_inverse=True, return_counts=True)
    kept_values = np.where(counts >= minimum_points, values, VOID)
    return kept_values[inverse].astype(labels.dtype) if len(values) else labels.copy()
