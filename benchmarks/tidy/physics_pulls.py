"""Pulls in physics: table 7.3 of Srinivas 2024, and what a pulled dish may carry.

    python -m benchmarks.tidy.physics_pulls --out FOLDER [--quick] [--part divergence|loads|pairs ...]
                                            [--piles NAME ...] [--speeds METRES_PER_SECOND ...] [--seconds S]

divergence: a pull of 20, 30 or 40 cm is aimed from a nominal place; the dish stands elsewhere, drawn uniformly where
the closed fingers still go down inside it (10 placements a row, as the thesis). Initial and final distance: from where
the dish should start and end. loads: piles are pulled at several speeds; kept: everything still stands on what carried
it, and the pile within 1 cm of its goal. pairs: a pile is pulled to a dish like its lowest one, and both are carried
away; kept: everything comes to the bin. One JSON line a pull in pulls.jsonl; a stopped run goes on.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import defaultdict
from collections.abc import Callable
from math import cos, hypot, pi, sin
from pathlib import Path

import numpy as np

from benchmarks.run_log import whole_lines
from stages.tableware.actions.pull import Pull
from stages.tableware.actions.pull_grasp import pull_grasp
from stages.tableware.planning.rules import Rules
from stages.tableware.simulation.holds import PAD, PAD_WIDTH
from stages.tableware.simulation.physics import PhysicsTable, Speeds
from stages.tableware.world.items import MEASURES, Kind, Table, make_item, stand_height

PLURAL: dict[str, Kind] = {"cups": "cup", "bowls": "bowl"}
LENGTHS = (20, 30, 40)
PLACEMENTS = 10
LOADS = ("c", "b", "cc", "bb", "bc", "bu", "bcc", "ccc", "bbb")
SPEEDS = (0.1, 0.2, 0.3)
REPEATS = 10
KINDS: dict[str, Kind] = {"c": "cup", "b": "bowl", "u": "fork"}
INSIDE = 0.030
"""Height [m] above the foot at which the fingers must fit for a placement to count as around the hand."""


def divergence(plural: str, centimetres: int, number: int) -> dict[str, float]:
    """Return initial and final distance [cm] of one placement."""
    kind = PLURAL[plural]
    random = np.random.default_rng([number, centimetres, list(PLURAL).index(plural), 75])
    most = MEASURES[kind].inner_radius(INSIDE) - hypot(PAD, PAD_WIDTH / 2) - 0.002
    radius, angle = most * np.sqrt(random.random()), random.uniform(-pi, pi)
    nominal, length = (-0.25, 0.05), centimetres / 100
    heading = random.uniform(-0.15, 0.15)
    goal = (nominal[0] + length * cos(heading), nominal[1] + length * sin(heading))
    right = make_item("dish", kind, *nominal)
    item = make_item("dish", kind, nominal[0] + radius * cos(angle), nominal[1] + radius * sin(angle))
    world = PhysicsTable(Table((item,)))
    start = world.table.by_name["dish"].position
    world.do(Pull("dish", "", (*nominal, 0.0), heading, (*goal, 0.0), heading), Table((right,)))
    end = world.table.by_name["dish"].position
    world.close()
    return {
        "initial": 100 * hypot(start[0] - nominal[0], start[1] - nominal[1]),
        "final": 100 * hypot(end[0] - goal[0], end[1] - goal[1]),
    }


def pile(letters: str, x: float, y: float, yaw: float) -> Table:
    """Return a pile at a place, lower things first."""
    table = Table(())
    below = None
    for number, letter in enumerate(letters):
        item = make_item(f"{KINDS[letter]}_{number}", KINDS[letter], x, y, yaw if letter == "u" else 0.0, on=below)
        if below is not None:
            z = stand_height(table, item, below)
            item = make_item(item.name, item.kind, x, y, item.yaw, z, below)
        table, below = Table((*table.items, item)), item.name
    return table


def load(letters: str, speed: float, number: int) -> dict[str, float]:
    """Return whether a pile bears a pull of 18 cm at a speed [m/s]."""
    random = np.random.default_rng([number, LOADS.index(letters), 76])
    heading = random.uniform(-pi, pi)
    table = pile(letters, 0.0, 0.05, random.uniform(-pi / 2, pi / 2))
    goal = (0.18 * cos(heading), 0.05 + 0.18 * sin(heading))
    world = PhysicsTable(table, speeds=Speeds(pull=speed))
    base = table.items[0].name
    seen = world.table
    world.do(Pull(base, "", (0.0, 0.05, 0.0), heading, (*goal, 0.0), heading))
    after = world.table.by_name
    stood = not world.troubles and all(item.name in after and after[item.name].on == item.on for item in seen.items)
    off = hypot(after[base].position[0] - goal[0], after[base].position[1] - goal[1]) if base in after else 1.0
    lost = world.trial.dropped
    world.close()
    return {"kept": float(stood and off < 0.01), "off_cm": 100 * off, "lost": lost}


def pair(letters: str, number: int) -> dict[str, float]:
    """Return whether a pile pulled to a dish like its lowest is carried away with it."""
    random = np.random.default_rng([number, LOADS.index(letters), 77])
    heading = random.uniform(-pi, pi)
    first = pile(letters, 0.16 * cos(heading), 0.03 + 0.16 * sin(heading), random.uniform(-pi / 2, pi / 2))
    other = make_item("target", KINDS[letters[0]], -0.1 * cos(heading), 0.03 - 0.1 * sin(heading))
    world = PhysicsTable(Table((*first.items, other)))
    count = len(world.table.items)
    world.do(pull_grasp(world.table, first.items[0].name, "target", Rules()))
    result = {"kept": float(world.trial.moved == count), "lost": world.trial.dropped}
    world.close()
    return result


def main() -> None:
    """Parse the command line and run."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.tidy.physics_pulls", description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--quick", action="store_true", help="two pulls a row")
    parser.add_argument("--part", nargs="+", default=["divergence", "loads", "pairs"])
    parser.add_argument("--piles", nargs="+", default=list(LOADS), choices=LOADS)
    parser.add_argument("--speeds", nargs="+", type=float, default=list(SPEEDS), help="of loads [m/s]")
    parser.add_argument("--seconds", type=float, help="stop after this time")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    log = options.out / "pulls.jsonl"
    rows = _read(log)
    done = {(row["case"], row["number"]) for row in rows}
    repeats = 2 if options.quick else REPEATS
    jobs: list[tuple[str, int, Callable[..., dict[str, float]], tuple[object, ...]]] = []
    if "divergence" in options.part:
        jobs += [
            (f"pull/{plural}/{length}", number, divergence, (plural, length, number))
            for number in range(2 if options.quick else PLACEMENTS)
            for plural in PLURAL
            for length in LENGTHS
        ]
    if "loads" in options.part:
        jobs += [
            (f"load/{letters}/{speed}", number, load, (letters, speed, number))
            for number in range(repeats)
            for letters in options.piles
            for speed in options.speeds
        ]
    if "pairs" in options.part:
        jobs += [(f"pair/{letters}", n, pair, (letters, n)) for n in range(repeats) for letters in options.piles]
    started = time.monotonic()
    for case, number, work, arguments in jobs:
        if options.seconds is not None and time.monotonic() - started > options.seconds:
            break
        if (case, number) not in done:
            row = {"case": case, "number": number, **work(*arguments)}
            rows.append(row)
            with log.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps(row) + "\n")
    figures = metrics(rows)
    (options.out / "metrics.json").write_text(json.dumps(figures, indent=1, sort_keys=True) + "\n")
    (options.out / "table.md").write_text(table(figures), encoding="utf-8")
    print(options.out / "table.md")


def _read(path: Path) -> list[dict[str, object]]:
    return [json.loads(line) for line in whole_lines(path)]


def metrics(rows: list[dict[str, object]]) -> dict[str, float]:
    """Return `ours/<case>/<measure>` -> number. Expected divergence: sum of final over sum of initial distances
    (Srinivas 2024, section 6.3)."""
    groups: dict[str, list[dict[str, object]]] = defaultdict(list)
    for row in rows:
        groups[str(row["case"])].append(row)
    figures: dict[str, float] = {}
    for case, group in groups.items():
        figures[f"ours/{case}/pulls"] = len(group)
        if case.startswith("pull/"):
            initial = np.array([float(str(row["initial"])) for row in group])
            final = np.array([float(str(row["final"])) for row in group])
            figures[f"ours/{case}/initial_distance_cm"] = round(float(initial.mean()), 3)
            figures[f"ours/{case}/final_distance_cm"] = round(float(final.mean()), 3)
            figures[f"ours/{case}/expected_divergence"] = round(float(final.sum() / initial.sum()), 4)
        else:
            figures[f"ours/{case}/kept_share"] = round(float(np.mean([float(str(row["kept"])) for row in group])), 3)
    return figures


THESIS = {
    "cups/20": 0.19, "cups/30": 0.13, "cups/40": 0.07, "bowls/20": 0.21, "bowls/30": 0.24, "bowls/40": 0.16,
}  # fmt: skip
"""Expected divergence of table 7.3."""


def table(figures: dict[str, float]) -> str:
    """Return table 7.3 with the thesis's divergence beside ours, and the shares of piles that arrived whole."""
    cases = sorted({name.rsplit("/", 1)[0].removeprefix("ours/") for name in figures})
    pulls = [case for case in cases if case.startswith("pull/")]
    lines = ["## Table 7.3: pulls in physics", ""]
    lines += ["| pull, length [cm] | n | initial [cm] | final [cm] | divergence | thesis |"]
    lines += ["|---|--:|--:|--:|--:|--:|"]
    for case in pulls:
        count, *values = (
            figures[f"ours/{case}/{measure}"]
            for measure in ("pulls", "initial_distance_cm", "final_distance_cm", "expected_divergence")
        )
        shown = " | ".join(f"{value:.2f}" for value in values)
        name = case.removeprefix("pull/")
        lines.append(f"| {name} | {count:g} | {shown} | {THESIS.get(name, float('nan')):.2f} |")
    if len(cases) > len(pulls):
        lines += ["", "| pile | n | kept |", "|---|--:|--:|"]
    lines += [
        f"| {case} | {figures[f'ours/{case}/pulls']:g} | {100 * figures[f'ours/{case}/kept_share']:.0f} % |"
        for case in cases
        if case not in pulls
    ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
