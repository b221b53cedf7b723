"""`python -m benchmarks.scene`: rooms in processes of their own, then the real logs, metrics.json and table.md."""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path

from benchmarks.mapping.rooms import CLUTTER, REPORTING, TUNING_UNTRAINED, RoomFolder, make_room
from benchmarks.scene.arms import ARMS, CASES, MASK_LEVEL, PERFECT, REAL
from benchmarks.scene.experiment import Outcome, Shared, load_room, run_case
from benchmarks.scene.figures_of_merit import FIGURES
from benchmarks.scene.real_logs import annotated_runs, run_real
from benchmarks.scene.tables import (
    PRINTED,
    Results,
    by_room,
    cad_table,
    differences,
    failures_table,
    function_table,
    graph_table,
    physics_table,
    unsettled_table,
)
from schemas.cad_library import CadLibrary

SEED = 0
FRAMES, QUICK_FRAMES = 60, 40
QUICK_ROOMS = 3
HELD_OUT_SEED = 501
"""Of the library whose shapes no room has."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--maps", type=Path, required=True, help="folder of `make bench-mapping`: its rooms and maps")
    parser.add_argument("--real", type=Path, help="folder of `make real`; the case `real` needs its maps")
    parser.add_argument("--quick", action="store_true", help=f"{QUICK_ROOMS} rooms of {QUICK_FRAMES} frames")
    parser.add_argument("--tuning", action="store_true", help="the tuning rooms instead of those for reporting")
    parser.add_argument("--jobs", type=int, default=min(2, os.cpu_count() or 1))
    parser.add_argument("--cases", default="", help="comma-separated; default: all")
    parser.add_argument("--as-is", action="store_true", help="take rooms and maps as they stand, even of older code")
    parser.add_argument("--rooms", type=int, default=0, help="only so many of the rooms, in their order; 0: all")
    parser.add_argument("--keep", action="store_true", help="keep the artifacts (100 MB an arm and case)")
    parser.add_argument("--room", help="run this one room (recipe:seed) and stop")
    options = parser.parse_args(argv)
    has_real = options.real is not None and bool(annotated_runs(options.real))
    cases = options.cases.split(",") if options.cases else [*CASES, *([REAL] if has_real else [])]
    if REAL in cases and not has_real:
        parser.error(f"case {REAL}: no map of an annotated log under --real; run `make real` first")
    options.out.mkdir(parents=True, exist_ok=True)
    if options.room:
        recipe, seed = options.room.split(":")
        return one_room(options, [case for case in cases if case != REAL], (recipe, int(seed)))
    rooms = (TUNING_UNTRAINED if options.tuning else REPORTING)[
        : QUICK_ROOMS if options.quick else options.rooms or None
    ]
    make_libraries(options, rooms[0])
    with ThreadPoolExecutor(options.jobs) as pool:
        codes = list(pool.map(lambda room: _room_process(options, cases, room), rooms))
    failed = [room for room, code in zip(rooms, codes, strict=True) if code]
    if failed:
        print(f"error: {len(failed)} rooms failed: {failed}; see above, then run the command again", file=sys.stderr)
        return 1
    outcomes = [o for room in rooms for case in cases if case != REAL for o in read(outcome_file(options, room, case))]
    if REAL in cases:
        outcomes += run_real(options.real, options.out / "scenes", ARMS, SEED)
    write_results(options, outcomes, cases, rooms)
    return 0


def room_folder(options: argparse.Namespace, room: tuple[str, int]) -> RoomFolder:
    """Return the room's artifacts; they are made, or made again when they are not up to date, but with `--as-is`."""
    folder = RoomFolder(f"{room[0]}-{room[1]}", options.maps / "rooms" / f"{room[0]}-{room[1]}-{frames_of(options)}")
    if options.as_is and folder.ground_truth.is_dir() and folder.sequence.is_dir():
        return folder
    return make_room(options.maps / "rooms", *room, frames_of(options))


def frames_of(options: argparse.Namespace) -> int:
    """Frames of every room."""
    return QUICK_FRAMES if options.quick else FRAMES


def held_out_library(options: argparse.Namespace) -> Path:
    """Where the library stands that shares no shape with the rooms."""
    return Path(options.out) / "held_out_library"


def make_libraries(options: argparse.Namespace, room: tuple[str, int]) -> None:
    """Make the rooms' library and the other one, before rooms run beside each other."""
    room_folder(options, room)
    command = [sys.executable, "-m", "cli", "library", "build", "--seed", str(HELD_OUT_SEED)]
    subprocess.run([*command, "--out", str(held_out_library(options))], check=True, stdout=subprocess.DEVNULL)


def outcome_file(options: argparse.Namespace, room: tuple[str, int], case: str) -> Path:
    """Where a room's outcomes in a case stand."""
    return Path(options.out) / "outcomes" / f"{room[0]}-{room[1]}-{case}.json"


def one_room(options: argparse.Namespace, cases: Sequence[str], room: tuple[str, int]) -> int:
    """Run the cases of one room that are not there yet; maps that are missing are made first."""
    missing = [case for case in cases if not outcome_file(options, room, case).is_file()]
    folder = room_folder(options, room)
    maps = options.maps / "maps" / folder.name
    wanted = sorted({arm.map_arm for arm in ARMS})
    if any(case != PERFECT for case in missing) and not all(
        (maps / MASK_LEVEL / arm / "panoptic_map" / "volume.npz").is_file() for arm in wanted
    ):
        command = [sys.executable, "-m", "benchmarks.mapping", "--out", str(options.maps)]
        command += [
            "--room",
            f"{room[0]}:{room[1]}",
            "--cases",
            MASK_LEVEL,
            "--arms",
            ",".join(wanted),
            *(["--quick"] if options.quick else []),
        ]
        # `make bench-mapping` takes a room for done where this file stands; it would hold these arms alone.
        outcome = options.maps / "outcomes" / f"{folder.name}-{MASK_LEVEL}.json"
        outcome.unlink(missing_ok=True)
        subprocess.run(command, check=True)
        outcome.unlink()
    libraries = {
        False: CadLibrary(options.maps / "rooms" / "cad_library"),
        True: CadLibrary(held_out_library(options)),
    }
    loaded = load_room(folder, maps, libraries)
    shared = Shared()
    for case in missing:
        outcomes = run_case(loaded, ARMS, case, options.out / "scenes", SEED, shared, keep=options.keep)
        write(outcome_file(options, room, case), outcomes)
    return 0


def _room_process(options: argparse.Namespace, cases: Sequence[str], room: tuple[str, int]) -> int:
    generated = [case for case in cases if case != REAL]
    if all(outcome_file(options, room, case).is_file() for case in generated):
        print(f"{room[0]}-{room[1]}: kept from an earlier run", flush=True)
        return 0
    command = [sys.executable, "-m", "benchmarks.scene", "--out", str(options.out), "--maps", str(options.maps)]
    command += ["--room", f"{room[0]}:{room[1]}", "--cases", ",".join(generated)]
    command += [f"--{name.replace('_', '-')}" for name in ("quick", "keep", "as_is") if getattr(options, name)]
    threads = str(max(1, (os.cpu_count() or 1) // options.jobs))
    found = subprocess.run(command, env={**os.environ, "NUMBA_NUM_THREADS": threads, "OMP_NUM_THREADS": threads})
    print(f"{room[0]}-{room[1]}: {'done' if found.returncode == 0 else 'failed'}", flush=True)
    return found.returncode


def write(path: Path, outcomes: list[Outcome]) -> None:
    """Write the outcomes of a room; the file appears whole."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(".partial")
    partial.write_text(json.dumps([asdict(outcome) for outcome in outcomes]))
    partial.rename(path)


def read(path: Path) -> list[Outcome]:
    """Read what `write` wrote."""
    outcomes = []
    for row in json.loads(path.read_text()):
        row["edges"] = {name: tuple(counts) for name, counts in row["edges"].items()}
        row["failures"] = tuple(tuple(entry) for entry in row["failures"])
        outcomes.append(Outcome(**{**row, "unsettled": tuple(row["unsettled"])}))
    return outcomes


def write_results(
    options: argparse.Namespace, outcomes: Sequence[Outcome], cases: Sequence[str], rooms: Sequence[tuple[str, int]]
) -> None:
    """Write metrics.json and table.md."""
    arms = {arm.name: arm.title for arm in ARMS}
    results: Results = {
        (arm, case): [outcome for outcome in outcomes if (outcome.arm, outcome.case) == (arm, case)]
        for arm in arms
        for case in cases
    }
    metrics: dict[str, object] = {
        f"{arm}/{case}/{name}": figure(found)
        for (arm, case), found in results.items()
        if found
        for name, figure in FIGURES.items()
    }
    names = [f"{recipe}-{seed}" for recipe, seed in rooms]
    metrics["rooms"], metrics["seeds"] = len(rooms), names
    (options.out / "metrics.json").write_text(json.dumps(metrics, indent=1, sort_keys=True) + "\n")
    generated = [case for case in cases if case != REAL]
    text = [
        f"{len(rooms)} generated rooms ({'tuning' if options.tuning else 'reporting'} seeds: {', '.join(names)}), "
        f"clutter {CLUTTER}, {frames_of(options)} frames of 640x480 each, depth noise, voxels of 20 mm. Shares in per "
        "cent; intervals: 95 %, bootstrap over rooms. What was missed counts as failed.\n",
        graph_table(results, arms, cases),
        PRINTED,
        cad_table(results, arms, generated),
        physics_table(results, arms, cases),
        function_table(results, arms, generated),
        differences(results, generated),
        by_room(results, list(arms), cases),
        failures_table(results, generated),
        unsettled_table(results, cases),
    ]
    (options.out / "table.md").write_text("\n".join(text))
    print("\n".join(text[:1] + text[1:5]), flush=True)


if __name__ == "__main__":
    sys.exit(main())
