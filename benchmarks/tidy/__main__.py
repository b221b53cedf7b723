"""Runs every arm on the same seeded tables; a stopped run goes on where it was.

    python -m benchmarks.tidy --out FOLDER [--quick] [--tuning] [--tiers NAME ...] [--worlds NAME ...] [--arms NAME ...]
                              [--scenes N] [--seconds S]

Reporting seeds are 1000 to 1199 and, for fifteen scenes as in the thesis (three a cell), 2000 to 2002; tuning seeds
(`--tuning`) 0 to 199; `--quick` takes the first ten. Writes runs.jsonl, metrics.json and table.md. `--seconds` stops
early, between two seeds.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

from benchmarks.tidy.arms import ARMS, WORLDS, applies, trials
from benchmarks.tidy.records import read_runs
from benchmarks.tidy.tables import metrics, table
from stages.tableware.world.scenes import TIERS

REPORTING, TUNING, AS_THE_THESIS = 1000, 0, 2000
SCENES, QUICK = 200, 10


def main() -> None:
    """Parse the command line and run."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.tidy", description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--quick", action="store_true", help="ten tables a tier")
    parser.add_argument("--tuning", action="store_true", help="tuning seeds instead of reporting seeds")
    parser.add_argument("--tiers", nargs="+", default=list(TIERS), choices=list(TIERS))
    parser.add_argument("--worlds", nargs="+", default=list(WORLDS), choices=list(WORLDS))
    parser.add_argument("--arms", nargs="+", default=list(ARMS), choices=list(ARMS))
    parser.add_argument("--scenes", type=int, default=SCENES, help="tables a tier")
    parser.add_argument("--seconds", type=float, help="stop after this time")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    log = options.out / "runs.jsonl"
    first = TUNING if options.tuning else REPORTING
    seeds = range(first, first + (QUICK if options.quick else options.scenes))
    fifteen = () if options.tuning else range(AS_THE_THESIS, AS_THE_THESIS + 3)
    done = {(run.arm, run.case, run.seed) for run in read_runs(log)}
    started = time.monotonic()
    for seed in (*fifteen, *seeds):
        if options.seconds is not None and time.monotonic() - started > options.seconds:
            break
        tag = "/thesis15" if seed in fifteen else ""
        rows = []
        for tier in options.tiers:
            for world in options.worlds:
                for arm in options.arms:
                    if applies(tier, world, arm, tag) and (arm, f"{tier}/{world}{tag}", seed) not in done:
                        rows.extend(trials(tier, world, seed, arm, tag))
        with log.open("a", encoding="utf-8") as stream:
            stream.writelines(run.model_dump_json() + "\n" for run in rows)
    runs = [run for run in read_runs(log) if run.seed in seeds or run.seed in fifteen]
    (options.out / "metrics.json").write_text(json.dumps(metrics(runs), indent=1, sort_keys=True) + "\n")
    (options.out / "table.md").write_text(table(runs), encoding="utf-8")
    print(options.out / "table.md")


if __name__ == "__main__":
    main()
