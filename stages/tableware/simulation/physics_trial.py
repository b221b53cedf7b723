"""One policy on one table in physics, seen truly or through rendered images; whose fault it was when it fails."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, pi
from typing import Literal

from scenewright.stages.tableware.actions.grasp import grasp
from scenewright.stages.tableware.planning.action import Action
from scenewright.stages.tableware.planning.policy import Policy, liftable
from scenewright.stages.tableware.planning.rules import Rules
from scenewright.stages.tableware.sight import Eyes
from scenewright.stages.tableware.simulation.physics import PhysicsTable
from scenewright.stages.tableware.simulation.trial import Done, Trial, most_actions, run_in, truth
from scenewright.stages.tableware.world.items import Item, Table

NEAR = 0.015
"""An item that is seen within this [m] of where one of its kind stands is seen rightly."""
LEAST_CONFIDENCE = 0.3
"""Least confidence of what is planned for, as the command's."""

Sight = Literal["truth", "image"]


@dataclass
class Outcome:
    """What a trial came to. `perception` and `policy`: items lost or left by whose fault."""

    trial: Trial
    actions: int = 0
    looks: int = 0
    perception: int = 0
    policy: int = 0
    troubles: tuple[str, ...] = ()
    losses: tuple[str, ...] = ()
    """Of each item that was lost what it is and in which action, as `fork: take uu`."""

    def hear(self, done: Done) -> None:
        """Take down an action."""
        self.actions += 1
        self.troubles = (*self.troubles, *done.troubles)
        kinds = {item.name: item.kind for item in done.before.items}
        action_text = done.action.in_kinds(done.seen)
        self.losses = (*self.losses, *(f"{kinds.get(name, 'item')}: {action_text}" for name in done.dropped))
        if all(_rightly(item, done.before) for item in done.action.meant(done.seen)):
            self.policy += len(done.dropped)
        else:
            self.perception += len(done.dropped)


def run_physics_trial(table: Table, policy: Policy, seed: int, sight: Sight) -> Outcome:
    """Clear a table in physics, looking before each action, until nothing is seen or 3 actions an item are spent.

    What the eyes doubt is refused as in the command. After an action that changed nothing comes `alone`, whatever the
    policy.
    """
    world = PhysicsTable(table)
    eyes = Eyes(seed, "usual", "dark_on_white", LEAST_CONFIDENCE)
    try:
        outcome = Outcome(world.trial)
        most = most_actions(world.table)
        run_in(world, policy, eyes if sight == "image" else truth, outcome.hear, alone)
    finally:
        world.close()
    outcome.looks = eyes.images
    if sight == "image" and outcome.actions < most:
        outcome.perception += outcome.trial.left
    else:
        outcome.policy += outcome.trial.left
    return outcome


def alone(seen: Table, last: Done, idle: int) -> Action:
    """Return a grasp after actions that changed nothing, a quarter turn on each time: first of the pile that was meant,
    alone, then of the highest thing of one pile after another."""
    if idle == 1:
        for item in last.action.meant(last.seen):
            pile = next((pile for pile in seen.stacks if any(member.name == item.name for member in pile)), None)
            if pile is not None:
                return grasp(seen, liftable(seen, pile, Rules()), 0.5 * pi)
    return grasp(seen, seen.tops[(idle - 1) % len(seen.tops)].name, 0.5 * pi * idle)


def _rightly(item: Item, truth: Table) -> bool:
    """Whether an item of this kind stands there, on as many others."""
    for true_item in truth.items:
        apart = hypot(true_item.position[0] - item.position[0], true_item.position[1] - item.position[1])
        same = (true_item.is_dish and true_item.kind == item.kind) or (not true_item.is_dish and not item.is_dish)
        if same and apart < NEAR and abs(true_item.position[2] - item.position[2]) < 0.01:
            return True
    return False
