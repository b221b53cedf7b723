"""Clearing tables in the fast simulator: tables 7.1 and 7.2 (Srinivas 2024), a joint planner and the exact optimum."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from scenewright.stages.tableware import PRINTED, TIERS

from benchmarks.experiment import Bench, Experiment, Measure, Results, Trial, count, mean, statistic
from benchmarks.experiments.tidy_fast.arms import ARMS, DELAYS, DROPS_ON, OURS, SPILLS_ON, WORLDS, Run, trials
from benchmarks.tabulation import Figure
from benchmarks.tidy.rivals import against, faster, no_slower

TUNING, REPORTING = range(200), range(2200, 2230)
AS_THE_THESIS = ("2000", "2001", "2002")
"""Fifteen tables, three a tier but tier 3, in cases of their own."""
FIFTEEN = "/thesis15"
WORLDS_OF = {
    tier: [
        w
        for w in WORLDS
        if not (w == "fast/spills" and tier not in SPILLS_ON or w == "fast/drops" and tier not in DROPS_ON)
    ]
    for tier in TIERS
}
CASES = tuple(
    f"{tier}/{world}{tag}"
    for tag in ("", FIFTEEN)
    for tier in TIERS
    for world in WORLDS_OF[tier]
    if not (tag and tier == "tier3")
)
SHOWN = tuple(case for case in CASES if not case.endswith(FIFTEEN) and not ("tier0" in case and "exact" in case))
SHOWN_ARMS = tuple(arm for arm in ARMS if arm not in ("random_piles", "ours_without_loaded_pulls"))
"""What the page shows, by default."""


def seeds_of(bench: Bench, case: str) -> Sequence[str]:
    """The tables."""
    if case.endswith(FIFTEEN):
        return () if bench.tuning else AS_THE_THESIS
    return tuple(map(str, TUNING if bench.tuning else REPORTING))


def measure(bench: Bench, asked: Sequence[Trial]) -> Iterator[tuple[Trial, tuple[Run, ...]]]:
    """Yield one arm's trials on one table, at all delays."""
    for trial in asked:
        tier, world = trial.case.removesuffix(FIFTEEN).split("/", 1)
        yield trial, trials(trial.arm, tier, world, int(trial.seed))


def subcases() -> dict[str, tuple[str, Callable[[tuple[Run, ...]], Run | None]]]:
    """Every case by the delay of its bin."""

    def at(delay: int) -> Callable[[tuple[Run, ...]], Run | None]:
        return lambda runs: next((run for run in runs if run.delay == delay), None)

    return {f"{case}/delay{delay}" if delay else case: (case, at(delay)) for case in CASES for delay in DELAYS}


def p95(values: Sequence[float]) -> float | None:
    """The 95th percentile; None where nothing was planned."""
    return float(np.percentile(values, 95)) if any(values) else None


def more_figures(results: Results) -> dict[str, float | Figure | None]:
    """What the thesis prints, and figures over other arms on the same tables: ratios against Random (`_piles`: against
    Random as its tier-2 figure implies), shares of tables on which ours is no slower than the better of Pull and Stack,
    gaps to the optimum."""
    flat: dict[str, float | Figure | None] = {**printed(results)}
    for case in results.cases:
        for arm in results.arms(case):
            at = f"{arm}/{case}"
            flat |= against(results, arm, case) | against(results, arm, case, "random_piles", "_piles")
            if arm not in OURS:
                continue
            for name, ending in (("time", ""), ("time_first", "_one_draw")):
                flat[f"{at}/no_slower_share{ending}"] = no_slower(results, arm, case, name)
            flat |= faster(results, arm, case)
            gaps = [a.time / b.time - 1.0 for a, b in results.pairs(arm, "optimum", case)]
            flat[f"{at}/gap_to_optimum"] = float(np.mean(gaps)) if gaps else None
            flat[f"{at}/gap_to_optimum_worst"] = max(gaps, default=None)
    return flat


def printed(results: Results) -> dict[str, Figure]:
    """What the thesis prints, beside the cases that ran."""
    flat: dict[str, Figure] = {}
    for tier, policies in PRINTED.items():
        for policy, (near, middle, far, objects, failed) in policies.items():
            values = {
                "/time": (near, "s"),
                "/delay3/time": (middle, "s"),
                "/delay5/time": (far, "s"),
                "/objects_per_trip": (objects, ""),
                "/failed_trials": (float(failed), ""),
            }
            if f"{tier}/fast" in results.cases:
                at = f"printed {policy}/{tier}/fast"
                flat |= {f"{at}{name}": Figure(value, None, None, 3, unit) for name, (value, unit) in values.items()}
    return flat


EXPERIMENT = Experiment(
    name="tidy_fast",
    title="Clearing tables in the fast simulator",
    simulated=(
        "Times and slips of actions, fitted to the thesis; no sight, no physics. `fast`: pulls miss as in "
        "table 7.3, second piles slip as in table 7.2. `fast/exact`: nothing does. `fast/spills`: utensils "
        "also slide off dishes lifted side by side. `fast/drops`: things also fall as often as the thesis's "
        "trials failed."
    ),
    knows="The whole table, and the chances and times it is judged by.",
    does_not_show=(
        "An arm: no physics, no sight. The planner knows the chances and times that judge it. Times are "
        "fitted to few trials of the thesis, one table a tier. With a near bin ours is hardly faster than "
        "Pull and on some tables slower than the better rival; the gain is with a farther bin. On tier 3 ours "
        "is slower than Pull, and with a near bin than Stack. Where things fall as often as in the thesis's "
        "trials ours is slower than Pull and fails too."
    ),
    arms={arm: arm for arm in ARMS},
    cases=CASES,
    default_arms=lambda bench: SHOWN_ARMS,
    default_cases=lambda bench: SHOWN,
    runs=lambda arm, case: not (arm == "optimum" and "fast/drops" in case),
    tuning=tuple(map(str, TUNING)),
    reporting=tuple(map(str, REPORTING)),
    seeds_of=seeds_of,
    measure=measure,
    record=tuple[Run, ...],
    subcases=subcases(),
    measures={
        "time": mean("time", "s"),
        "objects_per_trip": mean("objects_per_trip"),
        "failure_rate": mean("failed", interval=False),
        "failures_policy": Measure(lambda runs: sum(round(run.failed * run.draws) for run in runs), interval=False),
        "tables": Measure(count, interval=False),
        "trials": Measure(statistic("draws", np.sum), interval=False),
        "planning_seconds_median": Measure(
            lambda runs: float(np.median(times)) if any(times := [run.planning_seconds for run in runs]) else None,
            "s",
            interval=False,
        ),
        "planning_seconds_p95": Measure(lambda runs: p95([run.planning_seconds for run in runs]), "s", interval=False),
    },
    more_figures=more_figures,
    quick_seeds=10,
)
