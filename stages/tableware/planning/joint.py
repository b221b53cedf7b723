"""Our policy: pulls, stackings, multi-object and single grasps chosen together for the whole table.

The exact optimum (optimum.py) of expected time, slips counted in, where the table is small enough, which the thesis's
tables are; larger ones are cleared in portions, each by its own optimum. With `slack`, of the plans nearly as fast as
the fastest the one with the fewest trips is taken, which loses least when the bin is farther than thought. The plan
is kept while what is seen is what it foresaw, and made anew otherwise.
"""

from __future__ import annotations

from stages.tableware.planning.actions import (
    Action,
    after_pull,
    after_stack,
    grasp,
    grasp_two,
    pull,
    stack,
    taken,
)
from stages.tableware.planning.optimum import MOST_ITEMS, Optimum, Trip, seconds
from stages.tableware.planning.policies import liftable
from stages.tableware.planning.rules import Rules, can_grasp_two
from stages.tableware.planning.time_model import Chances, TimeModel
from stages.tableware.world.items import Table

SLACK = 0.01
"""How much slower than the fastest, as a share of its time, a plan with fewer trips may be."""
CHARGES = (1.0, 2.0, 4.0, 8.0)
"""Seconds charged for a trip beyond what it takes, to find plans with fewer of them."""
PORTION = 14


def plan(table: Table, rules: Rules, model: TimeModel, chances: Chances, slack: float = SLACK) -> list[Trip]:
    """Return the trips that clear a table, or the first portion of a large one, in order."""
    optimum = Optimum(_portion(table), rules, model, chances)
    plans = [optimum.trips()]
    limit = seconds(plans[0]) * (1.0 + slack)
    for charge in CHARGES if slack > 0.0 else ():
        other = optimum.trips(charge)
        if seconds(other) > limit:
            break
        plans.append(other)
    return min(plans, key=lambda trips: (len(trips), seconds(trips)))


def _portion(table: Table) -> Table:
    """Return the piles that are planned for now: those nearest to the first, as many as the optimum takes."""
    if len(table.items) <= MOST_ITEMS:
        return table
    start = table.stacks[0][0].position
    near = sorted(
        table.stacks,
        key=lambda pile: (pile[0].position[0] - start[0]) ** 2 + (pile[0].position[1] - start[1]) ** 2,
    )
    chosen: set[str] = set()
    for pile in near:
        if len(chosen) + len(pile) <= PORTION:
            chosen.update(item.name for item in pile)
    return Table(tuple(item for item in table.items if item.name in chosen))


class JointPolicy:
    """Keeps a plan and takes its actions one at a time."""

    def __init__(self, rules: Rules, model: TimeModel, chances: Chances, slack: float = SLACK) -> None:
        self._rules, self._model, self._chances, self._slack = rules, model, chances, slack
        self._trips: list[Trip] = []
        self._expected: frozenset[tuple[str, str | None]] | None = None

    def decide(self, table: Table) -> Action:
        """Return the next action of the plan, or the first of a new one."""
        if not self._trips or self._expected != _state(table):
            self._trips = plan(table, self._rules, self._model, self._chances, self._slack)
        action = self._next(table)
        if action is None:  # two things came to stand too far apart for their grasp
            self._trips = plan(table, self._rules, self._model, self._chances, self._slack)
            action = self._next(table)
        if action is None:
            return grasp(table, liftable(table, table.stacks[0], self._rules))
        return action

    def _next(self, table: Table) -> Action | None:
        trip = self._trips[0]
        action: Action
        if trip.pull is not None:
            action = pull(table, *trip.pull, self._rules)
            self._keep(Trip(None, trip.stacks, trip.bases, trip.taken, trip.seconds))
            self._expected = _state(after_pull(table, action))
        elif trip.stacks:
            action = stack(table, *trip.stacks[0])
            self._keep(Trip(None, trip.stacks[1:], trip.bases, trip.taken, trip.seconds))
            self._expected = _state(after_stack(table, action))
        else:
            if len(trip.bases) == 2 and not can_grasp_two(table, trip.bases[0], trip.bases[1], self._rules):
                return None
            action = grasp_two(table, *trip.bases) if len(trip.bases) == 2 else grasp(table, trip.bases[0])
            self._trips = self._trips[1:]
            self._expected = _state(table.without(taken(table, action)))
        return action

    def _keep(self, rest: Trip) -> None:
        self._trips = [rest, *self._trips[1:]]


def _state(table: Table) -> frozenset[tuple[str, str | None]]:
    """Return what stands on what."""
    return frozenset((item.name, item.on) for item in table.items)
