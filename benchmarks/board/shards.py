"""What is measured together: units of work, and shards of them that end within twenty minutes of two cores."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from itertools import accumulate
from multiprocessing import get_context

from scenewright.schemas.errors import ScenewrightError
from scenewright.stages.engine.interruption import PARENT_VARIABLE, end_with_parent

from benchmarks.board import others, rooms, tasks
from benchmarks.board.real import part as real_logs
from benchmarks.board.records import Line
from benchmarks.board.rooms import SEALED_RECIPES, Setting, public_rooms

JOBS = 2


@dataclass(frozen=True)
class Unit:
    """Work that one process does: a room, a log, a system."""

    part: str
    name: str

    def measure(self, setting: Setting) -> Iterator[Line]:
        """Yield its lines, kept or measured."""
        return MEASURES[self.part](setting, self.name)


MEASURES: dict[str, Callable[[Setting, str], Iterator[Line]]] = {
    "public": lambda setting, name: rooms.measure_public(setting, *_room_and_rungs(name)),
    "sealed": lambda setting, name: rooms.measure_sealed(setting, int(name)),
    "tasks": lambda setting, name: tasks.measure_room(setting, int(name)),
    "real": real_logs.measure_log,
    "others": others.measure_system,
}


def _room_and_rungs(name: str) -> tuple[str, tuple[str, ...]]:
    """Return the room of a unit, and the rungs that are named behind it; none are all of that room."""
    room, *rungs = name.split()
    return room, tuple(rungs)


def all_shards() -> dict[str, list[Unit]]:
    """Return the shards by name, in the order in which they are measured."""
    parts = {
        "public": ([Unit("public", room) for room in public_rooms()], (2, 2, 2, 10)),
        "real": ([Unit("real", name) for name in real_logs.names()], (len(real_logs.names()),)),
        "sealed": ([Unit("sealed", str(number)) for number in range(len(SEALED_RECIPES))], (4, 4, 4)),
        "others": ([Unit("others", name) for name in others.SYSTEMS], (len(others.SYSTEMS),)),
        "tasks": ([Unit("tasks", str(number)) for number in range(tasks.ROOMS)], (4, 4, 4)),
    }
    shards = {}
    for part, (units, sizes) in parts.items():
        for number, last in enumerate(accumulate(sizes), start=1):
            name = part if len(sizes) == 1 else f"{part}-{number}"
            shards[name] = units[last - sizes[number - 1] : last]
    return shards


def measure_shard(
    setting: Setting, units: Sequence[Unit], say: Callable[[str], None], jobs: int = JOBS
) -> tuple[list[Line], list[str]]:
    """Return the lines of all units, and what failed in words: a unit that fails leaves the others alone."""
    lines: list[Line] = []
    problems: list[str] = []
    own = {"NUMBA_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", PARENT_VARIABLE: str(os.getpid())}
    os.environ.update(own)
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn"), initializer=end_with_parent) as pool:
        waiting = {pool.submit(measure_unit, setting, unit): unit for unit in units}
        for number, future in enumerate(as_completed(waiting), start=1):
            found, problem = future.result()
            lines += found
            problems += [problem] if problem else []
            unit = waiting[future]
            say(f"{number} of {len(units)}: {unit.part} {unit.name}: {problem or f'{len(found)} lines'}")
    return lines, problems


def measure_unit(setting: Setting, unit: Unit) -> tuple[list[Line], str]:
    """Return the lines of a unit, and the error that ended it, or ""."""
    lines: list[Line] = []
    try:
        lines.extend(unit.measure(setting))
    except ScenewrightError as error:
        return lines, f"{unit.part} {unit.name}: {error}"
    return lines, ""
