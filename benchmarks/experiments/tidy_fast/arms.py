"""Who clears which tables, in which world."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import process_time

import numpy as np
from scenewright.stages.tableware import (
    EXACT,
    Action,
    Chances,
    JointPolicy,
    Optimum,
    Policy,
    PullPolicy,
    RandomOne,
    RandomPile,
    StackPolicy,
    Table,
    TimeModel,
    Trial,
    declared_policy,
    make_table,
    plan,
    run_trial,
)
from scenewright.stages.tableware.planning.joint import rules_in
from scenewright.stages.tableware.planning.time_model import fitted, measured, with_spills, with_thesis_failures

OURS = {name: declared_policy(name).rules for name in ("ours", "ours_without_loaded_pulls", "ours_bold")}
SIMPLE = ("random", "random_piles", "stack", "pull")
ARMS = (*SIMPLE, *OURS, "optimum")
WORLDS: dict[str, Chances] = {
    "fast": measured(),
    "fast/exact": EXACT,
    "fast/spills": with_spills(),
    "fast/drops": with_thesis_failures(),
}
"""As the thesis's robot slips and misses; as planned; slipping, missing, and dropping as often as its trials failed."""
DROPS_ON, SPILLS_ON = ("tier1", "tier2"), ("tier2",)
DELAYS = (0, 3, 5)
DRAWS = 60
"""Of what chance decides on a table."""


@dataclass(frozen=True)
class Run:
    """Means over the draws of what chance decides, on one table with one delay of the bin."""

    delay: int
    draws: int
    time: float
    time_first: float
    """Of the first draw alone: one trial a table, as the thesis has."""
    objects_per_trip: float
    trips: float
    pulls: float
    stacks: float
    failed: float
    """Share of the draws in which something was dropped or left."""
    planning_seconds: float = 0.0
    """CPU time of making the first plan (ours), or the dynamic programme (optimum), one thread."""


class _Remembering:
    """A policy that always says the same of the same table, asked once for each."""

    def __init__(self, policy: Policy) -> None:
        self._policy, self._said = policy, dict[tuple[object, ...], Action]()

    def decide(self, table: Table) -> Action:
        key = tuple((item.name, item.on, item.position, item.yaw) for item in table.items)
        if key not in self._said:
            self._said[key] = self._policy.decide(table)
        return self._said[key]


def trials(arm: str, tier: str, world: str, seed: int) -> tuple[Run, ...]:
    """Return one arm's trials on one table, a row for each delay. What the thesis's policies do does not depend on the
    delay; ours and the optimum are asked anew."""
    table, chances = make_table(tier, seed), WORLDS[world]
    rows: list[Run] = []
    done: list[Trial] = []
    planning = 0.0
    for delay in DELAYS if world != "fast/drops" else DELAYS[:1]:
        model = fitted(tier, float(delay))
        if arm == "optimum":
            rows.append(_optimum(table, model, chances, delay))
            continue
        elif arm in OURS:
            began = process_time()
            found = plan(table, OURS[arm], model, chances)
            planning = process_time() - began
            done = _draws(
                table,
                model,
                chances,
                seed,
                lambda _, m=model, f=found: JointPolicy(OURS[arm], m, chances, made=f),  # type: ignore[misc]
            )
        elif not done:
            done = _draws(table, model, chances, seed, _simple(arm, seed))
        added = 2.0 * delay if arm in SIMPLE else 0.0
        rows.append(_row(done, [trial.seconds + added * trial.trips for trial in done], delay, planning))
    return tuple(rows)


def _simple(arm: str, seed: int) -> Callable[[int], Policy]:
    """Return the maker of a thesis policy for a draw."""
    if arm == "random":
        return lambda draw: RandomOne(1000 * seed + draw)
    if arm == "random_piles":
        return lambda draw: RandomPile(1000 * seed + draw)
    same = _Remembering(StackPolicy() if arm == "stack" else PullPolicy())
    return lambda draw: same


def _draws(table: Table, model: TimeModel, chances: Chances, seed: int, policy: Callable[[int], Policy]) -> list[Trial]:
    """Return the trials of one policy under every draw: the same luck for all policies (fast.py)."""
    count = 1 if chances is EXACT else DRAWS
    return [run_trial(table, policy(draw), model, chances, (seed, draw)) for draw in range(count)]


def _optimum(table: Table, model: TimeModel, chances: Chances, delay: int) -> Run:
    """Return what the optimum expects by its own account: exact where nothing slips."""
    began = process_time()
    optimum = Optimum(table, rules_in(OURS["ours_bold"], chances), model, chances)
    best = optimum.solve()
    planning = process_time() - began
    trips, everything = optimum.trips(best), optimum.everything
    time, expected = float(best.seconds[everything]), float(best.trips[everything])
    return Run(
        delay=delay,
        draws=1,
        time=time,
        time_first=time,
        objects_per_trip=len(table.items) / expected,
        trips=expected,
        pulls=sum(trip.pull is not None for trip in trips),
        stacks=sum(len(trip.stacks) for trip in trips),
        failed=0.0,
        planning_seconds=planning,
    )


def _row(done: list[Trial], times: list[float], delay: int, planning: float) -> Run:
    def mean(name: str) -> float:
        return float(np.mean([getattr(trial, name) for trial in done]))

    return Run(
        delay=delay,
        draws=len(done),
        time=float(np.mean(times)),
        time_first=times[0],
        objects_per_trip=mean("objects_per_trip"),
        trips=mean("trips"),
        pulls=mean("pulls"),
        stacks=mean("stacks"),
        failed=mean("failed"),
        planning_seconds=planning,
    )
