"""The needle's pose by the thesis's estimator and by ours on the same seeded views; a stopped run goes on.

    python -m benchmarks.stitch.needle --out FOLDER [--quick] [--tuning] [--cases NAME ...] [--views N] [--seconds S]

Reporting seeds begin at 1300 (those from 1000 on were seen with earlier versions), tuning seeds (`--tuning`) at 0.
Writes needle.jsonl, metrics.json and table.md.
`--seconds` stops early, between two seeds; the table says how many views were reached. Times are CPU times.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

from benchmarks.stitch.needle_records import read_estimates
from benchmarks.stitch.needle_tables import metrics, table
from benchmarks.stitch.needle_trials import CASES, run

REPORTING, TUNING = 1300, 0
QUICK = 10
VIEWS = {
    "rendered": 500,
    "geometry": 500,
    "geometry_miscalibrated": 200,
    "geometry_filtered": 100,
    "geometry_corner_left": 200,
    "geometry_corner_right": 200,
    "geometry_endoscope": 200,
}
LARGEST = max(VIEWS.values())


def main() -> None:
    """Parse the command line and run."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.stitch.needle", description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--quick", action="store_true", help=f"{QUICK} views a case")
    parser.add_argument("--tuning", action="store_true", help="tuning seeds instead of reporting seeds")
    parser.add_argument("--cases", nargs="+", default=list(CASES), choices=list(CASES))
    parser.add_argument("--views", type=int, help="at most so many views a case")
    parser.add_argument("--seconds", type=float, help="stop after this time")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    log = options.out / "needle.jsonl"
    first = TUNING if options.tuning else REPORTING
    most = {name: min(VIEWS[name], QUICK if options.quick else LARGEST, options.views or LARGEST) for name in VIEWS}
    done = {(record.case, record.seed) for record in read_estimates(log)}
    started = time.monotonic()
    for name, seed in _order(options.cases, most, first):
        if options.seconds is not None and time.monotonic() - started > options.seconds:
            break
        if (name, seed) in done:
            continue
        with log.open("a", encoding="utf-8") as stream:
            stream.writelines(record.model_dump_json() + "\n" for record in run(CASES[name], seed))
    records = [record for record in read_estimates(log) if first <= record.seed < first + LARGEST]
    (options.out / "metrics.json").write_text(json.dumps(metrics(records), indent=1, sort_keys=True) + "\n")
    (options.out / "table.md").write_text(table(records), encoding="utf-8")
    print(options.out / "table.md")


def _order(cases: list[str], most: dict[str, int], first: int) -> list[tuple[str, int]]:
    """Return (case, seed) such that all cases come to their end together, however early a run is stopped."""
    pairs = [((index + 0.5) / most[name], name, first + index) for name in cases for index in range(most[name])]
    return [(name, seed) for _, name, seed in sorted(pairs)]


if __name__ == "__main__":
    main()
