"""Our policy: pulls, stackings, multi-object and single grasps chosen together for the whole table.

The exact optimum (optimum.py) of expected time and risk, slips counted in, where the table is small enough, which the
thesis's tables are; larger ones are cleared in portions, each by its own optimum. What a trip takes is known badly (the
bin's place, the arm's speed), and it is what decides between many short trips and few laden ones. So of the plans that
are best for some time of a trip within `OFF` of the one that is told, the one is taken whose regret is least: by how
much, as a share, it costs more than the best plan would, where the time is off by the most. The plan says what is best
for whatever may be left, so that after a slip nothing is planned anew unless something moved.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from scenewright.stages.tableware.actions.grasp import grasp, grasp_two
from scenewright.stages.tableware.actions.pull import pull
from scenewright.stages.tableware.actions.stack import stack
from scenewright.stages.tableware.planning.action import Action, Primitive
from scenewright.stages.tableware.planning.optimum import MOST_ITEMS, Optimum, Solution, Trip
from scenewright.stages.tableware.planning.policy import liftable
from scenewright.stages.tableware.planning.rules import Rules, can_grasp_two
from scenewright.stages.tableware.planning.time_model import Chances, TimeModel
from scenewright.stages.tableware.world.items import Table

OFF = 0.3
"""How far off, as a share of it, the time of a trip with its delay is reckoned to be."""
STEPS = (-1.0, -0.5, 0.0, 0.5, 1.0)
"""Shares of `OFF` for which the best plans are made."""
WORTH = 60.0
"""Seconds that we give for not losing an item (ours): six trips."""
PORTION = 14
"""Most items that are planned together in one go; by eye."""


@dataclass(frozen=True)
class Plan:
    """What is best for whatever may be left of a table, or of the first portion of a large one."""

    optimum: Optimum
    solution: Solution

    @property
    def trips(self) -> list[Trip]:
        """The trips in order, when nothing slips."""
        return self.optimum.trips(self.solution)

    @property
    def seconds(self) -> float:
        """Expected time [s]."""
        return float(self.solution.seconds[self.optimum.everything])

    @property
    def expected_trips(self) -> float:
        """Expected number of trips."""
        return float(self.solution.trips[self.optimum.everything])

    @property
    def lost(self) -> float:
        """Expected number of actions that let something fall off the table."""
        return float(self.solution.lost[self.optimum.everything])


def rules_in(rules: Rules, chances: Chances) -> Rules:
    """Return the rules of a planner that knows what spills in its world."""
    return replace(rules, laden_beside=False) if chances.spills else rules


def plan(
    table: Table, rules: Rules, model: TimeModel, chances: Chances, off: float = OFF, worth: float = WORTH
) -> Plan:
    """Return the plan for a table, or the first portion of one with more than 16 items.

    Of the plans that are best with some time of a trip within a share `off` of the model's, that of the least regret.
    A plan's cost is linear in that time and the least cost concave, so that its regret is greatest at an end.
    """
    optimum = Optimum(_portion(table), rules_in(rules, chances), model, chances, worth)
    charges = [off * step * model.whole_trip for step in (STEPS if off else (0.0,))]
    plans = [Plan(optimum, optimum.solve(charge)) for charge in charges]
    least = {charge: _plan_cost(best, charge, worth) for charge, best in zip(charges, plans, strict=True)}

    def regret(one: Plan) -> float:
        return max(_plan_cost(one, charge, worth) / max(least[charge], 1e-9) for charge in (charges[0], charges[-1]))

    return min(plans, key=lambda one: (round(regret(one), 9), _plan_cost(one, 0.0, worth)))


def _plan_cost(plan: Plan, charge: float, worth: float) -> float:
    """Return what a plan costs [s] when each trip takes `charge` more than the model says."""
    return plan.seconds + charge * plan.expected_trips + worth * plan.lost


def _portion(table: Table) -> Table:
    """Return the piles that are planned for now: those nearest to the first, as many as the optimum takes."""
    if len(table.items) <= MOST_ITEMS:
        return table
    start = table.stacks[0][0].position
    nearest_piles = sorted(
        table.stacks, key=lambda pile: (pile[0].position[0] - start[0]) ** 2 + (pile[0].position[1] - start[1]) ** 2
    )
    chosen: set[str] = set()
    for pile in nearest_piles:
        if len(chosen) + len(pile) <= PORTION:
            chosen.update(item.name for item in pile)
    return Table(tuple(item for item in table.items if item.name in chosen), table.obstacles)


class JointPolicy:
    """Keeps a plan and takes its actions one at a time. `made` is a plan that was made before."""

    def __init__(
        self,
        rules: Rules,
        model: TimeModel,
        chances: Chances,
        seed: int = 0,
        off: float = OFF,
        worth: float = WORTH,
        made: Plan | None = None,
    ) -> None:
        self._make = lambda table: plan(table, rules, model, chances, off, worth)
        self._rules = rules_in(rules, chances)
        self._first, self._plan = made, made
        self._trip: Trip | None = None
        self._expected: frozenset[tuple[str, str | None]] | None = None

    def decide(self, table: Table) -> Action:
        """Return the next action of the plan, or the first of a new one."""
        if self._expected != _state(table):
            self._trip = None
        if self._trip is None:
            self._trip = self._next_trip(table)
        action = self._next(table, self._trip)
        if action is None:  # two things came to stand too far apart for their grasp
            self._plan = self._make(table)
            self._trip = self._plan.trips[0]
            action = self._next(table, self._trip)
        if action is None:
            self._trip = None
            return grasp(table, liftable(table, table.stacks[0], self._rules))
        return action

    def _next_trip(self, table: Table) -> Trip:
        for earlier in (self._plan, self._first):
            remaining = None if earlier is None else earlier.optimum.left_of(table)
            if earlier is not None and remaining is not None:
                return earlier.optimum.trips(earlier.solution, remaining)[0]
        self._plan = self._make(table)
        self._first = self._first or self._plan
        return self._plan.trips[0]

    def _next(self, table: Table, trip: Trip) -> Action | None:
        action: Primitive
        if trip.pull is not None:
            action = pull(table, *trip.pull, self._rules)
            self._trip = Trip(None, trip.stacks, trip.bases, trip.taken, trip.seconds)
            self._expected = _state(action.after(table))
        elif trip.stacks:
            action = stack(table, *trip.stacks[0])
            self._trip = Trip(None, trip.stacks[1:], trip.bases, trip.taken, trip.seconds)
            self._expected = _state(action.after(table))
        else:
            if len(trip.bases) == 2 and not can_grasp_two(table, trip.bases[0], trip.bases[1], self._rules):
                return None
            action = grasp_two(table, *trip.bases) if len(trip.bases) == 2 else grasp(table, trip.bases[0])
            self._trip = None
        return action


def _state(table: Table) -> frozenset[tuple[str, str | None]]:
    """Return what stands on what."""
    return frozenset((item.name, item.on) for item in table.items)
