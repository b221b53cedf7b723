"""What every language backend is asked and answers. None of them judges replies: that is done in one place, chat.py."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass
from typing import Any, Protocol

from scenewright.schemas.base import canonical_json
from scenewright.stages.kit.language.messages import Image, Message, described
from scenewright.stages.kit.language.reply_schema import ReplySchema

CHARACTERS_PER_TOKEN = 4
"""Rule of thumb for English and JSON, where a server does not count."""
TOKENS_PER_IMAGE = 1000
"""Rule of thumb for an image, where a server does not count."""


@dataclass(frozen=True)
class Request:
    """One question. Its `digest` is what transcripts are keyed by."""

    messages: tuple[Message, ...]
    schema: ReplySchema[Any]
    model: str
    temperature: float
    maximum_tokens: int
    """Of the reply; not part of the digest: a reply that was cut is re-asked, and the recorded one was not."""

    @property
    def digest(self) -> str:
        """sha256 over canonical JSON of messages (images by their own sha256), schema, model and temperature."""
        return request_digest(described(self.messages), self.schema.document, self.model, self.temperature)


def request_digest(messages: list[dict[str, Any]], schema: dict[str, Any], model: str, temperature: float) -> str:
    """Return the digest of a request, of one that is asked as of one that was recorded. `messages`: as `described`.

    Raises ValueError for what no JSON can hold.
    """
    content = {"messages": messages, "schema": schema, "model": model, "temperature": float(temperature)}
    return hashlib.sha256(canonical_json(content).encode()).hexdigest()


@dataclass(frozen=True)
class Usage:
    """Tokens of one question and its reply."""

    prompt_tokens: int
    completion_tokens: int
    estimated: bool


@dataclass(frozen=True)
class RawReply:
    """What came back, not yet judged: text of any form and length."""

    text: str
    finish: str
    """`stop`; `length` when the reply was cut at the largest number of tokens; `declined`."""
    usage: Usage
    repeats: int = 0
    """HTTP requests that were sent again for it."""


class Backend(Protocol):
    """Something that answers requests."""

    @property
    def label(self) -> str:
        """`scripted:<name>`, `recorded:<model>` or `openai:<model>`: for records, manifests and tables."""
        ...

    def ask(self, request: Request) -> RawReply:
        """Return the reply to one request. Raises LanguageFailed."""
        ...


def estimated_usage(request: Request, reply: str) -> Usage:
    """Return tokens estimated from the numbers of characters and images."""
    characters = sum(len(message.text) for message in request.messages)
    images = sum(isinstance(part, Image) for message in request.messages for part in message.parts)
    prompt = math.ceil(characters / CHARACTERS_PER_TOKEN) + TOKENS_PER_IMAGE * images
    return Usage(prompt, math.ceil(len(reply) / CHARACTERS_PER_TOKEN), estimated=True)
