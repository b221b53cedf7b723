"""Clears seeded tables in physics with every arm; a stopped run goes on where it was.

    python -m benchmarks.tidy.physics --out FOLDER [--quick] [--tuning] [--sight image|truth ...] [--tiers NAME ...]
                                      [--arms NAME ...] [--scenes N] [--seconds S]

One process, one JSON line a trial in trials.jsonl; all arms of a table are run before the next table, so that what has
run is paired. Reporting seeds are 1000 and up, tuning seeds (`--tuning`) 0 and up. `--quick`: one table a tier.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

from benchmarks.tidy.physics_records import PhysicsRun, metrics, read_runs, table
from stages.tableware.planning.choice import make_policy
from stages.tableware.planning.time_model import EXACT, fitted
from stages.tableware.simulation.physics_trial import run_physics_trial
from stages.tableware.world.scenes import make_table

TIERS = ("tier0_cups", "tier0_bowls", "tier0_utensils", "tier1", "tier2")
ARMS = ("random", "pull", "stack", "ours_one_pile", "ours_careful", "ours")
"""All that can be asked for."""
RUN = ("random", "pull", "stack", "ours_one_pile", "ours_careful")
"""Run unless said otherwise: things that stand free in a dish fall out when two dishes are lifted side by side, and
more than two utensils slide off (docs/TIDY_PHYSICS.md), which `ours` does not know."""
SIGHTS = ("image", "truth")
SCENES = 20


def trial(arm: str, tier: str, seed: int, sight: str) -> PhysicsRun:
    """Run one trial."""
    started = time.process_time()
    planner = make_policy(arm, fitted(tier), EXACT, seed)
    outcome = run_physics_trial(make_table(tier, seed), planner, seed, "image" if sight == "image" else "truth")
    done = outcome.trial
    return PhysicsRun(
        arm=arm, tier=tier, seed=seed, sight=sight, time=round(done.seconds, 3), trips=done.trips, moved=done.moved,
        pulls=done.pulls, stacks=done.stacks, dropped=done.dropped, left=done.left, actions=outcome.actions,
        perception=outcome.perception, policy=outcome.policy, troubles=outcome.troubles,
        cpu_seconds=round(time.process_time() - started, 2),
    )  # fmt: skip


def main() -> None:
    """Parse the command line and run."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.tidy.physics", description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--quick", action="store_true", help="one table a tier")
    parser.add_argument("--tuning", action="store_true", help="tuning seeds instead of reporting seeds")
    parser.add_argument("--tiers", nargs="+", default=list(TIERS), choices=TIERS)
    parser.add_argument("--arms", nargs="+", default=list(RUN), choices=ARMS)
    parser.add_argument("--sight", nargs="+", default=["image"], choices=SIGHTS)
    parser.add_argument("--scenes", type=int, default=SCENES, help="tables a tier")
    parser.add_argument("--seconds", type=float, help="stop after this time")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    log = options.out / "trials.jsonl"
    first = 0 if options.tuning else 1000
    seeds = range(first, first + (1 if options.quick else options.scenes))
    done = {(run.arm, run.tier, run.seed, run.sight) for run in read_runs(log)}
    started = time.monotonic()
    for seed in seeds:
        for tier in options.tiers:
            for sight in options.sight:
                for arm in options.arms:
                    if options.seconds is not None and time.monotonic() - started > options.seconds:
                        break
                    if (arm, tier, seed, sight) not in done:
                        run = trial(arm, tier, seed, sight)
                        with log.open("a", encoding="utf-8") as stream:
                            stream.write(run.model_dump_json() + "\n")
    runs = [run for run in read_runs(log) if (run.seed >= 1000) != options.tuning]
    (options.out / "metrics.json").write_text(json.dumps(metrics(runs), indent=1, sort_keys=True) + "\n")
    (options.out / "table.md").write_text(table(runs), encoding="utf-8")
    print(options.out / "table.md")


if __name__ == "__main__":
    main()
