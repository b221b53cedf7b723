"""Clearing tables by sight: before each action the table is rendered, and what `detect` says is all that is known.

One trial a table (draw 0 of the world `fast`, where pulls miss and second piles slip; nothing drops by chance), light
levels and colour schemes alternating as for vision. A trial fails by perception when items stay that nobody saw, by
policy when something falls: here a pile that is more than the jaws hold because it was taken for less.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from scenewright.stages.tableware import TIERS, Eyes, FastWorld, make_policy, make_table, run_in
from scenewright.stages.tableware.planning.time_model import fitted

from benchmarks.experiment import Bench, Experiment, Measure, Trial, count, mean
from benchmarks.experiments.tidy_detect.experiment import conditions
from benchmarks.experiments.tidy_fast.arms import WORLDS

LEAST_CONFIDENCE = 0.3
TUNING, REPORTING = range(30), range(1000, 1030)


@dataclass(frozen=True)
class Run:
    """One trial."""

    time: float
    objects_per_trip: float
    dropped: int
    left: int
    failure: str
    images: int


def trial_of(tier: str, seed: int, arm: str) -> Run:
    """Return one arm's trial on one table."""
    ((level, scheme),) = conditions(seed, one=True)
    model, chances = fitted(tier), WORLDS["fast"]
    eyes = Eyes(seed, level, scheme, LEAST_CONFIDENCE)
    world = FastWorld(make_table(tier, seed), model, chances, (seed, 0))
    done = run_in(world, make_policy(arm, model, chances, 1000 * seed), eyes)
    return Run(done.seconds, done.objects_per_trip, done.dropped, done.left, done.failure, eyes.images)


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Run]]:
    """Yield trials."""
    for trial in trials:
        yield trial, trial_of(trial.case.split("/")[0], int(trial.seed), trial.arm)


def failures(kind: str) -> Measure:
    """Count the trials that failed in this way."""
    return Measure(lambda runs: float(sum(run.failure == kind for run in runs)), interval=False)


EXPERIMENT = Experiment(
    name="tidy_seen",
    title="Clearing tables by sight in the fast simulator",
    simulated="Tables, their images, times and slips of actions; nothing drops by chance.",
    knows="What `detect` finds in rendered images, with the camera's pose and the sizes of all dishes.",
    does_not_show="What an arm does, or a real image.",
    arms={arm: arm for arm in ("random", "stack", "pull", "ours")},
    cases=tuple(f"{tier}/fast/seen" for tier in TIERS),
    default_cases=lambda bench: ("tier1/fast/seen", "tier2/fast/seen"),
    tuning=tuple(map(str, TUNING)),
    reporting=tuple(map(str, REPORTING)),
    measure=measure,
    record=Run,
    measures={
        "time": mean("time", "s"),
        "objects_per_trip": mean("objects_per_trip"),
        "trials": Measure(count, interval=False),
        "failure_rate": Measure(lambda runs: sum(run.failure != "" for run in runs) / len(runs)),
        "failures_perception": failures("perception"),
        "failures_policy": failures("policy"),
        "images": mean("images", interval=False),
    },
    quick_seeds=2,
)
