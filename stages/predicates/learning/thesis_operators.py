"""The thesis's operator learner: candidates by pre-state, merged, then literals dropped while effects stay as certain.

Han 2024, section 5.4 (a variant of cluster-then-search): for each action one candidate for every distinct lifted state
before it; candidates whose preconditions another covers, with the same effect, are merged; literals are dropped
one by one, those with most variables outside action and effect first, never one that the teacher named; a drop is kept
when the log-likelihood, the negative entropy of the effects, does not fall by more than 1e-5.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence

from scenewright.stages.kit.tasks.strips import Atom, Domain, Schema
from scenewright.stages.predicates.learning.operators import Transition

FALL = 1e-5
"""Fall of the log-likelihood that counts as none."""
MOST_OTHERS = 2
"""Objects beside the action's that one lifted transition may speak of."""
Case = tuple[frozenset[Atom], frozenset[Atom], frozenset[Atom]]
"""Lifted: what held before, what was added, what was deleted."""
Effect = tuple[frozenset[Atom], frozenset[Atom]]


def search_operators(
    name: str,
    predicates: Mapping[str, int],
    transitions: Sequence[Transition],
    atoms: Sequence[frozenset[Atom]],
    stated: Mapping[str, frozenset[Atom]],
) -> Domain:
    """Return the operators of a domain, learned from scratch."""
    cases: dict[str, list[Case]] = defaultdict(list)
    for transition in transitions:
        case = lifted(transition.action, atoms[transition.before], atoms[transition.after])
        if case is not None:
            cases[transition.action[0]].append(case)
    schemas = []
    for action in sorted(cases):
        effect_of_preconditions: dict[frozenset[Atom], Effect] = {}
        stated_atoms = stated.get(action, frozenset())
        for before in dict.fromkeys(case[0] for case in cases[action]):
            dropped = _drop_irrelevant(before, stated_atoms, cases[action])
            effect = usual_effect(dropped, cases[action])
            effect_of_preconditions = {
                each: earlier_effect
                for each, earlier_effect in effect_of_preconditions.items()
                if not (dropped <= each and earlier_effect == effect)
            }
            if not any(
                each <= dropped and earlier_effect == effect for each, earlier_effect in effect_of_preconditions.items()
            ):
                effect_of_preconditions[dropped] = effect
        for number, (preconditions, (add, delete)) in enumerate(effect_of_preconditions.items()):
            required = preconditions | delete
            variables = {term for atom in (*required, *add) for term in atom[1:]} | {"?a"}
            if not {term for atom in add for term in atom[1:]} <= {term for atom in required for term in atom[1:]} | {
                "?a",
                "?b",
            }:
                continue
            parameters = tuple((variable, "") for variable in ("?a", "?b", "?x", "?y") if variable in variables)
            schemas.append(
                Schema(
                    f"{action}-{number + 1}",
                    parameters,
                    tuple(sorted(required)),
                    tuple(sorted(add)),
                    tuple(sorted(delete)),
                )
            )
    return Domain(name, {}, {each: ("",) * count for each, count in predicates.items()}, tuple(schemas))


def usual_effect(preconditions: frozenset[Atom], cases: Sequence[Case]) -> Effect:
    """Return what was added and deleted most often in the cases that preconditions cover."""
    covered = Counter(case[1:] for case in cases if preconditions <= case[0])
    effect, _ = max(covered.items(), key=lambda entry: (entry[1], sorted(entry[0][0])))
    return effect


def lifted(action: Atom, before: frozenset[Atom], after: frozenset[Atom]) -> Case | None:
    """Return a transition with variables, ?a and ?b for the action's objects, ?x and ?y for others that it changes;
    None when it changes more. Of what held before, atoms about these objects alone are kept."""
    names = dict(zip(action[1:], ("?a", "?b"), strict=False))
    changed = sorted({term for atom in before ^ after for term in atom[1:]} - set(names))
    if len(changed) > MOST_OTHERS or before == after:
        return None
    names.update(zip(changed, ("?x", "?y"), strict=False))

    def renamed(atoms: frozenset[Atom]) -> frozenset[Atom]:
        return frozenset(
            (atom[0], *(names[term] for term in atom[1:])) for atom in atoms if set(atom[1:]) <= set(names)
        )

    return renamed(before), renamed(after - before), renamed(before - after)


def likelihood(preconditions: frozenset[Atom], cases: Sequence[Case]) -> float:
    """Return the negative entropy of the effects of the cases that preconditions cover, not normalised."""
    counted = Counter(case[1:] for case in cases if preconditions <= case[0])
    total = sum(counted.values())
    return sum(count * math.log(count / total) for count in counted.values())


def _drop_irrelevant(before: frozenset[Atom], named: frozenset[Atom], cases: Sequence[Case]) -> frozenset[Atom]:
    """Return a state's atoms without those that make no difference to what follows."""
    remaining = before
    mine = next(case for case in cases if case[0] == before)
    inside = {"?a", "?b"} | {term for atom in (*mine[1], *mine[2]) for term in atom[1:]}
    order = sorted(before - named, key=lambda atom: (-len(set(atom[1:]) - inside), atom))
    for atom in order:
        fewer = remaining - {atom}
        if likelihood(fewer, cases) >= likelihood(remaining, cases) - FALL:
            remaining = fewer
    return remaining
