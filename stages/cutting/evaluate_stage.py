"""The step `cutting evaluate`: methods over many seeded goals, in one table of means and intervals."""

from __future__ import annotations

from contextlib import closing

import numpy as np
from scenewright.schemas.cutting_model import CuttingModel
from scenewright.schemas.cutting_plan import CuttingEvaluation, CuttingEvaluationFile, EvaluatedCutting
from scenewright.stages.cutting.measure.scores import Scores
from scenewright.stages.cutting.methods import Learned, read_learned
from scenewright.stages.cutting.ours.items import item_of
from scenewright.stages.cutting.parameters import EvaluateParameters
from scenewright.stages.cutting.policy import Goal
from scenewright.stages.cutting.sight.laying import Hand
from scenewright.stages.cutting.sight.perceiving import PerceivingPolicy
from scenewright.stages.cutting.trying import Reached, again, goal_trial, reach
from scenewright.stages.kit.measurement.bootstrap import bootstrap_interval
from scenewright.stages.kit.stage import Context


def run(model: CuttingModel, *, parameters: EvaluateParameters, context: Context) -> CuttingEvaluation:
    """Compare methods on the same goals."""
    learned = read_learned(model)
    rows = []
    for cell in context.progress.track(parameters.cells, total=len(parameters.cells), description="cells"):
        for method in parameters.methods:
            seeds = range(parameters.first_goal, parameters.first_goal + parameters.goals)
            scores = [attempt(learned, method, cell, seed).scores for seed in seeds]
            rows.append(_row(method, cell, scores))
    file = CuttingEvaluationFile(first_goal=parameters.first_goal, rows=tuple(rows))
    file.write(context.output / "results.json")
    context.output.joinpath("table.md").write_text(as_markdown(file), encoding="utf-8")
    summary = {"goals": parameters.goals * len(parameters.cells), "methods": len(parameters.methods)}
    return CuttingEvaluation(root=context.output, summary=summary)


def attempt(learned: Learned, method: str, cell: str, seed: int) -> Reached:
    """Return how well a method reaches the goal of a seed. `scatter` is the scripted cutter, who knows the recipe that
    the goal was cut after and follows it a second time."""
    trial = goal_trial(cell, seed)
    if method == "scatter":
        return again(trial, seed)
    most = len(trial.fragments) + method.startswith("ours")
    if method == "ours_perceived":
        items = [item_of(body, k) for k, body in enumerate(trial.fragments)]
        with closing(Hand()) as hand:
            return reach(PerceivingPolicy(learned.grammar, items, seed), trial, most=most, lie=hand.lay)
    policy = learned.policy(method, Goal(tuple(trial.fragments)), seed)
    return reach(policy, trial, most=most)


def _row(method: str, cell: str, scores: list[Scores]) -> EvaluatedCutting:
    def mean(name: str) -> float:
        return float(np.mean([getattr(each, name) for each in scores]))

    interval = bootstrap_interval(np.array([each.iou for each in scores]), np.random.default_rng(0))
    assert interval is not None  # there is at least one goal
    return EvaluatedCutting(
        method=method,
        cell=cell,
        goals=len(scores),
        iou=interval.value,
        iou_interval=(interval.low, interval.high),
        iou_thesis=mean("iou_thesis"),
        count_exact=mean("count_exact"),
        count_error=mean("count_error"),
        volume_error=mean("volume_error"),
        shape_distance=mean("shape_distance"),
    )


def as_markdown(file: CuttingEvaluationFile) -> str:
    """Return the results as a table."""
    lines = [
        "Overlap of matched fragments, unmatched counted as zero, with 95 % bootstrap intervals over goals.",
        "",
        "| cell | method | goals | overlap | unmatched left out | count right | volume error | shape distance |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in file.rows:
        low, high = row.iou_interval
        lines.append(
            f"| {row.cell} | `{row.method}` | {row.goals} | {row.iou:.3f} [{low:.3f}, {high:.3f}] "
            f"| {row.iou_thesis:.3f} | {100 * row.count_exact:.0f} % | {row.volume_error:.3f} "
            f"| {row.shape_distance:.3f} |"
        )
    return "\n".join(lines) + "\n"
