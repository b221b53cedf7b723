"""The thesis's learner: a language model as Reasoner, Coder and Corrector (Han 2024, section 5.3), its own operators.

The Reasoner says which complaint a sentence makes and of which objects; the Coder writes what the predicate means, in
our checked language (nothing is run as code, other than in the thesis, where it is Python); the Corrector mends it, at
most three times, where it contradicts examples. Each predicate has its negation as one of its own. With probability a
half it tries a feasible action by chance, else it plans; plans are followed open loop in tests.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator, Sequence
from typing import Any

from pydantic import Field
from scenewright.schemas.base import Model
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.language.backend import Request
from scenewright.stages.kit.language.chat import Chat
from scenewright.stages.kit.language.failures import LanguageFailed
from scenewright.stages.kit.language.messages import say
from scenewright.stages.kit.language.reply_schema import schema_of
from scenewright.stages.kit.language.reply_text import objects_in
from scenewright.stages.kit.predicates.expressions import Predicate, Tree, check, read, text_of
from scenewright.stages.kit.predicates.vocabulary import Perceived
from scenewright.stages.kit.tasks.strips import Atom
from scenewright.stages.predicates.learning.grammar import candidates
from scenewright.stages.predicates.learning.ours import OursLearner
from scenewright.stages.predicates.learning.phrases import Phrase, phrase_of
from scenewright.stages.predicates.learning.synthesis import Label
from scenewright.stages.predicates.learning.thesis_memory import THESIS, ThesisMemory
from scenewright.stages.predicates.teacher.simulated import Teacher

ROUNDS = 3
"""Most repairs by the Corrector, and tries of the Coder."""
EXPLORING = 0.5
"""Probability of an action by chance in training."""
MOST_EXAMPLES = 6
"""Most examples that a correction is shown; by eye."""
NEVER: Tree = ("not", ("at_most", 0.0, 0.0))
"""What a predicate means that nobody could write: it never holds."""


class Reasoned(Model):
    """What the Reasoner says of a sentence."""

    complaint: str = Field(max_length=300)
    """The sentence with <1>, <2> for its objects: of complaints that mean the same, the one that was heard first."""
    objects: tuple[str, ...] = Field(max_length=2)


class Coded(Model):
    """What the Coder or the Corrector writes."""

    expression: str = Field(max_length=4000)


class ThesisLearner(OursLearner):
    """Learns as the thesis does; what it asks of the language model is counted by `chat`."""

    def __init__(
        self, teacher: Teacher, actions: Sequence[str], seed: int, memory: ThesisMemory | None = None, *, chat: Chat
    ) -> None:
        super().__init__(teacher, actions, seed, memory or ThesisMemory())
        self.chat, self.label = chat, f"{THESIS}, {chat.backend.label}"
        self.unwritten: list[str] = []
        """Why a predicate could not be written."""

    def _phrase_of(self, sentence: str, state: Perceived) -> tuple[Phrase, tuple[str, ...]]:
        """Return what the Reasoner makes of a sentence; taken literally where it names what is not there."""
        facts = {
            "sentence": sentence,
            "objects": list(state.names),
            "complaints": [phrase.text for phrase in self.memory.labels],
        }
        reply = self._ask_model("reasoner", REASONER, facts, Reasoned)
        if reply is None or not set(reply.objects) <= set(state.names):
            return phrase_of(sentence, state.names)
        return Phrase(reply.complaint, len(reply.objects)), tuple(reply.objects)

    def _understand(self, phrase: Phrase, state: Perceived) -> None:
        """Let the Coder write a new predicate, the Corrector mend one that contradicts its examples."""
        labels = self.memory.labels[phrase]
        means = self.memory.meanings.get(phrase)
        if means is None:
            means = (
                self._write_expression("coder", CODER, phrase, {"complaint": phrase.text, **self._words(phrase)})
                or NEVER
            )
        for _ in range(ROUNDS):
            wrong = [each for each in labels if self._synthesiser.truth(means, each.state, each.objects) != each.holds]
            if not wrong:
                break
            facts = {
                "complaint": phrase.text,
                "expression": text_of(means),
                **self._words(phrase),
                "examples": [self._example(label) for label in (*wrong, *labels)[:MOST_EXAMPLES]],
            }
            better = self._write_expression("corrector", CORRECTOR, phrase, facts)
            if better is None or better == means:
                break
            means = better
        self.memory.meanings[phrase] = means

    def reconsider(self) -> None:
        """The thesis's learner asks nothing again."""

    def _write_expression(self, who: str, task: str, phrase: Phrase, given: dict[str, Any]) -> Tree | None:
        """Return an expression that passes every check, None when none came in ROUNDS tries."""
        for _ in range(ROUNDS):
            reply = self._ask_model(who, task, given, Coded)
            if reply is None:
                return None
            try:
                tree = read(reply.expression, "reply")
                check({**self.setting.given, "it": Predicate("it", phrase.arguments, tree)}, self.setting.words)
                for label in self.memory.labels[phrase]:
                    self._synthesiser.truth(tree, label.state, label.objects)
            except BadInput as error:
                given = {**given, "refused": reply.expression, "because": error.message}
                self.unwritten.append(error.message)
                continue
            return tree
        return None

    def _words(self, phrase: Phrase) -> dict[str, Any]:
        words = self.setting.words
        return {
            "variables": [f"?{chr(97 + index)}" for index in range(phrase.arguments)],
            "of_object": list(words.of_object),
            "of_scene": list(words.of_scene),
            "given": {name: text_of(each.means) for name, each in self.setting.given.items()},
        }

    def _example(self, label: Label) -> dict[str, Any]:
        state, words = self.memory.states[label.state], self.setting.words
        return {
            "objects": list(label.objects),
            "holds": label.holds,
            "seen": {
                name: {
                    "category": state.category(name),
                    **{call: round(state.number(name, call), 3) for call in words.of_object},
                }
                for name in state.names
            },
            "scene": {call: round(state.of_scene(call), 3) for call in words.of_scene},
        }

    def _ask_model(self, who: str, task: str, given: dict[str, Any], model: type[Any]) -> Any:
        """Return a reply, None where the language model gave none that can be read."""
        try:
            return self.chat.ask(
                (say("system", f"{PREFACE} You are the {who}. {task}"), say("user", json.dumps(given, sort_keys=True))),
                schema_of(model),
            )
        except LanguageFailed as error:
            self.unwritten.append(str(error))
            return None

    def explore(self, state: Perceived) -> Atom | None:
        """Return, by chance, an action that nothing is known against."""
        stated, atoms = self.memory.preconditions(), self.memory.see(state)
        applicable = []
        for name in self.actions:
            for objects in itertools.permutations(state.names, self.setting.arity[name]):
                binding = dict(zip(("?a", "?b"), objects, strict=False))
                if {(atom[0], *(binding[term] for term in atom[1:])) for atom in stated.get(name, ())} <= atoms:
                    applicable.append((name, *objects))
        return applicable[int(self.random.integers(len(applicable)))] if applicable else None

    def worth_trying(self, state: Perceived) -> Iterator[tuple[tuple[int, ...], Atom, frozenset[Atom]]]:
        """It seeks out nothing."""
        return iter(())

    def doubtful(self, state: Perceived) -> Atom | None:
        """It doubts nothing."""
        return None

    def curious(self, state: Perceived) -> bool:
        """Half of the time."""
        return bool(self.random.random() < EXPLORING)


PREFACE = (
    "A robot learns from a person's corrections what words mean. Expressions are lists in brackets: "
    "(less A B), (at_most A B), (near A B) of numbers; (and ...), (or ...), (not ...) of truths; "
    "(some ?x T), (every ?x T) over the other objects; (is (category ?a) word); (plus A B), (minus A B), (times A B), "
    "(over A B), (abs A); calls of one object such as (width ?a), calls of the scene such as (table_height), and the "
    "given predicates by name. For example, that an object is in the gripper: (and (less 0.2 (gripper_mass)) "
    "(near (left ?a) (gripper_left)) (near (right ?a) (gripper_right)) (less (bottom ?a) (gripper_top)) "
    "(less (gripper_bottom) (top ?a)))."
)
REASONER = (
    "Say which complaint the sentence makes: the sentence with <1>, <2> in place of its objects, in their order; when "
    "one of the complaints heard so far means the same, repeat that one exactly."
)
CODER = "Write the expression that holds exactly when the complaint is NOT right of the variables."
CORRECTOR = (
    "The expression should hold exactly when the complaint is not right, and contradicts some examples (`holds` says "
    "what it should be there). Write a better one."
)


def stand_in(request: Request) -> str:
    """Answer as the word list does: no language model. The cheapest meaning of the grammar for the Coder; for the
    Corrector the next one after that which was wrong."""
    task, facts = request.messages[0].text, objects_in(request.messages[1].text)[0]
    if "You are the reasoner" in task:
        phrase, objects = phrase_of(facts["sentence"], facts["objects"])
        return json.dumps({"complaint": phrase.text, "objects": list(objects)})
    phrase = Phrase(facts["complaint"], len(facts["variables"]))
    meanings = [text_of(tree) for _, tree in candidates(phrase, {})]
    before = facts.get("expression")
    next_number = meanings.index(before) + 1 if before in meanings else 0
    return json.dumps({"expression": meanings[min(next_number, len(meanings) - 1)]})
