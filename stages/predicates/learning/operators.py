"""Operators out of what was seen: transitions are clustered by what changed, preconditions are those that the teacher
named and those that the change itself asks for."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass

from scenewright.stages.kit.tasks.strips import Atom, Domain, Schema

RARE = 0.05
"""A change that follows an action less often than this is taken for an accident."""


@dataclass(frozen=True)
class Transition:
    """An action that was allowed and done: states before and after, by their numbers."""

    action: Atom
    before: int
    after: int


Lifted = tuple[frozenset[Atom], frozenset[Atom]]
Stated = Mapping[str, frozenset[Atom]]
"""Action -> atoms over ?a, ?b that the teacher named as its preconditions."""


def lift(action: Atom, added: frozenset[Atom], deleted: frozenset[Atom]) -> Lifted | None:
    """Return a change with variables: ?a, ?b for the action's objects, ?x for one other. None when it concerns more
    than one other."""
    names = dict(zip(action[1:], ("?a", "?b"), strict=False))
    others = {term for atom in (*added, *deleted) for term in atom[1:]} - set(names)
    if len(others) > 1:
        return None
    names.update(dict.fromkeys(others, "?x"))

    def renamed(atoms: frozenset[Atom]) -> frozenset[Atom]:
        return frozenset((atom[0], *(names[term] for term in atom[1:])) for atom in atoms)

    return renamed(added), renamed(deleted)


def learn_operators(
    name: str,
    predicates: Mapping[str, int],
    transitions: list[Transition],
    atoms: list[frozenset[Atom]],
    stated: Stated,
    apart: bool = False,
) -> Domain:
    """Return the operators of a domain; `atoms` are what held in each state. With `apart`, of an action with several
    effects, each asks for what held whenever it was seen and never when another was."""
    groups: dict[str, dict[Lifted, int]] = defaultdict(lambda: defaultdict(int))
    before_of: dict[str, dict[Lifted, list[frozenset[Atom]]]] = defaultdict(lambda: defaultdict(list))
    for transition in transitions:
        before, after = atoms[transition.before], atoms[transition.after]
        lifted = lift(transition.action, after - before, before - after)
        if lifted is not None and any(lifted):
            groups[transition.action[0]][lifted] += 1
            if apart:
                before_of[transition.action[0]][lifted].append(_of_arguments(transition.action, before))
    schemas = []
    for action in sorted(groups):
        effects = _without_accidents(groups[action])
        for number, (add, delete) in enumerate(effects):
            variables = {term for atom in (*add, *delete) for term in atom[1:]}
            preconditions = stated.get(action, frozenset()) | delete
            if apart:
                preconditions |= _telling(before_of[action], (add, delete))
            arity = {"?a"} | {term for atom in preconditions for term in atom[1:]} | variables
            if _takes_two(action, transitions):
                arity.add("?b")
            parameters = tuple((variable, "") for variable in ("?a", "?b", "?x") if variable in arity)
            if "?x" in variables and not any("?x" in atom for atom in delete):
                continue  # nothing says which other object would change
            schemas.append(
                Schema(
                    f"{action}-{number + 1}",
                    parameters,
                    tuple(sorted(preconditions)),
                    tuple(sorted(add)),
                    tuple(sorted(delete)),
                )
            )
    return Domain(name, {}, {each: ("",) * count for each, count in predicates.items()}, tuple(schemas))


def _of_arguments(action: Atom, held: frozenset[Atom]) -> frozenset[Atom]:
    """Return what held of an action's objects alone, lifted."""
    names = dict(zip(action[1:], ("?a", "?b"), strict=False))
    return frozenset((atom[0], *(names[term] for term in atom[1:])) for atom in held if set(atom[1:]) <= set(names))


def _telling(seen: Mapping[Lifted, list[frozenset[Atom]]], effect: Lifted) -> frozenset[Atom]:
    """Return the atoms over the arguments that held before every transition with an effect and before none with
    another; nothing where there is one effect alone."""
    others = [atoms for other_effect, each in seen.items() if other_effect != effect for atoms in each]
    if not others:
        return frozenset()
    always = frozenset.intersection(*seen[effect])
    return frozenset(atom for atom in always if len(atom) > 1 and not any(atom in atoms for atoms in others))


def _takes_two(action: str, transitions: list[Transition]) -> bool:
    return any(len(each.action) == 3 for each in transitions if each.action[0] == action)


def _without_accidents(counted: Mapping[Lifted, int]) -> list[Lifted]:
    """Return the changes in the order of how often they were seen, without rare ones."""
    total = sum(counted.values())
    order = sorted(counted, key=lambda lifted: (-counted[lifted], sorted(lifted[0]), sorted(lifted[1])))
    return [lifted for rank, lifted in enumerate(order) if rank == 0 or counted[lifted] / total >= RARE]
