"""The thread's curve in space from true masks and from learned ones, against the true curve; a stopped run goes on.

    python -m benchmarks.stitch.thread --out FOLDER [--views FOLDER] [--quick] [--tuning] [--count N] [--seconds S]

Reporting seeds begin at 1000, tuning seeds (`--tuning`) at 0. Writes thread.jsonl, metrics.json and table.md. The start
is the true swage. Times are CPU times of one thread.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import torch

from benchmarks.stitch.thread_records import read_records
from benchmarks.stitch.thread_tables import metrics, table
from benchmarks.stitch.thread_views import reconstructions
from stages.suture.segmentation.checkpoint import BUNDLED
from stages.suture.segmentation.infer import Segmenter

REPORTING, TUNING, COUNT, QUICK = 1000, 0, 100, 4


def main() -> None:
    """Parse the command line and run."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.stitch.thread", description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--views", type=Path, help="where rendered views are kept; OUT/views if not given")
    parser.add_argument("--checkpoint", type=Path, default=BUNDLED)
    parser.add_argument("--quick", action="store_true", help=f"{QUICK} views")
    parser.add_argument("--tuning", action="store_true", help="tuning seeds instead of reporting seeds")
    parser.add_argument("--count", type=int, default=COUNT)
    parser.add_argument("--seconds", type=float, help="stop after this time")
    options = parser.parse_args()
    torch.set_num_threads(1)
    options.out.mkdir(parents=True, exist_ok=True)
    first = TUNING if options.tuning else REPORTING
    count = QUICK if options.quick else options.count
    segmenter = Segmenter.load(options.checkpoint)
    log = options.out / "thread.jsonl"
    done = {(record.seed, record.masks) for record in read_records(log)}
    began = time.monotonic()
    for seed in range(first, first + count):
        if (seed, "learned") in done:
            continue
        if options.seconds is not None and time.monotonic() - began > options.seconds:
            break
        found = reconstructions(options.views or options.out / "views", seed, segmenter)
        with log.open("a", encoding="utf-8") as stream:
            stream.writelines(record.model_dump_json() + "\n" for record in found)
    kept = {(r.seed, r.masks): r for r in read_records(log) if first <= r.seed < first + count}
    records = list(kept.values())
    (options.out / "metrics.json").write_text(json.dumps(metrics(records), indent=1, sort_keys=True) + "\n")
    (options.out / "table.md").write_text(table(records), encoding="utf-8")
    print(options.out / "table.md")


if __name__ == "__main__":
    main()
