"""A person as the teacher: asked in the terminal, every answer written down before the next question, and replayed.

A dialogue is JSON lines, `{"question": ..., "answer": ...}`. Replayed, each question has to be the one that was asked
then; a dialogue that ends too early is continued in the terminal where there is one, and refused in one line otherwise.
Nothing that was answered is lost.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from pydantic import ValidationError
from scenewright.schemas.base import Model
from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import file_content
from scenewright.stages.kit.predicates.vocabulary import Perceived
from scenewright.stages.kit.tasks.strips import Atom
from scenewright.stages.predicates.truth import truth_of

LARGEST_DIALOGUE, LONGEST_ANSWER = 16 * 2**20, 1000
"""Largest file of a dialogue [bytes] and longest answer [characters]; by eye."""
YES, NO = ("yes", "y", "ja", "true"), ("no", "n", "nein", "false")
HINT = "the teacher.jsonl of an earlier run, or --teacher terminal in a terminal"


class Asked(Model):
    """One question and its answer."""

    question: str
    answer: str


def read_dialogue(path: Path) -> list[Asked]:
    """Read a dialogue. Raises BadInput naming the line that is none."""
    questions = []
    for number, line in enumerate(file_content(path, LARGEST_DIALOGUE, hint=HINT).split(b"\n"), start=1):
        if not line.strip():
            continue
        try:
            questions.append(Asked.model_validate_json(line))
        except ValidationError:
            raise BadInput(f"{path}, line {number}: no question and answer", hint=HINT) from None
    return questions


class TerminalTeacher:
    """Asks a person, or what a person answered before. `ask` is None where there is no terminal."""

    def __init__(self, domain: str, earlier: list[Asked], log: Path, ask: Callable[[str], str] | None) -> None:
        self.domain, self._earlier, self._log, self._ask = domain, earlier, log, ask
        self._at = 0

    @property
    def label(self) -> str:
        """Who she is."""
        return "a person in the terminal"

    def allows(self, state: Perceived, action: Atom) -> bool:
        """Ask whether an action may be done."""
        return self._yes(f"May I {_action(action)}?")

    def correct(self, state: Perceived, action: Atom) -> str:
        """Ask what keeps an action from being done."""
        return self._next_answer(f"Why can't I {_action(action)}? (a sentence; say `object NAME` for objects)")

    def satisfied(self, state: Perceived, goal: tuple[Atom, ...]) -> bool:
        """Ask whether all is as wanted."""
        return self._yes(f"Is it done: {self._goal_text(goal)}?")

    def unmet(self, state: Perceived, goal: tuple[Atom, ...]) -> str:
        """Ask what is not as wanted."""
        return self._next_answer(f"What is missing of it: {self._goal_text(goal)}? (a sentence)")

    def answer(self, state: Perceived, phrase: str, objects: tuple[str, ...]) -> bool:
        """Ask whether a phrase is right of objects."""
        for number, name in enumerate(objects, start=1):
            phrase = phrase.replace(f"<{number}>", name)
        return self._yes(f"Is it so that {phrase}?")

    def _goal_text(self, goal: tuple[Atom, ...]) -> str:
        return " and ".join(map(truth_of(self.domain).goal_phrase, goal))

    def _yes(self, question: str) -> bool:
        text = question
        while True:
            answer = self._next_answer(text).lower().strip(" .!")
            if answer in YES or answer in NO:
                return answer in YES
            text = f"{question} (yes or no)"

    def _next_answer(self, question: str) -> str:
        if self._at < len(self._earlier):
            earlier = self._earlier[self._at]
            if earlier.question != question:
                raise BadInput(
                    f"dialogue, question {self._at + 1}: {earlier.question[:60]!r} was asked then, "
                    f"{question[:60]!r} is now",
                    hint="replay it with the seed, tasks and scene of then",
                )
            answer = earlier.answer
        elif self._ask is None:
            raise BadInput(
                f"dialogue: it ends before question {self._at + 1}, {question[:80]!r}", hint="continue it in a terminal"
            )
        else:
            answer = self._ask(question)[:LONGEST_ANSWER]
        self._at += 1
        with self._log.open("a", encoding="utf-8") as file:
            file.write(json.dumps({"answer": answer, "question": question}, ensure_ascii=False) + "\n")
        return answer


def _action(action: Atom) -> str:
    return " ".join([action[0].replace("_", " "), *action[1:]])
