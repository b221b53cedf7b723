"""Runs every arm on the same seeded instances; a stopped run goes on where it was.

    python -m benchmarks.llm3 --out FOLDER [--quick] [--tuning] [--fresh] [--arms NAME ...] [--cases NAME ...]

Reporting seeds are 1000 to 1099, tuning seeds (`--tuning`) 0 to 99; `--quick` takes the first ten. Writes runs.jsonl
(one line an attempt), metrics.json and table.md.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

from benchmarks.llm3.arms import ARMS, EVERYWHERE, make_instance
from benchmarks.llm3.records import Run, read_runs
from benchmarks.llm3.tables import metrics, table
from stages.pack.environment import PackingWorld
from stages.pack.loop import run_loop
from stages.pack.motion import MotionPlanner

REPORTING, TUNING = 1000, 0
INSTANCES, QUICK = 100, 10


def attempt(arm: str, case: str, seed: int, planner: MotionPlanner, world: PackingWorld) -> Run:
    """Return what one arm did on one instance. Seconds are CPU time of planning, one thread."""
    proposer = ARMS[arm].make(seed)
    started = time.process_time()
    run = run_loop(world, proposer, ARMS[arm].budget(case))
    seconds = time.process_time() - started
    return Run(
        arm=arm, case=case, seed=seed, success=run.success, proposer_calls=run.proposer_calls,
        motion_planner_calls=run.motion_calls, mesh_calls=run.mesh_calls, iterations=len(run.attempts),
        seconds=round(seconds, 4), boxes=len(world.instance.boxes), fill=round(world.instance.fill, 4),
        failures=tuple(
            entry.task.kind if entry.task is not None else _kind(entry.feedback[-1].failure)
            for entry in run.attempts
            if entry.task is not None or (entry.feedback and entry.feedback[-1].failure is not None)
        )[:40],
    )  # fmt: skip


def _kind(failure: object) -> str:
    return str(getattr(failure, "kind", ""))


def main() -> None:
    """Parse the command line and run."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.llm3", description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--quick", action="store_true", help="ten instances a case")
    parser.add_argument("--tuning", action="store_true", help="tuning seeds instead of reporting seeds")
    parser.add_argument("--fresh", action="store_true", help="measure again what is measured already")
    parser.add_argument("--arms", nargs="+", default=list(ARMS), choices=list(ARMS))
    parser.add_argument("--cases", nargs="+", default=list(EVERYWHERE), choices=list(EVERYWHERE))
    options = parser.parse_args()
    if not any(case in ARMS[arm].cases for arm in options.arms for case in options.cases):
        parser.error("none of these arms runs on any of these cases")
    options.out.mkdir(parents=True, exist_ok=True)
    log = options.out / "runs.jsonl"
    if options.fresh:
        log.unlink(missing_ok=True)
    first = TUNING if options.tuning else REPORTING
    seeds = range(first, first + (QUICK if options.quick else INSTANCES))
    planner = MotionPlanner()
    done = {(run.arm, run.case, run.seed) for run in read_runs(log)}
    with PackingWorld(make_instance("published/easy", TUNING), planner=planner) as world:
        attempt("ours", "published/easy", TUNING, planner, world)  # compiles what is compiled; its time is not kept
    # Seeds outside, arms inside: a table of a stopped run has whole pairs.
    for seed in seeds:
        for case in options.cases:
            arms = [arm for arm in options.arms if case in ARMS[arm].cases and (arm, case, seed) not in done]
            if not arms:
                continue
            with PackingWorld(make_instance(case, seed), planner=planner) as world:
                rows = [attempt(arm, case, seed, planner, world) for arm in arms]
            with log.open("a", encoding="utf-8") as stream:
                stream.writelines(run.model_dump_json() + "\n" for run in rows)
    planner.close()
    runs = [run for run in read_runs(log) if run.seed in seeds]
    (options.out / "metrics.json").write_text(json.dumps(metrics(runs), indent=1, sort_keys=True) + "\n")
    (options.out / "table.md").write_text(table(runs), encoding="utf-8")
    print(options.out / "table.md")


if __name__ == "__main__":
    main()
