"""Tasks of one's own in the form of InterPreT's authors: JSON files, each {name: {objects, goal_text, goal_lits_gt}}.

`objects` name -> (middle x, bottom y) in the kitchen's units, `goal_text` a sentence, `goal_lits_gt` what is wanted, as
[predicate, object, ...] (github hmz-15/Interactive-Predicate-Learning, domains/*/train/train.json).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field, ValidationError
from scenewright.schemas.base import Model
from scenewright.schemas.errors import BadInput, first_problem
from scenewright.schemas.outside import LARGEST_SETTINGS, file_json
from scenewright.stages.predicates.state import TABLE_LEFT, TABLE_RIGHT, TOLERANCE
from scenewright.stages.predicates.tasks import Task
from scenewright.stages.predicates.truth import truth_of
from scenewright.stages.predicates.world.catalogue import DOMAINS, kitchen_file

HINT = "docs/INTERPRET.md, Tasks of your own"
MOST_TASKS = 1000
"""Most tasks of a folder; a bound."""


class WrittenTask(Model):
    """One task as it is written."""

    objects: dict[str, tuple[float, float]] = Field(min_length=1, max_length=40)
    goal_text: str = Field("", max_length=2000)
    goal_lits_gt: tuple[tuple[str, ...], ...] = Field(min_length=1, max_length=40)


@dataclass(frozen=True)
class TaskSet:
    """The tasks of one file."""

    name: str
    tasks: tuple[Task, ...]


def read_task_sets(path: Path, domain: str, seed: int) -> list[TaskSet]:
    """Return the tasks of a file, or of the JSON files below a folder, by path. Where folders are named after domains
    (`SetTable`), those of other domains are passed over; so are JSON files that hold no task. `seed` begins the chance
    of each kitchen.

    Raises BadInput, which names the task, where there is no task of the domain, and for what is none.
    """
    files = [path] if path.is_file() else sorted(path.rglob("*.json"))
    other_domains = {_letters(name): name for name in DOMAINS if name != domain}
    sets: list[TaskSet] = []
    passed_over: set[str] = set()
    for file in files:
        others_named = {other_domains.get(_letters(part), "") for part in file.relative_to(path).parts[:-1]} - {""}
        passed_over |= others_named
        if others_named:
            continue
        document = file_json(file, LARGEST_SETTINGS, hint=HINT)
        if file != path and not _holds_tasks(document):
            continue
        name = file.stem if file == path else file.relative_to(path).with_suffix("").as_posix()
        sets.append(TaskSet(name, _tasks(document, str(file), domain, name, seed)))
    if not sets:
        others = f", only of {', '.join(sorted(passed_over))}" if passed_over else ""
        raise BadInput(f"{path}: no task of {domain} in a JSON file there{others}", hint=HINT)
    if sum(len(each.tasks) for each in sets) > MOST_TASKS:
        raise BadInput(f"{path}: more than {MOST_TASKS} tasks", hint="give a part of them")
    return sets


def _letters(name: str) -> str:
    return re.sub(r"[^a-z]", "", name.lower())


def _holds_tasks(document: Any) -> bool:
    """Whether a document looks like tasks, so that what is wrong with it is worth a line."""
    values = document.values() if isinstance(document, dict) else ()
    return any(isinstance(value, dict) and set(value) & set(WrittenTask.model_fields) for value in values)


def _tasks(document: Any, where: str, domain: str, which: str, seed: int) -> tuple[Task, ...]:
    if not isinstance(document, dict) or not document:
        raise BadInput(f"{where}: no object of tasks by name", hint=HINT)
    tasks = []
    for number, (name, written) in enumerate(document.items()):
        place = f"{where}, task {name!r:.40}"
        try:
            task = WrittenTask.model_validate(written)
        except ValidationError as error:
            raise BadInput(f"{place}: {first_problem(error, 'task')}", hint=HINT) from None
        _check_objects(task.objects, place)
        chance = int(np.random.default_rng([seed, number]).integers(2**31))
        goal = _goal(task, domain, place)
        tasks.append(Task(f"{domain}/{which}/{name}", dict(task.objects), goal, chance, task.goal_text.strip()))
    return tuple(tasks)


def _check_objects(objects: Mapping[str, tuple[float, float]], place: str) -> None:
    """Raise BadInput for objects that the kitchen lacks, and for places where none can stand."""
    kinds = kitchen_file().objects
    for name, (x, y) in objects.items():
        if name not in kinds:
            raise BadInput(f"{place}: no object {name!r:.40} in the kitchen", hint=f"there are {', '.join(kinds)}")
        if not (TABLE_LEFT <= x <= TABLE_RIGHT and -TOLERANCE <= y <= -TABLE_LEFT):
            raise BadInput(
                f"{place}: {name} at ({x:g}, {y:g}) is not above the table",
                hint=f"x from {TABLE_LEFT:g} to {TABLE_RIGHT:g}, y from 0 to {-TABLE_LEFT:g}",
            )
        if not _stands(objects, name):
            raise BadInput(f"{place}: {name} at ({x:g}, {y:g}) stands on nothing", hint="y is the height of its bottom")
    for one, other in combinations(objects, 2):
        if "container" not in (kinds[one].shape, kinds[other].shape) and _overlap(objects, one, other):
            raise BadInput(f"{place}: {one} and {other} are in the same place", hint="(middle x, bottom y) of each")


def _stands(objects: Mapping[str, tuple[float, float]], name: str) -> bool:
    """Whether an object is on the table, on the top of another, or within a container."""
    kinds = kitchen_file().objects
    x, y = objects[name]
    if abs(y) <= TOLERANCE:
        return True
    for other, (u, v) in objects.items():
        kind = kinds[other]
        near = other != name and abs(x - u) < (kinds[name].width + kind.width) / 2
        if near and (abs(v + kind.height - y) <= TOLERANCE or (kind.shape == "container" and v < y < v + kind.height)):
            return True
    return False


def _overlap(objects: Mapping[str, tuple[float, float]], one: str, other: str) -> bool:
    a, b = (kitchen_file().objects[name] for name in (one, other))
    (x, y), (u, v) = objects[one], objects[other]
    beside = abs(x - u) >= (a.width + b.width) / 2 - TOLERANCE
    return not (beside or y + a.height <= v + TOLERANCE or v + b.height <= y + TOLERANCE)


def _goal(task: WrittenTask, domain: str, place: str) -> tuple[tuple[str, ...], ...]:
    truth = truth_of(domain)
    arguments = {name: len(kinds) for name, kinds in truth.operators.predicates.items() if name in truth.file.goals}
    for literal in task.goal_lits_gt:
        text = " ".join(literal)[:80]
        if not literal or literal[0] not in arguments:
            raise BadInput(f"{place}: goal {text!r} is none of {domain}", hint=f"goals are {', '.join(arguments)}")
        if len(literal) != arguments[literal[0]] + 1:
            raise BadInput(f"{place}: goal {text!r} needs {arguments[literal[0]]} objects", hint=HINT)
        missing = [name for name in literal[1:] if name not in task.objects]
        if missing:
            raise BadInput(f"{place}: goal {text!r}: {missing[0]} is not an object of the task", hint=HINT)
    return task.goal_lits_gt
