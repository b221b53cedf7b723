"""One policy on one table in physics, seen truly or through rendered images; whose fault it was when it fails."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import hypot, pi
from typing import Literal

from stages.tableware.planning.actions import Action, Grasp, Pull, PullGrasp, Stack, StackGrasp, grasp
from stages.tableware.planning.policies import Policy, liftable
from stages.tableware.planning.rules import Rules
from stages.tableware.simulation.fast import Trial
from stages.tableware.simulation.physics import PhysicsTable, Speeds
from stages.tableware.vision.detection import detect
from stages.tableware.vision.detections import as_table
from stages.tableware.world.items import Item, Table

NEAR = 0.015
"""An item that is seen within this [m] of where one of its kind stands is seen rightly."""
STILL = 0.004
"""What moved less than this [m] has not been moved."""

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


def run_physics_trial(
    table: Table, policy: Policy, seed: int, sight: Sight, *, speeds: Speeds | None = None,
    record: Callable[[PhysicsTable, str], None] | None = None,
) -> Outcome:  # fmt: skip
    """Clear a table in physics, looking before each action, until nothing is seen or 3 actions an item are spent.

    Where an action has changed nothing the next takes a pile alone, from another side; all policies do so.
    """
    world = PhysicsTable(table, speeds=speeds, record=record)
    try:
        return _run(world, policy, seed, sight)
    finally:
        world.close()


def _run(world: PhysicsTable, policy: Policy, seed: int, sight: Sight) -> Outcome:
    outcome = Outcome(world.trial)
    stuck = 0
    for number in range(3 * len(world.table.items) + 4):
        if not world.table.items:
            break
        before = world.table
        seen = before
        if sight == "image":
            color, depth, camera = world.image(1000 * seed + number)
            seen = as_table(detect(color, depth, camera))
            outcome.looks += 1
            if not seen.items:
                break
        action = policy.decide(seen) if not stuck else _alone(seen, stuck)
        right = all(_rightly(item, before) for item in _meant(action, seen))
        lost = world.trial.dropped
        world.do(action, seen)
        outcome.actions += 1
        outcome.troubles = (*outcome.troubles, *world.troubles)
        newly = world.trial.dropped - lost
        if right:
            outcome.policy += newly
        else:
            outcome.perception += newly
        stuck = stuck + 1 if _same(before, world.table) else 0
    left = len(world.table.items)
    if left and sight == "image" and outcome.actions < 3 * len(world.top.items) + 4:
        outcome.perception += left
    else:
        outcome.policy += left
    return outcome


def _alone(seen: Table, stuck: int) -> Action:
    """Return a grasp of another pile than the last time, a quarter turn on."""
    pile = seen.stacks[(stuck - 1) % len(seen.stacks)]
    return grasp(seen, liftable(seen, pile, Rules()), 0.5 * pi * stuck)


def _meant(action: Action, seen: Table) -> list[Item]:
    names: tuple[str, ...]
    if isinstance(action, Grasp):
        names = action.items
    elif isinstance(action, Pull):
        names = (action.item, action.target)
    elif isinstance(action, PullGrasp):
        names = (action.u_P.item, action.u_P.target)
    elif isinstance(action, Stack):
        names = (action.u_G.items[0], action.onto)
    else:
        assert isinstance(action, StackGrasp)
        names = (action.u_S.u_G.items[0], action.u_S.onto)
    return [seen.by_name[name] for name in names if name in seen.by_name]


def _rightly(item: Item, truth: Table) -> bool:
    """Whether an item of this kind stands there, on as many others."""
    for other in truth.items:
        apart = hypot(other.position[0] - item.position[0], other.position[1] - item.position[1])
        same = (other.is_dish and other.kind == item.kind) or (not other.is_dish and not item.is_dish)
        if same and apart < NEAR and abs(other.position[2] - item.position[2]) < 0.01:
            return True
    return False


def _same(before: Table, after: Table) -> bool:
    """Whether nothing has been moved or taken away."""
    if set(before.by_name) != set(after.by_name):
        return False
    return all(
        hypot(item.position[0] - after.by_name[name].position[0], item.position[1] - after.by_name[name].position[1])
        < STILL
        for name, item in before.by_name.items()
    )
