"""The simulated person of the protocol: she knows the truth, allows or forbids, and names one thing that is amiss."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, Protocol

import numpy as np
from scenewright.stages.kit.predicates.evaluating import Evaluator
from scenewright.stages.kit.predicates.vocabulary import Perceived
from scenewright.stages.kit.tasks.strips import Atom, Problem, ground
from scenewright.stages.predicates.truth import action_of, truth_of

Wording = Literal["plain", "diverse"]


class TeacherLeft(Exception):
    """The teacher is gone; what she taught stays."""


class Teacher(Protocol):
    """Who corrects."""

    @property
    def label(self) -> str:
        """Who she is, for records."""
        ...

    def allows(self, state: Perceived, action: Atom) -> bool:
        """Whether an action may be done."""
        ...

    def correct(self, state: Perceived, action: Atom) -> str:
        """Say one thing that keeps an action from being done; nothing when she can't name one."""
        ...

    def satisfied(self, state: Perceived, goal: tuple[Atom, ...]) -> bool:
        """Whether all is as wanted."""
        ...

    def unmet(self, state: Perceived, goal: tuple[Atom, ...]) -> str:
        """Say one thing that is not as wanted; nothing when all is."""
        ...

    def answer(self, state: Perceived, phrase: str, objects: tuple[str, ...]) -> bool:
        """Say whether a phrase (a complaint) is right of objects."""
        ...


@dataclass
class SimulatedTeacher:
    """Answers by the ground truth of a domain; a share `wrong` of what she says is wrong or missing."""

    domain: str
    seed: int
    wording: Wording = "plain"
    wrong: float = 0.0
    physics: int = field(default=0)
    """Actions that she allowed and physics failed."""

    def __post_init__(self) -> None:
        """Take up the seed."""
        self._random = np.random.default_rng([self.seed, 7])
        self._truth = truth_of(self.domain)
        self._operators = self._truth.operators

    def allows(self, state: Perceived, action: Atom) -> bool:
        """Whether one of her operators for the action applies."""
        atoms = self._truth.atoms(state)
        problem = Problem("now", dict.fromkeys(state.names, ""), atoms, frozenset())
        return any(
            action_of(each.name) == action[0]
            and each.arguments[: len(action) - 1] == action[1:]
            and each.preconditions <= atoms
            for each in ground(self._operators, problem)
        )

    def correct(self, state: Perceived, action: Atom) -> str:
        """Name one of the preconditions, common to her operators for the action, that do not hold."""
        sets = [set(each.preconditions) for each in self._operators.schemas if action_of(each.name) == action[0]]
        if not sets:
            return ""  # what her domain does not know: a learner may know the action from another one
        binding = dict(zip(("?a", "?b"), action[1:], strict=False))
        shared = [tuple(binding.get(term, term) for term in atom) for atom in set.intersection(*sets)]
        atoms = self._truth.atoms(state)
        violated = sorted(atom for atom in shared if atom not in atoms)
        if self._random.random() < self.wrong:
            return self._something_wrong(action, set(violated)) if self._random.random() < 0.5 else ""
        if not violated:
            return ""
        return self._say(violated[int(self._random.integers(len(violated)))], "lacks")

    def _something_wrong(self, action: Atom, violated: set[Atom]) -> str:
        others = [
            (name, *action[1 : 1 + len(kinds)])
            for name, kinds in sorted(self._operators.predicates.items())
            if len(kinds) <= len(action) - 1
        ]
        chosen = [atom for atom in others if atom not in violated]
        return self._say(chosen[int(self._random.integers(len(chosen)))], "lacks")

    @property
    def label(self) -> str:
        """Who she is."""
        return f"simulated, {self.wording}, {self.wrong:g} wrong"

    def satisfied(self, state: Perceived, goal: tuple[Atom, ...]) -> bool:
        """Whether all is as wanted."""
        return set(goal) <= self._truth.atoms(state)

    def unmet(self, state: Perceived, goal: tuple[Atom, ...]) -> str:
        """Name one literal of the goal that does not hold."""
        missing = sorted(set(goal) - self._truth.atoms(state))
        return self._say(missing[int(self._random.integers(len(missing)))], "unmet") if missing else ""

    def answer(self, state: Perceived, phrase: str, objects: tuple[str, ...]) -> bool:
        """Whether the complaint is right."""
        name = self._truth.meant_by(phrase)
        right = name is not None and not Evaluator(state, self._truth.predicates).holds((name, *objects))
        return right != (self._random.random() < self.wrong)

    def _say(self, atom: Atom, kind: Literal["lacks", "unmet"]) -> str:
        texts = getattr(self._truth.file.predicates[atom[0]], kind)
        text = texts[0] if self.wording == "plain" else texts[int(self._random.integers(len(texts)))]
        for number, name in enumerate(atom[1:], start=1):
            text = text.replace(f"<{number}>", name)
        return str(text)
