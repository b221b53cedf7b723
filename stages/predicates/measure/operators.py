"""Operators against the teacher's own, on states and actions that happened: what they allow, what they expect."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

from scenewright.stages.kit.predicates.vocabulary import Perceived
from scenewright.stages.kit.tasks.strips import Atom, Domain, Problem, apply_action, ground
from scenewright.stages.predicates.execution import ARITY, Abstraction, action_atom
from scenewright.stages.predicates.truth import true_domain, truth_of

Done = tuple[Perceived, Atom, Perceived]
"""A state, an action that worked in it, and the state after it."""


def allowing(domain: Domain, see: Abstraction, actions: Sequence[str]) -> Callable[[Perceived], dict[Atom, bool]]:
    """Return what says of every action in a state whether one of a domain's operators applies."""

    def allowed(state: Perceived) -> dict[Atom, bool]:
        atoms = see(state)
        problem = Problem("now", dict.fromkeys(state.names, ""), atoms, frozenset())
        possible = {action_atom(each) for each in ground(domain, problem) if each.preconditions <= atoms}
        return {
            (name, *objects): (name, *objects) in possible
            for name in actions
            for objects in itertools.permutations(state.names, ARITY[name])
        }

    return allowed


def allowed_accuracy(
    domain: Domain, see: Abstraction, actions: Sequence[str], truth: str, states: Sequence[Perceived]
) -> float:
    """Return the balanced accuracy of which actions learned operators allow, beside the teacher's operators."""
    learned = allowing(domain, see, actions)
    true = allowing(true_domain(truth), truth_of(truth).atoms, actions)
    right: dict[bool, list[bool]] = {True: [], False: []}
    for state in states:
        allowed = learned(state)
        for action, may in true(state).items():
            right[may].append(allowed[action] == may)
    shares = [sum(each) / len(each) for each in right.values() if each]
    return sum(shares) / len(shares)


def expected_share(domain: Domain, see: Abstraction, done: Sequence[Done]) -> float:
    """Return the share of actions after which exactly that was seen which some operator that applied expected."""
    met = 0
    for before, action, after in done:
        atoms, state_after = see(before), see(after)
        problem = Problem("now", dict.fromkeys(before.names, ""), atoms, frozenset())
        met += any(
            action_atom(each) == action and each.preconditions <= atoms and apply_action(atoms, each) == state_after
            for each in ground(domain, problem)
        )
    return met / len(done)
