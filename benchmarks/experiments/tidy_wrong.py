"""Tables in the fast simulator, planned with wrong times and chances: what our plans are worth when the fit is off.

The world is `fast` of `tidy_fast`: times fitted to the thesis, pulls that miss, second piles that slip. What ours
believes of it is off by three tenths: `trips_dear` takes a trip for 1.3 times as long and pulls and stackings for 0.7
times, `trips_cheap` the other way round; `slips_more` and `slips_fewer` take second piles to slip 1.3 and 0.7 times as
often. Pull and Stack plan by neither.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scenewright.stages.tableware import (
    Chances,
    JointPolicy,
    Policy,
    PullPolicy,
    StackPolicy,
    TimeModel,
    make_table,
    plan,
    run_trial,
)
from scenewright.stages.tableware.planning.time_model import fitted

from benchmarks.experiment import Bench, Experiment, Measure, Results, Trial, count, mean, ratio
from benchmarks.experiments.tidy_fast.arms import OURS, WORLDS
from benchmarks.tabulation import Figure
from benchmarks.tidy.rivals import faster, no_slower

DEAR, CHEAP = 1.3, 0.7
TUNING, REPORTING = range(60), range(2200, 2212)
DELAYS = (0, 5)


def times_off(model: TimeModel, trip: float, rest: float) -> TimeModel:
    """Return times of which a trip, and what is done on the table, are off by these factors."""
    return replace(model, trip=trip * model.trip, stack=rest * model.stack, pull=rest * model.pull)


def slips_off(chances: Chances, factor: float) -> Chances:
    """Return chances by which second piles slip `factor` times as often."""
    return replace(
        chances, hold={letter: 1.0 - min(1.0, factor * (1.0 - hold)) for letter, hold in chances.hold.items()}
    )


BELIEFS: dict[str, Callable[[TimeModel, Chances], tuple[TimeModel, Chances]]] = {
    "ours": lambda model, chances: (model, chances),
    "ours_trips_dear": lambda model, chances: (times_off(model, DEAR, CHEAP), chances),
    "ours_trips_cheap": lambda model, chances: (times_off(model, CHEAP, DEAR), chances),
    "ours_slips_more": lambda model, chances: (model, slips_off(chances, DEAR)),
    "ours_slips_fewer": lambda model, chances: (model, slips_off(chances, CHEAP)),
}
"""What ours takes the world to be, from what it is."""


@dataclass(frozen=True)
class Run:
    """Means over the draws of what chance decides, on one table."""

    time: float
    objects_per_trip: float


def trial_of(arm: str, tier: str, delay: int, seed: int, draws: int) -> Run:
    """Return one arm's trials on one table: the same luck for all arms."""
    table, model, chances = make_table(tier, seed), fitted(tier, float(delay)), WORLDS["fast"]
    make: Callable[[], Policy]
    if arm in BELIEFS:
        believed = BELIEFS[arm](model, chances)
        made = plan(table, OURS["ours"], *believed)
        make = lambda: JointPolicy(OURS["ours"], *believed, made=made)  # noqa: E731
    else:
        make = PullPolicy if arm == "pull" else StackPolicy
    done = [run_trial(table, make(), model, chances, (seed, draw)) for draw in range(draws)]
    return Run(
        float(np.mean([trial.seconds for trial in done])), float(np.mean([trial.objects_per_trip for trial in done]))
    )


def measure(bench: Bench, asked: Sequence[Trial]) -> Iterator[tuple[Trial, Run]]:
    """Yield one arm's trials on one table."""
    for trial in asked:
        tier, delay = trial.case.split("/delay")
        yield trial, trial_of(trial.arm, tier, int(delay), int(trial.seed), 20)


def more_figures(results: Results) -> dict[str, float | Figure | None]:
    """Beside each of ours: how much slower than with the right beliefs, how much faster than the better rival on
    average, and the share of tables on which it is no slower than either rival."""
    flat: dict[str, float | Figure | None] = {}
    for case in results.cases:
        for arm in (arm for arm in results.arms(case) if arm in BELIEFS):
            at = f"{arm}/{case}"
            flat[f"{at}/slower_than_right"] = _less_one(
                ratio([(a.time, b.time) for a, b in results.pairs(arm, "ours", case)])
            )
            flat |= faster(results, arm, case)
            flat[f"{at}/no_slower_share"] = no_slower(results, arm, case, "time")
    return flat


def _less_one(share: Figure | None) -> Figure | None:
    if share is None or share.low is None or share.high is None:
        return share and replace(share, value=share.value - 1)
    return replace(share, value=share.value - 1, low=share.low - 1, high=share.high - 1)


EXPERIMENT = Experiment(
    name="tidy_wrong",
    title="Clearing tables with wrong times and chances",
    simulated="Times and slips of actions, fitted to the thesis; no sight, no physics.",
    knows=(
        "The whole table; times or chances are off by three tenths, but for `ours`, which knows those that judge it."
    ),
    does_not_show=(
        "What an arm does; larger errors, or errors that a plan does not model. Trips wrong one way with "
        "stackings and pulls wrong the other are outside the range in which ours seeks the least regret."
    ),
    arms={arm: arm for arm in (*BELIEFS, "pull", "stack")},
    cases=tuple(f"{tier}/delay{delay}" for tier in ("tier1", "tier2") for delay in DELAYS),
    tuning=tuple(map(str, TUNING)),
    reporting=tuple(map(str, REPORTING)),
    measure=measure,
    record=Run,
    measures={
        "time": mean("time", "s"),
        "objects_per_trip": mean("objects_per_trip"),
        "tables": Measure(count, interval=False),
    },
    more_figures=more_figures,
    quick_seeds=2,
)
