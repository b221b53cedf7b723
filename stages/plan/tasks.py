"""Tasks by name (`--task`): goals derived from what is in the scene, the preferred first; or why there is none."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
from scenewright.stages.kit.acting.hand.grip import narrowest_width
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.tasks.strips import Atom, atom_text
from scenewright.stages.plan.world_model import WorldModel

TaskName = Literal["fridge-to-microwave", "tidy-the-desk", "put-away-in-drawer", "stack-and-carry"]
Goals = list[tuple[str, ...]]
TABLES = ("table", "desk")
"""Classes that a task means by tables."""
SHELVES = ("shelf", "wall_shelf", "cabinet")
"""Classes that a task means by shelves."""
MOST_GOALS = 6
"""Most goals that a task gives; by eye."""
MOST_STACKED = 2
"""Things put on a tray before it is carried."""


class SceneFacts:
    """What the initial atoms say, indexed for the rules below."""

    def __init__(self, model: WorldModel, initial: frozenset[Atom]) -> None:
        self.model, self.initial = model, initial
        self.on = {atom[1]: atom[2] for atom in initial if atom[0] == "on"}
        self.inside = {atom[1]: atom[2] for atom in initial if atom[0] == "in"}

    def holds(self, *atom: str) -> bool:
        """Whether an atom is among the initial ones."""
        return atom in self.initial

    def bodies(self, *classes: str) -> list[str]:
        """Return the bodies of some classes that the arm reaches, by name."""
        of_classes = (name for name, record in self.model.records.items() if record.class_name in classes)
        return sorted(name for name in of_classes if self.holds("reachable", name))

    def small(self, names: list[str]) -> list[str]:
        """Return those that can be picked up on their own: graspable, within reach, nothing on them, no carrier."""
        return [
            name
            for name in names
            if all(self.holds(word, name) for word in ("graspable", "reachable", "clear"))
            and not self.holds("carrier", name)
        ]

    def width(self, name: str) -> float:
        """Return the least width of a thing [m]; narrow things are safer to grasp."""
        return narrowest_width(apply(self.model.pose(name), self.model.points(name)))

    def slenderness(self, name: str) -> float:
        """Return height over least width of a thing: slender things fall over on what moves."""
        return round(self.model.footprint(name)[1] / max(self.width(name), 1e-3), 2)

    def distance(self, first: str, second: str) -> float:
        """Return the distance of two bodies in the plane [m]."""
        return float(np.linalg.norm((self.model.pose(first) - self.model.pose(second))[:2, 3]))

    def doors(self, container: str) -> list[str]:
        """Return the doors behind which a container takes things."""
        return sorted(atom[1] for atom in self.initial if atom[0] == "entrance" and atom[2] == container)


def task_goals(task: TaskName, model: WorldModel, initial: frozenset[Atom]) -> Goals:
    """Return the candidate goals of a task, the preferred first. Raises MotionFailed `no_goal` with what is missing."""
    goals = RULES[task](SceneFacts(model, initial))
    return goals[:MOST_GOALS]


def _no_goal(task: str, message: str, numbers: dict[str, float]) -> MotionFailed:
    return MotionFailed("no_goal", f"{task}: {message}", (), numbers)


def fridge_to_microwave(facts: SceneFacts) -> Goals:
    """`in(item, microwave)`, both shut: every item of a fridge that fits, the narrowest first."""
    fridges, ovens = facts.bodies("fridge"), facts.bodies("microwave")
    food = facts.small([item for item, where in facts.inside.items() if where in fridges])
    ranked = []
    for item in food:
        for oven in ovens:
            if any(facts.holds("fits", item, door) for door in facts.doors(oven)):
                fridge = facts.inside[item]
                ranked.append((round(facts.width(item), 3), facts.distance(fridge, oven), item, oven, fridge))
    if not ranked:
        raise _no_goal(
            "fridge-to-microwave",
            f"{len(fridges)} fridges with {len(food)} things that the hand can take, {len(ovens)} microwaves within "
            "reach: nothing fits into one (--assume declares what a closed fridge hides)",
            {"fridges": len(fridges), "items": len(food), "microwaves": len(ovens)},
        )
    return [
        (atom_text(("in", item, oven)), atom_text(("closed", oven)), atom_text(("closed", fridge)))
        for _, _, item, oven, fridge in sorted(ranked)
    ]


def tidy_the_desk(facts: SceneFacts) -> Goals:
    """Everything small on one desk goes onto one shelf (or cabinet), else half onto each of two."""
    desks = facts.bodies("desk")
    targets = facts.bodies(*SHELVES)
    ranked = []
    for desk in desks:
        things = sorted(facts.small([item for item, where in facts.on.items() if where == desk]))
        for target in targets:
            fitting = tuple(item for item in things if facts.holds("fits", item, target))
            if fitting:
                open_shelf = facts.model.records[target].class_name not in ("shelf", "wall_shelf")
                ranked.append((-len(fitting), open_shelf, facts.distance(desk, target), fitting, target))
    if not ranked:
        raise _no_goal(
            "tidy-the-desk",
            f"{len(desks)} desks and {len(targets)} shelves within reach: nothing small on a desk fits on one",
            {"desks": len(desks), "shelves": len(targets)},
        )
    goals = [tuple(atom_text(("on", item, target)) for item in fitting) for _, _, _, fitting, target in sorted(ranked)]
    return goals[:2] + _share_out(sorted(ranked)[:2]) + goals[2:]


def _share_out(ranked: list[tuple[int, bool, float, tuple[str, ...], str]]) -> Goals:
    """Return goals in which the things of one desk that fit on either of two targets are shared between them."""
    if len(ranked) < 2 or ranked[0][3] != ranked[1][3] or len(ranked[0][3]) < 2:
        return []
    things, targets = ranked[0][3], [entry[4] for entry in ranked]
    return [
        tuple(atom_text(("on", item, targets[(number + turn) % 2])) for number, item in enumerate(things))
        for turn in range(2)
    ]


def put_away_in_drawer(facts: SceneFacts) -> Goals:
    """`in(item, furniture)`, shut: a small thing that stands in the open, into a drawer with room for it."""
    drawers = {
        joint.name: name
        for name, record in facts.model.records.items()
        if facts.holds("reachable", name)
        for joint in record.joints
        if joint.type == "prismatic" and facts.holds("reachable", joint.name)
    }
    things = facts.small(sorted(item for item, where in facts.on.items() if where in facts.bodies(*TABLES, *SHELVES)))
    ranked = []
    for item in things:
        units = {unit for drawer, unit in drawers.items() if facts.holds("fits", item, drawer)}
        for unit in units:
            ranked.append((round(facts.width(item), 3), round(facts.distance(item, unit), 3), item, unit))
    if not ranked:
        raise _no_goal(
            "put-away-in-drawer",
            f"{len(things)} small things in the open and {len(drawers)} drawers within reach: none fits into one",
            {"items": len(things), "drawers": len(drawers)},
        )
    return [(atom_text(("in", item, unit)), atom_text(("closed", unit))) for _, _, item, unit in sorted(ranked)]


def stack_and_carry(facts: SceneFacts) -> Goals:
    """Small things onto a tray, those that stand best, and the tray with all that onto another table."""
    trays = sorted(
        name
        for name in facts.model.records
        if all(facts.holds(word, name) for word in ("carrier", "graspable", "reachable", "flat"))
        and facts.on.get(name) is not None
    )
    surfaces = facts.bodies(*TABLES)
    ranked = []
    for tray in trays:
        tray_support = facts.on[tray]
        beside = facts.small([item for item, where in facts.on.items() if where in (tray_support, *surfaces)])
        beside = sorted(item for item in beside if facts.holds("fits", item, tray))
        for target in surfaces:
            if target != tray_support and facts.holds("fits", tray, target) and beside:
                load_order = sorted(
                    beside, key=lambda item: (facts.on[item] != tray_support, facts.slenderness(item), item)
                )
                ranked.append((facts.distance(tray_support, target), tray, target, tuple(load_order)))
    if not ranked:
        raise _no_goal(
            "stack-and-carry",
            f"{len(trays)} trays that can be lifted and {len(surfaces)} tables within reach: there is no tray with "
            "something small to put on it and another table to carry it to",
            {"trays": len(trays), "tables": len(surfaces)},
        )
    goals = []
    for count in range(MOST_STACKED, 0, -1):
        for _, tray, target, stackable in sorted(ranked):
            if len(stackable) >= count:
                stacked = tuple(atom_text(("carried_along", item, tray)) for item in stackable[:count])
                goals.append((*stacked, atom_text(("on", tray, target))))
    return goals


RULES: dict[TaskName, Callable[[SceneFacts], Goals]] = {
    "fridge-to-microwave": fridge_to_microwave,
    "tidy-the-desk": tidy_the_desk,
    "put-away-in-drawer": put_away_in_drawer,
    "stack-and-carry": stack_and_carry,
}
"""Task -> what sets its goals in a scene."""
