"""Figures of merit of trials with 95 % intervals, and their table."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scenewright.schemas.suture_trial import SutureRun
from scenewright.stages.kit.measurement.bootstrap import Interval, bootstrap_interval

SEED_OF_INTERVALS, DRAWS = 0, 2000
"""Seed of the bootstrap, and the number of its draws."""
KINDS = "IEHT"
Pairs = Sequence[tuple[str, str]]
PAIRS = (("ours", "thesis"), ("ours_supervised", "thesis_supervised"))
"""Arms whose figures are divided, on the seeds of both."""


def interval_of(over: Callable[[np.ndarray], np.ndarray], trials: int) -> Interval:
    """Return a figure of whole trials and its 95 % interval. `over`: numbers of trials (..., N) -> figure (...)."""

    def statistic(numbers: np.ndarray, axis: int) -> np.ndarray:
        return over(numbers.astype(int))

    random = np.random.default_rng(SEED_OF_INTERVALS)
    interval = bootstrap_interval(np.arange(trials), random, statistic=statistic, resamples=DRAWS)
    assert interval is not None  # an arm has a trial
    return interval


def by_arm(runs: Sequence[SutureRun]) -> dict[str, dict[int, SutureRun]]:
    """Return arm -> seed -> run."""
    groups: dict[str, dict[int, SutureRun]] = {}
    for run in runs:
        groups.setdefault(run.arm, {})[run.seed] = run
    return groups


def metrics(runs: Sequence[SutureRun], pairs: Pairs = PAIRS) -> dict[str, float]:
    """Return `<arm>/trials/<measure>` -> number. Shares are 0 to 1; `_low` and `_high` bound 95 % intervals.

    `single_suture_rate` is completed over attempted throws; `seconds_per_suture` the seconds of all trials over
    attempted throws (`seconds_per_completed` over completed ones); errors are counts over all trials. Ratios of
    ours to the thesis's arm are over the same seeds: `sutures_ratio`, `seconds_ratio` (attempted) and
    `seconds_completed_ratio`, their intervals of draws of pairs.
    """
    groups = by_arm(runs)
    figures: dict[str, float] = {}

    def put(arm: str, name: str, values: np.ndarray, weights: np.ndarray | None = None) -> None:
        below = np.ones(len(values)) if weights is None else weights

        def ratio(rows: np.ndarray) -> np.ndarray:
            return np.asarray(values[rows].sum(axis=-1) / np.maximum(below[rows].sum(axis=-1), 1e-9))

        figures.update(_interval_entries(f"{arm}/trials/{name}", interval_of(ratio, len(values))))

    for arm, group in groups.items():
        rows = list(group.values())
        thrown = np.array([run.sutures for run in rows], dtype=float)
        tried = np.array([run.attempts for run in rows], dtype=float)
        seconds = np.array([run.seconds for run in rows])
        put(arm, "sutures_to_failure", thrown)
        put(arm, "sutures_to_failure_neutral", np.array([run.sutures_neutral for run in rows], dtype=float))
        put(arm, "single_suture_rate", thrown, tried)
        put(arm, "three_throw_rate", (thrown >= 3).astype(float))
        put(arm, "full_wound_rate", (thrown >= 6).astype(float))
        put(arm, "seconds_per_suture", seconds, tried)
        put(arm, "seconds_per_completed", seconds, thrown)
        interventions = np.array([run.interventions for run in rows], dtype=float)
        if interventions.sum() > 0:
            put(arm, "sutures_to_intervention", thrown, interventions)
        for kind in KINDS:
            figures[f"{arm}/trials/errors_{kind.lower()}"] = float(sum(run.errors.count(kind) for run in rows))
        figures[f"{arm}/trials/seen_right_share"] = sum(run.right for run in rows) / max(1, sum(r.looks for r in rows))
        figures[f"{arm}/trials/count"] = float(len(rows))
    for ours, rival in pairs:
        figures |= ratios(ours, groups.get(ours, {}), groups.get(rival, {}))
    return {name: round(value, 5) for name, value in figures.items()}


def ratios(arm: str, ours: dict[int, SutureRun], rival: dict[int, SutureRun]) -> dict[str, float]:
    """Return the figures of `arm` over its rival's on the seeds (keys) of both, with 95 % bootstrap intervals."""
    seeds = sorted(set(ours) & set(rival))
    if not seeds:
        return {}
    pair = [[group[seed] for seed in seeds] for group in (ours, rival)]
    sutures, attempts, seconds = (
        np.array([[getattr(run, name) for run in runs] for runs in pair], dtype=float)
        for name in ("sutures", "attempts", "seconds")
    )
    figures: dict[str, float] = {}
    for name, above, below in (
        ("sutures_ratio", sutures, np.ones_like(sutures)),
        ("seconds_ratio", seconds, attempts),
        ("seconds_completed_ratio", seconds, sutures),
    ):

        def ratio(rows: np.ndarray, above: np.ndarray = above, below: np.ndarray = below) -> np.ndarray:
            return _over(above[:, rows].sum(axis=-1), below[:, rows].sum(axis=-1))

        figures.update(_interval_entries(f"{arm}/trials/{name}", interval_of(ratio, len(seeds))))
    return figures


def _interval_entries(at: str, interval: Interval) -> dict[str, float]:
    return {at: interval.value, f"{at}_low": interval.low, f"{at}_high": interval.high}


def _over(above: np.ndarray, below: np.ndarray) -> np.ndarray:
    """Return the ratio of two ratios whose parts are (2, ...): ours, the rival's."""
    each = above / np.maximum(below, 1e-9)
    return np.asarray(each[0] / np.maximum(each[1], 1e-9))


def table(runs: Sequence[SutureRun], pairs: Pairs = PAIRS, below: Mapping[str, str] | None = None) -> str:
    """Return table.md in the layout of table 4.1 (Srinivas 2024), then what failed. `below`: arm -> a line that goes
    below its row."""
    figures, groups = metrics(runs, pairs), by_arm(runs)
    lines = [
        "# STITCH, whole trials in the simulator\n",
        "Layout of table 4.1. Mean [95 % bootstrap over trials]; errors are counts over all trials of the row.\n",
        "| arm | trials | sutures to failure | single-suture rate | three throws | full wound | seconds a suture "
        "| I E H T | sutures to intervention | back at neutral (section 2.2) |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for arm, group in groups.items():

        def cell(name: str, scale: float = 1.0, digits: int = 2, arm: str = arm) -> str:
            at = f"{arm}/trials/{name}"
            if at not in figures:
                return "–"
            low, high = figures[f"{at}_low"] * scale, figures[f"{at}_high"] * scale
            return f"{figures[at] * scale:.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]"

        errors = " ".join(str(int(figures[f"{arm}/trials/errors_{kind.lower()}"])) for kind in KINDS)
        lines.append(
            f"| {arm} | {len(group)} | {cell('sutures_to_failure')} | {cell('single_suture_rate', 100, 1)} % "
            f"| {cell('three_throw_rate', 100, 1)} % | {cell('full_wound_rate', 100, 1)} % "
            f"| {cell('seconds_per_suture', 1, 1)} | {errors} | {cell('sutures_to_intervention')} "
            f"| {cell('sutures_to_failure_neutral')} |"
        )
        if below is not None and arm in below:
            lines.append(below[arm])
    lines += _pairs_table(figures, pairs)
    lines += ["", "## What ended trials\n", "| arm | class | reason | count |", "|---|---|---|---|"]
    for arm, group in groups.items():
        counted: dict[tuple[str, str], int] = {}
        for run in group.values():
            for kind, reason in zip(run.errors, run.reasons, strict=True):
                reason = "slack stays in the stitch" if "mm of slack" in reason else reason
                counted[kind, reason] = counted.get((kind, reason), 0) + 1
        for (kind, reason), count in sorted(counted.items(), key=lambda item: -item[1]):
            lines.append(f"| {arm} | {kind} | {reason} | {count} |")
    return "\n".join(lines) + "\n"


def _pairs_table(figures: dict[str, float], pairs: Pairs) -> list[str]:
    """Return the lines on ratios of arms on the same seeds; none where no arms are paired."""
    rows = []
    for ours, rival in pairs:
        cells = []
        for name in ("sutures_ratio", "seconds_ratio", "seconds_completed_ratio"):
            at = f"{ours}/trials/{name}"
            if at in figures:
                cells.append(f"{figures[at]:.2f} [{figures[f'{at}_low']:.2f}, {figures[f'{at}_high']:.2f}]")
        if cells:
            rows.append(f"| {ours} / {rival} | {' | '.join(cells)} |")
    if not rows:
        return []
    head = "| | sutures | seconds an attempted throw | seconds a completed suture |"
    return ["", "## Ratios over the same seeds", "", head, "|---|---|---|---|", *rows]
