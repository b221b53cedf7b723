"""Clearing a table, for the page: what was seen, the plan, the trial as pictures and in motion, policies compared."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any

from scenewright.schemas.tableware_detections import TablewareDetections
from scenewright.schemas.tableware_plan import TablewarePlan
from scenewright.schemas.tableware_trial import EvaluatedPolicy, TablewareEvaluation, TablewareTrial
from scenewright.stages.report.images import Picture, animation, from_file
from scenewright.stages.report.page import Page

WIDTH = 1100
"""Largest width of pictures [px]."""
CAPTIONS = {
    "overlay": "What was seen, and how sure that is",
    "detections": "What was seen, and how sure that is",
    "strip": "The plan from above, before each action: green pulls, violet stackings, red jaws, in rings how many are "
    "stacked",
    "keyframes": "The trial from above, the true table before each action",
    "physics": "The trial in physics, after each action",
    "clearing": "The table being cleared",
}


@dataclass(frozen=True)
class TablewareRow:
    """An action of a trial."""

    number: int
    text: str
    time: str
    came: str
    """What came to the bin, what fell, what did not go as planned."""
    wrong: bool


@dataclass(frozen=True)
class TablewareView:
    """Everything the page says about clearing a table."""

    seen: str
    plan: str
    refused: tuple[str, ...]
    impossible: tuple[tuple[str, int], ...]
    """Kinds of reasons with their numbers."""
    reasons: tuple[str, ...]
    trial: str
    cleared: bool
    rows: tuple[TablewareRow, ...]
    compared: str
    policies: tuple[EvaluatedPolicy, ...]
    pictures: dict[str, tuple[Picture, str]]
    """By name, with the caption; what the artifacts have of them."""


def tableware_view(
    detections: TablewareDetections | None,
    plan: TablewarePlan | None,
    trial: TablewareTrial | None,
    evaluation: TablewareEvaluation | None,
    width: int,
) -> TablewareView:
    """Read what there is; pictures are at most `width` wide [px]. Raises BadInput for a picture that cannot be read."""
    folders = {
        "overlay": detections,
        "detections": plan if detections is None else None,
        "strip": plan,
        "keyframes": trial,
        "physics": trial,
    }
    pictures = {
        name: (from_file(path, CAPTIONS[name], width), CAPTIONS[name])
        for name, artifact in folders.items()
        if artifact is not None and (path := artifact.path(f"{name}.png")).is_file()
    }
    if trial is not None and (path := trial.path("clearing.gif")).is_file():
        pictures["clearing"] = (animation(path, CAPTIONS["clearing"]), CAPTIONS["clearing"])
    file = plan.info if plan is not None else None
    done = trial.info if trial is not None else None
    results = evaluation.info if evaluation is not None else None
    statement = compared = ""
    if done is not None:
        statement = f"{done.policy.replace('_', ' ')} in the {done.simulator} simulator: {done.statement}."
    if results is not None:
        compared = (
            f"{results.draws} draws a table, chances: {results.chances.replace('_', ' ')}, the policies see the "
            f"{results.sight}; 95 % bootstrap intervals over tables, ratios against Random."
        )
    return TablewareView(
        seen="" if detections is None else detections.info.statement,
        plan=_plan_text(plan),
        refused=tuple(refusal.message for refusal in file.refused) if file is not None else (),
        impossible=tuple(
            Counter(f"{action.primitive}: {action.kind}".replace("_", " ") for action in file.impossible).most_common()
        )
        if file is not None
        else (),
        reasons=tuple(f"{action.primitive.replace('_', ' ')}: {action.message}" for action in file.impossible)
        if file
        else (),
        trial=statement,
        cleared=done is not None and not done.counts.failure,
        rows=_rows(trial),
        compared=compared,
        policies=results.rows if results is not None else (),
        pictures=pictures,
    )


def _plan_text(plan: TablewarePlan | None) -> str:
    if plan is None:
        return ""
    file = plan.info
    return (
        f"{file.statement[:1].upper()}{file.statement[1:]}. {file.policy.replace('_', ' ')} takes {file.trips} trips "
        f"and {file.seconds:.0f} s when nothing slips; {file.expected_seconds:.0f} s and "
        f"{file.expected_objects_per_trip:.2f} objects a trip are expected over {file.draws} draws."
    )


def _rows(trial: TablewareTrial | None) -> tuple[TablewareRow, ...]:
    if trial is None:
        return ()
    rows = []
    for number, step in enumerate(trial.info.steps, start=1):
        came = f"to the bin: {', '.join(step.binned)}" if step.binned else ""
        wrong = "; ".join(step.troubles)
        text = "; ".join(part for part in (came, wrong) if part)
        rows.append(TablewareRow(number, step.action.words, f"{step.start:.1f}", text, bool(wrong)))
    return tuple(rows)


def view(page: Page) -> dict[str, Any]:
    """Return what there is of a table: what was seen, planned, tried, compared."""
    values = tableware_view(
        page.given("tableware_detections", TablewareDetections),
        page.given("tableware_plan", TablewarePlan),
        page.given("tableware_trial", TablewareTrial),
        page.given("tableware_evaluation", TablewareEvaluation),
        WIDTH,
    )
    return {"tableware": values}
