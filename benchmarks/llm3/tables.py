"""Figures of merit with 95 % intervals, and tables in the layout of tables 4.1 and 4.2 (Han 2024)."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable

import numpy as np

from benchmarks.llm3.arms import ARMS, HARD, PUBLISHED
from benchmarks.llm3.records import Run
from stages.kit.measurement.bootstrap import bootstrap_interval
from stages.kit.measurement.proportions import wilson_interval

MEASURES = ("success", "proposer_calls", "motion_planner_calls", "seconds")
SEEDS_OF_INTERVALS, DRAWS = 0, 2000
THESIS_4_1 = {
    "LLM3 Backtrack": ("100 / 1.6 / 11.8", "100 / 4.4 / 28.4", "60 / 11.4 / 39.8", "80 / 9.5 / 50", "50 / 13.5 / 44.8"),
    "Backtrack, no reasons": (
        "100 / 1.8 / 12.6", "90 / 6.3 / 32", "40 / 15.1 / 55.3", "30 / 14.6 / 16", "30 / 15.8 / 48"
    ),
    "LLM3 Scratch": ("100 / 1.7 / 13.2", "100 / 7 / 46.1", "70 / 8.8 / 30.9", "70 / 11.5 / 50.2", "60 / 10.6 / 32"),
    "Scratch, no reasons": (
        "100 / 2.4 / 17.6", "60 / 12.3 / 45.3", "50 / 13.7 / 42.8", "30 / 16.2 / 45.7", "40 / 13.2 / 24"
    ),
}  # fmt: skip
"""As printed, 10 attempts a cell, GPT-4 Turbo: %SR / #LM / #MP."""
THESIS_4_2 = {"Random": (109.6, 663.1), "LLM": (10.8, 70.2), "LLM + Feedback": (7.9, 53.2)}
SAMPLERS = {
    "random": "Random",
    "scripted_scratch_no_reasons": "Stand-in",
    "scripted_scratch": "Stand-in + Feedback",
    "ours": "Ours",
}

Runs = dict[tuple[str, str], dict[int, Run]]


def grouped(runs: Iterable[Run]) -> Runs:
    """Return (arm, case) -> seed -> run."""
    groups: Runs = defaultdict(dict)
    for run in runs:
        groups[run.arm, run.case][run.seed] = run
    return groups


def bootstrap(values: np.ndarray) -> tuple[float, float]:
    """Return the 95 % percentile-bootstrap interval of the mean of (N,) values; raises ValueError for none."""
    found = bootstrap_interval(values, np.random.default_rng(SEEDS_OF_INTERVALS), resamples=DRAWS)
    if found is None:
        raise ValueError("no values have no interval")
    return found.low, found.high


def metrics(runs: list[Run]) -> dict[str, float]:
    """Return `<arm>/<case>/<measure>` -> mean; failed attempts count with what they spent."""
    figures = {}
    for (arm, case), group in grouped(runs).items():
        for measure in MEASURES:
            values = [float(getattr(run, measure)) for run in group.values()]
            figures[f"{arm}/{case}/{measure}"] = round(float(np.mean(values)), 4)
        figures[f"{arm}/{case}/instances"] = float(len(group))
    return figures


def table(runs: list[Run]) -> str:
    """Return table.md."""
    groups = grouped(runs)
    count = max((len(group) for group in groups.values()), default=0)
    seeds = sorted({run.seed for run in runs})
    parts = [
        f"# LLM3: {count} instances a cell where no other number is said (seeds {seeds[0]} to {seeds[-1]})\n",
        "Success in % with its 95 % Wilson interval / proposer calls / motion-planner calls; means over all attempts, "
        "a failed one counts with what it spent; ± is half the 95 % bootstrap interval.\n",
        _layout_4_1(groups),
        _layout_4_2(groups),
        _hard(groups),
        _paired(groups),
    ]
    return "\n".join(part for part in parts if part) + "\n"


def _cell(group: dict[int, Run] | None, most: int) -> str:
    if not group:
        return "-"
    rows = list(group.values())
    successes = sum(run.success for run in rows)
    low, high = wilson_interval(successes, len(rows))
    calls = np.array([run.motion_planner_calls for run in rows], dtype=float)
    below, above = bootstrap(calls)
    share = f"{100 * successes / len(rows):.0f} [{100 * low:.0f}, {100 * high:.0f}]"
    proposals = float(np.mean([run.proposer_calls for run in rows]))
    fewer = f" (n = {len(rows)})" if len(rows) < most else ""
    return f"{share} / {proposals:.1f} / {calls.mean():.1f} ± {(above - below) / 2:.1f}{fewer}"


def _rows(groups: Runs, cases: tuple[str, ...]) -> list[str]:
    lines = []
    most = max((len(group) for group in groups.values()), default=0)
    for arm in ARMS:
        cells = [_cell(groups.get((arm, case)), most) for case in cases]
        if any(cell != "-" for cell in cells):
            lines.append(f"| `{arm}` | " + " | ".join(cells) + " |")
    return lines


def _layout_4_1(groups: Runs) -> str:
    head = [
        "## Table 4.1: published suite\n",
        "| method | S1 Easy | S1 Medium | S1 Hard = S2 Small | S2 Medium | S2 Large |",
        "|---|---|---|---|---|---|",
    ]
    printed = [f"| thesis: {name} | " + " | ".join(cells) + " |" for name, cells in THESIS_4_1.items()]
    return "\n".join([*head, *_rows(groups, PUBLISHED), *printed, ""])


def _layout_4_2(groups: Runs) -> str:
    lines = ["## Table 4.2: samplers (set 2, small basket)\n", "| method | #Iteration | #MP |", "|---|---|---|"]
    for arm, name in SAMPLERS.items():
        group = groups.get((arm, "published/medium"))
        if group:
            columns = []
            for measure in ("iterations", "motion_planner_calls"):
                values = np.array([float(getattr(run, measure)) for run in group.values()])
                low, high = bootstrap(values)
                columns.append(f"{values.mean():.1f} [{low:.1f}, {high:.1f}]")
            lines.append(f"| {name} (`{arm}`, n = {len(group)}) | {columns[0]} | {columns[1]} |")
    lines += [f"| thesis: {name} | {a} | {b} |" for name, (a, b) in THESIS_4_2.items()]
    return "\n".join([*lines, ""])


def _hard(groups: Runs) -> str:
    cases = tuple(case for case in HARD if any((arm, case) in groups for arm in ARMS))
    if not cases:
        return ""
    names = [case.removeprefix("hard/") for case in cases]
    lines = ["## Harder suites\n", "| method | " + " | ".join(names) + " |", "|---|" + "---|" * len(names)]
    about = []
    for case in cases:
        rows = next(group for (_, name), group in groups.items() if name == case).values()
        fill = 100 * float(np.mean([run.fill for run in rows]))
        about.append(f"{np.mean([run.boxes for run in rows]):.1f} boxes, fill {fill:.0f} %")
    lines.append("| mean instance | " + " | ".join(about) + " |")
    return "\n".join([*lines, *_rows(groups, cases), ""])


def _paired(groups: Runs) -> str:
    """Return motion-planner calls of each sampler over ours on the instances that both solve, paired."""
    lines = [
        "## Paired with ours\n",
        "Motion-planner calls of a rival over ours on the instances that both solve (ratio of means [95 % bootstrap], "
        "how many), and instances that only ours / only the rival solves.\n",
        "| case | rival | calls over ours | both | only ours | only rival |",
        "|---|---|---|---|---|---|",
    ]
    for case in (*PUBLISHED, *HARD):
        ours = groups.get(("ours", case), {})
        for arm in ("random", "random_restarts", "backtracking", "backtracking_corners", "ours_no_reasons"):
            rival = groups.get((arm, case), {})
            seeds = sorted(set(ours) & set(rival))
            if not seeds:
                continue
            both = [seed for seed in seeds if ours[seed].success and rival[seed].success]
            only_ours = sum(ours[seed].success and not rival[seed].success for seed in seeds)
            only_rival = sum(rival[seed].success and not ours[seed].success for seed in seeds)
            lines.append(
                f"| {case} | `{arm}` | {_ratio(ours, rival, both)} | {len(both)} | {only_ours} | {only_rival} |"
            )
    return "\n".join([*lines, ""])


def _ratio(ours: dict[int, Run], rival: dict[int, Run], seeds: list[int]) -> str:
    if not seeds:
        return "-"
    pairs = np.array([(rival[seed].motion_planner_calls, ours[seed].motion_planner_calls) for seed in seeds], float)
    random = np.random.default_rng(SEEDS_OF_INTERVALS)
    drawn = pairs[random.integers(len(pairs), size=(DRAWS, len(pairs)))].mean(axis=1)
    low, high = np.percentile(drawn[:, 0] / drawn[:, 1], [2.5, 97.5])
    mean = pairs.mean(axis=0)
    return f"{mean[0] / mean[1]:.1f} [{low:.1f}, {high:.1f}]"
