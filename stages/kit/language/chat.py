"""One chat with a language model: asks, reads and judges the reply, asks again with the reason, counts, keeps within
the budget. The only place where replies are judged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from scenewright.schemas.language import LanguageRecord
from scenewright.schemas.plan import Failure
from scenewright.stages.kit.language.backend import Backend, RawReply, Request
from scenewright.stages.kit.language.failures import LanguageFailed
from scenewright.stages.kit.language.messages import Message, say
from scenewright.stages.kit.language.reply_schema import DoesNotFollow, ReplySchema
from scenewright.stages.kit.language.reply_text import Unreadable, objects_in

T = TypeVar("T")

RE_PROMPTS = 5
"""Times an unreadable reply is asked for again, as the LLM3 authors do; not counted as calls."""
LONGEST_QUOTE = 2000
"""Characters of an unreadable reply that are said back to the model."""


@dataclass(frozen=True)
class ChatSettings:
    """What is asked of the model, and how much may be asked in one run."""

    model: str = ""
    temperature: float = 0.0
    maximum_tokens: int = 4096
    call_budget: int = 1000
    """Requests that are answered, re-prompts included."""
    token_budget: int = 10_000_000
    """Tokens of prompts and replies together."""
    re_prompts: int = RE_PROMPTS


class Chat:
    """Questions to one backend under one budget; `record` says what they were and what they cost."""

    def __init__(self, backend: Backend, settings: ChatSettings | None = None) -> None:
        self.backend, self.settings = backend, settings or ChatSettings()
        self.calls = self.re_prompts = self.repeats = 0
        self.prompt_tokens = self.completion_tokens = 0
        self.estimated = False
        self.failures: list[Failure] = []

    def ask(self, messages: Sequence[Message], schema: ReplySchema[T]) -> T:
        """Return a reply that follows the schema.

        An unreadable one is answered with what is wrong with it, up to `re_prompts` times; the next question starts
        afresh. Raises LanguageFailed: `unreadable_reply`, `declined`, a budget, or what the backend raises.
        """
        conversation = tuple(messages)
        for attempt in range(self.settings.re_prompts + 1):
            self._keep_to_budget()
            self.calls += attempt == 0
            self.re_prompts += attempt > 0
            raw = self._ask(conversation, schema)
            try:
                return read_reply(raw, schema)
            except (Unreadable, DoesNotFollow) as error:
                reason = str(error)
            numbers = {"attempt": float(attempt + 1), "characters": float(len(raw.text))}
            self.failures.append(Failure(kind="unreadable_reply", message=reason, numbers=numbers))
            conversation = (
                *messages,
                say("assistant", raw.text[:LONGEST_QUOTE] or "(nothing)"),
                _re_prompt(reason, schema),
            )
        raise self._failure(
            "unreadable_reply",
            f"{self.backend.label}: no reply followed the schema {schema.name} in {attempt + 1} tries; last: {reason}",
            {"tries": float(attempt + 1)},
            "another model may do; --maximum-tokens when replies are cut short",
        )

    @property
    def tokens(self) -> int:
        """Tokens of prompts and replies so far."""
        return self.prompt_tokens + self.completion_tokens

    @property
    def record(self) -> LanguageRecord:
        """What was asked so far."""
        return LanguageRecord(
            backend=self.backend.label,
            model=self.settings.model,
            calls=self.calls,
            re_prompts=self.re_prompts,
            repeats=self.repeats,
            prompt_tokens=self.prompt_tokens,
            completion_tokens=self.completion_tokens,
            estimated=self.estimated,
            failures=tuple(self.failures),
        )

    def _keep_to_budget(self) -> None:
        settings, asked_count = self.settings, self.calls + self.re_prompts
        if asked_count >= settings.call_budget:
            numbers = {"asked": float(asked_count), "budget": float(settings.call_budget)}
            message = f"{self.backend.label}: asked {asked_count} times, as often as --call-budget allows"
            raise self._failure("call_budget", message, numbers, "raise it")
        if self.tokens >= settings.token_budget:
            numbers = {"tokens": float(self.tokens), "budget": float(settings.token_budget)}
            message = f"{self.backend.label}: {self.tokens} tokens used of --token-budget {settings.token_budget}"
            raise self._failure("token_budget", message, numbers, "raise it")

    def _ask(self, messages: tuple[Message, ...], schema: ReplySchema[Any]) -> RawReply:
        settings = self.settings
        try:
            raw = self.backend.ask(
                Request(messages, schema, settings.model, settings.temperature, settings.maximum_tokens)
            )
        except LanguageFailed as error:
            self.failures.append(error.failure)
            raise
        self.repeats += raw.repeats
        self.prompt_tokens += raw.usage.prompt_tokens
        self.completion_tokens += raw.usage.completion_tokens
        self.estimated |= raw.usage.estimated
        if raw.finish == "declined":
            message = f"{self.backend.label}: the model would not answer: {' '.join(raw.text.split())[:200]!r}"
            raise self._failure("declined", message, {}, "put the question in other words, or ask another model")
        return raw

    def _failure(self, kind: str, message: str, numbers: dict[str, float], hint: str) -> LanguageFailed:
        error = LanguageFailed(kind, message, numbers=numbers, hint=hint)
        self.failures.append(error.failure)
        return error


def read_reply(raw: RawReply, schema: ReplySchema[T]) -> T:
    """Return the one JSON object of a reply that follows the schema. Raises Unreadable or DoesNotFollow.

    A reply that was cut is unreadable even when what is there parses. Of several objects in one reply exactly one may
    follow the schema: which of two answers is meant is not guessed.
    """
    if raw.finish == "length":
        raise Unreadable(f"the reply was cut after {raw.usage.completion_tokens} tokens; be briefer")
    objects = objects_in(raw.text)
    values: list[T] = []
    for value in objects:
        try:
            values.append(schema.read(value))
        except DoesNotFollow as error:
            reason = error
    if len(values) > 1:
        raise Unreadable(f"the reply holds {len(values)} objects that follow the schema; one is wanted")
    if not values:
        raise reason
    return values[0]


def _re_prompt(reason: str, schema: ReplySchema[Any]) -> Message:
    return say(
        "user",
        f"Your last reply could not be used: {reason}. Reply again with one JSON object that follows the schema "
        f"{schema.name}, and nothing else.",
    )
