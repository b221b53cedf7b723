"""Short tasks of a true room, drawn by seed: what is to hold in the end, in true names."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from benchmarks.board.tasks.room_facts import CARRIERS, SHELVES, SIDE_INSIDE, TABLES, TOPS, RoomFacts, Thing

TASKS = 5
"""Tasks of a room, where it holds so many."""
MOST_CLEARED = 3
"""Most things of a task that clears a table."""


@dataclass(frozen=True)
class Task:
    """What is asked of the robot in one room, in true names."""

    kind: str
    goal: tuple[str, ...]
    """Literals such as `on(cup_5, table_3)`; none holds at the beginning."""
    keeps: tuple[str, ...] = ()
    """Literals that hold at the beginning and have to hold in the end too: furniture that is shut again. They count
    for success, not for the share of literals that hold."""

    def literals(self) -> tuple[str, ...]:
        """Return all that has to hold in the end."""
        return self.goal + self.keeps


def draw_tasks(facts: RoomFacts, seed: int) -> tuple[Task, ...]:
    """Return up to `TASKS` tasks of a room, no goal twice.

    The kinds are put in an order by seed; each in turn gives one of the tasks that the room holds of it, all alike
    likely, until there are enough or no kind has another one.
    """
    random = np.random.default_rng(seed)
    left = [list(KINDS[name](facts)) for name in random.permutation(sorted(KINDS)).tolist()]
    drawn: list[Task] = []
    while len(drawn) < TASKS and any(left):
        for tasks in left:
            if tasks and len(drawn) < TASKS:
                drawn.append(tasks.pop(int(random.integers(len(tasks)))))
    return tuple(drawn)


def move(facts: RoomFacts) -> Iterator[Task]:
    """Something small that stands in the open goes to another table, shelf or top."""
    for thing in _in_the_open(facts):
        for place in facts.of_class(*TABLES, *SHELVES, *TOPS):
            if place != thing.parent and facts.fits(thing, place, inside=False):
                yield Task("move", (f"on({thing.name}, {place})",))


def put_in(facts: RoomFacts) -> Iterator[Task]:
    """Something small goes into furniture with doors or drawers, which is shut in the end."""
    holding = sorted({level.owner for level in facts.levels if level.inside})
    for thing in facts.things:
        for place in holding:
            if place != thing.parent and facts.fits(thing, place, inside=True):
                yield _and_shut("put_in", facts, (f"in({thing.name}, {place})",), place)


def take_out(facts: RoomFacts) -> Iterator[Task]:
    """Something in furniture with doors or drawers goes on a table, the furniture is shut in the end."""
    for thing in facts.things:
        for place in facts.of_class(*TABLES):
            if thing.inside and facts.fits(thing, place, inside=False):
                yield _and_shut("take_out", facts, (f"on({thing.name}, {place})",), thing.parent)


def clear(facts: RoomFacts) -> Iterator[Task]:
    """Everything small on a table, two things or three, goes onto a shelf or a top; of more, any three."""
    for table in facts.of_class(*TABLES):
        for place in facts.of_class(*SHELVES, *TOPS):
            things = [thing for thing in facts.things if thing.parent == table]
            fitting = [thing for thing in things if facts.fits(thing, place, inside=False)]
            if len(things) < 2 or (len(fitting) < len(things) and len(fitting) < MOST_CLEARED):
                continue
            for chosen in combinations(fitting, min(len(fitting), MOST_CLEARED)):
                yield Task("clear", tuple(f"on({thing.name}, {place})" for thing in chosen))


def load_tray(facts: RoomFacts) -> Iterator[Task]:
    """Two small things go onto a tray on which they have room beside each other."""
    for tray in facts.of_class(*CARRIERS):
        longest, narrowest = (2 * next(level.half for level in facts.levels if level.owner == tray)[[0, 1]]).tolist()
        longest, narrowest = max(longest, narrowest), min(longest, narrowest)
        for pair in combinations([thing for thing in _in_the_open(facts) if thing.parent != tray], 2):
            widths = [2 * (thing.radius + SIDE_INSIDE) for thing in pair]
            if sum(widths) <= longest and max(widths) <= narrowest:
                yield Task("load_tray", tuple(f"on({thing.name}, {tray})" for thing in pair))


KINDS: dict[str, Callable[[RoomFacts], Iterator[Task]]] = {
    "move": move,
    "put_in": put_in,
    "take_out": take_out,
    "clear": clear,
    "load_tray": load_tray,
}
"""Kind -> the tasks of it that a room holds."""


def _in_the_open(facts: RoomFacts) -> Sequence[Thing]:
    return [thing for thing in facts.things if not thing.inside]


def _and_shut(kind: str, facts: RoomFacts, goal: tuple[str, ...], place: str) -> Task:
    shut = (f"closed({place})",)
    return Task(kind, goal + shut) if place in facts.open_containers else Task(kind, goal, shut)
