"""Five minutes of the board: a small room, a table told in words, and what was not run under its name."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.board.figures import line_for_a_lab
from benchmarks.board.inputs import HEADLINE, LADDER, RUNGS
from benchmarks.board.records import Line, by_case
from benchmarks.board.shards import Unit, all_shards
from benchmarks.tabulation import markdown

ROOM = LADDER[2]
RUNS = ("perfect", "errors")
"""Rungs that five minutes allow in one room."""
SYSTEM = "told robot"
NOT_RUN = "not run"


def quick_units() -> list[Unit]:
    """Return the units of a quick run."""
    return [Unit("public", " ".join((ROOM, *RUNS))), Unit("others", SYSTEM)]


def quick_table(lines: Sequence[Line]) -> str:
    """Return a row for everything that the board measures: what came of one room, or that it was not run."""
    found = {group: line_for_a_lab(own) for group, own in by_case(lines).items() if group[0] == "public"}
    rows = [
        (f"public rooms, {rung}: {RUNGS[rung].title}", found.get(("public", rung, "ours"), NOT_RUN)) for rung in RUNGS
    ]
    rows.append((f"sealed rooms, {HEADLINE}", f"{NOT_RUN}: a quick look would be a look"))
    units = [unit for shard in all_shards().values() for unit in shard if unit.part in ("tasks", "real", "others")]
    for part, name in dict.fromkeys((unit.part, unit.name if unit.part != "tasks" else "") for unit in units):
        own = [line for line in lines if line.trial.part == part and line.trial.case == name]
        said = "; ".join(f"{line.trial.arm} {_numbers(line)}" for line in own) or NOT_RUN
        rows.append((f"{part} {name}".strip(), said))
    return markdown("One room, so no interval: nothing here is published", ("what", "came of it"), rows)


def _numbers(line: Line) -> str:
    return ", ".join(f"{name} {value:.3g}" for name, value in sorted(line.figures.items()))
