"""Measures over rooms: sums and rankings are pooled before they become a figure; intervals resample whole rooms."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.mapping.experiment import Outcome
from stages.evaluate.truth import stuff_classes
from stages.kit.measurement.average_precision import (
    Candidates,
    PrecisionRecall,
    average_precision,
    average_precision_thesis_code,
    match_greedily,
    mean_precision,
)
from stages.kit.measurement.bootstrap import Interval, figure_interval, paired_interval
from stages.kit.measurement.panoptic_quality import ClassQuality, average_quality, average_quality_thesis_code

Measure = Callable[[Sequence[Outcome]], float | None]
ANY = "any"
RESAMPLES = 200


def summed_qualities(outcomes: Sequence[Outcome], field: str = "qualities") -> dict[str, ClassQuality]:
    """Return the sums of eq. 2.15 by class over all rooms."""
    sums: dict[str, ClassQuality] = {}
    for outcome in outcomes:
        for name, quality in getattr(outcome, field).items():
            sums[name] = sums.get(name, ClassQuality()) + quality
    return sums


@dataclass(frozen=True)
class Ranked:
    """Predictions of one class in one room with whether each found something true. Matching never crosses rooms, so
    that it is done once and pooling is a sort."""

    confidence: np.ndarray
    hits: np.ndarray
    true_count: int


def ranked(found: Candidates) -> Ranked:
    """Match one room's predictions of a class (`average_precision.match_greedily`); remembered by the object."""
    key = id(found)
    if key not in _RANKED:
        matches = match_greedily(found.iou, found.confidence)
        order = [row for row, _ in matches]
        hits = np.array([truth is not None for _, truth in matches], dtype=float)
        # The object is kept beside, so that its id stays its own.
        _RANKED[key] = (found, Ranked(found.confidence[order], hits, found.iou.shape[1]))
    return _RANKED[key][1]


_RANKED: dict[int, tuple[Candidates, Ranked]] = {}


def pooled_curve(rooms: Sequence[Ranked]) -> PrecisionRecall:
    """Return the precision-recall curve of one class over rooms; ties in confidence: earlier room first."""
    confidence = np.concatenate([np.zeros(0), *(room.confidence for room in rooms)])
    hits = np.concatenate([np.zeros(0), *(room.hits for room in rooms)])[np.argsort(-confidence, kind="stable")]
    true_count = sum(room.true_count for room in rooms)
    found = np.cumsum(hits)
    precision = found / np.arange(1, len(hits) + 1)
    recall = found / true_count if true_count else np.zeros(len(hits))
    return PrecisionRecall(precision, recall, true_count)


def pooled_curves(outcomes: Sequence[Outcome], field: str) -> dict[str, PrecisionRecall]:
    """Return the precision-recall curve of every class, the predictions of all rooms ranked together."""
    rooms: dict[str, list[Ranked]] = {}
    for outcome in outcomes:
        for name, found in getattr(outcome, field).items():
            if name != ANY:
                rooms.setdefault(name, []).append(ranked(found))
    return {name: pooled_curve(found) for name, found in sorted(rooms.items())}


def quality_measure(which: str, kind: str = "all") -> Measure:
    """Return the measure `pq`, `sq` or `rq`, the mean over the classes that are true or predicted; `kind` is all,
    stuff or thing."""

    def measure(outcomes: Sequence[Outcome]) -> float | None:
        stuff = stuff_classes()
        sums = {
            name: quality
            for name, quality in summed_qualities(outcomes).items()
            if kind == "all" or (name in stuff) == (kind == "stuff")
        }
        mean = average_quality(sums.values())
        return getattr(mean, which)

    return measure


def quality_thesis_code(outcomes: Sequence[Outcome]) -> float | None:
    """PQ as the thesis's code forms it: on the map's own vertices, classes never predicted left out."""
    return average_quality_thesis_code(summed_qualities(outcomes, "qualities_thesis_code").values()).pq


def precision_measure(field: str, form: Callable[[PrecisionRecall], float | None] = average_precision) -> Measure:
    """Return the mean over classes of average precision of `instances`, `boxes` or `boxes_refined`."""

    def measure(outcomes: Sequence[Outcome]) -> float | None:
        return mean_precision([form(curve) for curve in pooled_curves(outcomes, field).values()])

    return measure


def frames_per_second(outcomes: Sequence[Outcome]) -> float | None:
    """Frames over the wall clock of geometric segmentation, fusion with the masks, and integration."""
    seconds = sum(outcome.seconds for outcome in outcomes)
    return sum(outcome.frames for outcome in outcomes) / seconds if seconds else None


MEASURES: dict[str, Measure] = {
    "pq": quality_measure("pq"),
    "sq": quality_measure("sq"),
    "rq": quality_measure("rq"),
    "pq_stuff": quality_measure("pq", "stuff"),
    "pq_thing": quality_measure("pq", "thing"),
    "pq_thesis_code": quality_thesis_code,
    "instance_ap": precision_measure("instances"),
    "instance_ap_thesis_code": precision_measure("instances", average_precision_thesis_code),
    "box_ap": precision_measure("boxes"),
    "box_ap_refined": precision_measure("boxes_refined"),
    "frames_per_second": frames_per_second,
}


def interval(outcomes: Sequence[Outcome], measure: Measure, random: np.random.Generator) -> Interval | None:
    """Return a measure with its 95 % percentile bootstrap interval over rooms; None where it is undefined."""
    return figure_interval(measure, outcomes, random, resamples=RESAMPLES)


def difference(
    first: Sequence[Outcome], second: Sequence[Outcome], measure: Measure, random: np.random.Generator
) -> Interval | None:
    """Return first minus second with the interval over rooms, both on the same draws (paired)."""
    return paired_interval(measure, first, second, random, resamples=RESAMPLES)
