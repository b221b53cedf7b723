"""Twelve tasks: the thesis's four at a table and four on the move with their words, two with a door to open, two that
cannot be done. Each stocks an apartment and says in `goals` what counts; brains get the words alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from scenewright.schemas.apartment import Apartment
from scenewright.stages.agent.goals import FRUIT, TOYS, Among, Gather, Goal, Move, Shut, kind
from scenewright.stages.agent.world.generation import Draft, drawn

CLUTTER = ("book", "can", "sponge", "bottle", "spoon")
COLORS = ("red", "blue", "green", "white")


@dataclass(frozen=True)
class Task:
    """A task. `stock` adds what it needs to a draft and returns before what the robot starts."""

    name: str
    words: str
    goals: tuple[Goal, ...]
    stock: Callable[[Draft], str | None]
    impossible: str = ""
    """The word that a right refusal names; empty: it can be done."""


def make_apartment(task: Task, seed: int) -> Apartment:
    """Return the apartment of a task and a seed."""
    return drawn(seed, list(TASKS).index(task.name), task.stock)


def make_household(seed: int) -> Apartment:
    """Return an apartment with a little of everything, for words of the user's own."""
    return drawn(seed, len(TASKS), _household)


def _furnish(draft: Draft, tables: int = 2, *more: str) -> list[str]:
    """Put up what every apartment has, the tables first; return the tables' names."""
    for label in (*("table",) * tables, "bed", "sofa", "fridge", "dresser", *more):
        draft.add_furniture(label)
    return draft.named("table")


def _clutter(draft: Draft, tables: list[str]) -> None:
    for _ in range(int(draft.random.integers(draft.recipe.clutter[0], draft.recipe.clutter[1] + 1))):
        label, table = draft.random.choice(CLUTTER), draft.random.choice(tables)
        draft.add_thing(str(label), str(table))


def _some(draft: Draft, labels: tuple[str, ...], low: int, high: int) -> list[str]:
    """Draw from `low` to `high` classes, each once."""
    return [str(x) for x in draft.random.permutation(list(labels))[: int(draft.random.integers(low, high + 1))]]


def _place_fruit(draft: Draft) -> str:
    table = _furnish(draft)[0]
    draft.add_thing("plate", table, carries=True)
    for label in _some(draft, FRUIT, 2, 3):
        draft.add_thing(label, table)
    draft.add_thing("cup", table, color="white")
    _clutter(draft, [table])
    return table


def _fruit_among_cups(draft: Draft) -> str:
    table = _furnish(draft)[0]
    draft.add_thing(_some(draft, FRUIT, 1, 1)[0], table)
    for _ in range(int(draft.random.integers(2, 4))):
        draft.add_thing("cup", table, color=str(draft.random.choice(COLORS)))
    _clutter(draft, [table])
    return table


def _prepare_cup(draft: Draft) -> str:
    table = _furnish(draft)[0]
    draft.add_thing("plate", table, carries=True)
    for used in draft.random.permutation([True, False]):
        draft.add_thing("cup", table, color=str(draft.random.choice(COLORS)), used=bool(used))
    _clutter(draft, [table])
    return table


def _tidy_table(draft: Draft) -> str:
    table = _furnish(draft)[0]
    draft.add_thing("fruit box", table, carries=True)
    draft.add_thing("toy box", table, carries=True)
    for label in (*_some(draft, FRUIT, 1, 2), *_some(draft, TOYS, 1, 2)):
        draft.add_thing(label, table)
    return table


def _move_toy(draft: Draft) -> None:
    tables = _furnish(draft)
    draft.add_thing(_some(draft, TOYS, 1, 1)[0], tables[0])
    _clutter(draft, tables)


def _transfer_all_toys(draft: Draft) -> None:
    tables = _furnish(draft)
    for number, label in enumerate(_some(draft, TOYS, 2, 3)):
        draft.add_thing(label, tables[number % len(tables)])
    _clutter(draft, tables)


def _move_cup_and_toy(draft: Draft) -> None:
    tables = _furnish(draft)
    draft.add_thing("plate", tables[0], carries=True)
    draft.add_thing("doll", str(draft.random.choice(tables)))
    draft.add_thing("cup", str(draft.random.choice(tables)), color="blue")
    draft.add_thing("cup", str(draft.random.choice(tables)), color=str(draft.random.choice(["red", "white"])))
    _clutter(draft, tables)


def _gather_cups(draft: Draft) -> None:
    tables = _furnish(draft)
    for number in range(int(draft.random.integers(2, 4))):
        draft.add_thing("cup", tables[number % 2], color=COLORS[number])
    _clutter(draft, tables)


def _fridge_bottle(draft: Draft) -> None:
    tables = _furnish(draft)
    draft.add_thing("bottle", "fridge_0")
    for table in tables:
        draft.add_thing("can", table)
        draft.add_thing("sponge", table)


def _drawer_spoon(draft: Draft) -> None:
    tables = _furnish(draft)
    draft.add_thing("spoon", "dresser_0")
    draft.add_thing("plate", tables[0], carries=True)
    for table in tables:
        draft.add_thing("book", table)
        draft.add_thing("can", table)


def _absent_teapot(draft: Draft) -> None:
    tables = _furnish(draft)
    draft.add_thing("cup", tables[0], color="white")
    _clutter(draft, tables)


def _high_shelf(draft: Draft) -> None:
    tables = _furnish(draft, 2, "shelf")
    draft.add_thing("book", tables[0])
    draft.add_thing("cup", tables[1], color="red")


def _household(draft: Draft) -> None:
    first, second = _furnish(draft)
    draft.add_thing("plate", first, carries=True)
    for label in ("apple", "banana"):
        draft.add_thing(label, first)
    for label in ("doll", "book"):
        draft.add_thing(label, second)
    for table, color in ((first, "blue"), (second, "red")):
        draft.add_thing("cup", table, color=color)
    draft.add_thing("bottle", "fridge_0")
    draft.add_thing("spoon", "dresser_0")


_TOYS_AWAY = Move(kind("toy"), kind("sofa"), every=True, start="table")
_TIDY = (Move(kind("fruit"), kind("fruit box"), every=True), Move(kind("toy"), kind("toy box"), every=True))
_BLUE = (Move(kind("cup", color="blue"), kind("plate")), Move(kind("doll"), kind("bed")))
_BOTTLE = (Move(kind("bottle"), kind("table"), start="fridge"), Shut(kind("fridge")))
TASKS = {
    task.name: task
    for task in (
        Task(
            "place_fruit",
            "Put all the fruit onto the plate.",
            (Move(kind("fruit"), kind("plate"), every=True),),
            _place_fruit,
        ),
        Task(
            "fruit_among_cups",
            "Put the fruit in the middle of the cups.",
            (Among(kind("fruit"), kind("cup")),),
            _fruit_among_cups,
        ),
        Task(
            "prepare_cup",
            "Put a cup onto the plate, I will pour water into it.",
            (Move(kind("cup", clean=True), kind("plate")),),
            _prepare_cup,
        ),
        Task("tidy_table", "Can you help me tidy up the table?", _TIDY, _tidy_table),
        Task(
            "move_toy",
            "Move the toy from the table to the bed.",
            (Move(kind("toy"), kind("bed"), start="table"),),
            _move_toy,
        ),
        Task("transfer_all_toys", "Place all toys on tables to the sofa.", (_TOYS_AWAY,), _transfer_all_toys),
        Task("move_cup_and_toy", "Put the blue cup on the plate and doll to the bed.", _BLUE, _move_cup_and_toy),
        Task("gather_cups", "Put cups onto the same table.", (Gather(kind("cup"), kind("table")),), _gather_cups),
        Task(
            "fridge_bottle",
            "Bring the bottle from the fridge to the table and close the fridge.",
            _BOTTLE,
            _fridge_bottle,
        ),
        Task(
            "drawer_spoon",
            "Take the spoon out of the dresser and put it on the plate.",
            (Move(kind("spoon"), kind("plate"), start="dresser"),),
            _drawer_spoon,
        ),
        Task(
            "absent_teapot",
            "Bring the teapot to the bed.",
            (Move(kind("teapot"), kind("bed")),),
            _absent_teapot,
            impossible="teapot",
        ),
        Task(
            "high_shelf",
            "Put the book onto the shelf.",
            (Move(kind("book"), kind("shelf")),),
            _high_shelf,
            impossible="shelf",
        ),
    )
}
THESIS_TASKS = tuple(TASKS)[:8]
"""Names of the thesis's tasks."""
TABLETOP = tuple(TASKS)[:4]
"""Names of those at a table."""
