"""What was measured, beside a baseline where one is given."""

from __future__ import annotations

from typing import Any

from scenewright.schemas.evaluation import Evaluation
from scenewright.stages.report.figures import GROUPS, all_metrics, metric_groups, read_plots, read_tables
from scenewright.stages.report.page import Page

HEADLINES = (
    "counts/frames",
    "counts/entities",
    "map/pq",
    "map/mesh_recall",
    "map/accuracy_mean_mm",
    "graph/edit_distance",
    "graph/support_f1",
    "counts/support_edges",
    "cad/replaced",
    "replacement/scan2cad_success",
    "counts/joints",
    "plan/goal_reached",
)


def view(page: Page) -> dict[str, Any] | None:
    """Return tables and plots; None without figures."""
    evaluation, baseline = page.given("evaluation", Evaluation), page.given("baseline_evaluation", Evaluation)
    if evaluation is None:
        return None
    groups = metric_groups(evaluation, baseline)
    if not groups:
        return None
    metrics = evaluation.info.metrics
    against_truth = any(not name.startswith("counts/") for name in metrics)
    measures = {measure.key: measure for _, rows in GROUPS for measure in rows}
    return dict(
        groups=groups,
        baseline=baseline is not None,
        has_intervals=any(row.interval for _, rows in groups for row in rows),
        notes=evaluation.info.notes,
        plots=read_plots(evaluation),
        tables=read_tables(evaluation),
        metrics=all_metrics(evaluation),
        tiles=[
            {"name": measures[key].name, "value": measures[key].form(value)}
            for key in HEADLINES
            if (value := metrics.get(key)) is not None
        ],
        figures_text=(
            "Against the ground truth of the generated room. Arrows say which way is better."
            if against_truth
            else "Counts; there is no ground truth to compare with."
        )
        + (
            " Class-agnostic masks name nothing: compare the rows that say “whatever the class”."
            if baseline is not None and metrics.get("map/pq") is not None and baseline_is_nameless(baseline)
            else ""
        ),
    )


def baseline_is_nameless(baseline: Evaluation) -> bool:
    """Whether the baseline's masks have no classes (its class-wise figures are undefined)."""
    theirs = baseline.info.metrics
    return theirs.get("map/pq") is None and theirs.get("map/pq_class_agnostic") is not None
