"""Tables 2.1 to 2.4 in the thesis's layout, out of what every arm made of every scene."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.experiments.mapping.figures_of_merit import pooled_curves
from benchmarks.experiments.mapping.measuring import Outcome
from stages.kit.measurement.average_precision import (
    PrecisionRecall,
    average_precision,
    average_precision_thesis_code,
    mean_precision,
)
from stages.kit.measurement.panoptic_quality import (
    ClassQuality,
    QualityAverage,
    average_quality,
    average_quality_thesis_code,
)
from stages.kit.measurement.tables import Cell, Table

PUBLISHED = Path(__file__).resolve().parents[2] / "expectations" / "thesis_mapping.toml"
ALL = "all"


@dataclass(frozen=True)
class Summary:
    """One arm over some scenes: sums by class first, averages over classes then."""

    qualities: Mapping[str, ClassQuality]
    qualities_thesis_code: Mapping[str, ClassQuality]
    instances: Mapping[str, PrecisionRecall]
    boxes: Mapping[str, PrecisionRecall]
    boxes_refined: Mapping[str, PrecisionRecall]


def read_published() -> dict[str, Any]:
    """Return what the thesis prints (benchmarks/expectations/thesis_mapping.toml), percentages."""
    return tomllib.loads(PUBLISHED.read_text())


def summarise(outcomes: Sequence[Outcome], classes: Sequence[str], things: Sequence[str]) -> Summary:
    """Add up the outcomes of one arm. Only `classes` take part; instances and boxes are of `things` alone."""

    def added(of: str) -> dict[str, ClassQuality]:
        return {
            name: sum((getattr(outcome, of).get(name, ClassQuality()) for outcome in outcomes), ClassQuality())
            for name in classes
        }

    def pooled(of: str) -> dict[str, PrecisionRecall]:
        curves = pooled_curves(outcomes, of)
        return {name: curves[name] for name in things if name in curves}

    return Summary(
        added("qualities"), added("qualities_thesis_code"),
        pooled("instances"), pooled("boxes"), pooled("boxes_refined"),
    )  # fmt: skip


def averages(summary: Summary, stuff: Sequence[str]) -> dict[str, QualityAverage]:
    """Return the averages over `all`, `stuff` and `thing` classes that are there or were predicted."""
    groups = {
        ALL: summary.qualities,
        "stuff": {name: quality for name, quality in summary.qualities.items() if name in stuff},
        "thing": {name: quality for name, quality in summary.qualities.items() if name not in stuff},
    }
    return {name: average_quality(group.values()) for name, group in groups.items()}


def figures(summary: Summary, stuff: Sequence[str]) -> dict[str, float]:
    """Return every measure of the summary by name, shares in [0, 1]; what is undefined is left out."""
    values: dict[str, float | None] = {}
    for group, mean in averages(summary, stuff).items():
        suffix = "" if group == ALL else f"_{group}"
        values |= {f"pq{suffix}": mean.pq, f"sq{suffix}": mean.sq, f"rq{suffix}": mean.rq}
    code = average_quality_thesis_code(summary.qualities_thesis_code.values())
    values |= {"pq_thesis_code": code.pq, "sq_thesis_code": code.sq, "rq_thesis_code": code.rq}
    for name, quality in summary.qualities.items():
        if quality.segments:
            values |= {f"pq_{name}": quality.pq, f"rq_{name}": quality.rq}
            values[f"sq_{name}"] = quality.sq if quality.true_positives else None
    for measure, classes in (
        ("instance_ap", summary.instances), ("box_ap", summary.boxes), ("box_ap_refined", summary.boxes_refined)
    ):  # fmt: skip
        for suffix, form in (("", average_precision), ("_thesis_code", average_precision_thesis_code)):
            by_class = {name: form(curve) for name, curve in classes.items()}
            values[f"{measure}{suffix}"] = mean_precision(list(by_class.values()))
            values |= {f"{measure}{suffix}_{name}": value for name, value in by_class.items()}
    return {name: value for name, value in values.items() if value is not None}


def all_figures(outcomes: Mapping[tuple[str, str], Outcome], published: Mapping[str, Any]) -> dict[str, float]:
    """Return `<arm>/<scene or all>/<measure>` -> share, of outcomes by arm and scene."""
    stuff, things = published["stuff"], published["things"]
    metrics: dict[str, float] = {}
    for arm in dict.fromkeys(arm for arm, _ in outcomes):
        own = {scene: outcome for (name, scene), outcome in outcomes.items() if name == arm}
        for case, chosen in {ALL: list(own.values()), **{scene: [o] for scene, o in own.items()}}.items():
            summary = summarise(chosen, [*stuff, *things], things)
            metrics |= {f"{arm}/{case}/{name}": value for name, value in figures(summary, stuff).items()}
    return metrics


def make_tables(metrics: Mapping[str, float], arms: Sequence[str], published: Mapping[str, Any]) -> list[Table]:
    """Return the four tables: percentages, our arms first, then the thesis's printed rows as context."""
    stuff, things = published["stuff"], published["things"]
    scenes = sorted({key.split("/")[1] for key in metrics} - {ALL})

    def get(arm: str, case: str, measure: str) -> Cell:
        value = metrics.get(f"{arm}/{case}/{measure}")
        return None if value is None else round(100 * value, 1)

    def printed(row: Mapping[str, float], names: Sequence[str]) -> tuple[Cell, ...]:
        return tuple(row.get(name) for name in names)

    by_scene: list[tuple[Cell, ...]] = []
    own = ("pq", "sq", "rq", "instance_ap", "instance_ap_thesis_code", "pq_thesis_code")
    for scene in [*scenes, ALL]:
        by_scene += [(scene, arm, *(get(arm, scene, measure) for measure in own)) for arm in arms]
        for row, values in published["table_2_1"].items():
            if scene in values:
                value = values[scene]
                code = (None, value["instance_ap"], None)
                by_scene.append((scene, row, *printed(value, ("pq", "sq", "rq")), *code))
    groups = [ALL, "stuff", "thing", *stuff, *things]
    by_class: list[tuple[Cell, ...]] = []
    for arm in arms:
        for measure in ("pq", "sq", "rq"):
            names = [measure if group == ALL else f"{measure}_{group}" for group in groups]
            by_class.append((arm, measure.upper(), *(get(arm, ALL, name) for name in names)))
    for row, values in published["table_2_2"].items():
        by_class += [(row, measure.upper(), *printed(values[measure], groups)) for measure in ("pq", "sq", "rq")]
    columns = [ALL, *things]

    def of_things(rows: Sequence[tuple[str, str]], table: str) -> tuple[tuple[Cell, ...], ...]:
        lines: list[tuple[Cell, ...]] = []
        for arm in arms:
            for title, measure in rows:
                names = [measure if name == ALL else f"{measure}_{name}" for name in columns]
                lines.append((arm, title, *(get(arm, ALL, name) for name in names)))
        return (*lines, *((row, "printed", *printed(values, columns)) for row, values in published[table].items()))

    context = "Rows that begin with `Han 2024:` are what the thesis prints, for context: no result of this program."
    return [
        Table(
            "by_sequence", "2.1 Averages over classes by sequence [%]",
            ("sequence", "arm", "PQ", "SQ", "RQ", "AP", "AP, thesis's code", "PQ, thesis's code"), tuple(by_scene),
            "Missed classes count, unmapped surface counts; `thesis's code`: on the map's own vertices, classes that "
            f"were never predicted left out, recall that is never reached given the last precision. {context}",
        ),
        Table(
            "by_class", "2.2 Panoptic quality by class [%]", ("arm", "", *groups), tuple(by_class),
            f"Sums over all sequences first. {context}",
        ),
        Table(
            "instances", "2.3 Instance AP at IoU 0.5 by class [%]", ("arm", "form", *columns),
            of_things((("standard", "instance_ap"), ("thesis's code", "instance_ap_thesis_code")), "table_2_3"),
            f"Predictions of all sequences in one curve a class. The printed rows are of the thesis's code. {context}",
        ),
        Table(
            "boxes", "2.4 AP of upright boxes at IoU 0.5 by class [%]", ("arm", "form", *columns),
            of_things(
                (
                    ("before", "box_ap"),
                    ("refined", "box_ap_refined"),
                    ("before, thesis's code", "box_ap_thesis_code"),
                    ("refined, thesis's code", "box_ap_refined_thesis_code"),
                ),
                "table_2_4",
            ),
            "True boxes are those of the annotated mesh; the thesis took them from the map's own vertices, which is "
            f"kinder to parts that were not seen. {context}",
        ),
    ]  # fmt: skip
