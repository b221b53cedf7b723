"""Holds in physics: what one grasp brings to the bin, of piles alone and of two piles side by side.

A case names its piles, lower things first: `c` cup, `b` bowl, `p` plate, `u` utensil; `cc|c` are two cups in one
another beside a third. Places, directions, gaps (dishes 0 to 12 mm, utensils as a pull leaves them) are drawn from the
number.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import cos, hypot, pi, sin

import numpy as np
from scenewright.stages.tableware import (
    Item,
    Kind,
    PhysicsTable,
    Table,
    footprint,
    grasp,
    grasp_two,
    make_item,
    stand_height,
)

from benchmarks.experiment import Bench, Experiment, Measure, Trial, count, mean, median, share

CASES = (
    "c",
    "b",
    "u",
    "cc",
    "bb",
    "ccc",
    "bbb",
    "bc",
    "bcc",
    "bu",
    "buu",
    "buuuu",
    "bcu",
    "cu",
    "uu",
    "c|c",
    "b|b",
    "u|u",
    "cc|c",
    "cc|cc",
    "bb|b",
    "bb|bb",
    "ccc|ccc",
    "bbb|bbb",
    "cu|c",
    "bu|b",
    "bu|bu",
    "bc|b",
    "bc|bc",
    "uu|u",
    "uu|uu",
    "bb|bc",
    "bcc|bc",
    "bcc|bcc",
    "bcc|bb",
    "bbc|b",
    "bbc|bc",
    "bbc|bb",
    "bbc|bbc",
    "bbc|bcc",
    "bbb|b",
    "bbb|bc",
    "bbb|bb",
    "ccc|c",
    "bcu|bc",
    "bcu|bcu",
    "bccuu",
    "bbcc",
    "cccuu",
    "buuu",
    "p",
    "pp",
    "pbc",
)
SHOWN = (
    "ccc",
    "bbb",
    "buu",
    "buuuu",
    "cc|c",
    "cc|cc",
    "bb|bb",
    "bbb|bbb",
    "bc|bc",
    "bcc|bcc",
    "bcc|bb",
    "bbc|bbc",
    "bbb|bb",
    "cccuu",
    "p",
    "pp",
)
"""What the page shows, by default."""
KINDS: dict[str, Kind] = {"c": "cup", "b": "bowl", "p": "plate"}
NUDGE = 0.001
"""Standard deviation [m] of where a utensil comes to lie on what carries it, along each axis."""


@dataclass(frozen=True)
class Grasp:
    """What a grasp brought to the bin."""

    stood: bool
    """Whether everything stood before it."""
    items: int
    moved: int
    dropped: int
    left: int
    seconds: float
    troubles: tuple[str, ...]
    tilt: float
    """Of what hangs the most over the bin [degrees]."""
    apart: float
    """First and last thing, in the plane [m]."""

    @property
    def kept(self) -> float:
        """Whether everything came to the bin."""
        return float(self.moved == self.items)

    @property
    def lost(self) -> float:
        """Whether something fell."""
        return float(self.dropped > 0)


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


def held(case: str, number: int) -> Grasp:
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
    row = Grasp(
        stood=stood,
        items=count,
        moved=trial.moved,
        dropped=trial.dropped,
        left=trial.left,
        seconds=trial.seconds,
        troubles=tuple(world.troubles),
        tilt=max(tilts.values(), default=0.0),
        apart=hypot(*np.subtract(table.items[0].position[:2], table.items[-1].position[:2])),
    )
    world.close()
    return row


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Grasp]]:
    """Yield grasps."""
    for trial in trials:
        yield trial, held(trial.case, int(trial.seed))


EXPERIMENT = Experiment(
    name="tidy_holds",
    title="Holds in physics",
    simulated="Tables, dishes, and an arm with friction grasps.",
    knows="Where everything stands.",
    does_not_show="A real arm or table.",
    arms={"hold": "hold"},
    cases=CASES,
    default_cases=lambda bench: SHOWN,
    tuning=tuple(map(str, range(10))),
    reporting=tuple(map(str, range(20, 40))),
    measure=measure,
    record=Grasp,
    subcases={case: (case, lambda grasp: grasp if grasp.stood else None) for case in CASES},
    measures={
        "grasps": Measure(count, interval=False),
        "kept_share": share("kept"),
        "lost_share": share("lost"),
        "tilt_degrees": median("tilt", "°", interval=False),
        "seconds": mean("seconds", "s", interval=False),
    },
    quick_seeds=1,
)
