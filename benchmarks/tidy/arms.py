"""Who clears which tables, in which world."""

from __future__ import annotations

from dataclasses import replace

from benchmarks.tidy.records import Run
from stages.tableware.planning.joint import JointPolicy
from stages.tableware.planning.optimum import clear, seconds
from stages.tableware.planning.policies import Policy, PullPolicy, RandomOne, RandomPile, StackPolicy
from stages.tableware.planning.rules import Rules
from stages.tableware.planning.time_model import EXACT, Chances, TimeModel, fitted, measured
from stages.tableware.simulation.fast import Trial, run_trial
from stages.tableware.world.items import Table
from stages.tableware.world.scenes import make_table

OURS = {"ours": Rules(), "ours_without_loaded_pulls": Rules(loaded_pulls=False)}
SIMPLE = ("random", "random_piles", "stack", "pull")
ARMS = (*SIMPLE, *OURS, "optimum")
WORLDS: dict[str, Chances] = {"fast": measured(), "fast/exact": EXACT}
"""As the thesis's robot slips and misses; as planned."""
DELAYS = (0, 3, 5)


def _simple(arm: str, seed: int) -> Policy:
    if arm == "random":
        return RandomOne(seed)
    if arm == "random_piles":
        return RandomPile(seed)
    return StackPolicy() if arm == "stack" else PullPolicy()


def _row(arm: str, case: str, seed: int, trial: Trial, time: float) -> Run:
    return Run(
        arm=arm, case=case, seed=seed, time=round(time, 4), trips=trial.trips, moved=trial.moved, pulls=trial.pulls,
        stacks=trial.stacks, failed=trial.failed,
    )  # fmt: skip


def trials(tier: str, world: str, seed: int, arm: str, tag: str = "") -> list[Run]:
    """Return one arm's trials on one table, a row for each delay. What the thesis's policies do does not depend on the
    delay; ours and the optimum are asked anew."""
    table, chances = make_table(tier, seed), WORLDS[world]
    rows = []
    trial: Trial | None = None
    for delay in DELAYS:
        model = fitted(tier, float(delay))
        case = f"{tier}/{world}{tag}" + (f"/delay{delay}" if delay else "")
        if arm == "optimum":
            rows.append(_optimum(table, model, case, seed))
        elif arm in OURS:
            done = run_trial(table, JointPolicy(OURS[arm], model, chances), model, chances, seed)
            rows.append(_row(arm, case, seed, done, done.seconds))
        else:
            if trial is None:
                trial = run_trial(table, _simple(arm, seed), replace(model, delay=0.0), chances, seed)
            rows.append(_row(arm, case, seed, trial, trial.seconds + 2.0 * delay * trial.trips))
    return rows


def _optimum(table: Table, model: TimeModel, case: str, seed: int) -> Run:
    trips = clear(table, Rules(), model, EXACT)
    trial = Trial(
        trips=len(trips), moved=len(table.items), pulls=sum(trip.pull is not None for trip in trips),
        stacks=sum(len(trip.stacks) for trip in trips),
    )  # fmt: skip
    return _row("optimum", case, seed, trial, seconds(trips))
