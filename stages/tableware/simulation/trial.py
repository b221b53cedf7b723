"""One policy on one table in any world, of fitted times or of contact physics: the loop of a trial."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import hypot
from typing import Literal, Protocol

from scenewright.stages.tableware.planning.action import Action
from scenewright.stages.tableware.planning.policy import Policy
from scenewright.stages.tableware.world.items import Table

MOST_ACTIONS, MOST_IDLE = 400, 8
"""Most actions of a trial, and most in a row that move nothing; by eye."""
STILL = 0.004
"""What moved less than this [m] has not been moved."""


@dataclass
class Trial:
    """One policy on one table. A trial fails when something was dropped or left (section 7.1)."""

    seconds: float = 0.0
    trips: int = 0
    moved: int = 0
    pulls: int = 0
    stacks: int = 0
    dropped: int = 0
    left: int = 0

    @property
    def objects_per_trip(self) -> float:
        """Items brought to the bin over trips."""
        return self.moved / max(self.trips, 1)

    @property
    def failed(self) -> bool:
        """Whether not everything came to the bin."""
        return self.dropped + self.left > 0

    @property
    def failure(self) -> Literal["", "policy", "perception"]:
        """What a failed trial is counted as: something was dropped, or only left, which nobody saw (section 7.1)."""
        return "policy" if self.dropped else "perception" if self.left else ""


class World(Protocol):
    """A table that actions change, simulated fast or with physics."""

    table: Table
    """The truth as it is now."""
    trial: Trial

    def do(self, action: Action, seen: Table | None = None) -> None:
        """Carry out an action that was decided on `seen` (None: on the truth), a composite one without looking in
        between."""
        ...


@dataclass(frozen=True)
class Done:
    """An action that was carried out: the truth before and after it, seconds since the beginning, what fell off the
    table, and what did not go as planned."""

    action: Action
    before: Table
    after: Table
    start: float
    end: float
    dropped: tuple[str, ...] = ()
    troubles: tuple[str, ...] = ()
    seen: Table = Table(())
    """On which the action was decided."""

    @property
    def idle(self) -> bool:
        """Whether nothing was moved or taken away."""
        if set(self.before.by_name) != set(self.after.by_name):
            return False
        places = ((item.position, self.after.by_name[name].position) for name, item in self.before.by_name.items())
        return all(hypot(before[0] - after[0], before[1] - after[1]) < STILL for before, after in places)


def truth(world: World) -> Table:
    """See everything as it is."""
    return world.table


def do_in(world: World, action: Action, seen: Table) -> Done:
    """Carry out an action that was decided on `seen`, and say what came of it."""
    before, start = world.table, world.trial.seconds
    fallen = set(getattr(world, "fallen", ()))
    world.do(action, seen)
    after, end = world.table, world.trial.seconds
    dropped = tuple(name for name in getattr(world, "fallen", ()) if name not in fallen)
    return Done(action, before, after, start, end, dropped, tuple(getattr(world, "troubles", ())), seen)


def most_actions(table: Table) -> int:
    """Return after how many actions a trial ends whose actions are tried again."""
    return 3 * len(table.items) + 4


def run_in(
    world: World,
    policy: Policy,
    see: Callable[[World], Table] = truth,
    hear: Callable[[Done], None] = lambda done: None,
    again: Callable[[Table, Done, int], Action] | None = None,
) -> Trial:
    """Let a policy clear the table of any world, one action an image; `hear` is told of each action. It ends when
    nothing is seen, when eight actions in a row have changed nothing, and after 400. What is left counts as left.

    `again` decides instead of the policy after a number of actions in a row, the last of which it is told, that changed
    nothing; then the trial ends when nothing is seen, or after 3 actions an item and 4.
    """
    idle = 0
    last: Done | None = None
    for _ in range(MOST_ACTIONS if again is None else most_actions(world.table)):
        seen_table = see(world)
        if not seen_table.items or (again is None and idle == MOST_IDLE):
            break
        action = (
            again(seen_table, last, idle)
            if again is not None and idle and last is not None
            else policy.decide(seen_table)
        )
        last = do_in(world, action, seen_table)
        idle = idle + 1 if last.idle else 0
        hear(last)
    return world.trial
