"""Measures over rooms: sums and rankings are pooled before they become a figure; intervals resample whole rooms."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scenewright.stages.evaluate import stuff_classes
from scenewright.stages.kit.measurement.average_precision import (
    PrecisionRecall,
    average_precision,
    average_precision_thesis_code,
    mean_precision,
)
from scenewright.stages.kit.measurement.panoptic_quality import (
    ClassQuality,
    average_quality,
    average_quality_thesis_code,
)

from benchmarks.experiment import Measure
from benchmarks.experiments.scenenn.outcomes import Outcome, Ranked

Figure = Callable[[Sequence[Outcome]], float | None]
ANY = "any"


def summed_qualities(outcomes: Sequence[Any], field: str = "qualities") -> dict[str, ClassQuality]:
    """Return the sums of eq. 2.15 by class over all rooms."""
    sums: dict[str, ClassQuality] = {}
    for outcome in outcomes:
        for name, quality in getattr(outcome, field).items():
            sums[name] = sums.get(name, ClassQuality()) + quality
    return sums


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
                rooms.setdefault(name, []).append(found)
    return {name: pooled_curve(found) for name, found in sorted(rooms.items())}


def quality_measure(which: str, kind: str = "all") -> Figure:
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


def precision_measure(field: str, form: Callable[[PrecisionRecall], float | None] = average_precision) -> Figure:
    """Return the mean over classes of average precision of `instances`, `boxes` or `boxes_refined`."""

    def measure(outcomes: Sequence[Outcome]) -> float | None:
        return mean_precision([form(curve) for curve in pooled_curves(outcomes, field).values()])

    return measure


MEASURES = {
    "pq": Measure(quality_measure("pq")),
    "sq": Measure(quality_measure("sq"), interval=False),
    "rq": Measure(quality_measure("rq"), interval=False),
    "pq_stuff": Measure(quality_measure("pq", "stuff"), interval=False),
    "pq_thing": Measure(quality_measure("pq", "thing"), interval=False),
    "pq_thesis_code": Measure(quality_thesis_code, interval=False),
    "instance_ap": Measure(precision_measure("instances")),
    "instance_ap_thesis_code": Measure(precision_measure("instances", average_precision_thesis_code), interval=False),
    "box_ap": Measure(precision_measure("boxes")),
    "box_ap_refined": Measure(precision_measure("boxes_refined")),
}


def class_figures(outcomes: Sequence[Outcome]) -> dict[str, float | None]:
    """Return PQ, SQ, RQ and average precision of every class that is true, as `pq_chair`, `instance_ap_chair`."""
    values: dict[str, float | None] = {}
    for name, quality in sorted(summed_qualities(outcomes).items()):
        if quality.true_positives + quality.false_negatives:
            values |= {f"{which}_{name}": getattr(quality, which) for which in ("pq", "sq", "rq")}
    for measure, field in (("instance_ap", "instances"), ("box_ap", "boxes"), ("box_ap_refined", "boxes_refined")):
        for name, curve in pooled_curves(outcomes, field).items():
            values[f"{measure}_{name}"] = average_precision(curve)
            values[f"{measure}_thesis_code_{name}"] = average_precision_thesis_code(curve)
    return {name: value for name, value in values.items() if value is not None}
