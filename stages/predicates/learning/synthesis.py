"""Choosing what a phrase means: the cheapest expression that agrees with the labels; rivals are kept."""

from __future__ import annotations

from dataclasses import dataclass

from scenewright.stages.kit.predicates.evaluating import Evaluator
from scenewright.stages.kit.predicates.expressions import Tree
from scenewright.stages.kit.predicates.vocabulary import Perceived
from scenewright.stages.predicates.learning.grammar import candidates
from scenewright.stages.predicates.learning.phrases import Phrase
from scenewright.stages.predicates.learning.setting import KITCHEN, Setting

VIOLATION = 6.0
"""What a label that a meaning contradicts adds to its cost, times the label's weight."""
RIVAL = 0.5
"""Meanings within this of the cheapest are its rivals."""
MOST_TRIED = 400
"""Most meanings of a phrase that are compared with the labels, the cheapest first; by eye."""
FOLLOWED = "accepted "
"""How the source of a label begins that followed from an action which was allowed."""


@dataclass
class Label:
    """A phrase's predicate is said to hold, or not to hold, for objects in a state."""

    state: int
    objects: tuple[str, ...]
    holds: bool
    source: str
    """`sentence`, `answer`, or what followed: `accepted <action>`, `goal`."""
    weight: float = 1.0
    turn: int = 0
    """Of the dialogue."""


@dataclass(frozen=True)
class Meaning:
    """What a phrase is taken to mean."""

    means: Tree
    cost: float
    violated: tuple[int, ...]
    """Places, among the labels, of those that it contradicts."""
    rivals: tuple[Tree, ...]


def _against(violated: list[Label]) -> float:
    """Return the weight of contradicted labels. What followed from one precondition stands or falls together: when the
    teacher was wrong about it all of those labels are, so that they weigh as one."""
    claims: dict[str, float] = {}
    weight = 0.0
    for label in violated:
        if label.source.startswith(FOLLOWED):
            claims[label.source] = max(label.weight, claims.get(label.source, 0.0))
        else:
            weight += label.weight
    return weight + sum(claims.values())


class Synthesiser:
    """Finds meanings over remembered states; truths of expressions are kept."""

    def __init__(self, states: list[Perceived], setting: Setting = KITCHEN) -> None:
        self.states, self.setting = states, setting
        self._evaluators: dict[int, Evaluator] = {}
        self._known: dict[tuple[Tree, int, tuple[str, ...]], bool] = {}

    def truth(self, tree: Tree, state: int, objects: tuple[str, ...]) -> bool:
        """Whether an expression holds for objects in a remembered state."""
        key = (tree, state, objects)
        if key not in self._known:
            if state not in self._evaluators:
                self._evaluators[state] = Evaluator(self.states[state], self.setting.given)
            binding = dict(zip(("?a", "?b"), objects, strict=False))
            self._known[key] = self._evaluators[state].truth(tree, binding)
        return self._known[key]

    def best(self, phrase: Phrase, labels: list[Label]) -> Meaning:
        """Return the cheapest meaning; contradicted labels are paid for, so that one wrong sentence does not undo what
        many right ones say."""
        priced: list[tuple[float, Tree, tuple[int, ...]]] = []
        least = float("inf")
        for cost, tree in candidates(phrase, self._margins(phrase, labels), self.setting)[:MOST_TRIED]:
            if cost > least + RIVAL:
                break
            violated = tuple(
                index
                for index, label in enumerate(labels)
                if self.truth(tree, label.state, label.objects) != label.holds
            )
            total_cost = cost + VIOLATION * _against([labels[index] for index in violated])
            least = min(least, total_cost)
            priced.append((total_cost, tree, violated))
        priced.sort(key=lambda entry: (entry[0], str(entry[1])))
        cost, tree, violated = priced[0]
        rivals = tuple(rival for total_cost, rival, _ in priced[1:] if total_cost <= cost + RIVAL)
        return Meaning(tree, cost, violated, rivals)

    def _margins(self, phrase: Phrase, labels: list[Label]) -> dict[str, list[float]]:
        """Return, for each measure, middles between values with and without the predicate."""
        margins: dict[str, list[float]] = {}
        measures = ((*self.setting.of_whole,), (*self.setting.measures,), ())[phrase.arguments]
        for measure in measures:
            values: dict[bool, set[float]] = {True: set(), False: set()}
            for label in labels:
                state = self.states[label.state]
                value = state.number(label.objects[0], measure) if label.objects else state.of_scene(measure)
                values[label.holds].add(round(value, 3))
            if values[True] and values[False] and not values[True] & values[False]:
                ordered = sorted([(v, True) for v in values[True]] + [(v, False) for v in values[False]])
                changes = [(a + b) / 2 for (a, x), (b, y) in zip(ordered, ordered[1:], strict=False) if x != y]
                margins[measure] = [round(value, 3) for value in changes[:2]]
        return margins
