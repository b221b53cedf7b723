"""Who clears which tables, in which world."""

from __future__ import annotations

from collections.abc import Callable
from time import process_time

import numpy as np

from benchmarks.tidy.records import Run
from stages.tableware.planning.action import Action
from stages.tableware.planning.choice import declared_policy
from stages.tableware.planning.joint import JointPolicy, plan, rules_in
from stages.tableware.planning.optimum import Optimum
from stages.tableware.planning.policy import Policy
from stages.tableware.planning.rules import Rules
from stages.tableware.planning.time_model import (
    EXACT,
    Chances,
    TimeModel,
    fitted,
    measured,
    with_spills,
    with_thesis_failures,
)
from stages.tableware.policies.pull import PullPolicy
from stages.tableware.policies.random import RandomOne
from stages.tableware.policies.random_piles import RandomPile
from stages.tableware.policies.stack import StackPolicy
from stages.tableware.simulation.fast import run_trial
from stages.tableware.simulation.trial import Trial
from stages.tableware.world.items import Table
from stages.tableware.world.scenes import make_table

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
DRAWS, DRAWS_OF_THE_AIMS = 20, 400
"""Of what chance decides on a table: the second on tiers 1 and 2, where the aims are."""


class _Remembering:
    """A policy that always says the same of the same table, asked once for each."""

    def __init__(self, policy: Policy) -> None:
        self._policy, self._said = policy, dict[tuple[object, ...], Action]()

    def decide(self, table: Table) -> Action:
        key = tuple((item.name, item.on, item.position, item.yaw) for item in table.items)
        if key not in self._said:
            self._said[key] = self._policy.decide(table)
        return self._said[key]


def applies(tier: str, world: str, arm: str, tag: str) -> bool:
    """Return whether an arm is run: drops are for the mixed tables, spills for those with laden dishes."""
    if tag and tier == "tier3":
        return False
    if world == "fast/spills":
        return tier in SPILLS_ON
    return not (world == "fast/drops" and (arm == "optimum" or tier not in DROPS_ON))


def trials(tier: str, world: str, seed: int, arm: str, tag: str = "") -> list[Run]:
    """Return one arm's trials on one table, a row for each delay. What the thesis's policies do does not depend on the
    delay; ours and the optimum are asked anew."""
    table, chances = make_table(tier, seed), WORLDS[world]
    rows: list[Run] = []
    done: list[Trial] = []
    planning = 0.0
    for delay in DELAYS if world != "fast/drops" else DELAYS[:1]:
        model = fitted(tier, float(delay))
        case = f"{tier}/{world}{tag}" + (f"/delay{delay}" if delay else "")
        if arm == "optimum":
            rows.append(_optimum(table, model, chances, case, seed))
            continue
        elif arm in OURS:
            began = process_time()
            found = plan(table, OURS[arm], model, chances)
            planning = process_time() - began
            done = _draws(
                table,
                model,
                chances,
                (tier, seed),
                lambda _, m=model, f=found: JointPolicy(OURS[arm], m, chances, made=f),  # type: ignore[misc]
            )
        elif not done:
            done = _draws(table, model, chances, (tier, seed), _simple(arm, seed))
            without_delay = [trial.seconds for trial in done]
        times = [trial.seconds for trial in done]
        if arm in SIMPLE:
            times = [time + 2.0 * delay * trial.trips for time, trial in zip(without_delay, done, strict=True)]
        rows.append(_row(arm, case, seed, done, times, planning))
    return rows


def _simple(arm: str, seed: int) -> Callable[[int], Policy]:
    """Return the maker of a thesis policy for a draw."""
    if arm == "random":
        return lambda draw: RandomOne(1000 * seed + draw)
    if arm == "random_piles":
        return lambda draw: RandomPile(1000 * seed + draw)
    same = _Remembering(StackPolicy() if arm == "stack" else PullPolicy())
    return lambda draw: same


def _draws(
    table: Table, model: TimeModel, chances: Chances, scene: tuple[str, int], policy: Callable[[int], Policy]
) -> list[Trial]:
    """Return the trials of one policy under every draw: the same luck for all policies (fast.py)."""
    tier, seed = scene
    count = 1 if chances is EXACT else DRAWS_OF_THE_AIMS if tier in DROPS_ON else DRAWS
    return [run_trial(table, policy(draw), model, chances, (seed, draw)) for draw in range(count)]


def _optimum(table: Table, model: TimeModel, chances: Chances, case: str, seed: int) -> Run:
    """Return what the optimum expects by its own account: exact where nothing slips."""
    began = process_time()
    optimum = Optimum(table, rules_in(Rules(), chances), model, chances)
    best = optimum.solve()
    planning = process_time() - began
    trips, everything = optimum.trips(best), optimum.everything
    time, expected = float(best.seconds[everything]), float(best.trips[everything])
    return Run(
        arm="optimum", case=case, seed=seed, draws=1, time=round(time, 5), time_first=round(time, 5),
        objects_per_trip=round(len(table.items) / expected, 5), trips=round(expected, 5),
        pulls=sum(trip.pull is not None for trip in trips), stacks=sum(len(trip.stacks) for trip in trips),
        failed=0.0, failed_first=False, planning_seconds=round(planning, 5),
    )  # fmt: skip


def _row(arm: str, case: str, seed: int, done: list[Trial], times: list[float], planning: float) -> Run:
    def mean(values: list[float]) -> float:
        return round(float(np.mean(values)), 5)

    return Run(
        arm=arm, case=case, seed=seed, draws=len(done), time=mean(times), time_first=round(times[0], 5),
        objects_per_trip=mean([trial.objects_per_trip for trial in done]), trips=mean([trial.trips for trial in done]),
        pulls=mean([trial.pulls for trial in done]), stacks=mean([trial.stacks for trial in done]),
        failed=mean([trial.failed for trial in done]), failed_first=done[0].failed,
        planning_seconds=round(planning, 5),
    )  # fmt: skip
