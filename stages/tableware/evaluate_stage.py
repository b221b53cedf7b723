"""The step `tableware evaluate`: policies over many seeded tables, in one table of means and intervals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scenewright.schemas.tableware_trial import EvaluatedPolicy, TablewareEvaluation, TablewareEvaluationFile
from scenewright.stages.kit.measurement.bootstrap import bootstrap_interval
from scenewright.stages.kit.stage import Context
from scenewright.stages.tableware.options import TierName
from scenewright.stages.tableware.parameters import EvaluateParameters
from scenewright.stages.tableware.planning.choice import chances_of, declared_policy, time_model
from scenewright.stages.tableware.planning.policy import Policy
from scenewright.stages.tableware.planning.time_model import Chances, TimeModel
from scenewright.stages.tableware.sight import Eyes
from scenewright.stages.tableware.simulation.fast import FastWorld
from scenewright.stages.tableware.simulation.trial import Trial, World, run_in, truth
from scenewright.stages.tableware.world.items import Table
from scenewright.stages.tableware.world.scenes import make_table

BASELINE = "random"
"""The policy against which ratios are taken."""
SAME = 1e-6
"""Difference of time below which two policies are alike [s]."""


@dataclass(frozen=True)
class OnTable:
    """What a policy came to on one table: means over the draws."""

    seconds: float
    objects_per_trip: float
    failures: tuple[str, ...]


def run(*, parameters: EvaluateParameters, context: Context) -> TablewareEvaluation:
    """Compare policies."""
    times = parameters if "times_of" in parameters.model_fields_set else _with_times_of(parameters, parameters.tier)
    model, chances = time_model(times), chances_of(parameters.chances)
    seeds = range(parameters.first_scene, parameters.first_scene + parameters.scenes)
    by_policy: dict[str, list[OnTable]] = {policy: [] for policy in dict.fromkeys(parameters.policies)}
    for seed in context.progress.track(seeds, total=parameters.scenes, description="scenes"):
        table = make_table(parameters.tier, seed)
        for policy, rows in by_policy.items():
            rows.append(_on_table(table, policy, seed, model, chances, parameters))
    results = tuple(_row(policy, rows, by_policy, parameters) for policy, rows in by_policy.items())
    file = TablewareEvaluationFile(
        chances=parameters.chances,
        sight=parameters.sight,
        delay=parameters.delay,
        draws=parameters.draws,
        first_scene=parameters.first_scene,
        rows=results,
    )
    file.write(context.output / "results.json")
    context.output.joinpath("table.md").write_text(as_markdown(file), encoding="utf-8")
    summary = {"tier": parameters.tier, "scenes": parameters.scenes, "policies": len(results)}
    return TablewareEvaluation(root=context.output, summary=summary)


def _with_times_of(parameters: EvaluateParameters, tier: TierName) -> EvaluateParameters:
    return parameters.model_copy(update={"times_of": tier})


def _on_table(
    table: Table, name: str, seed: int, model: TimeModel, chances: Chances, parameters: EvaluateParameters
) -> OnTable:
    """Return what a policy comes to on a table, every policy with the same luck."""
    sure = chances.sure and not chances.noise
    declared = declared_policy(name)
    same = None if declared.draws else declared.make(model, chances, seed)
    done: list[Trial] = []
    for draw in range(1 if sure and same is not None and parameters.sight == "truth" else parameters.draws):
        policy: Policy = same or declared.make(model, chances, 1000 * seed + draw)
        see: Callable[[World], Table] = truth
        if parameters.sight == "image":
            see = Eyes(seed + 100_003 * draw, "usual", "dark_on_white", parameters.least_confidence)
        done.append(run_in(FastWorld(table, model, chances, (seed, draw)), policy, see))
    return OnTable(
        float(np.mean([trial.seconds for trial in done])),
        float(np.mean([trial.objects_per_trip for trial in done])),
        tuple(trial.failure for trial in done),
    )


def _row(
    policy: str, rows: list[OnTable], by_policy: dict[str, list[OnTable]], parameters: EvaluateParameters
) -> EvaluatedPolicy:
    seconds = np.array([row.seconds for row in rows])
    objects = np.array([row.objects_per_trip for row in rows])
    time, per_trip = (bootstrap_interval(values, np.random.default_rng(0)) for values in (seconds, objects))
    assert time is not None and per_trip is not None  # there is at least one scene
    baseline = by_policy.get(BASELINE)
    failures = [failure for row in rows for failure in row.failures]
    share = None
    rivals = declared_policy(policy).rivals
    if rivals and all(rival in by_policy for rival in rivals):
        better = np.min([[row.seconds for row in by_policy[rival]] for rival in rivals], axis=0)
        share = float(np.mean(seconds <= better + SAME))
    return EvaluatedPolicy(
        policy=policy,
        tier=parameters.tier,
        tables=len(rows),
        trials=len(failures),
        time=time.value,
        time_interval=(time.low, time.high),
        objects_per_trip=per_trip.value,
        objects_per_trip_interval=(per_trip.low, per_trip.high),
        time_ratio=None if baseline is None else float(np.mean([row.seconds for row in baseline]) / seconds.mean()),
        objects_per_trip_ratio=None
        if baseline is None
        else float(objects.mean() / np.mean([row.objects_per_trip for row in baseline])),
        failure_rate=float(np.mean([failure != "" for failure in failures])),
        failures_policy=failures.count("policy"),
        failures_perception=failures.count("perception"),
        no_slower_share=share,
    )


def as_markdown(file: TablewareEvaluationFile) -> str:
    """Return the results as a table."""
    lines = [
        f"Chances: {file.chances}; the policies see: {file.sight}; delay {file.delay:g} s; {file.draws} draws a scene, "
        f"scenes from seed {file.first_scene}. Means with 95 % bootstrap intervals over scenes; ratios against Random.",
        "",
        "| tier | policy | scenes | seconds | objects per trip | time ratio | objects ratio | failed trials "
        "| of perception | no slower than Pull and Stack |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]

    def ratio(value: float | None) -> str:
        return "-" if value is None else f"{value:.2f}"

    for row in file.rows:
        low, high = row.time_interval
        least, most = row.objects_per_trip_interval
        share = "-" if row.no_slower_share is None else f"{100 * row.no_slower_share:.0f} %"
        lines.append(
            f"| {row.tier} | `{row.policy}` | {row.tables} | {row.time:.1f} [{low:.1f}, {high:.1f}] "
            f"| {row.objects_per_trip:.2f} [{least:.2f}, {most:.2f}] | {ratio(row.time_ratio)} "
            f"| {ratio(row.objects_per_trip_ratio)} | {100 * row.failure_rate:.1f} % of {row.trials} "
            f"| {row.failures_perception} | {share} |"
        )
    return "\n".join(lines) + "\n"
