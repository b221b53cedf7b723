"""What one grasp in physics brings to the bin: piles alone, and two piles side by side.

    python -m benchmarks.tidy.physics_holds --out FOLDER [--cases NAME ...] [--repeats N] [--first N]

A case names its piles, lower things first: `c` cup, `b` bowl, `p` plate, `u` utensil; `cc|c` are two cups in one
another beside a third. Places, directions, gaps (dishes 0 to 12 mm, utensils as a pull leaves them) are drawn from the
number. One JSON line a grasp in holds.jsonl; a stopped run goes on.
"""

from __future__ import annotations

import argparse
import json
from collections import defaultdict
from dataclasses import replace
from math import cos, hypot, pi, sin
from pathlib import Path

import numpy as np

from benchmarks.run_log import whole_lines
from stages.kit.measurement.proportions import wilson_interval
from stages.tableware.actions.grasp import grasp, grasp_two
from stages.tableware.simulation.physics import PhysicsTable
from stages.tableware.world.footprints import footprint
from stages.tableware.world.items import Item, Kind, Table, make_item, stand_height

CASES = (
    "c", "b", "u", "cc", "bb", "ccc", "bbb", "bc", "bcc", "bu", "buu", "buuuu", "bcu", "cu", "uu",
    "c|c", "b|b", "u|u", "cc|c", "cc|cc", "bb|b", "bb|bb", "ccc|ccc", "bbb|bbb", "cu|c", "bu|b", "bu|bu", "bc|b",
    "bc|bc", "uu|u", "uu|uu", "bb|bc", "bcc|bc", "bcc|bcc", "bcc|bb", "bbc|b", "bbc|bc", "bbc|bb", "bbc|bbc", "bbc|bcc",
    "bbb|b", "bbb|bc", "bbb|bb", "ccc|c", "bcu|bc", "bcu|bcu", "bccuu", "bbcc", "cccuu", "buuu", "p", "pp", "pbc",
)  # fmt: skip
KINDS: dict[str, Kind] = {"c": "cup", "b": "bowl", "p": "plate"}
NUDGE = 0.001
"""Standard deviation [m] of where a utensil comes to lie on what carries it, along each axis."""


def placed(case: str, number: int) -> Table:
    """Return the piles of a case somewhere on the table."""
    random = np.random.default_rng([number, CASES.index(case), 78])
    piles = case.split("|")
    while True:
        x, y, heading = random.uniform(-0.30, 0.30), random.uniform(-0.22, 0.22), random.uniform(-pi, pi)
        items = _pile(piles[0], "one", x, y, random.uniform(-pi / 2, pi / 2), random)
        if len(piles) == 2:
            base = items[0]
            if base.is_dish:
                apart = 2 * base.measures.rim_radius + random.uniform(0.0, 0.012)
                there = (x + apart * cos(heading), y + apart * sin(heading), random.uniform(-pi / 2, pi / 2))
            else:
                yaw = base.yaw + random.choice([0.0, pi]) + random.normal(0.0, 0.02)
                apart = base.measures.width + 0.01 + random.normal(0.0, 0.001)
                along = random.normal(0.0, 0.003)
                there = (
                    x + along * cos(base.yaw) - apart * sin(base.yaw),
                    y + along * sin(base.yaw) + apart * cos(base.yaw),
                    yaw,
                )
            items = (*items, *_pile(piles[1], "other", *there, random))
        if all(footprint(item).on_table for item in items):
            return Table(items)


def _pile(kinds: str, name: str, x: float, y: float, yaw: float, random: np.random.Generator) -> tuple[Item, ...]:
    table = Table(())
    below: str | None = None
    for number, letter in enumerate(kinds):
        kind: Kind = KINDS[letter] if letter in KINDS else ("fork", "spoon")[int(random.integers(2))]
        at, turned = (x, y), yaw
        if letter == "u" and below is not None:
            at = (x + random.normal(0.0, NUDGE), y + random.normal(0.0, NUDGE))
            turned = yaw + (random.normal(0.0, 0.01) if not table.by_name[below].is_dish else 0.0)
        item = make_item(f"{name}_{number}", kind, *at, turned if letter == "u" else 0.0, on=below)
        if below is not None:
            item = replace(item, position=(*at, stand_height(table, item, below)))
        table, below = Table((*table.items, item)), item.name
    return table.items


def held(case: str, number: int) -> dict[str, object]:
    """Return how many things of a case came to the bin, and what it took."""
    tilts: dict[str, float] = {}

    def watch(world: PhysicsTable, label: str) -> None:
        if label == "over the bin":
            tilts.update({name: float(np.rad2deg(world.top.lean(name))) for name in world.top.bodies})

    world = PhysicsTable(placed(case, number), record=watch)
    table = world.table
    bases = [pile[0].name for pile in table.stacks]
    count = len(table.items)
    angle = float(np.random.default_rng([number, 79]).uniform(-pi, pi))
    stood = len(bases) == len(case.split("|")) and count == len(case.replace("|", ""))
    if stood:
        world.do(grasp_two(table, *bases) if len(bases) == 2 else grasp(table, bases[0], angle))
    trial = world.trial
    row: dict[str, object] = {
        "stood": stood, "items": count, "moved": trial.moved, "dropped": trial.dropped, "left": trial.left,
        "seconds": round(trial.seconds, 2), "troubles": world.troubles,
        "tilt": round(max(tilts.values(), default=0.0), 1),
        "apart": round(hypot(*np.subtract(table.items[0].position[:2], table.items[-1].position[:2])), 4),
    }  # fmt: skip
    world.close()
    return row


def metrics(rows: list[dict[str, object]]) -> dict[str, float]:
    """Return `hold/<case>/<measure>` -> number over the grasps before which everything stood."""
    groups: dict[str, list[dict[str, object]]] = defaultdict(list)
    for row in rows:
        if row["stood"]:
            groups[str(row["case"])].append(row)
    figures: dict[str, float] = {}
    for case, group in groups.items():
        kept = sum(row["moved"] == row["items"] for row in group)
        low, high = wilson_interval(kept, len(group))
        lost = sum(int(str(row["dropped"])) > 0 for row in group)
        figures |= {
            f"hold/{case}/grasps": len(group), f"hold/{case}/kept_share": round(kept / len(group), 4),
            f"hold/{case}/kept_share_low": round(low, 4), f"hold/{case}/kept_share_high": round(high, 4),
            f"hold/{case}/lost_share": round(lost / len(group), 4),
            f"hold/{case}/tilt_degrees": round(float(np.median([float(str(row["tilt"])) for row in group])), 1),
            f"hold/{case}/seconds": round(float(np.mean([float(str(row["seconds"])) for row in group])), 3),
        }  # fmt: skip
    return figures


def table(figures: dict[str, float]) -> str:
    """Return table.md."""
    cases = [case for case in CASES if f"hold/{case}/grasps" in figures]
    lines = [
        "## Holds in physics",
        "",
        "Kept: everything came to the bin [95 % Wilson]; lost: something fell; tilt: of what hangs the most, median.",
        "",
    ]
    lines += ["| piles | grasps | kept | lost | tilt | seconds |", "|---|--:|--:|--:|--:|--:|"]
    for case in cases:
        count, kept, low, high, lost, tilt, seconds = (
            figures[f"hold/{case}/{name}"]
            for name in (
                "grasps",
                "kept_share",
                "kept_share_low",
                "kept_share_high",
                "lost_share",
                "tilt_degrees",
                "seconds",
            )
        )
        shown = case.replace("|", " beside ")
        lines.append(
            f"| {shown} | {count:g} | {100 * kept:.0f} % [{100 * low:.0f}, {100 * high:.0f}] | {100 * lost:.0f} % "
            f"| {tilt:.0f} | {seconds:.1f} |"
        )
    return "\n".join(lines) + "\n"


def main() -> None:
    """Parse the command line and run."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.tidy.physics_holds", description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--cases", nargs="+", default=list(CASES), choices=CASES)
    parser.add_argument("--repeats", type=int, default=10)
    parser.add_argument("--first", type=int, default=0, help="number of the first draw")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    log = options.out / "holds.jsonl"
    rows = [json.loads(line) for line in whole_lines(log)]
    done = {(row["case"], row["number"]) for row in rows}
    for number in range(options.first, options.first + options.repeats):
        for case in options.cases:
            if (case, number) not in done:
                row = {"case": case, "number": number, **held(case, number)}
                rows.append(row)
                with log.open("a", encoding="utf-8") as stream:
                    stream.write(json.dumps(row) + "\n")
    figures = metrics(rows)
    (options.out / "metrics.json").write_text(json.dumps(figures, indent=1, sort_keys=True) + "\n")
    (options.out / "table.md").write_text(table(figures), encoding="utf-8")
    print(options.out / "table.md")


if __name__ == "__main__":
    main()
