"""Pulls in physics: table 7.3 of Srinivas 2024, and what a pulled dish may carry.

pull/<dishes>/<cm>: a pull is aimed from a nominal place; the dish stands elsewhere, drawn uniformly where the closed
fingers still go down inside it (10 placements a row, as the thesis). Initial and final distance: from where the dish
should start and end. load/<pile>/<m/s>: a pile is pulled; kept: everything still stands on what carried it, and the
pile within 1 cm of its goal. pair/<pile>: a pile is pulled to a dish like its lowest one, and both are carried away;
kept: everything comes to the bin.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from math import cos, hypot, pi, sin

import numpy as np
from scenewright.stages.tableware import (
    STANDARD,
    Kind,
    PhysicsTable,
    Pull,
    Rules,
    Speeds,
    Table,
    make_item,
    pull_grasp,
    stand_height,
)
from scenewright.stages.tableware.simulation.holds import PAD, PAD_WIDTH

from benchmarks.experiment import Bench, Experiment, Measure, Results, Trial, count, mean, share

PLURAL: dict[str, Kind] = {"cups": "cup", "bowls": "bowl"}
LENGTHS = (20, 30, 40)
PRINTED = {"cups": (0.19, 0.13, 0.07), "bowls": (0.21, 0.24, 0.16)}
"""Expected divergence by LENGTHS, as the thesis prints it."""
LOADS = ("c", "b", "cc", "bb", "bc", "bu", "bcc", "ccc", "bbb", "bbc")
SPEEDS = (0.1, 0.2, 0.3)
KINDS: dict[str, Kind] = {"c": "cup", "b": "bowl", "u": "fork"}
INSIDE = 0.030
"""Height [m] above the foot at which the fingers must fit for a placement to count as around the hand."""


def divergence(plural: str, centimetres: int, number: int) -> dict[str, float]:
    """Return initial and final distance [cm] of one placement."""
    kind = PLURAL[plural]
    random = np.random.default_rng([number, centimetres, list(PLURAL).index(plural), 75])
    most = STANDARD[kind].inner_radius(INSIDE) - hypot(PAD, PAD_WIDTH / 2) - 0.002
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


WORK: dict[str, Callable[[int], dict[str, float]]] = {
    **{f"pull/{dishes}/{length}": partial(divergence, dishes, length) for dishes in PLURAL for length in LENGTHS},
    **{f"load/{pile}/{speed}": partial(load, pile, speed) for pile in LOADS for speed in SPEEDS},
    **{f"pair/{pile}": partial(pair, pile) for pile in LOADS},
}


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, dict[str, float]]]:
    """Yield pulls."""
    for trial in trials:
        yield trial, WORK[trial.case](int(trial.seed))


def expected_divergence(rows: Sequence[dict[str, float]]) -> float | None:
    """Sum of final over sum of initial distances (Srinivas 2024, section 6.3)."""
    pulled = [row for row in rows if "initial" in row]
    return sum(row["final"] for row in pulled) / sum(row["initial"] for row in pulled) if pulled else None


def printed(results: Results) -> dict[str, float]:
    """The expected divergences of table 7.3 beside those that were measured."""
    return {
        f"printed thesis/pull/{dishes}/{length}/expected_divergence": value
        for dishes, row in PRINTED.items()
        for length, value in zip(LENGTHS, row, strict=True)
        if f"pull/{dishes}/{length}" in results.cases
    }


EXPERIMENT = Experiment(
    name="tidy_pulls",
    title="Pulls in physics",
    simulated="Tables, dishes, and an arm with friction grasps.",
    knows="Where everything stands, but for the drawn error of a placement.",
    does_not_show="A real arm or table.",
    arms={"ours": "ours"},
    cases=tuple(WORK),
    tuning=tuple(map(str, range(10))),
    reporting=tuple(map(str, range(30, 50))),
    measure=measure,
    record=dict[str, float],
    measures={
        "pulls": Measure(count, interval=False),
        "initial_distance_cm": mean("initial", "cm"),
        "final_distance_cm": mean("final", "cm"),
        "expected_divergence": Measure(expected_divergence),
        "kept_share": share("kept"),
    },
    quick_seeds=2,
    more_figures=printed,
)
