"""Clears seeded tables in physics with every arm; a stopped run goes on where it was.

    python -m benchmarks.tidy.physics --out FOLDER [--quick] [--tuning] [--sight truth|image ...] [--tiers NAME ...]
                                      [--arms NAME ...] [--first N] [--scenes N] [--seconds S]

One process, one JSON line a trial in trials.jsonl; all arms of a table are run before the next table, and a seed in all
tiers before the next seed, so that what has run is paired. Reporting seeds are 1040 and up (1000, 1001 and 1010 to 1035
were seen while the arm was built), tuning seeds (`--tuning`) 0 and up. `--quick`: one table a tier.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path

from benchmarks.tidy.arms import OURS
from benchmarks.tidy.physics_records import PhysicsRun, metrics, read_runs, table
from stages.tableware.planning.choice import make_policy
from stages.tableware.planning.joint import JointPolicy
from stages.tableware.planning.policy import Policy
from stages.tableware.planning.time_model import EXACT
from stages.tableware.simulation.arm_times import arm_times
from stages.tableware.simulation.physics_trial import run_physics_trial
from stages.tableware.world.scenes import make_table

TIERS = ("tier0_cups", "tier0_bowls", "tier0_utensils", "tier1", "tier2", "tier3")
RULES = {
    **{arm: (rules, 0.0) for arm, rules in OURS.items()},
    **{f"{arm}_far": (rules, 5.0) for arm, rules in OURS.items()},
}
"""Rules of our arms, and the delay of the bin [s] for which they plan. `ours_far` is what `ours` does where the bin is
far: its trials are those of `ours` under /delay3 and /delay5."""
ARMS = ("random", "pull", "stack", *RULES)
"""All that can be asked for."""
UNLOADED, LOADED_ON = "ours_without_loaded_pulls", ("tier2", "tier3")
"""What does the same as `ours` but where dishes that carry others stand from the beginning."""
RUN = ("random", "pull", "stack", "ours", "ours_far", UNLOADED)
"""Run unless said otherwise."""
CHANCES = replace(EXACT, spills=True)
"""What our planner is told of physics."""
SIGHTS = ("truth", "image")
SCENES = 20
FIRST = 1040


def policy(arm: str, seed: int) -> Policy:
    """Return an arm's policy; ours plan by the arm's own times."""
    if arm in RULES:
        rules, delay = RULES[arm]
        return JointPolicy(rules, arm_times(delay), CHANCES)
    return make_policy(arm, arm_times(), EXACT, seed)


def trial(arm: str, tier: str, seed: int, sight: str) -> PhysicsRun:
    """Run one trial."""
    started = time.process_time()
    looking = "image" if sight == "image" else "truth"
    outcome = run_physics_trial(make_table(tier, seed), policy(arm, seed), seed, looking)  # type: ignore[arg-type]
    done = outcome.trial
    return PhysicsRun(
        arm=arm, tier=tier, seed=seed, sight=sight, time=round(done.seconds, 3), trips=done.trips, moved=done.moved,
        pulls=done.pulls, stacks=done.stacks, dropped=done.dropped, left=done.left, actions=outcome.actions,
        looks=outcome.looks, perception=outcome.perception, policy=outcome.policy, troubles=outcome.troubles,
        losses=outcome.losses, cpu_seconds=round(time.process_time() - started, 2),
    )  # fmt: skip


def main() -> None:
    """Parse the command line and run."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.tidy.physics", description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--quick", action="store_true", help="one table a tier")
    parser.add_argument("--tuning", action="store_true", help="tuning seeds instead of reporting seeds")
    parser.add_argument("--tiers", nargs="+", default=list(TIERS[:-1]), choices=TIERS)
    parser.add_argument("--arms", nargs="+", default=list(RUN), choices=ARMS)
    parser.add_argument("--sight", nargs="+", default=["truth"], choices=SIGHTS)
    parser.add_argument("--first", type=int, help="first seed")
    parser.add_argument("--scenes", type=int, default=SCENES, help="tables a tier")
    parser.add_argument("--seconds", type=float, help="stop after this time")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    log = options.out / "trials.jsonl"
    first = options.first if options.first is not None else 0 if options.tuning else FIRST
    seeds = range(first, first + (1 if options.quick else options.scenes))
    done = {(run.arm, run.tier, run.seed, run.sight) for run in read_runs(log)}
    started = time.monotonic()
    for sight in options.sight:
        for seed in seeds:
            for tier in options.tiers:
                for arm in options.arms:
                    if options.seconds is not None and time.monotonic() - started > options.seconds:
                        break
                    if arm == UNLOADED and tier not in LOADED_ON:
                        continue
                    if (arm, tier, seed, sight) not in done:
                        run = trial(arm, tier, seed, sight)
                        with log.open("a", encoding="utf-8") as stream:
                            stream.write(run.model_dump_json() + "\n")
    write(options.out, options.tuning)
    print(options.out / "table.md")


def write(folder: Path, tuning: bool) -> None:
    """Write the figures and the table of what has run."""
    runs = [run for run in read_runs(folder / "trials.jsonl") if (run.seed >= 1000) != tuning]
    (folder / "metrics.json").write_text(json.dumps(metrics(runs), indent=1, sort_keys=True) + "\n")
    (folder / "table.md").write_text(table(runs), encoding="utf-8")


if __name__ == "__main__":
    main()
