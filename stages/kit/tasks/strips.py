"""Typed STRIPS: predicates, action schemas, grounding, and a plain simulator that validates plans."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

Atom = tuple[str, ...]
"""Predicate name and arguments; in schemas, arguments that start with `?` are parameters."""


def atom_text(atom: Atom) -> str:
    """Return an atom as people write it: `on(bottle_7, table_3)`."""
    return f"{atom[0]}({', '.join(atom[1:])})"


@dataclass(frozen=True)
class Schema:
    """An action schema; effects are conjunctions of literals."""

    name: str
    parameters: tuple[tuple[str, str], ...]
    """(variable, type)"""
    preconditions: tuple[Atom, ...]
    add: tuple[Atom, ...]
    delete: tuple[Atom, ...]


@dataclass(frozen=True)
class Domain:
    """Types (name -> supertype, "" at the top), predicates (name -> types of arguments) and schemas."""

    name: str
    types: dict[str, str]
    predicates: dict[str, tuple[str, ...]]
    schemas: tuple[Schema, ...]

    def is_a(self, kind: str, wanted: str) -> bool:
        """Whether type `kind` is `wanted` or below it."""
        while kind and kind != wanted:
            kind = self.types[kind]
        return bool(kind)


@dataclass(frozen=True)
class Problem:
    """Objects (name -> type), initial atoms and goal atoms (all must hold)."""

    name: str
    objects: dict[str, str]
    initial: frozenset[Atom]
    goal: frozenset[Atom]


@dataclass(frozen=True)
class GroundAction:
    """An action without variables."""

    name: str
    arguments: tuple[str, ...]
    preconditions: frozenset[Atom]
    add: frozenset[Atom]
    delete: frozenset[Atom]

    @property
    def text(self) -> str:
        """The action as people write it."""
        return atom_text((self.name, *self.arguments))


def _ground(atoms: tuple[Atom, ...], binding: dict[str, str]) -> frozenset[Atom]:
    return frozenset((atom[0], *(binding.get(term, term) for term in atom[1:])) for atom in atoms)


def ground(domain: Domain, problem: Problem) -> list[GroundAction]:
    """Return every action whose static preconditions hold, in a fixed order.

    Static predicates are those that no action changes. Actions with equal arguments for two parameters are left out.
    """
    changed = {atom[0] for schema in domain.schemas for atom in (*schema.add, *schema.delete)}
    by_type = {
        kind: sorted(name for name, own in problem.objects.items() if domain.is_a(own, kind)) for kind in domain.types
    }
    return [action for schema in domain.schemas for action in _ground_schema(schema, by_type, changed, problem)]


def _ground_schema(
    schema: Schema, by_type: dict[str, list[str]], changed: set[str], problem: Problem
) -> Iterator[GroundAction]:
    variables = [name for name, _ in schema.parameters]
    static = tuple(atom for atom in schema.preconditions if atom[0] not in changed)
    for values in product(*(by_type[kind] for _, kind in schema.parameters)):
        if len(set(values)) < len(values):
            continue
        binding = dict(zip(variables, values, strict=True))
        if not _ground(static, binding) <= problem.initial:
            continue
        add, delete = _ground(schema.add, binding), _ground(schema.delete, binding)
        yield GroundAction(schema.name, values, _ground(schema.preconditions, binding), add, delete - add)


def apply_action(state: frozenset[Atom], action: GroundAction) -> frozenset[Atom]:
    """Return the state after an action. Raises ValueError naming the preconditions that do not hold."""
    missing = action.preconditions - state
    if missing:
        raise ValueError(f"{action.text}: not true before it: {', '.join(sorted(map(atom_text, missing)))}")
    return (state - action.delete) | action.add


def validate(problem: Problem, plan: list[GroundAction]) -> frozenset[Atom]:
    """Run a plan step by step and return the last state. Raises ValueError when a step or the goal does not hold."""
    state = problem.initial
    for action in plan:
        state = apply_action(state, action)
    missing = problem.goal - state
    if missing:
        raise ValueError(f"goal not reached: {', '.join(sorted(map(atom_text, missing)))}")
    return state
