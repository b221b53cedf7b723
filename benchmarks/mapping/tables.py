"""The tables of the benchmark in the layout of the thesis's tables 2.1 to 2.4, and a headline over cases."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TypeVar

import numpy as np

from benchmarks.mapping.experiment import Outcome
from benchmarks.mapping.figures_of_merit import (
    MEASURES,
    difference,
    interval,
    pooled_curves,
    quality_measure,
    summed_qualities,
)
from stages.evaluate.truth import stuff_classes
from stages.kit.measurement.average_precision import average_precision, average_precision_thesis_code
from stages.kit.measurement.bootstrap import Interval
from stages.kit.measurement.panoptic_quality import ClassQuality

PRINTED = Path(__file__).resolve().parent.parent / "expectations" / "thesis_mapping.toml"
Results = Mapping[tuple[str, str], Sequence[Outcome]]
"""(arm, case) -> outcomes, one a room, rooms in the same order everywhere."""
AnyOutcome = TypeVar("AnyOutcome")


def percent(value: float | None) -> str:
    """Format a share."""
    return "–" if value is None else f"{100 * value:.1f}"


def with_interval(found: Interval | None) -> str:
    """Format a share with its interval."""
    if found is None:
        return "–"
    return f"{100 * found.value:.1f} [{100 * found.low:.1f}, {100 * found.high:.1f}]"


def markdown(title: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return one table with its title."""
    lines = [f"### {title}", "", "| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows), ""])


def rows_of(
    results: Mapping[tuple[str, str], Sequence[AnyOutcome]], arms: Mapping[str, str], cases: Sequence[str]
) -> Iterator[tuple[str, str, Sequence[AnyOutcome]]]:
    """Yield (case, title of the arm, its outcomes), case by case, for all that were run. `arms`: name -> title."""
    for case in cases:
        for arm, title in arms.items():
            if outcomes := results.get((arm, case)):
                yield case, title, outcomes


def headline(results: Results, arms: Mapping[str, str], cases: Sequence[str]) -> str:
    """Every arm in every case, PQ and the average precisions with intervals over rooms."""
    head = (
        "case",
        "arm",
        "rooms",
        "PQ",
        "SQ",
        "RQ",
        "instance AP",
        "AP, thesis's code",
        "box AP",
        "box AP refined",
        "frames/s",
    )
    rows = []
    for case, title, outcomes in rows_of(results, arms, cases):
        random = np.random.default_rng(0)
        cells = [with_interval(interval(outcomes, MEASURES["pq"], random))]
        cells += [percent(MEASURES[name](outcomes)) for name in ("sq", "rq")]
        cells += [with_interval(interval(outcomes, MEASURES["instance_ap"], random))]
        cells += [percent(MEASURES["instance_ap_thesis_code"](outcomes)), percent(MEASURES["box_ap"](outcomes))]
        cells += [with_interval(interval(outcomes, MEASURES["box_ap_refined"], random))]
        cells += [f"{MEASURES['frames_per_second'](outcomes) or 0:.1f}"]
        rows.append((case, title, str(len(outcomes)), *cells))
    return markdown("All arms, all cases", head, rows)


def differences(results: Results, cases: Sequence[str]) -> str:
    """What was asked: the thesis's ordering, and ours over the thesis; paired over rooms."""
    pairs = (
        ("thesis_separate", "voxblox++"),
        ("thesis", "thesis_separate"),
        ("thesis", "voxblox++"),
        ("ours", "thesis"),
    )
    rows = []
    for case in cases:
        for better, worse in pairs:
            first, second = results.get((better, case)), results.get((worse, case))
            if not first or not second:
                continue
            cells = []
            for name in ("pq", "instance_ap", "box_ap", "box_ap_refined"):
                found = difference(first, second, MEASURES[name], np.random.default_rng(0))
                cells.append(with_interval(found))
            rows.append((case, f"{better} – {worse}", *cells))
    head = ("case", "difference", "PQ", "instance AP", "box AP", "box AP refined")
    return markdown("Differences in points, paired over rooms", head, rows)


def by_room(results: Results, arms: Mapping[str, str], case: str) -> str:
    """Table 2.1: PQ, SQ, RQ and instance AP of every room."""
    names = [arm for arm in arms if results.get((arm, case))]
    head = ("room", *(f"{arms[arm]}: PQ (SQ, RQ), AP" for arm in names))
    rows = []
    for index, outcome in enumerate(results[names[0], case]):
        row = [outcome.room]
        for arm in names:
            own = [results[arm, case][index]]
            pq, sq, rq, ap = (percent(MEASURES[m](own)) for m in ("pq", "sq", "rq", "instance_ap"))
            row.append(f"{pq} ({sq}, {rq}), {ap}")
        rows.append(row)
    return markdown(f"Table 2.1's layout: every room, case {case}", head, rows)


def quality_by_class(results: Results, arms: Mapping[str, str], case: str) -> str:
    """Table 2.2: PQ, SQ, RQ over all, stuff, thing, and by class; missed classes count."""
    sums = {arm: summed_qualities(results[arm, case]) for arm in arms if results.get((arm, case))}
    true = sorted({n for found in sums.values() for n, q in found.items() if q.true_positives + q.false_negatives})
    stuff = stuff_classes()
    classes = [n for n in true if n in stuff] + [n for n in true if n not in stuff]
    rows = []
    for arm, found in sums.items():
        for which in ("pq", "sq", "rq"):
            groups = [percent(quality_measure(which, kind)(results[arm, case])) for kind in ("all", "stuff", "thing")]
            cells = [_class_cell(found.get(name, ClassQuality()), which) for name in classes]
            rows.append((arms[arm], which.upper(), *groups, *cells))
    return markdown(f"Table 2.2's layout: by class, case {case}", ("arm", "", "all", "stuff", "thing", *classes), rows)


def _class_cell(quality: ClassQuality, which: str) -> str:
    if which == "sq" and not quality.true_positives:
        return "–"
    return percent(getattr(quality, which))


def precision_by_class(results: Results, arms: Mapping[str, str], case: str, field: str, title: str) -> str:
    """Tables 2.3 and 2.4: average precision by class, in the standard form; the thesis's form in the last column."""
    found = {arm: pooled_curves(results[arm, case], field) for arm in arms if results.get((arm, case))}
    classes = sorted({name for each in found.values() for name, curve in each.items() if curve.true_count})
    rows = []
    for arm, each in found.items():
        values = [average_precision(each[name]) if name in each else 0.0 for name in classes]
        inflated = [average_precision_thesis_code(each[name]) if name in each else 0.0 for name in classes]
        rows.append((arms[arm], percent(_mean(values)), *(percent(v) for v in values), percent(_mean(inflated))))
    return markdown(f"{title}, case {case}", ("arm", "all", *classes, "all, thesis's code"), rows)


def _mean(values: Sequence[float | None]) -> float | None:
    defined = [value for value in values if value is not None]
    return float(np.mean(defined)) if defined else None


def printed_by_the_thesis() -> str:
    """The thesis's own figures (SceneNN, other masks, other sensor): context, never compared with."""
    with PRINTED.open("rb") as stream:
        printed = tomllib.load(stream)
    instances, boxes = printed["table_2_3"], printed["table_2_4"]
    rows = []
    for name in dict.fromkeys([*printed["table_2_2"], *instances, *boxes]):
        quality = printed["table_2_2"].get(name)
        cells = [f"{quality[which]['all']:.1f}" if quality else "–" for which in ("pq", "sq", "rq")]
        by_class = list(instances.get(name, {}).values())
        cells += [f"{np.mean(by_class):.1f}" if by_class else "–"]
        cells += [f"{boxes[name]['all']:.1f}" if name in boxes else "–"]
        rows.append((name, *cells))
    head = ("as printed", "PQ", "SQ", "RQ", "instance AP, mean of the classes", "box AP")
    return markdown("Context: what the thesis prints for SceneNN", head, rows)
