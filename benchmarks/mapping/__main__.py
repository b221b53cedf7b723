"""`python -m benchmarks.mapping`: rooms in processes of their own, then metrics.json and table.md."""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from benchmarks.mapping.arms import DRIFTING, LEVELS, NETWORK, SHOWN, all_arms
from benchmarks.mapping.experiment import Outcome, run_room
from benchmarks.mapping.figures_of_merit import MEASURES
from benchmarks.mapping.records import read_outcomes, write_outcomes
from benchmarks.mapping.rooms import CLUTTER, REPORTING, TUNING, TUNING_UNTRAINED, make_room
from benchmarks.mapping.tables import (
    Results,
    by_room,
    differences,
    headline,
    percent,
    precision_by_class,
    printed_by_the_thesis,
    quality_by_class,
)

SEED = 0
FRAMES, QUICK_FRAMES = 60, 40
QUICK_ROOMS = 3


def main(argv: Sequence[str] | None = None) -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--quick", action="store_true", help=f"{QUICK_ROOMS} rooms of {QUICK_FRAMES} frames")
    parser.add_argument("--tuning", action="store_true", help="the tuning rooms instead of those for reporting")
    parser.add_argument("--untrained", action="store_true", help="with --tuning: rooms our own network never saw")
    parser.add_argument("--voxel-size", type=float, default=0.02, help="of all arms [m] (the publications: 0.01)")
    parser.add_argument("--jobs", type=int, default=min(2, os.cpu_count() or 1))
    parser.add_argument("--arms", default="", help="comma-separated; default: all")
    parser.add_argument("--cases", default="", help="comma-separated; default: all")
    parser.add_argument("--room", help="run this one room (recipe:seed) and stop")
    options = parser.parse_args(argv)
    cases = options.cases.split(",") if options.cases else default_cases()
    frames = QUICK_FRAMES if options.quick else FRAMES
    options.out.mkdir(parents=True, exist_ok=True)
    if options.room:
        return one_room(options, cases, frames)
    tuning = TUNING_UNTRAINED if options.untrained else TUNING
    rooms = (tuning if options.tuning else REPORTING)[: QUICK_ROOMS if options.quick else None]
    make_room(options.out / "rooms", *rooms[0], frames)  # the library is shared: make it before rooms run beside it
    with ThreadPoolExecutor(options.jobs) as pool:
        codes = list(pool.map(lambda room: _room_process(options, cases, room), rooms))
    failed = [room for room, code in zip(rooms, codes, strict=True) if code]
    if failed:
        print(f"error: {len(failed)} rooms failed: {failed}; see above, then run the command again", file=sys.stderr)
        return 1
    outcomes = [o for room in rooms for case in cases for o in read_outcomes(outcomes_file(options, room, case))]
    write_results(options, outcomes, cases, rooms)
    return 0


def default_cases() -> list[str]:
    """All cases that can be run here."""
    return [*LEVELS, DRIFTING, NETWORK]


def outcomes_file(options: argparse.Namespace, room: tuple[str, int], case: str) -> Path:
    """Where a room's outcomes in a case stand."""
    return options.out / "outcomes" / f"{room[0]}-{room[1]}-{case.replace('/', '-')}.json"


def one_room(options: argparse.Namespace, cases: Sequence[str], frames: int) -> int:
    """Make one room and run the cases that are not there yet; writes the outcomes of each."""
    recipe, seed = options.room.split(":")
    room = make_room(options.out / "rooms", recipe, int(seed), frames)
    chosen = options.arms.split(",") if options.arms else None
    arms = [arm for arm in all_arms(options.voxel_size) if chosen is None or arm.name in chosen]
    files = {case: outcomes_file(options, (recipe, int(seed)), case) for case in cases}
    missing = [case for case, file in files.items() if not file.is_file()]
    for case, outcomes in run_room(room, arms, missing, options.out / "maps", SEED):
        files[case].parent.mkdir(exist_ok=True)
        write_outcomes(files[case], outcomes)
    return 0


def _room_process(options: argparse.Namespace, cases: Sequence[str], room: tuple[str, int]) -> int:
    if all(outcomes_file(options, room, case).is_file() for case in cases):
        print(f"{room[0]}-{room[1]}: kept from an earlier run", flush=True)
        return 0
    command = [sys.executable, "-m", "benchmarks.mapping", "--out", str(options.out), "--room", f"{room[0]}:{room[1]}"]
    command += ["--cases", ",".join(cases), "--voxel-size", str(options.voxel_size)]
    command += ["--quick"] if options.quick else []
    command += ["--arms", options.arms] if options.arms else []
    threads = str(max(1, (os.cpu_count() or 1) // options.jobs))
    code = subprocess.run(command, env={**os.environ, "NUMBA_NUM_THREADS": threads, "OMP_NUM_THREADS": threads})
    print(f"{room[0]}-{room[1]}: {'done' if code.returncode == 0 else 'failed'}", flush=True)
    return code.returncode


def write_results(
    options: argparse.Namespace, outcomes: Sequence[Outcome], cases: Sequence[str], rooms: Sequence[tuple[str, int]]
) -> None:
    """Write metrics.json and table.md."""
    arms = {arm.name: arm.title for arm in all_arms(options.voxel_size)}
    results: Results = {
        (arm, case): [outcome for outcome in outcomes if (outcome.arm, outcome.case) == (arm, case)]
        for arm in arms
        for case in cases
    }
    results = {key: found for key, found in results.items() if found}
    metrics: dict[str, object] = {
        f"{arm}/{case}/{name}": measure(found)
        for (arm, case), found in results.items()
        for name, measure in MEASURES.items()
    }
    names = [f"{recipe}-{seed}" for recipe, seed in rooms]
    metrics["rooms"], metrics["seeds"] = len(rooms), names
    (options.out / "metrics.json").write_text(json.dumps(metrics, indent=1, sort_keys=True) + "\n")
    shown = SHOWN if SHOWN in cases else cases[0]
    text = [
        f"{len(rooms)} generated rooms ({'tuning' if options.tuning else 'reporting'} seeds: "
        f"{', '.join(names)}), clutter {CLUTTER}, "
        f"{outcomes[0].frames} frames of 640x480 each, depth noise, voxels of {1000 * options.voxel_size:g} mm in "
        "every arm. Shares in per cent; intervals: 95 %, bootstrap over rooms. Missed classes count; columns named for "
        "the thesis's code leave them out and inflate.\n",
        headline(results, arms, cases),
        differences(results, cases),
        by_room(results, arms, shown),
        quality_by_class(results, arms, shown),
        precision_by_class(results, arms, shown, "instances", "Table 2.3's layout: instance AP at IoU 0.5"),
        precision_by_class(results, arms, shown, "boxes", "Table 2.4's layout: oriented boxes as observed"),
        precision_by_class(results, arms, shown, "boxes_refined", "Table 2.4's layout: oriented boxes, refined"),
        printed_by_the_thesis(),
    ]
    (options.out / "table.md").write_text("\n".join(text))
    for (arm, case), found in results.items():
        print(f"{case:16s} {arm:24s} PQ {percent(MEASURES['pq'](found)):>5s}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
