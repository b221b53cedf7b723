"""Kept records become figures with intervals: metrics.json, figures.json, table.md."""

from __future__ import annotations

import json
import math
import os
import platform
import shlex
import subprocess
import sys
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from scenewright.stages.kit.measurement.bootstrap import Interval

from benchmarks.experiment import RESAMPLES, Results, Trial
from benchmarks.tabulation import Figure, grid

MOST_COLUMNS, MOST_SEEDS = 8, 200
INTERVALS = (
    "95 %, over clusters of seeds, none of fewer than five: Student's t of means and shares over five to nineteen, "
    f"else bootstrap of {RESAMPLES} draws; Wilson's of shares of single tries"
)
"""How intervals are made (benchmarks/experiment.py)."""
RUNNING = "trials"
"""`all/<case>/trials`: how many seeds a case ran on."""


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
    for key, more in (results.experiment.more_figures(results) if results.experiment.more_figures else {}).items():
        if isinstance(more, Figure):
            figures[key] = more
        elif isinstance(more, Interval):
            figures[key] = Figure(more.value, more.low, more.high, None, "")
        elif more is not None and math.isfinite(more):
            figures[key] = Figure(float(more), None, None, None, "")
    return figures


def write_results(results: Results, command: Sequence[str], missing: Sequence[Trial]) -> str:
    """Write metrics.json, figures.json, table.md and the pictures into the output folder; return the table."""
    out, figures = results.bench.out, figures_of(results)
    out.mkdir(parents=True, exist_ok=True)
    _write(out / "metrics.json", {name: figure.value for name, figure in figures.items()})
    _write(out / "figures.json", described(results, figures, command))
    text = table(results, figures)
    if missing:
        text += f"\nNot measured: {', '.join(map(str, missing))}.\n"
    (out / "table.md").write_text(text, encoding="utf-8")
    if results.experiment.pictures:
        results.experiment.pictures(results)
    return text


def described(results: Results, figures: Mapping[str, Figure], command: Sequence[str]) -> dict[str, Any]:
    """Return figures.json: the figures, and what has to stand beside them."""
    experiment = results.experiment
    return {
        "experiment": experiment.name,
        "title": experiment.title,
        **circumstances(command),
        "simulated": experiment.simulated,
        "knows": experiment.knows,
        "does_not_show": experiment.does_not_show,
        "notes": seeds_told(results),
        "interval": INTERVALS,
        "figures": {name: vars(figure) for name, figure in figures.items()},
    }


def write_figures(out: Path, name: str, about: Mapping[str, str], figures: Mapping[str, Figure]) -> None:
    """Write `<name>.json` of a measurement that is no experiment into the output folder, in the form of docs/results.
    `about`: title, simulated, knows, does_not_show."""
    out.mkdir(parents=True, exist_ok=True)
    command = ["python", "-m", f"benchmarks.{name}", *("FOLDER" if word == str(out) else word for word in sys.argv[1:])]
    told = {"experiment": name, **about, **circumstances(command)}
    _write(out / f"{name}.json", {**told, "figures": {key: vars(figure) for key, figure in figures.items()}})


def circumstances(command: Sequence[str]) -> dict[str, str]:
    """Return when, by which code, where and by which command something is measured."""
    return {
        "date": datetime.now(UTC).date().isoformat(),
        "commit": _commit(),
        "machine": f"{os.cpu_count()} processors, {platform.machine()}, {platform.system()}",
        "command": shlex.join(command),
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
    """Say which seeds ran and how intervals are made."""
    return f"{seeds_told(results)} Intervals: {INTERVALS}.\n"


def seeds_told(results: Results) -> str:
    """Say which seeds ran."""
    told = []
    for names in dict.fromkeys(tuple(results.seeds(case)) for case in results.cases):
        kind = next(
            (kind for kind in ("tuning", "reporting") if set(names) <= set(getattr(results.experiment, kind))), ""
        )
        told.append(f"{len(names)}{f' for {kind}' if kind else ''}{_told(names)}")
    return f"Seeds: {'; '.join(told)}."


def _told(names: Sequence[str]) -> str:
    """Return, in brackets, the first names of numbered or of few seeds: many names of other things say nothing. Seeds
    without a gap are told by the first and the last."""
    numbers = [int(name) for name in names if name.isdecimal()]
    if len(numbers) > 2 and numbers == list(range(numbers[0], numbers[0] + len(names))):
        return f" ({numbers[0]} to {numbers[-1]})"
    if all(name.isdecimal() for name in names) or len(names) <= 20:
        return f" ({', '.join(names[:20])}{', ...' * (len(names) > 20)})"
    return ""


def _write(path: Path, values: Mapping[str, Any]) -> None:
    path.write_text(json.dumps(values, indent=1, sort_keys=True) + "\n", encoding="utf-8")


def _commit() -> str:
    here = Path(__file__).resolve().parent
    words = ["git", "-C", str(here), "describe", "--always", "--dirty", "--abbrev=10", "--exclude=*"]
    return subprocess.run(words, capture_output=True, text=True, check=False).stdout.strip()
