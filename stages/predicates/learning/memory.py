"""What a learner has seen and heard, and what it makes of it: states, phrases with labels, goals, operators."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field

from scenewright.stages.kit.predicates.evaluating import Evaluator
from scenewright.stages.kit.predicates.expressions import Predicate, Tree
from scenewright.stages.kit.predicates.goal_sentences import read_goal
from scenewright.stages.kit.predicates.vocabulary import Perceived
from scenewright.stages.kit.tasks.strips import Atom, Domain
from scenewright.stages.predicates.learning.operators import Transition, learn_operators
from scenewright.stages.predicates.learning.phrases import Phrase
from scenewright.stages.predicates.learning.setting import KITCHEN, Setting
from scenewright.stages.predicates.learning.synthesis import Label


@dataclass
class Turn:
    """One line of the dialogue."""

    speaker: str
    """`teacher` or `robot`."""
    text: str
    about: str = ""
    believed: bool = True


@dataclass
class Memory:
    """Everything that a learner keeps; `meanings` are set by whoever learns them."""

    setting: Setting = KITCHEN
    states: list[Perceived] = field(default_factory=list)
    labels: dict[Phrase, list[Label]] = field(default_factory=lambda: defaultdict(list))
    meanings: dict[Phrase, Tree] = field(default_factory=dict)
    stated: dict[tuple[str, Phrase, tuple[str, ...]], int] = field(default_factory=dict)
    """Action, phrase and its variables -> how often it was named as a precondition."""
    goals: dict[str, list[tuple[Phrase, tuple[int, ...]]]] = field(default_factory=lambda: defaultdict(list))
    """Part of a goal sentence -> what the teacher missed of it: phrase, and which of the part's objects."""
    transitions: list[Transition] = field(default_factory=list)
    dialogue: list[Turn] = field(default_factory=list)
    disbelieved: list[str] = field(default_factory=list)
    questions: int = 0

    def remember(self, state: Perceived) -> int:
        """Return the number of a state, kept from now on."""
        if not self.states or self.states[-1] != state:
            self.states.append(state)
        return len(self.states) - 1

    @property
    def sentences(self) -> int:
        """Sentences of the teacher's feedback, answers to questions included."""
        return sum(turn.speaker == "teacher" and turn.about != "goal" for turn in self.dialogue)

    def names(self) -> dict[Phrase, str]:
        """Return the predicate of every phrase; phrases that mean the same have the same."""
        by_meaning: dict[Tree, str] = {each.means: name for name, each in self.setting.given.items()}
        by_meaning |= {(name, *each.variables): name for name, each in self.setting.given.items()}
        used_names = set(self.setting.given)
        name_of_phrase = {}
        for phrase, means in self.meanings.items():
            if means not in by_meaning:
                name = phrase.name
                while name in used_names:
                    name += "_too"
                by_meaning[means] = name
                used_names.add(name)
            name_of_phrase[phrase] = by_meaning[means]
        return name_of_phrase

    def predicates(self) -> dict[str, Predicate]:
        """Return what was learned, with the given predicates that it uses."""
        by_name = dict(self.setting.given)
        for phrase, name in self.names().items():
            if name not in by_name:
                by_name[name] = Predicate(name, phrase.arguments, self.meanings[phrase])
        return by_name

    def used(self) -> dict[str, int]:
        """Return the predicates that plans are made with: those of phrases, and of the worked example."""
        learned = {name: phrase.arguments for phrase, name in self.names().items()}
        return {self.setting.held: 1, **learned}

    def see(self, state: Perceived) -> frozenset[Atom]:
        """Return which atoms hold in a state."""
        return Evaluator(state, self.predicates()).atoms(self.used())

    def preconditions(self) -> dict[str, frozenset[Atom]]:
        """Return what the teacher named for each action."""
        names, atoms_of_action = self.names(), defaultdict(set)
        for action, phrase, variables in self.stated:
            if phrase in names:
                atoms_of_action[action].add((names[phrase], *variables))
        return {action: frozenset(atoms) for action, atoms in atoms_of_action.items()}

    def domain(self, name: str, actions: int | None = None) -> Domain:
        """Return the operators learned from scratch from all that was seen, or from the first `actions` alone."""
        predicates, used = self.predicates(), self.used()
        transitions = self.transitions[:actions]
        states_needed = {each.before for each in transitions} | {each.after for each in transitions}
        nothing: frozenset[Atom] = frozenset()
        atoms = [
            Evaluator(state, predicates).atoms(used) if number in states_needed else nothing
            for number, state in enumerate(self.states)
        ]
        apart = self.setting.tells_apart
        return learn_operators(name, used, transitions, atoms, self.preconditions(), apart)

    def wanted(self, sentence: str, objects: Iterable[str]) -> tuple[frozenset[Atom], str]:
        """Return what a goal in words wants of objects, or nothing and what the words lack."""
        reading = read_goal(sentence, objects, self.goals)
        if reading.lacking:
            return frozenset(), reading.lacking
        for part in reading.parts:
            if not self.goal_atoms([part])[0]:
                return frozenset(), f"nobody has said what {part[0]!r} means"
        return self.goal_atoms(list(reading.parts))[0], ""

    def goal_atoms(self, parts: list[tuple[str, tuple[str, ...]]]) -> tuple[frozenset[Atom], tuple[str, ...]]:
        """Return what a goal sentence's parts want, and the parts that nobody has explained."""
        names = self.names()
        atoms, unknown = set(), []
        for part, objects in parts:
            if part not in self.goals:
                unknown.append(part)
            for phrase, places in self.goals.get(part, []):
                if phrase in names:
                    atoms.add((names[phrase], *(objects[index] for index in places)))
        return frozenset(atoms), tuple(unknown)
