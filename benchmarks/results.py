"""Kept records become figures with intervals: metrics.json, figures.json, table.md."""

from __future__ import annotations

import json
import math
import os
import platform
import shlex
import subprocess
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.experiment import Bench, Experiment, Trial
from benchmarks.tabulation import grid
from stages.kit.measurement.bootstrap import Interval, figure_interval, paired_interval

RESAMPLES = 2000
SEED_OF_INTERVALS = 0
LEAST_CLUSTERS = 2
"""With fewer there is nothing to resample."""
MOST_COLUMNS, MOST_SEEDS = 8, 200
RUNNING = "trials"
"""`all/<case>/trials`: how many seeds a case ran on."""


@dataclass
class Results:
    """The records of a run."""

    experiment: Experiment
    bench: Bench
    records: Mapping[Trial, Any]
    _clusters: dict[tuple[str, str], dict[str, list[Any]]] = field(default_factory=dict)
    _values: dict[tuple[str, ...], dict[tuple[int, ...], float | None]] = field(default_factory=dict)

    @property
    def cases(self) -> list[str]:
        """The cases that ran, in their order."""
        return list(dict.fromkeys(trial.case for trial in self.records))

    def arms(self, case: str | None = None) -> list[str]:
        """The arms that ran (in a case), in the order of the declaration."""
        there = {trial.arm for trial in self.records if case in (None, trial.case)}
        return [arm for arm in self.experiment.arms if arm in there]

    def seeds(self, case: str) -> list[str]:
        """The seeds of a case that any arm ran on."""
        return list(dict.fromkeys(trial.seed for trial in self.records if trial.case == case))

    def of(self, arm: str, case: str) -> list[Any]:
        """The records of an arm in a case, by seed."""
        return [record for group in self._grouped(arm, case).values() for record in group]

    def get(self, arm: str, case: str, seed: str) -> Any | None:
        """The record of one trial."""
        return self.records.get(Trial(arm, case, seed))

    def value(self, arm: str, case: str, measure: str) -> float | None:
        """A measure of an arm in a case."""
        records = self.of(arm, case)
        return self.experiment.measures[measure].of(records) if records else None

    def interval(self, arm: str, case: str, measure: str) -> Interval | None:
        """A measure with its 95 % percentile bootstrap interval over clusters of seeds; None where it is undefined, or
        where there are fewer than two clusters."""
        names = list(self._grouped(arm, case))
        if len(names) < LEAST_CLUSTERS:
            return None
        random = np.random.default_rng(SEED_OF_INTERVALS)
        return figure_interval(self._figure(arm, case, measure, names), range(len(names)), random, resamples=RESAMPLES)

    def difference(self, first: str, second: str, case: str, measure: str) -> Interval | None:
        """`first` minus `second` over the clusters that both ran on, drawn together, with its 95 % interval."""
        other = self._grouped(second, case)
        names = [name for name in self._grouped(first, case) if name in other]
        if len(names) < LEAST_CLUSTERS:
            return None
        figures = [self._figure(arm, case, measure, names) for arm in (first, second)]
        numbers = [(which, k) for which in (0, 1) for k in range(len(names))]

        def of_either(samples: Sequence[tuple[int, int]]) -> float | None:
            return figures[samples[0][0]]([k for _, k in samples])

        half = len(names)
        random = np.random.default_rng(SEED_OF_INTERVALS)
        return paired_interval(of_either, numbers[:half], numbers[half:], random, resamples=RESAMPLES)

    def _grouped(self, arm: str, case: str) -> dict[str, list[Any]]:
        if (arm, case) not in self._clusters:
            groups: dict[str, list[Any]] = {}
            for trial, record in self.records.items():
                if (trial.arm, trial.case) == (arm, case):
                    groups.setdefault(self.experiment.cluster(trial.seed), []).append(record)
            self._clusters[arm, case] = groups
        return self._clusters[arm, case]

    def _figure(
        self, arm: str, case: str, measure: str, names: Sequence[str]
    ) -> Callable[[Sequence[int]], float | None]:
        """The measure over clusters given by their numbers; remembered by how often each is drawn."""
        groups, of = self._grouped(arm, case), self.experiment.measures[measure].of
        values = self._values.setdefault((arm, case, measure, *names), {})

        def figure(numbers: Sequence[int]) -> float | None:
            drawn = tuple(sorted(numbers))
            if drawn not in values:
                values[drawn] = of([record for k in drawn for record in groups[names[k]]])
            return values[drawn]

        return figure


@dataclass(frozen=True)
class Figure:
    """One number of figures.json."""

    value: float
    low: float | None
    high: float | None
    cases: int | None
    unit: str


def figures_of(results: Results) -> dict[str, Figure]:
    """Return `<arm>/<case>/<measure>` -> figure; what is undefined is left out."""
    figures: dict[str, Figure] = {}
    for case in results.cases:
        figures[f"all/{case}/{RUNNING}"] = Figure(float(len(results.seeds(case))), None, None, None, "")
        for arm in results.arms(case):
            for name, measure in results.experiment.measures.items():
                cases = len(results.of(arm, case))
                value = results.value(arm, case, name)
                if value is None or not math.isfinite(value):
                    continue
                low = high = None
                if measure.interval and (found := results.interval(arm, case, name)) is not None:
                    low, high = found.low, found.high
                figures[f"{arm}/{case}/{name}"] = Figure(value, low, high, cases, measure.unit)
    for key, value in (results.experiment.more_figures(results) if results.experiment.more_figures else {}).items():
        if value is not None and math.isfinite(value):
            figures[key] = Figure(float(value), None, None, None, "")
    return figures


def write_results(results: Results, command: Sequence[str], missing: Sequence[Trial]) -> str:
    """Write metrics.json, figures.json, table.md and the pictures into the output folder; return the table."""
    out, figures = results.bench.out, figures_of(results)
    out.mkdir(parents=True, exist_ok=True)
    _write(out / "metrics.json", {name: figure.value for name, figure in figures.items()})
    _write(out / "figures.json", described(results.experiment, figures, command))
    text = table(results, figures)
    if missing:
        text += f"\nNot measured: {', '.join(map(str, missing))}.\n"
    (out / "table.md").write_text(text, encoding="utf-8")
    if results.experiment.pictures:
        results.experiment.pictures(results)
    return text


def described(experiment: Experiment, figures: Mapping[str, Figure], command: Sequence[str]) -> dict[str, Any]:
    """Return figures.json: the figures, and what has to stand beside them."""
    return {
        "experiment": experiment.name,
        "title": experiment.title,
        "date": datetime.now(UTC).date().isoformat(),
        "commit": _commit(),
        "machine": f"{os.cpu_count()} processors, {platform.machine()}, {platform.system()}",
        "command": shlex.join(command),
        "simulated": experiment.simulated,
        "knows": experiment.knows,
        "does_not_show": experiment.does_not_show,
        "figures": {name: vars(figure) for name, figure in figures.items()},
    }


def table(results: Results, figures: Mapping[str, Figure]) -> str:
    """Return table.md: every figure of every arm and case, differences, single seeds, and what the experiment adds."""
    parts, shown = [seeds_line(results)], set()
    one_arm = len(results.arms()) == 1
    together: dict[tuple[str, str], Figure] = {}
    for case in results.cases:
        by_arm: dict[tuple[str, str], Figure] = {}
        for arm in results.arms(case):
            for name in (name for name in figures if name.startswith(f"{arm}/{case}/")):
                measure = name.removeprefix(f"{arm}/{case}/")
                if any(
                    name.startswith(f"{arm}/{longer}/") for longer in results.cases if longer.startswith(f"{case}/")
                ):
                    continue  # of a case like middle/drifting
                shown.add(name)
                by_arm[measure, results.experiment.arms[arm]] = together[measure, case] = figures[name]
        if not one_arm:
            parts.append(grid(case, "measure", by_arm))
    if one_arm:
        wide = len(results.cases) > MOST_COLUMNS
        parts.append(grid("", "", {(k[::-1] if wide else k): figure for k, figure in together.items()}))
    rest = {tuple(name.rsplit("/", 1)): figure for name, figure in figures.items() if name not in shown}
    further = {(key[0], key[1]): figure for key, figure in rest.items() if key[1] != RUNNING}
    parts += [grid("Further figures", "", further)] if further else []
    parts += [differences_table(results), seeds_table(results)]
    parts += [results.experiment.notes(results)] if results.experiment.notes else []
    return "\n".join(part for part in parts if part)


def differences_table(results: Results) -> str:
    """Return the differences that the experiment declares, case by case."""
    found: dict[tuple[str, str], Figure] = {}
    for case in results.cases:
        for first, second in results.experiment.pairs:
            for name in results.experiment.compared:
                if (d := results.difference(first, second, case, name)) is not None:
                    found[f"{case}: {first} – {second}", name] = Figure(d.value, d.low, d.high, None, "")
    return grid("Differences on the same seeds (95 %)", "case, arms", found) if found else ""


def seeds_table(results: Results) -> str:
    """Return the compared measures of every seed by itself."""
    found: dict[tuple[str, str], Figure] = {}
    for trial, record in results.records.items():
        for name in results.experiment.compared:
            if (value := results.experiment.measures[name].of([record])) is not None:
                row = f"{trial.case}, {trial.seed}"
                found[row, f"{trial.arm}: {name}"] = Figure(value, None, None, 1, "")
    return grid("Seed by seed", "case, seed", found) if len({row for row, _ in found}) in range(2, MOST_SEEDS) else ""


def seeds_line(results: Results) -> str:
    """Say which seeds ran."""
    told = []
    for names in dict.fromkeys(tuple(results.seeds(case)) for case in results.cases):
        kind = next(
            (kind for kind in ("tuning", "reporting") if set(names) <= set(getattr(results.experiment, kind))), ""
        )
        told.append(
            f"{len(names)}{f' for {kind}' if kind else ''} ({', '.join(names[:20])}{', ...' * (len(names) > 20)})"
        )
    return f"Seeds: {'; '.join(told)}. Intervals: 95 %, bootstrap, {RESAMPLES} draws over clusters of seeds.\n"


def _write(path: Path, values: Mapping[str, Any]) -> None:
    path.write_text(json.dumps(values, indent=1, sort_keys=True) + "\n", encoding="utf-8")


def _commit() -> str:
    here = Path(__file__).resolve().parent
    words = ["git", "-C", str(here), "describe", "--always", "--dirty", "--abbrev=10", "--exclude=*"]
    return subprocess.run(words, capture_output=True, text=True, check=False).stdout.strip()
