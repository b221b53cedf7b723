"""Clearing tables in physics: an arm with friction grasps, by the truth or through rendered images.

Tables 1000 to 1059 and 2100 to 2129 were run with earlier arms or motions. Where the bin is farther, trips cost its
delay twice. Ours is two arms: planned for the bin as it stands, and (`ours_far`) for one that is 5 s away; both stand
beside the rivals with either bin.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from scenewright.stages.kit.measurement.proportions import wilson_interval
from scenewright.stages.tableware import (
    EXACT,
    JointPolicy,
    Policy,
    arm_times,
    make_policy,
    make_table,
    run_physics_trial,
)

from benchmarks.experiment import Bench, Experiment, Measure, Results, Trial, count, mean
from benchmarks.experiments.tidy_fast.arms import DELAYS, OURS
from benchmarks.tabulation import Figure, markdown
from benchmarks.tidy.rivals import against, faster, no_slower

TIERS = ("tier0_cups", "tier0_bowls", "tier0_utensils", "tier1", "tier2", "tier3")
FAR = 5.0
"""Delay of the bin [s] for which ours plan where it is farther."""
FAR_ARM = "ours_far"
CHANCES = replace(EXACT, spills=True)
"""What our planner is told of physics."""
CASES = tuple(
    f"{tier}/physics{sight}" + (f"/delay{delay}" if delay else "")
    for sight in ("/truth", "")
    for delay in DELAYS
    for tier in TIERS
)
SHOWN = tuple(f"{tier}/physics{kind}" for kind in ("/truth", "/truth/delay5", "") for tier in ("tier1", "tier2"))
"""What the page shows, by default."""
TUNING, REPORTING = range(20), range(2130, 2150)
SEEN = 10
"""Tables that are cleared through images, the first of them: each image takes seconds."""


@dataclass(frozen=True)
class Run:
    """What a trial came to. `perception` and `policy`: items dropped or left by whose fault."""

    time: float
    """Simulated seconds, with the delay of the bin."""
    trips: int
    moved: int
    pulls: int
    stacks: int
    dropped: int
    left: int
    actions: int
    looks: int
    perception: int
    policy: int
    troubles: tuple[str, ...]
    losses: tuple[str, ...]
    """Of each item that was lost what it is and in which action, as `fork: take uu`."""
    cpu_seconds: float

    @property
    def failed(self) -> bool:
        """Whether not everything came to the bin."""
        return self.dropped + self.left > 0

    @property
    def objects_per_trip(self) -> float:
        """Items brought to the bin over trips."""
        return self.moved / max(self.trips, 1)


def delay_of(case: str) -> int:
    """Return the delay of a case's bin [s]."""
    return int(case.split("/delay")[1]) if "/delay" in case else 0


def same_trial(trial: Trial) -> tuple[object, ...]:
    """Cases that differ in their delay are one trial."""
    return trial.seed, trial.case.split("/delay")[0], trial.arm


def seeds_of(bench: Bench, case: str) -> Sequence[str]:
    """The tables."""
    seeds = tuple(map(str, TUNING if bench.tuning else REPORTING))
    return seeds if "/truth" in case else seeds[:SEEN]


def policy(arm: str, seed: int) -> Policy:
    """Return an arm's policy; ours plan by the arm's own times."""
    if arm == FAR_ARM or arm in OURS:
        rules, delay = (OURS["ours"], FAR) if arm == FAR_ARM else (OURS[arm], 0.0)
        return JointPolicy(rules, arm_times(delay), CHANCES)
    return make_policy(arm, arm_times(), EXACT, seed)


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Run]]:
    """Yield one trial with all its delays."""
    started = time.process_time()
    first, seed = trials[0], int(trials[0].seed)
    table, deciding = make_table(first.case.split("/")[0], seed), policy(first.arm, seed)
    outcome = run_physics_trial(table, deciding, seed, "truth" if "/truth" in first.case else "image")
    done = outcome.trial
    run = Run(
        time=done.seconds,
        trips=done.trips,
        moved=done.moved,
        pulls=done.pulls,
        stacks=done.stacks,
        dropped=done.dropped,
        left=done.left,
        actions=outcome.actions,
        looks=outcome.looks,
        perception=outcome.perception,
        policy=outcome.policy,
        troubles=outcome.troubles,
        losses=outcome.losses,
        cpu_seconds=time.process_time() - started,
    )
    for trial in trials:
        yield trial, replace(run, time=run.time + 2.0 * delay_of(trial.case) * run.trips)


def share(test: Callable[[Run], bool], interval: bool = True) -> Measure:
    """Return the share of trials."""
    return Measure(lambda runs: sum(map(test, runs)) / len(runs), interval=interval)


def items_lost(runs: Sequence[Run]) -> float:
    """The share of items that were dropped or left."""
    return sum(run.dropped + run.left for run in runs) / sum(run.moved + run.dropped + run.left for run in runs)


def wilson(count: int, tables: int) -> Figure:
    """Return a share of tables."""
    return Figure(count / tables, *wilson_interval(count, tables), tables, "")


def more_figures(results: Results) -> dict[str, float | Figure | None]:
    """Ratios against Random, by how much faster than Pull and Stack, shares of tables no slower than the better of
    them; failed trials of all tiers."""
    flat: dict[str, float | Figure | None] = {}
    for case in results.cases:
        for arm in results.arms(case):
            runs = results.of(arm, case)
            flat[f"{arm}/{case}/failed"] = wilson(sum(run.failed for run in runs), len(runs))
            flat |= against(results, arm, case)
            if arm == FAR_ARM or arm in OURS:
                flat |= faster(results, arm, case)
                flat[f"{arm}/{case}/no_slower_share"] = no_slower(results, arm, case)
    sums: Counter[str] = Counter()
    for trial, run in results.records.items():
        if not delay_of(trial.case):
            at = f"{trial.arm}/{'truth' if '/truth' in trial.case else 'image'}"
            sums.update({f"{at}/tables": 1, f"{at}/failed_tables": run.failed, f"{at}/lost_tables": run.dropped > 0})
    for at in {name.rsplit("/", 1)[0] for name in sums}:
        tables = sums[f"{at}/tables"]
        for what in ("failed", "lost"):
            flat[f"{at}/{what}"] = wilson(sums[f"{at}/{what}_tables"], tables)
    return flat | {name: float(value) for name, value in sums.items()}


def causes(results: Results) -> str:
    """What was lost or left, in which actions."""
    counts: Counter[tuple[str, str, str]] = Counter()
    for trial, run in results.records.items():
        if not delay_of(trial.case):
            counts.update((trial.case, trial.arm, loss) for loss in run.losses)
            counts[trial.case, trial.arm, "left on the table"] += run.left
    rows = [(*cause, str(number)) for cause, number in sorted(counts.items()) if number]
    return markdown("What was lost, in which action", ("case", "arm", "what", "items"), rows)


EXPERIMENT = Experiment(
    name="tidy_physics",
    title="Clearing tables in physics",
    simulated="An arm with friction grasps, forces within a 2F-85's data sheet; images are rendered.",
    knows="By truth, what stands where; through images, what `detect` finds with known sizes.",
    does_not_show=(
        "A real arm or table. Rules were tuned in the same physics; times of actions were fitted there on "
        "tuning seeds. With few tables one failure cannot be told from none."
    ),
    arms={arm: arm for arm in ("random", "pull", "stack", *OURS, FAR_ARM)},
    cases=CASES,
    default_arms=lambda bench: ("random", "pull", "stack", "ours", FAR_ARM),
    default_cases=lambda bench: SHOWN,
    runs=lambda arm, case: arm not in ("random", FAR_ARM) or "/truth" in case,
    tuning=tuple(map(str, TUNING)),
    reporting=tuple(map(str, REPORTING)),
    seeds_of=seeds_of,
    together=same_trial,
    measure=measure,
    record=Run,
    measures={
        "time": mean("time", "s"),
        "objects_per_trip": mean("objects_per_trip"),
        "trials": Measure(count, interval=False),
        "failure_rate": share(lambda run: run.failed),
        "lost_rate": share(lambda run: run.dropped > 0),
        "failures_perception": share(lambda run: run.perception > 0, interval=False),
        "failures_policy": share(lambda run: run.policy > 0, interval=False),
        "items_lost_share": Measure(items_lost, interval=False),
        "cpu_seconds": mean("cpu_seconds", "s", interval=False),
    },
    more_figures=more_figures,
    quick_seeds=1,
    notes=causes,
)
