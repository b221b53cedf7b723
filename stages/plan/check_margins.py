"""How sure the checks of an executed plan are: the room as it was left comes to rest eight times more, from poses a
tenth of a millimetre apart. The way there is not gone again: it takes a minute, this a second."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
from scenewright.schemas.plan import Check
from scenewright.stages.kit.simulation.engine import engine
from scenewright.stages.kit.simulation.margins import RUNS, SHIFT, margin, perturbed
from scenewright.stages.kit.simulation.world import PhysicsWorld

REACH = 0.5
"""A threshold is near when less than this share of what is allowed is left, or missing."""
SECONDS = 0.25
"""How long a room comes to rest [s]."""


def with_margins(
    checks: tuple[Check, ...], world: PhysicsWorld, held: str | None, again: Callable[[], tuple[Check, ...]]
) -> tuple[Check, ...]:
    """Return the checks with the margins of those that are near a threshold. The world is left as it was.

    `held`: the body in the hand, which stays there. `again` checks the world as it stands.
    """
    if not any(_is_near(check) for check in checks):
        return checks
    random = np.random.default_rng(0)
    runs = []
    with _left_as_it_was(world) as restore:
        for _ in range(RUNS):
            _perturb(world, held, random)
            world.step(round(SECONDS / world.time_step))
            runs.append(again())
            restore()
    return tuple(
        check.model_copy(update={"margin": _margin(check, [run[place] for run in runs])}) if _is_near(check) else check
        for place, check in enumerate(checks)
    )


def verdict_margin(checks: tuple[Check, ...]) -> float | None:
    """Return the margin of whether all checks hold: where they do the least, else that of all that fail."""
    failing = [check.margin for check in checks if not check.holds]
    if failing:
        known = [found for found in failing if found is not None]
        return max(known) if len(known) == len(failing) else None
    return min((check.margin for check in checks if check.margin is not None), default=None)


def _is_near(check: Check) -> bool:
    return check.slack is not None and abs(check.slack) < REACH


def _margin(check: Check, runs: list[Check]) -> float:
    """Return the margin; a run in which things came apart is as far beyond the threshold as it can be."""
    slacks = [run.slack if run.slack is not None else -1.0 for run in runs]
    return round(margin(check.slack or 0.0, 0.0, slacks), 2)


@contextmanager
def _left_as_it_was(world: PhysicsWorld) -> Iterator[Callable[[], None]]:
    """Give a function that puts bodies, speeds and contacts back."""
    state = engine.saveState(physicsClientId=world.client)

    def restore() -> None:
        engine.restoreState(state, physicsClientId=world.client)

    try:
        yield restore
    finally:
        engine.removeState(state, physicsClientId=world.client)


def _perturb(world: PhysicsWorld, held: str | None, random: np.random.Generator) -> None:
    for name, body in world.bodies.items():
        if body.record.movable and name != held:
            world.set_pose(name, perturbed(world.pose(name), random))
        for joint in body.joints:
            world.set_joint(name, joint, world.joint_value(name, joint) + SHIFT * random.choice((-1.0, 1.0)))
    world.wake()
