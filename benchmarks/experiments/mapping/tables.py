"""The tables of the benchmark in the layout of the thesis's tables 2.1 to 2.4, and a headline over cases."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.experiments.mapping.arms import SHOWN
from benchmarks.experiments.mapping.figures_of_merit import (
    MEASURES,
    pooled_curves,
    quality_measure,
    summed_qualities,
)
from benchmarks.generated_rooms import CLUTTER
from benchmarks.results import Results, seeds_line
from benchmarks.tabulation import differences_table, figures_table, markdown, number, percent
from stages.evaluate.truth import stuff_classes
from stages.kit.measurement.average_precision import average_precision, average_precision_thesis_code
from stages.kit.measurement.panoptic_quality import ClassQuality

PRINTED = Path(__file__).resolve().parents[2] / "expectations" / "thesis_mapping.toml"
HEADLINE = (
    "pq", "sq", "rq", "instance_ap", "instance_ap_thesis_code", "box_ap", "box_ap_refined"
)  # fmt: skip


def table(results: Results) -> str:
    """Return table.md."""
    shown = SHOWN if SHOWN in results.cases else results.cases[0]
    parameters = results.bench.parameters
    return "\n".join(
        [
            seeds_line(results)
            + f"Generated rooms, clutter {CLUTTER}, {parameters.frames} frames of 640x480 each, depth noise, voxels of "
            f"{1000 * parameters.voxel_size:g} mm in every arm. Shares in per cent. Missed classes count; columns "
            "named for the thesis's code leave them out and inflate.\n",
            *(figures_table(results, case, HEADLINE, digits=1, scale=100.0) for case in results.cases),
            speed(results),
            differences_table(results, digits=1, scale=100.0),
            by_room(results, shown),
            quality_by_class(results, shown),
            precision_by_class(results, shown, "instances", "Table 2.3's layout: instance AP at IoU 0.5"),
            precision_by_class(results, shown, "boxes", "Table 2.4's layout: oriented boxes as observed"),
            precision_by_class(results, shown, "boxes_refined", "Table 2.4's layout: oriented boxes, refined"),
            printed_by_the_thesis(),
        ]
    )


def speed(results: Results) -> str:
    """Frames a second of every arm in every case."""
    arms = results.arms()
    rows = [(case, *(number(results.value(arm, case, "frames_per_second")) for arm in arms)) for case in results.cases]
    return markdown("Frames/s", ("case", *arms), rows)


def by_room(results: Results, case: str) -> str:
    """Table 2.1: PQ, SQ, RQ and instance AP of every room."""
    arms = results.arms(case)
    rows = []
    for room in results.seeds(case):
        row = [room]
        for arm in arms:
            own = [outcome] if (outcome := results.get(arm, case, room)) else []
            pq, sq, rq, ap = (percent(MEASURES[m].of(own)) for m in ("pq", "sq", "rq", "instance_ap"))
            row.append(f"{pq} ({sq}, {rq}), {ap}")
        rows.append(row)
    head = ("room", *(f"{results.experiment.arms[arm]}: PQ (SQ, RQ), AP" for arm in arms))
    return markdown(f"Table 2.1's layout: every room, case {case}", head, rows)


def quality_by_class(results: Results, case: str) -> str:
    """Table 2.2: PQ, SQ, RQ over all, stuff, thing, and by class; missed classes count."""
    sums = {arm: summed_qualities(results.of(arm, case)) for arm in results.arms(case)}
    true = sorted({n for found in sums.values() for n, q in found.items() if q.true_positives + q.false_negatives})
    stuff = stuff_classes()
    classes = [n for n in true if n in stuff] + [n for n in true if n not in stuff]
    rows = []
    for arm, found in sums.items():
        for which in ("pq", "sq", "rq"):
            own = results.of(arm, case)
            groups = [percent(quality_measure(which, kind)(own)) for kind in ("all", "stuff", "thing")]
            cells = [_class_cell(found.get(name, ClassQuality()), which) for name in classes]
            rows.append((results.experiment.arms[arm], which.upper(), *groups, *cells))
    return markdown(f"Table 2.2's layout: by class, case {case}", ("arm", "", "all", "stuff", "thing", *classes), rows)


def _class_cell(quality: ClassQuality, which: str) -> str:
    if which == "sq" and not quality.true_positives:
        return "–"
    return percent(getattr(quality, which))


def precision_by_class(results: Results, case: str, field: str, title: str) -> str:
    """Tables 2.3 and 2.4: average precision by class, in the standard form; the thesis's form in the last column."""
    found = {arm: pooled_curves(results.of(arm, case), field) for arm in results.arms(case)}
    classes = sorted({name for each in found.values() for name, curve in each.items() if curve.true_count})
    rows = []
    for arm, each in found.items():
        values = [average_precision(each[name]) if name in each else 0.0 for name in classes]
        inflated = [average_precision_thesis_code(each[name]) if name in each else 0.0 for name in classes]
        rows.append(
            (
                results.experiment.arms[arm],
                percent(_mean(values)),
                *(percent(v) for v in values),
                percent(_mean(inflated)),
            )
        )
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
