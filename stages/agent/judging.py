"""What a trial truly came to, by the world's truth and its log of executions. No arm sees any of it."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from math import hypot

from scenewright.stages.agent.goals import NEAR_MIDDLE, Among, Description, Gather, Goal, Move, Shut
from scenewright.stages.agent.session import Session
from scenewright.stages.agent.world.events import Event
from scenewright.stages.agent.world.failures import TABLE_3_4
from scenewright.stages.agent.world.truth import World

CAUSES = tuple(TABLE_3_4)
"""Rows of the failure table."""


@dataclass(frozen=True)
class Score:
    """Counts of one trial."""

    success: bool
    """The goals hold; of a task that cannot be done: it was said, with the right reason."""
    claimed: bool
    """The robot said that it is done."""
    executions: int
    executed: int
    """Of these, that did what they were to do."""
    replanned: int
    """Executions of a step that had failed before."""
    recovered: int
    """Of these, that did."""
    calls: int
    seconds: float
    metres: float
    failures: dict[str, tuple[int, int]]
    """Cause -> failures that nothing made good in a trial that failed, and the others."""


def score(goals: tuple[Goal, ...], impossible: str, session: Session, world: World) -> Score:
    """Judge a session. `impossible`: the word that a right refusal names, empty for a task that can be done."""
    holds = goals_hold(goals, world)
    success = holds and session.end == "done"
    if impossible:
        success = session.end in ("give_up", "ask") and impossible in session.words.lower()
    acted = [event for event in world.events if event.verb != "look"]
    replanned_events = [event for event in acted if event.replanned]
    return Score(
        success=success,
        claimed=session.end == "done",
        executions=len(acted),
        executed=sum(event.ok for event in acted),
        replanned=len(replanned_events),
        recovered=sum(event.ok for event in replanned_events),
        calls=len(session.calls),
        seconds=world.seconds,
        metres=world.metres,
        failures=_failures(world.events, _wrong_calls(session), success),
    )


def _wrong_calls(session: Session) -> int:
    return sum(turn.ran.error is not None for turn in session.turns)


def _failures(events: list[Event], wrong_calls: int, success: bool) -> dict[str, tuple[int, int]]:
    """A failure is recovered when its step succeeded later, or the trial did; direct otherwise."""
    direct: Counter[str] = Counter()
    recovered: Counter[str] = Counter()
    for number, event in enumerate(events):
        if event.cause:
            later = any(e.step == event.step and e.ok for e in events[number + 1 :])
            (recovered if success or later else direct)[event.cause] += 1
    acted_after = success or any(event.ok for event in events[-1:])
    (recovered if acted_after else direct)["api"] += wrong_calls
    return {cause: (direct[cause], recovered[cause]) for cause in CAUSES}


def goals_hold(goals: tuple[Goal, ...], world: World) -> bool:
    """Whether all goals are truly met."""
    return all(_holds(goal, world) for goal in goals)


def _holds(goal: Goal, world: World) -> bool:
    match goal:
        case Shut(what=what, opened=opened):
            doors = [f.name for f in world.furniture.values() if f.label in what.labels]
            return bool(doors) and all((name in world.opened) == opened for name in doors)
        case Gather(what=what, onto=onto):
            places = {world.root(name) for name in _things(what, world)}
            return len(places) == 1 and _label(next(iter(places)), world) in onto.labels
        case Among(what=what, around=around):
            return any(_in_the_middle(name, around, world) for name in _things(what, world))
        case Move(what=what, onto=onto, every=every, start=start):
            names = [n for n in _things(what, world) if not start or _label(_root_before(n, world), world) == start]
            on = [_is_carried_by(name, onto, world) for name in names]
            return bool(names) and (all(on) if every else any(on))


def _things(what: Description, world: World) -> list[str]:
    things = (body.thing for body in world.bodies.values())
    return [t.name for t in things if what.fits(t.label, t.color, t.used)]


def _label(name: str, world: World) -> str:
    return world.furniture[name].label if name in world.furniture else name


def _root_before(name: str, world: World) -> str:
    """Return the furniture on or in which a thing was at the beginning."""
    before = {placed.name: placed.on for placed in world.apartment.things}
    at = before[name]
    while at in before:
        at = before[at]
    return at


def _is_carried_by(name: str, onto: Description, world: World) -> bool:
    """Whether a thing is on something of a description, or on what that carries."""
    on = world.bodies[name].on
    while on:
        if on in world.bodies:
            carrier = world.bodies[on].thing
            if onto.fits(carrier.label, carrier.color, carrier.used):
                return True
            on = world.bodies[on].on
        else:
            return _label(on, world) in onto.labels
    return False


def _in_the_middle(name: str, around: Description, world: World) -> bool:
    others = [world.bodies[n] for n in _things(around, world) if world.root(n) == world.root(name)]
    if not others or not world.bodies[name].on:
        return False
    x, y = (sum(body.at[k] for body in others) / len(others) for k in (0, 1))
    return hypot(world.bodies[name].at[0] - x, world.bodies[name].at[1] - y) <= NEAR_MIDDLE
