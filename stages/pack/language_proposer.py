"""Proposers that ask a language model: LLM3's two variants, and the model as the symbolic half over our geometry."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal

from pydantic import Field
from scenewright.schemas.base import Model
from scenewright.schemas.plan import Failure
from scenewright.stages.kit.language.actions import LONGEST_NAME, ActionCall, quoted
from scenewright.stages.kit.language.chat import Chat
from scenewright.stages.kit.language.failures import LanguageFailed
from scenewright.stages.kit.language.messages import say
from scenewright.stages.kit.language.plan_schema import plan_schema
from scenewright.stages.kit.language.reply_schema import schema_of
from scenewright.stages.pack.language_prompt import packing_language, prompt, refused_order_text
from scenewright.stages.pack.records import Action, Attempt, Observation

TRACE_LENGTH = 5
"""Attempts that the authors' configurations show to the model."""
ORDER_CALLS = 5
"""Orders that the model may be asked for in one proposal, each without an arrangement before."""
MOST_NAMES = 100
"""Most names in an answer; by eye."""

PlacementSolver = Callable[[Observation, tuple[str, ...], Sequence[Attempt]], "tuple[Action, ...] | Failure"]
"""Observation, names in the order to pack, the trace -> the full plan of picks and places, or why there is none."""


class LanguageProposer:
    """Asks for a full plan with all of its numbers (Han 2024, algorithm 1). `calls` is #LM.

    A name that is no box's comes back as an action, which the loop refuses with a reason: a mistake that counts. A
    reply that breaks the schema or its ranges is asked for again and does not count. A plan that could not be read
    after all re-prompts is empty. Raises LanguageFailed when a budget is spent or nobody answers.
    """

    def __init__(
        self,
        chat: Chat,
        *,
        variant: Literal["backtrack", "scratch"],
        reasons: bool = True,
        trace_length: int = TRACE_LENGTH,
        name: str | None = None,
    ) -> None:
        self.chat = chat
        self._variant, self._reasons, self._trace_length = variant, reasons, trace_length
        self.name = name or f"{chat.backend.label} {variant}{'' if reasons else ' without reasons'}"
        self.calls = 0

    def propose(self, observation: Observation, trace: Sequence[Attempt]) -> tuple[Action, ...]:
        """Return the plan of one call of the model."""
        self.calls += 1
        latest = trace[max(0, len(trace) - self._trace_length) :]
        messages = prompt(observation, latest, self._variant, reasons=self._reasons)
        try:
            reply = self.chat.ask(messages, plan_schema(packing_language(observation)))
        except LanguageFailed as error:
            if error.failure.kind == "unreadable_reply":
                return ()
            raise
        return tuple(as_action(call) for call in reply.plan)


class OrderReply(Model):
    """An order as a reply holds it."""

    reasoning: str = Field("", description="Why the last order failed and what this one does about it")
    order: tuple[str, ...] = Field(description="Every box once, the first to be packed first", max_length=MOST_NAMES)


class SymbolicProposer:
    """Asks only for the order in which boxes are packed; `solve` finds where they go, or says why they cannot.

    An order without an arrangement goes back to the model with the reason before any motion is planned. Every order
    that is asked for counts in `calls`.
    """

    def __init__(
        self,
        chat: Chat,
        solve: PlacementSolver,
        *,
        trace_length: int = TRACE_LENGTH,
        reasons: bool = True,
        name: str | None = None,
    ) -> None:
        self.chat, self._solve = chat, solve
        self._trace_length, self._reasons = trace_length, reasons
        self.name = name or f"{chat.backend.label} order over geometry"
        self.calls = 0

    def propose(self, observation: Observation, trace: Sequence[Attempt]) -> tuple[Action, ...]:
        """Return a full plan; empty when no order asked for has an arrangement or could be read."""
        latest = trace[max(0, len(trace) - self._trace_length) :]
        refused: list[str] = []
        for _ in range(ORDER_CALLS):
            self.calls += 1
            messages = prompt(observation, latest, "symbolic", reasons=self._reasons)
            if refused:
                messages = (*messages, say("user", "\n".join(refused)))
            try:
                order = self.chat.ask(messages, schema_of(OrderReply)).order
            except LanguageFailed as error:
                if error.failure.kind == "unreadable_reply":
                    return ()
                raise
            answer: tuple[Action, ...] | Failure | None = wrong_order(order, observation)
            if answer is None:
                answer = self._solve(observation, order, trace)
            if not isinstance(answer, Failure):
                return answer
            refused.append(refused_order_text(order, answer, reasons=self._reasons))
        return ()


def as_action(call: ActionCall) -> Action:
    """Return the action of a call that follows the plan schema."""
    if call.action == "pick":
        return Action("pick", call.objects[0])
    numbers = call.parameters
    return Action("place", call.objects[0], numbers["x"], numbers["y"], numbers["theta"])


def wrong_order(order: Sequence[str], observation: Observation) -> Failure | None:
    """Return what is wrong with an order (a name of no box, one that comes twice, one that is missing), or None."""
    names = {box.name for box in observation.boxes}
    strange = next((name for name in order if name not in names), None)
    if strange is not None:
        return Failure(
            kind="unknown_object", message=f"there is no box {quoted(strange)}", objects=(strange[:LONGEST_NAME],)
        )
    twice = next((name for k, name in enumerate(order) if name in order[:k]), None)
    if twice is not None:
        return Failure(kind="wrong_arguments", message=f"{quoted(twice)} comes twice", objects=(twice,))
    missing = tuple(box.name for box in observation.boxes if not box.in_basket and box.name not in order)
    if missing:
        listed = ", ".join(quoted(name) for name in missing)
        return Failure(kind="wrong_arguments", message=f"the order lacks {listed}", objects=missing)
    return None
