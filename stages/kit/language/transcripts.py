"""Transcripts: what was asked of a language model and what it replied, one JSON object a line.

A line holds the whole prompt, so that people can read it and its digest can be checked; images are named by sha256.
Replies may be edited by hand, prompts may not.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

from pydantic import ValidationError
from scenewright.schemas.base import Model
from scenewright.schemas.errors import BadInput, MachineFailure, first_problem
from scenewright.schemas.outside import check_integers, file_content
from scenewright.stages.kit.language.backend import RawReply, Request, Usage, request_digest
from scenewright.stages.kit.language.messages import described

LARGEST_TRANSCRIPT = 512 * 2**20
"""Largest transcript [bytes]."""
FIRST_KEY = b'{"backend": '
"""How a line of ours begins."""


class Exchange(Model):
    """One line of a transcript."""

    format: Literal["scenewright-transcript/1"] = "scenewright-transcript/1"
    digest: str
    """Of the request: `Request.digest`."""
    model: str
    temperature: float
    schema_name: str
    schema_document: dict[str, Any]
    messages: tuple[dict[str, Any], ...]
    backend: str
    """Who replied: `openai:<model>`."""
    reply: str
    finish: str
    prompt_tokens: int
    completion_tokens: int
    estimated: bool

    @property
    def raw(self) -> RawReply:
        """The reply as a backend gives it."""
        usage = Usage(self.prompt_tokens, self.completion_tokens, self.estimated)
        return RawReply(self.reply, self.finish, usage)


def exchange_of(request: Request, raw: RawReply, backend: str) -> Exchange:
    """Return the line of a transcript for a request and its reply."""
    return Exchange(
        digest=request.digest,
        model=request.model,
        temperature=request.temperature,
        schema_name=request.schema.name,
        schema_document=request.schema.document,
        messages=tuple(described(request.messages)),
        backend=backend,
        reply=raw.text,
        finish=raw.finish,
        prompt_tokens=raw.usage.prompt_tokens,
        completion_tokens=raw.usage.completion_tokens,
        estimated=raw.usage.estimated,
    )


class Transcript:
    """The exchanges of a file, by the digest of the request, in the order in which they were made."""

    def __init__(self, name: str, exchanges: tuple[Exchange, ...] = ()) -> None:
        self.name = name
        self._by_digest: dict[str, list[Exchange]] = defaultdict(list)
        for exchange in exchanges:
            self.add(exchange)

    def add(self, exchange: Exchange) -> None:
        """Append an exchange."""
        self._by_digest[exchange.digest].append(exchange)

    def find(self, digest: str, occurrence: int) -> Exchange | None:
        """Return what was replied when this request was made for the `occurrence`-th time (0 first), or None."""
        exchanges = self._by_digest.get(digest, [])
        return exchanges[occurrence] if occurrence < len(exchanges) else None

    def __iter__(self) -> Iterator[Exchange]:
        return (exchange for exchanges in self._by_digest.values() for exchange in exchanges)

    def __len__(self) -> int:
        return sum(map(len, self._by_digest.values()))

    @property
    def models(self) -> tuple[str, ...]:
        """The models that replied, sorted."""
        return tuple(sorted({exchange.model for exchange in self}))


def read_transcript(path: Path) -> Transcript:
    """Read a transcript. Raises BadInput naming the line that is no exchange, or whose prompt was changed."""
    hint = "record it again (docs/INTERPRET.md, Language models)"
    lines = file_content(path, LARGEST_TRANSCRIPT, hint=hint).split(b"\n")
    exchanges = []
    for number, line in enumerate(lines, 1):
        if line.strip():
            exchanges.append(_exchange(line, f"{path}, line {number}", hint))
    return Transcript(str(path), tuple(exchanges))


def _exchange(line: bytes, where: str, hint: str) -> Exchange:
    check_integers(line, where, hint=hint)
    try:
        exchange = Exchange.model_validate_json(line)
    except ValidationError as error:
        raise BadInput(f"{where}: {first_problem(error, 'line')}", hint=hint) from None
    try:
        digest = request_digest(list(exchange.messages), exchange.schema_document, exchange.model, exchange.temperature)
    except (ValueError, RecursionError):  # NaN, or a number of thousands of digits, within the schema or a message
        raise BadInput(f"{where}: the prompt holds what no JSON can", hint=hint) from None
    if digest != exchange.digest:
        raise BadInput(f"{where}: the prompt is not the one that was recorded", hint=hint)
    return exchange


class TranscriptFile:
    """Appends exchanges to a file, each written before the next question is asked. A last line that was cut when a
    recording broke off is dropped. Raises BadInput for a file that is no transcript, MachineFailure when it cannot be
    written."""

    def __init__(self, path: Path) -> None:
        self.path = path
        if path.exists():
            file_content(path, LARGEST_TRANSCRIPT, hint="give another file")
            self._drop_torn_line()
        self.transcript = read_transcript(path) if path.exists() else Transcript(str(path))

    def append(self, exchange: Exchange) -> None:
        """Write one line."""
        line = json.dumps(exchange.model_dump(mode="json"), sort_keys=True, ensure_ascii=False, allow_nan=False)
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self.path.open("a", encoding="utf-8") as file:
                file.write(line + "\n")
        except OSError as error:
            raise MachineFailure(f"{self.path}: {error.strerror}", hint="choose another file") from None
        self.transcript.add(exchange)

    def _drop_torn_line(self) -> None:
        try:
            with self.path.open("rb+") as file:
                data = file.read(LARGEST_TRANSCRIPT + 1)
                end_of_lines = data.rfind(b"\n") + 1
                last = data[end_of_lines:]
                if last.startswith(FIRST_KEY) and not last.endswith(b"}"):
                    file.truncate(end_of_lines)
                elif last:  # edited by hand: whole, but for the end of its line
                    file.seek(0, 2)
                    file.write(b"\n")
        except OSError as error:
            raise MachineFailure(f"{self.path}: {error.strerror}", hint="choose another file") from None
