"""Our policy: pulls, stackings, multi-object and single grasps chosen together for the whole table.

The exact optimum (optimum.py) of expected time and risk, slips counted in, where the table is small enough, which the
thesis's tables are; larger ones are cleared in portions, each by its own optimum. Of the plans nearly as fast as the
fastest (`slack`) the one with the fewest trips is taken, which loses least when the bin is farther than thought, but
only of those no slower than Pull and Stack are to be expected. The plan says what is best for whatever
may be left, so that after a slip nothing is planned anew unless something moved.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from stages.tableware.actions.grasp import Grasp, grasp, grasp_two, taken
from stages.tableware.actions.pull import pull
from stages.tableware.actions.stack import stack
from stages.tableware.planning.action import Action, Primitive
from stages.tableware.planning.optimum import MOST_ITEMS, Optimum, Solution, Trip
from stages.tableware.planning.policy import THESIS, Policy, liftable
from stages.tableware.planning.rules import Rules, can_grasp_two, letters
from stages.tableware.planning.time_model import Chances, TimeModel
from stages.tableware.planning.trip_options import slip_cost
from stages.tableware.policies.pull import PullPolicy
from stages.tableware.policies.stack import StackPolicy
from stages.tableware.world.items import Table

SLACK = 0.029
"""How much slower than the fastest, as a share of its cost, a plan with fewer trips may be."""
MARGIN = 0.005
"""By how much it is to be faster than Pull and Stack for that, as these are reckoned without misses of pulls."""
UNLIKELY = 0.03
"""What is less likely than this is not followed further when Pull's time is reckoned; it counts as `slip_cost`."""
CHARGES = (1.0, 2.0, 4.0, 8.0)
"""Seconds charged for a trip beyond what it takes, to find plans with fewer of them."""
WORTH = 60.0
"""Seconds that we give for not losing an item (ours): six trips."""
PORTION = 14


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
    table: Table, rules: Rules, model: TimeModel, chances: Chances, slack: float | None = None, worth: float = WORTH
) -> Plan:
    """Return the plan for a table, or the first portion of one with more than 16 items; `slack`: None takes ours."""
    rules = rules_in(rules, chances)
    portion = _portion(table)
    optimum = Optimum(portion, rules, model, chances, worth)
    plans = [Plan(optimum, optimum.solve())]
    least = _cost(plans[0], worth)
    limit = least * (1.0 + (SLACK if slack is None else slack))
    if slack is None and not chances.drops:
        limit = max(least, min(limit, *(_alone(rival, portion, model, chances) for rival in _rivals(rules))))
    if chances.sure and limit > least:
        return Plan(optimum, optimum.fewest_trips(plans[0].solution, limit + 1e-9))
    for charge in CHARGES if limit > least else ():
        other = Plan(optimum, optimum.solve(charge))
        if _cost(other, worth) > limit:
            break
        plans.append(other)
    return min(plans, key=lambda plan: (round(plan.expected_trips, 6), _cost(plan, worth)))


def _rivals(rules: Rules) -> tuple[Policy, ...]:
    """Return the thesis's policies with the sizes and the hand of our rules."""
    theirs = replace(THESIS, setting=rules.setting)
    return PullPolicy(theirs), *((StackPolicy(theirs),) if rules.setting.stacking else ())


def _alone(policy: Policy, table: Table, model: TimeModel, chances: Chances, likely: float = 1.0) -> float:
    """Return the seconds to be expected of a policy of the thesis, where pulls do not miss and nothing falls. A slip
    is followed where that is likely enough, for `likely` is the chance that it comes to this table."""
    time = 0.0
    while table.items:
        *before, action = policy.decide(table).parts
        for part in before:
            time, table = time + part.seconds(model), part.after(table)
        assert isinstance(action, Grasp)  # these policies neither pull nor stack without grasping
        time, rest = time + model.whole_trip, table.without(taken(table, action))
        if len(action.items) == 2:
            hold = chances.holds(*(letters((table.by_name[name],)) for name in action.items))
            if likely * (1.0 - hold) >= UNLIKELY:
                stayed = table.without(taken(table, replace(action, items=action.items[:1])))
                time += (1.0 - hold) * _alone(policy, stayed, model, chances, likely * (1.0 - hold))
                return time + hold * _alone(policy, rest, model, chances, likely * hold)
            time += (1.0 - hold) * slip_cost(model)
        table = rest
    return time


def _cost(plan: Plan, worth: float) -> float:
    return plan.seconds + worth * plan.lost


def _portion(table: Table) -> Table:
    """Return the piles that are planned for now: those nearest to the first, as many as the optimum takes."""
    if len(table.items) <= MOST_ITEMS:
        return table
    start = table.stacks[0][0].position
    near = sorted(
        table.stacks, key=lambda pile: (pile[0].position[0] - start[0]) ** 2 + (pile[0].position[1] - start[1]) ** 2
    )
    chosen: set[str] = set()
    for pile in near:
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
        slack: float | None = None,
        worth: float = WORTH,
        made: Plan | None = None,
    ) -> None:
        self._make = lambda table: plan(table, rules, model, chances, slack, worth)
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
            left = None if earlier is None else earlier.optimum.left_of(table)
            if earlier is not None and left is not None:
                return earlier.optimum.trips(earlier.solution, left)[0]
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
