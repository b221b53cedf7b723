"""Whether the goal holds in the room after execution."""

from __future__ import annotations

from collections.abc import Callable

from scenewright.schemas.plan import BodyMatch, Check
from scenewright.stages.kit.simulation.world import PhysicsWorld
from scenewright.stages.plan.action import goal_checks
from scenewright.stages.plan.checks import GoalInRoom


def check_goal(
    world: PhysicsWorld,
    goal: tuple[str, ...],
    matches: dict[str, BodyMatch],
    joint_names: dict[str, str],
    held: str | None,
    learned: Callable[[str], Check | None],
) -> tuple[Check, ...]:
    """Check ground literals such as `on(bottle_7, table_3)` or `not in(cup_3, fridge_2)`, whose names are those of the
    plan.

    `joint_names` maps joints of the plan to those of this world; `learned` checks what predicates of a given domain
    mean, None for others. A body without a match makes its condition false, and a negated one too: it was not seen.
    """
    checks = []
    for literal in goal:
        learned_check = learned(literal)
        if learned_check is not None:
            checks.append(learned_check)
            continue
        plain = literal.removeprefix("not ")
        predicate, inner = plain.rstrip(")").split("(")
        names = [word.strip() for word in inner.split(",")]
        owners = [name if name in matches else _owner(name, matches) for name in names]
        missing = [name for name in owners if matches[name].matched is None]
        if missing:
            detail = f"the room has no body of the class of {missing[0]} near it"
            checks.append(Check(condition=literal, holds=False, detail=detail))
            continue
        room_names = tuple(matches[name].matched or "" for name in owners)
        joints = tuple(world.bodies[room_names[0]].joints) if names[0] in matches else (joint_names[names[0]],)
        check = goal_checks()[predicate](GoalInRoom(world, literal, room_names, joints, held))
        checks.append(check if plain == literal else check.model_copy(update={"holds": not check.holds}))
    return tuple(checks)


def _owner(joint: str, matches: dict[str, BodyMatch]) -> str:
    return max((name for name in matches if joint.startswith(f"{name}__")), key=len)
