"""Evaluating checked expressions in a state, with a limit on the steps."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import permutations

from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.predicates.expressions import Predicate, Tree
from scenewright.stages.kit.predicates.vocabulary import Perceived
from scenewright.stages.kit.tasks.strips import Atom

LIMIT = 200_000
"""Steps of the evaluation of one atom, those of the predicates that it names included."""


class Evaluator:
    """Truth of atoms in one state; what was evaluated is remembered."""

    def __init__(self, state: Perceived, predicates: Mapping[str, Predicate]) -> None:
        self.state, self.predicates = state, predicates
        self._truth_by_atom: dict[Atom, bool] = {}
        self._steps = 0

    def holds(self, atom: Atom) -> bool:
        """Whether an atom holds. Raises BadInput when its meaning divides by zero or takes too many steps."""
        self._steps = 0
        return self._atom(atom)

    def truth(self, tree: Tree, binding: Mapping[str, str]) -> bool:
        """Whether an expression holds for objects. Raises BadInput as `holds` does."""
        self._steps = 0
        return self._truth(tree, dict(binding))

    def atoms(self, names: Mapping[str, int] | None = None) -> frozenset[Atom]:
        """Return all atoms of predicates (name -> arguments; all, where none are given) that hold."""
        argument_counts = (
            names if names is not None else {name: each.arguments for name, each in self.predicates.items()}
        )
        holding = [
            (name, *objects)
            for name, count in argument_counts.items()
            for objects in permutations(self.state.names, count)
            if self.holds((name, *objects))
        ]
        return frozenset(holding)

    def _atom(self, atom: Atom) -> bool:
        if atom not in self._truth_by_atom:
            predicate = self.predicates[atom[0]]
            self._truth_by_atom[atom] = self._truth(
                predicate.means, dict(zip(predicate.variables, atom[1:], strict=True))
            )
        return self._truth_by_atom[atom]

    def _truth(self, tree: Tree, binding: dict[str, str]) -> bool:
        self._steps += 1
        if self._steps > LIMIT:
            raise BadInput(
                f"a predicate takes more than {LIMIT} steps to evaluate", hint="fewer nested `some`, `every`"
            )
        head = tree[0]
        if head == "and":
            return all(self._truth(part, binding) for part in tree[1:])  # type: ignore[arg-type]
        if head == "or":
            return any(self._truth(part, binding) for part in tree[1:])  # type: ignore[arg-type]
        if head == "not":
            return not self._truth(tree[1], binding)  # type: ignore[arg-type]
        if head in ("some", "every"):
            variable, body = str(tree[1]), tree[2]
            others = [name for name in self.state.names if name not in binding.values()]
            values = (self._truth(body, {**binding, variable: name}) for name in others)  # type: ignore[arg-type]
            return any(values) if head == "some" else all(values)
        if head == "is":
            return self._word(tree[1], binding) == self._word(tree[2], binding)
        if head in ("less", "at_most", "near"):
            first, two = self._number(tree[1], binding), self._number(tree[2], binding)
            if head == "less":
                return first < two
            return first <= two if head == "at_most" else abs(first - two) < self.state.tolerance
        names = tuple(binding[str(part)] for part in tree[1:])
        return self._atom((str(head), *names)) if head in self.predicates else self.state.related(str(head), names)

    def _word(self, tree: Tree | str | float, binding: dict[str, str]) -> str:
        if isinstance(tree, tuple):
            return self.state.category(binding[str(tree[1])])
        return str(tree)

    def _number(self, tree: Tree | str | float, binding: dict[str, str]) -> float:
        self._steps += 1
        if isinstance(tree, float):
            return tree
        assert isinstance(tree, tuple)
        head = str(tree[0])
        if len(tree) == 2 and head != "abs":
            return self.state.number(binding[str(tree[1])], head)
        if len(tree) == 1:
            return self.state.of_scene(head)
        numbers = [self._number(part, binding) for part in tree[1:]]
        if head == "abs":
            return abs(numbers[0])
        first, two = numbers
        if head == "plus":
            return first + two
        if head == "minus":
            return first - two
        if head == "times":
            return first * two
        if two == 0.0:
            raise BadInput("a predicate divides by zero", hint="docs/INTERPRET.md has the language of predicates")
        return first / two
