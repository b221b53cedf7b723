"""Tasks: where objects stand at the beginning and what is wanted: the sets of the thesis, and a hundred goals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.predicates.vocabulary import Perceived
from scenewright.stages.kit.tasks.strips import Atom, Problem, apply_action, ground
from scenewright.stages.predicates.truth import true_domain, truth_of
from scenewright.stages.predicates.world.actions import free_place
from scenewright.stages.predicates.world.catalogue import DomainSetup, kitchen_file
from scenewright.stages.predicates.world.kitchen import Kitchen

SETS = ("canonical", "more_objects", "novel_goals", "combined", "hundred_goals")
LAYOUTS = 20
"""Most tries to draw a layout in which nothing overlaps; by eye."""
LONGEST_WALK = 14
"""Actions of the walk whose end a generated goal is taken from."""
MOST_LITERALS = 6
"""Most literals of a generated goal; by eye."""
FRUITLESS = 40
"""Walks, for each goal that is asked for, after which there are taken to be no more."""


@dataclass(frozen=True)
class Task:
    """Objects at (middle x, bottom y), what is wanted, the seed of the kitchen's chance, and the goal as somebody said
    it (empty: nobody did)."""

    name: str
    objects: dict[str, tuple[float, float]]
    goal: tuple[Atom, ...]
    seed: int
    said: str = ""

    @property
    def sentence(self) -> str:
        """The goal in the teacher's words."""
        return " and ".join(map(truth_of(self.name.split("/")[0]).goal_phrase, self.goal))


def open_kitchen(task: Task) -> Kitchen:
    """Return the kitchen as a task begins."""
    kinds = kitchen_file().objects
    return Kitchen([(name, kinds[name], x, y) for name, (x, y) in task.objects.items()], task.seed)


def true_atoms(state: Perceived, domain: str) -> frozenset[Atom]:
    """Return which of the teacher's atoms hold."""
    return truth_of(domain).atoms(state)


def tasks_of(domain: str, which: str, count: int, seed: int) -> list[Task]:
    """Return the tasks of a set: `train`, or one of SETS. The same seed gives the same tasks.

    Goals cycle through the groups of the domain, as in the thesis; a goal that holds at the beginning is drawn anew.
    Raises BadInput when the objects don't fit on the table.
    """
    setup = kitchen_file().domains[domain]
    if which == "hundred_goals":
        return _generate_tasks(domain, setup, count, seed)
    names = setup.objects if which in ("train", "canonical", "novel_goals") else (*setup.objects, *setup.more)
    stream = ("train", *SETS).index(which)
    tasks = []
    for number in range(count):
        random = np.random.default_rng([seed, stream, number])
        while True:
            goal = _goal(setup, which, number, random)
            task = Task(
                f"{domain}/{which}/{number + 1}",
                layout(names, random, setup.stacked),
                goal,
                int(random.integers(2**31)),
            )
            if not set(goal) <= true_atoms(open_kitchen(task).state(), domain):
                break
        tasks.append(task)
    return tasks


def _goal(setup: DomainSetup, which: str, number: int, random: np.random.Generator) -> tuple[Atom, ...]:
    if which in ("novel_goals", "combined"):
        texts = setup.novel if which == "novel_goals" else setup.combined
    else:
        group = number % len(setup.goals)
        goals = list(setup.goals[group]) + (list(setup.more_goals[group]) if which == "more_objects" else [])
        texts = goals[int(random.integers(len(goals)))]
    return tuple(tuple(text.split()) for text in texts)


def layout(names: tuple[str, ...], random: np.random.Generator, stacked: float) -> dict[str, tuple[float, float]]:
    """Return where objects stand, drawn up to LAYOUTS times until they fit. Raises BadInput when they never do."""
    for _ in range(LAYOUTS):
        try:
            return _draw_layout(names, random, stacked)
        except ValueError as error:
            reason = str(error)
    raise BadInput(f"{', '.join(names)}: {reason}", hint="fewer or smaller objects (data/kitchen/kitchen.toml)")


def _draw_layout(names: tuple[str, ...], random: np.random.Generator, stacked: float) -> dict[str, tuple[float, float]]:
    """Return where objects stand: the anchored ones at their place, the plate beside the placemat, others on free
    places of the table or, a share `stacked` of them, on a thing that carries them.

    Raises ValueError when they don't fit."""
    kinds = kitchen_file().objects
    places: dict[str, tuple[float, float]] = {}
    occupied: list[tuple[float, float]] = []
    free: list[str] = []
    """What may still be stood on."""
    for name in sorted(names, key=lambda name: (kinds[name].at is None, kinds[name].shape != "plate")):
        kind = kinds[name]
        carriers = [each for each in free if kinds[each].width >= kind.width]
        if kind.at is not None:
            x, y = kind.at, 0.0
        elif kind.shape == "plate" and "placemat" in names:
            x, y = kinds["placemat"].at + 8.2 * (1 if random.random() < 0.5 else -1), 0.0  # type: ignore[operator]
        elif kind.shape == "block" and carriers and random.random() < stacked:
            under = carriers[int(random.integers(len(carriers)))]
            free.remove(under)
            x, y = places[under][0], places[under][1] + kinds[under].height
        else:
            x, y = free_place(random, kind.width / 2, occupied), 0.0
        places[name] = (x, y)
        occupied.append((x - kind.width / 2, x + kind.width / 2))
        if kind.shape != "container":
            free.append(name)
    return places


def _generate_tasks(domain: str, setup: DomainSetup, count: int, seed: int) -> list[Task]:
    """Return tasks with goals that differ from each other: what holds at the end of a random walk with the teacher's
    operators, and did not at its beginning; so a plan exists. Fewer where no more were found."""
    names = (*setup.objects, *setup.more)
    tasks: list[Task] = []
    goals: set[frozenset[Atom]] = set()
    number = 0
    while len(tasks) < count:
        random = np.random.default_rng([seed, 99, number])
        number += 1
        if number > FRUITLESS * count:
            break
        chosen = tuple(name for name in names if kitchen_file().objects[name].at is not None or random.random() < 0.85)
        places, chance = layout(chosen, random, setup.stacked), int(random.integers(2**31))
        task = Task(f"{domain}/hundred_goals/{len(tasks) + 1}", places, (), chance)
        goal = _walk_goal(domain, task, random)
        if goal and frozenset(goal) not in goals:
            goals.add(frozenset(goal))
            tasks.append(Task(task.name, places, goal, chance))
    return tasks


def _walk_goal(domain: str, task: Task, random: np.random.Generator) -> tuple[Atom, ...]:
    start = true_atoms(open_kitchen(task).state(), domain)
    problem = Problem("walk", dict.fromkeys(task.objects, ""), start, frozenset())
    actions = ground(true_domain(domain), problem)
    state = start
    for _ in range(int(random.integers(4, LONGEST_WALK + 1))):
        possible = [action for action in actions if action.preconditions <= state]
        if not possible:
            break
        state = apply_action(state, possible[int(random.integers(len(possible)))])
    if any(atom[0] == "in_gripper" for atom in state):
        return ()
    goal_names = truth_of(domain).file.goals
    new_atoms = sorted(atom for atom in state - start if atom[0] in goal_names)
    if not new_atoms:
        return ()
    drawn = random.permutation(len(new_atoms))[: int(random.integers(1, MOST_LITERALS + 1))]
    return tuple(new_atoms[index] for index in sorted(drawn.tolist()))
