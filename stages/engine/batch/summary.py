"""Tables about a batch: what came of every scene, why, and the figures of each parameter set."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence

import numpy as np
from scenewright.stages.engine.batch.job import Job
from scenewright.stages.engine.batch.outcomes import MEANINGS, Outcome, is_explained
from scenewright.stages.engine.batch.results import SceneResult
from scenewright.stages.kit.measurement.bootstrap import bootstrap_interval
from scenewright.stages.kit.measurement.tables import Cell, Table

NOT_RUN = "not run"
MANY = 100_000
"""Scenes that the costs are reckoned up to."""
_PATH = re.compile(r"(?<![\w.])~?/[^\s:,;'\")]+")
_NUMBER = re.compile(r"\d+(?:\.\d+)?")


def kind_of(outcome: Outcome) -> str:
    """Return `done`, `explained` or `crashed`."""
    return "done" if outcome == "done" else "explained" if is_explained(outcome) else "crashed"


def without_particulars(reason: str) -> str:
    """Return a reason with paths and numbers taken out, so that equal reasons of different scenes count together."""
    return _NUMBER.sub("#", _PATH.sub("PATH", reason))


def count_table(jobs: Sequence[Job], latest: Mapping[str, SceneResult]) -> Table:
    """Return how many scenes ended how."""
    counts: Counter[Outcome] = Counter(latest[job.name].outcome for job in jobs if job.name in latest)
    rows: list[tuple[Cell, ...]] = [
        (kind_of(outcome), outcome, counts[outcome], text) for outcome, text in MEANINGS.items() if counts[outcome]
    ]
    missing = len(jobs) - counts.total()
    if missing:
        rows.append(("", NOT_RUN, missing, "the batch ended before; run it again"))
    note = f"{len(jobs)} in all. Explained outcomes are results; a crash is a bug of ours or of a library."
    return Table("counts", "Outcomes", ("kind", "outcome", "scenes", "meaning"), tuple(rows), note)


def reason_table(jobs: Sequence[Job], latest: Mapping[str, SceneResult]) -> Table:
    """Return why scenes did not end well, equal reasons together, crashes first, then the most frequent."""
    groups: dict[tuple[str, Outcome, str, str], list[SceneResult]] = defaultdict(list)
    for job in jobs:
        result = latest.get(job.name)
        if result is not None and result.outcome != "done":
            step = result.failed_step or ""
            key = (kind_of(result.outcome), result.outcome, step, without_particulars(result.reason))
            groups[key].append(result)
    ordered = sorted(groups.items(), key=lambda item: (item[0][0] != "crashed", -len(item[1]), item[0]))
    rows = tuple((*key[:3], len(group), group[0].reason, group[0].job) for key, group in ordered)
    columns = ("kind", "outcome", "step", "scenes", "reason of the first", "first")
    return Table("reasons", "Why scenes did not end well", columns, rows)


def accepted_table(jobs: Sequence[Job], latest: Mapping[str, SceneResult]) -> Table:
    """Return outcomes besides ok that the batch file accepts: scenes that ended well, with a step that did not."""
    counts: Counter[tuple[str, str]] = Counter()
    for job in jobs:
        result = latest.get(job.name)
        if result is not None and result.outcome == "done":
            counts.update(result.outcomes.items())
    rows = tuple((step, outcome, count) for (step, outcome), count in sorted(counts.items()))
    return Table("accepted", "Accepted outcomes besides ok", ("step", "outcome", "scenes"), rows)


def measure_names(latest: Mapping[str, SceneResult]) -> list[str]:
    """Return all measures that any scene has, sorted."""
    return sorted({name for result in latest.values() for name in result.measures})


def scene_table(jobs: Sequence[Job], latest: Mapping[str, SceneResult], *, measures: bool) -> Table:
    """Return a row for each scene, in the order of their names; with all measures for machines, without for people."""
    names = measure_names(latest) if measures else []
    columns = (
        "scene",
        "parameters",
        "seed",
        "kind",
        "outcome",
        "exit_code",
        "failed_step",
        "reason",
        "seconds",
        "processor_seconds",
        "peak_memory_mb",
        "megabytes",
        "attempts",
        "host",
        "started",
        "log",
        *names,
    )
    rows: list[tuple[Cell, ...]] = []
    for job in sorted(jobs, key=lambda job: (job.scene, job.parameters or "", -1 if job.seed is None else job.seed)):
        identity: tuple[Cell, ...] = (job.scene, job.parameters, job.seed)
        result = latest.get(job.name)
        if result is None:
            rows.append((*identity, "", NOT_RUN, *[None] * (len(columns) - 5)))
            continue
        rows.append(
            (
                *identity,
                kind_of(result.outcome),
                result.outcome,
                result.exit_code,
                result.failed_step,
                result.reason,
                result.seconds,
                result.processor_seconds,
                round(result.peak_memory_bytes / 1e6, 1),
                round(result.artifact_bytes / 1e6, 3),
                result.attempts,
                result.host,
                result.started,
                f"{job.name}/batch.log",
                *(result.measures.get(name) for name in names),
            )
        )
    return Table("scenes", "Scenes", columns, tuple(rows))


def cost_table(jobs: Sequence[Job], latest: Mapping[str, SceneResult]) -> Table:
    """Return the processor time, bytes and memory of scenes that ended well and lost no worker, for each parameter
    set, and the means times 100,000."""
    costs: dict[str | None, list[tuple[float, float, float]]] = defaultdict(list)
    for job in jobs:
        result = latest.get(job.name)
        if result is not None and result.outcome == "done" and result.attempts == 1 and result.processor_seconds:
            row = (result.processor_seconds, result.artifact_bytes / 1e6, result.peak_memory_bytes / 1e6)
            costs[job.parameters].append(row)
    rows: list[tuple[Cell, ...]] = []
    for parameters, costs_of_group in sorted(costs.items(), key=lambda item: item[0] or ""):
        processor, megabytes, memory = np.array(costs_of_group).T
        rows.append(
            (
                parameters,
                len(costs_of_group),
                float(processor.mean()),
                float(np.median(processor)),
                float(processor.max()),
                float(megabytes.mean()),
                float(memory.max()),
                float(processor.mean()) * MANY / 3600,
                float(megabytes.mean()) * MANY / 1e6,
            )
        )
    columns = (
        "parameters",
        "scenes",
        "core-seconds, mean",
        "median",
        "most",
        "MB, mean",
        "most memory [MB]",
        f"core-hours of {MANY:,}",
        f"TB of {MANY:,}",
    )
    note = "A scene that ran again in a folder of before did only what was missing, and counts with that."
    return Table("costs", "What a scene costs", columns, tuple(rows), note)


def group_table(jobs: Sequence[Job], latest: Mapping[str, SceneResult]) -> Table:
    """Return mean, median and a 95 % interval of the mean of every measure, for each parameter set.

    Seeds of one scene are no independent scenes: their mean counts once, and the interval (percentile bootstrap, seed
    0) resamples scenes. Only scenes that ended well count, so `scenes` and `of` have to be read together.
    """
    scenes: dict[str | None, set[str]] = defaultdict(set)
    values: dict[tuple[str | None, str], dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    for job in jobs:
        scenes[job.parameters].add(job.scene)
        result = latest.get(job.name)
        if result is not None and result.outcome == "done":
            for name, value in result.measures.items():
                values[job.parameters, name][job.scene].append(value)
    rows: list[tuple[Cell, ...]] = []
    for parameters, name in sorted(values, key=lambda key: (key[1], key[0] or "")):
        by_scene = values[parameters, name]
        means = np.array([np.mean(by_scene[scene]) for scene in sorted(by_scene)])
        interval = bootstrap_interval(means, np.random.default_rng(0))
        assert interval is not None
        bounds: tuple[Cell, Cell] = (interval.low, interval.high) if len(means) > 1 else (None, None)
        runs = sum(map(len, by_scene.values()))
        median = float(np.median(means))
        rows.append((name, parameters, interval.value, *bounds, median, len(means), len(scenes[parameters]), runs))
    columns = ("measure", "parameters", "mean", "low", "high", "median", "scenes", "of", "runs")
    note = (
        "Over scenes that ended well; seeds of a scene are averaged first. low, high: 95 % percentile bootstrap of the "
        "mean over scenes."
    )
    return Table("groups", "Figures by parameter set", columns, tuple(rows), note)
