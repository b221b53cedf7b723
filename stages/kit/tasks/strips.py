"""Typed STRIPS: predicates, action schemas, grounding, and a plain simulator that validates plans."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

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
    negative: tuple[Atom, ...] = ()
    """Atoms that must not hold before it."""


@dataclass(frozen=True)
class Domain:
    """Types (name -> supertype, "" at the top), predicates (name -> types of arguments) and schemas."""

    name: str
    types: dict[str, str]
    predicates: dict[str, tuple[str, ...]]
    schemas: tuple[Schema, ...]

    def is_a(self, kind: str, wanted: str) -> bool:
        """Whether type `kind` is `wanted` or below it; everything is below "" (PDDL's object)."""
        while kind and kind != wanted:
            kind = self.types[kind]
        return kind == wanted


@dataclass(frozen=True)
class Problem:
    """Objects (name -> type), initial atoms and goal atoms (all must hold)."""

    name: str
    objects: dict[str, str]
    initial: frozenset[Atom]
    goal: frozenset[Atom]
    negative_goal: frozenset[Atom] = frozenset()
    """Atoms that must not hold at the end."""


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


def bound(schema: Schema, binding: dict[str, str]) -> GroundAction:
    """Return the action of a schema with these values of all its variables, in the order of its parameters."""
    add, delete = _ground(schema.add, binding), _ground(schema.delete, binding)
    return GroundAction(schema.name, tuple(binding.values()), _ground(schema.preconditions, binding), add, delete - add)


def ground(domain: Domain, problem: Problem) -> list[GroundAction]:
    """Return every action whose static preconditions hold, in the order of the schemas and of the problem's objects.

    Static predicates are those that no action changes. Actions with equal arguments for two parameters are left out.
    Raises ValueError where negative preconditions or goals occur: `positive_task` grounds those.
    """
    if problem.negative_goal or any(schema.negative for schema in domain.schemas):
        raise ValueError("negative preconditions: call positive_task")
    return [action for action, _ in _ground_all(domain, problem)]


def positive_task(domain: Domain, problem: Problem) -> tuple[Problem, list[GroundAction]]:
    """Return an equal task without negative preconditions and goals: the problem and its actions.

    Each atom that must be false somewhere gets a counterpart `not-<predicate>` that is true when the atom is not
    (Gazen & Knoblock 1997); actions keep names and arguments.
    """
    grounded = _ground_all(domain, problem)
    tracked = set(problem.negative_goal).union(*(negative for _, negative in grounded))

    def opposite(atoms: frozenset[Atom]) -> frozenset[Atom]:
        return frozenset((f"not-{atom[0]}", *atom[1:]) for atom in atoms & tracked)

    actions = [
        GroundAction(
            action.name,
            action.arguments,
            action.preconditions | opposite(negative),
            action.add | opposite(action.delete),
            action.delete | opposite(action.add),
        )
        for action, negative in grounded
    ]
    initial = problem.initial | opposite(frozenset(tracked - problem.initial))
    goal = problem.goal | opposite(problem.negative_goal)
    return Problem(problem.name, problem.objects, initial, goal), actions


def _ground_all(domain: Domain, problem: Problem) -> list[tuple[GroundAction, frozenset[Atom]]]:
    """Return ground actions with the atoms that must not hold before them."""
    changed = {atom[0] for schema in domain.schemas for atom in (*schema.add, *schema.delete)}
    by_type = {
        kind: [name for name, object_kind in problem.objects.items() if domain.is_a(object_kind, kind)]
        for kind in (*domain.types, "")
    }
    return [entry for schema in domain.schemas for entry in _ground_schema(schema, by_type, changed, problem)]


def _ground_schema(
    schema: Schema, by_type: dict[str, list[str]], changed: set[str], problem: Problem
) -> Iterator[tuple[GroundAction, frozenset[Atom]]]:
    """Bind one parameter after the other; a static precondition is checked as soon as its variables are bound."""
    static = [(atom, True) for atom in schema.preconditions if atom[0] not in changed]
    static += [(atom, False) for atom in schema.negative if atom[0] not in changed]
    variables = [name for name, _ in schema.parameters]
    checks: list[list[tuple[Atom, bool]]] = [[] for _ in range(len(variables) + 1)]
    for atom, truth in static:
        last = max((variables.index(term) + 1 for term in atom[1:] if term in variables), default=0)
        checks[last].append((atom, truth))

    def extend(binding: dict[str, str]) -> Iterator[dict[str, str]]:
        for atom, truth in checks[len(binding)]:
            if ((atom[0], *(binding.get(term, term) for term in atom[1:])) in problem.initial) != truth:
                return
        if len(binding) == len(variables):
            yield binding
            return
        name, kind = schema.parameters[len(binding)]
        for value in by_type[kind]:
            if value not in binding.values():
                yield from extend({**binding, name: value})

    for binding in extend({}):
        yield bound(schema, binding), _ground(schema.negative, binding)


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
