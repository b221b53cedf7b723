"""What the thesis's learner keeps: each predicate with its negation, operators by its own search."""

from __future__ import annotations

from dataclasses import dataclass

from scenewright.stages.kit.predicates.expressions import Predicate
from scenewright.stages.kit.tasks.strips import Domain
from scenewright.stages.predicates.learning.memory import Memory
from scenewright.stages.predicates.learning.thesis_operators import search_operators

THESIS = "thesis"
"""How the label of this learner begins."""


@dataclass
class ThesisMemory(Memory):
    """A memory whose predicates have negations, and whose operators are searched for."""

    def predicates(self) -> dict[str, Predicate]:
        """Return what was learned, each with its negation."""
        by_name = super().predicates()
        for name in self.names().values():
            each = by_name[name]
            by_name[f"no-{name}"] = Predicate(f"no-{name}", each.arguments, ("not", (name, *each.variables)))
        return by_name

    def used(self) -> dict[str, int]:
        """Return the predicates that plans are made with."""
        plain = super().used()
        learned = {self.names()[phrase] for phrase in self.meanings}
        return plain | {f"no-{name}": count for name, count in plain.items() if name in learned}

    def domain(self, name: str, actions: int | None = None) -> Domain:
        """Return the operators, searched for from scratch."""
        atoms = [self.see(state) for state in self.states]
        return search_operators(name, self.used(), self.transitions[:actions], atoms, self.preconditions())
