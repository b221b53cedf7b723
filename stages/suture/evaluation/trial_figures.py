"""Figures of merit with 95 % intervals, and table 4.1 with ours beside it (Srinivas 2024)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from schemas.suture_trial import SutureRun

SEED_OF_INTERVALS, DRAWS = 0, 2000
KINDS = "IEHT"
PAIRS = (("ours", "thesis"), ("ours_one_at_a_time", "thesis"), ("ours_supervised", "thesis_supervised"))
THESIS: dict[str, tuple[float, float, float, float, float, tuple[int, int, int, int], float | None]] = {
    "sensing_only": (1.40, 51.6, 0.0, 0.0, 106.8, (9, 6, 0, 0), None),
    "thread_handling": (1.80, 55.9, 20.0, 0.0, 117.9, (6, 5, 2, 2), None),
    "thesis": (2.93, 69.4, 73.3, 0.0, 159.3, (8, 5, 0, 2), None),
    "thesis_supervised": (4.47, 83.3, 100.0, 20.0, 141.9, (16, 10, 0, 2), 2.25),
}
"""Mean sutures to failure, single-suture rate, three throws, full wound [%], seconds a suture, errors of 15 trials,
sutures to intervention, as printed."""


def interval(values: np.ndarray, weights: np.ndarray | None = None) -> tuple[float, float]:
    """Return the 95 % percentile-bootstrap interval over trials of a mean (N,), or of a ratio of sums."""
    random = np.random.default_rng(SEED_OF_INTERVALS)
    rows = random.integers(len(values), size=(DRAWS, len(values)))
    below = np.ones(len(values)) if weights is None else weights
    drawn = values[rows].sum(axis=1) / np.maximum(below[rows].sum(axis=1), 1e-9)
    return float(np.percentile(drawn, 2.5)), float(np.percentile(drawn, 97.5))


def interval_of(values: Sequence[float]) -> tuple[float, float]:
    """Return the interval of the mean of plain numbers."""
    return interval(np.array(values, dtype=float))


def by_arm(runs: Sequence[SutureRun]) -> dict[str, dict[int, SutureRun]]:
    """Return arm -> seed -> run."""
    groups: dict[str, dict[int, SutureRun]] = {}
    for run in runs:
        groups.setdefault(run.arm, {})[run.seed] = run
    return groups


def metrics(runs: Sequence[SutureRun]) -> dict[str, float]:
    """Return `<arm>/trials/<measure>` -> number. Shares are 0 to 1; `_low` and `_high` bound 95 % intervals.

    `single_suture_rate` is completed over attempted throws; `seconds_per_suture` the seconds of all trials over
    attempted throws (`seconds_per_completed` over completed ones); errors are counts over all trials. Ratios of
    ours to the thesis's arm are over the same seeds: `sutures_ratio`, `seconds_ratio` (attempted) and
    `seconds_completed_ratio`, their intervals of draws of pairs.
    """
    groups = by_arm(runs)
    figures: dict[str, float] = {}

    def put(arm: str, name: str, values: np.ndarray, weights: np.ndarray | None = None) -> None:
        below = len(values) if weights is None else weights.sum()
        figures[f"{arm}/trials/{name}"] = float(values.sum() / max(below, 1e-9))
        low, high = interval(values, weights)
        figures[f"{arm}/trials/{name}_low"], figures[f"{arm}/trials/{name}_high"] = low, high

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
        asked = np.array([run.interventions for run in rows], dtype=float)
        if asked.sum() > 0:
            put(arm, "sutures_to_intervention", thrown, asked)
        for kind in KINDS:
            figures[f"{arm}/trials/errors_{kind.lower()}"] = float(sum(run.errors.count(kind) for run in rows))
        figures[f"{arm}/trials/seen_right_share"] = sum(run.right for run in rows) / max(1, sum(r.looks for r in rows))
        figures[f"{arm}/trials/count"] = float(len(rows))
    for ours, rival in PAIRS:
        figures |= ratios(ours, groups.get(ours, {}), groups.get(rival, {}))
    return {name: round(value, 5) for name, value in figures.items()}


def ratios(arm: str, ours: dict[int, SutureRun], rival: dict[int, SutureRun]) -> dict[str, float]:
    """Return the figures of `arm` over its rival's on the seeds (keys) of both, with 95 % bootstrap intervals."""
    seeds = sorted(set(ours) & set(rival))
    if not seeds:
        return {}
    rows = np.random.default_rng(SEED_OF_INTERVALS).integers(len(seeds), size=(DRAWS, len(seeds)))
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
        figures[f"{arm}/trials/{name}"] = float(_over(above.sum(axis=1), below.sum(axis=1)))
        drawn = _over(above[:, rows].sum(axis=2), below[:, rows].sum(axis=2))
        for end, percent in (("low", 2.5), ("high", 97.5)):
            figures[f"{arm}/trials/{name}_{end}"] = float(np.percentile(drawn, percent))
    return figures


def _over(above: np.ndarray, below: np.ndarray) -> np.ndarray:
    """Return the ratio of two ratios whose parts are (2, ...): ours, the rival's."""
    each = above / np.maximum(below, 1e-9)
    return np.asarray(each[0] / np.maximum(each[1], 1e-9))


def table(runs: Sequence[SutureRun]) -> str:
    """Return table.md: table 4.1's layout, the thesis's row under each of ours where there is one; then what failed."""
    figures, groups = metrics(runs), by_arm(runs)
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
        if arm in THESIS:
            mean, single, three, full, seconds, counts, between = THESIS[arm]
            lines.append(
                f"| *printed* | 15 | {mean:.2f} | {single} % | {three} % | {full} % | {seconds} "
                f"| {' '.join(map(str, counts))} | {'–' if between is None else between} | – |"
            )
    lines += _pairs_table(figures)
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


def _pairs_table(figures: dict[str, float]) -> list[str]:
    """Return the lines on ratios of arms on the same seeds; none where no arms are paired."""
    rows = []
    for ours, rival in PAIRS:
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
