"""One session: the brain writes a program, the interpreter runs it on the arm's calls, the brain reads what it did."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

from scenewright.schemas.plan import Failure
from scenewright.stages.agent.arms.skills import Skills
from scenewright.stages.agent.body import Body
from scenewright.stages.agent.brains.brain import Brain, Reply
from scenewright.stages.agent.language.interpreter import Called, Interpreter, Ran
from scenewright.stages.agent.language.program import PlanError, parse_program
from scenewright.stages.agent.language.values import Value
from scenewright.stages.agent.senses import Base
from scenewright.stages.kit.language.failures import LanguageFailed

End = Literal["done", "give_up", "ask", "turns", "time", "repeats", "brain"]
"""How a session ended: by the program's word, or by a limit; `brain`: it gave no usable answer."""


@dataclass(frozen=True)
class Limits:
    """Bounds of a session."""

    turns: int = 150
    seconds: float = 7200.0
    """Of the robot."""
    repeats: int = 5
    """The same program with the same outcome, so often in a row."""


@dataclass(frozen=True)
class Turn:
    """A program and what came of it."""

    reply: Reply
    ran: Ran
    seconds: float
    """Of the robot, when it was over."""
    base: Base
    holding: str


@dataclass
class Session:
    """What was said and done."""

    turns: list[Turn] = field(default_factory=list)
    end: End = "turns"
    words: str = ""
    """What the robot told the user at the end."""
    stopped: Failure | None = None

    @property
    def calls(self) -> list[Called]:
        """All calls, in order."""
        return [called for turn in self.turns for called in turn.ran.calls]


def run_session(
    brain: Brain,
    skills: Skills,
    body: Body,
    limits: Limits,
    *,
    one_program: bool = False,
    watch: Callable[[Turn], None] | None = None,
) -> Session:
    """Run a session to its end. `one_program`: what the brain said first is all that it says. `watch` sees each turn.

    Whatever a brain says or a world does, a session ends in a word or at a limit.
    """
    session, last = Session(), None

    def call(name: str, arguments: tuple[Value, ...]) -> Value:
        return skills.call(name, arguments)

    interpreter = Interpreter(call, lambda: body.seconds > limits.seconds)
    same: Counter[tuple[str, str]] = Counter()
    while len(session.turns) < limits.turns:
        try:
            reply = brain.reply(last)
        except LanguageFailed as error:
            session.end, session.stopped, session.words = "brain", error.failure, error.failure.message
            return session
        try:
            last = interpreter.run(parse_program(reply.code))
        except PlanError as error:
            last = Ran(error=error.failure)
        turn = Turn(reply, last, body.seconds, body.base, skills.holding.key if skills.holding else "")
        session.turns.append(turn)
        if watch is not None:
            watch(turn)
        if last.ended is not None:
            session.end, session.words = last.ended.how, last.ended.words  # type: ignore[assignment]
            return session
        if last.error is not None and last.error.kind == "out_of_time":
            session.end = "time"
            return session
        if one_program:
            session.end, session.stopped = "brain", last.error
            session.words = last.error.message if last.error else ""
            return session
        outcome = (reply.code, repr([(c.name, c.arguments, c.value, c.error) for c in last.calls]) + repr(last.error))
        same = Counter({outcome: same[outcome] + 1})
        if same[outcome] >= limits.repeats:
            session.end, session.words = "repeats", f"the same program {limits.repeats} times with the same outcome"
            return session
    return session
