"""The measures over the thesis's ten classes, and what the thesis prints beside them."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

from scenewright.stages.kit.measurement.average_precision import average_precision_thesis_code

from benchmarks.experiment import Measure
from benchmarks.experiments.scenenn.figures_of_merit import MEASURES as OF_MAPS
from benchmarks.experiments.scenenn.figures_of_merit import class_figures, precision_measure
from benchmarks.experiments.scenenn.outcomes import Outcome
from benchmarks.tabulation import MISSING, markdown

ALL = "all"
PRINTED = Path(__file__).resolve().parents[2] / "expectations" / "thesis_mapping.toml"
MEASURES = OF_MAPS | {
    f"{name}_thesis_code": Measure(precision_measure(field, average_precision_thesis_code), interval=False)
    for name, field in (("box_ap", "boxes"), ("box_ap_refined", "boxes_refined"))
}


@cache
def read_published() -> dict[str, Any]:
    """Return what the thesis prints (benchmarks/expectations/thesis_mapping.toml), percentages."""
    return tomllib.loads(PRINTED.read_text(encoding="utf-8"))


def of_ten(outcome: Outcome) -> Outcome:
    """Return what of an outcome is of the thesis's ten classes; instances and boxes are of things alone."""
    things = read_published()["things"]
    kept = {
        "qualities": [*read_published()["stuff"], *things],
        "qualities_thesis_code": [*read_published()["stuff"], *things],
        **dict.fromkeys(("instances", "boxes", "boxes_refined"), things),
    }
    changes: dict[str, Any] = {
        of: {name: value for name, value in getattr(outcome, of).items() if name in names} for of, names in kept.items()
    }
    return replace(outcome, **changes)


def all_figures(outcomes: Sequence[Outcome]) -> dict[str, float | None]:
    """Return every measure, and those of every class."""
    return {name: measure.of(outcomes) for name, measure in MEASURES.items()} | class_figures(outcomes)


def printed(scenes: Sequence[str]) -> str:
    """Return what the thesis prints, of these sequences and of every class: context, no result of this program."""
    published = read_published()
    columns = [ALL, *published["things"]]
    groups = [ALL, "stuff", "thing", *published["stuff"], *published["things"]]

    def cells(row: Mapping[str, float], names: Sequence[str]) -> list[str]:
        return [f"{row[name]:.1f}" if name in row else MISSING for name in names]

    own = ("pq", "sq", "rq", "instance_ap")
    by_scene = [
        (scene, name, *cells(values[scene], own))
        for scene in scenes
        for name, values in published["table_2_1"].items()
        if scene in values
    ]
    by_class = [
        (name, which.upper(), *cells(values[which], groups))
        for name, values in published["table_2_2"].items()
        for which in own[:3]
    ]
    tables = [
        markdown("As printed, 2.1: by sequence [%]", ("sequence", "", "PQ", "SQ", "RQ", "instance AP"), by_scene),
        markdown("As printed, 2.2: panoptic quality by class [%]", ("", "", *groups), by_class),
    ]
    for number, title in (("3", "instance AP at IoU 0.5"), ("4", "AP of upright boxes at IoU 0.5")):
        rows = [(name, *cells(values, columns)) for name, values in published[f"table_2_{number}"].items()]
        tables.append(markdown(f"As printed, 2.{number}: {title} by class [%]", ("", *columns), rows))
    return "\n".join(tables)
