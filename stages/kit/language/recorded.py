"""Backends around transcripts: `recorded` answers out of one and asks nobody; `Recording` asks and writes one."""

from __future__ import annotations

from collections import Counter

from scenewright.stages.kit.language.backend import Backend, RawReply, Request
from scenewright.stages.kit.language.failures import LanguageFailed
from scenewright.stages.kit.language.messages import described
from scenewright.stages.kit.language.transcripts import Transcript, TranscriptFile, exchange_of

LONGEST_EXCERPT = 80
"""Characters of a prompt in an error."""


class RecordedBackend:
    """Replays a transcript. The same request made again gets what was replied when it was made again."""

    def __init__(self, transcript: Transcript, model: str) -> None:
        self._transcript, self._model = transcript, model
        self._occurrences: Counter[str] = Counter()

    @property
    def label(self) -> str:
        """`recorded:<model>`."""
        return f"recorded:{self._model}"

    def ask(self, request: Request) -> RawReply:
        """Return the recorded reply. Raises LanguageFailed (`not_recorded`) saying which prompt and how to record."""
        digest, occurrence = request.digest, self._occurrences[request.digest]
        exchange = self._transcript.find(digest, occurrence)
        if exchange is None:
            raise _missing(self._transcript, request, occurrence)
        self._occurrences[digest] += 1
        return exchange.raw


class RecordingBackend:
    """Asks another backend and writes down what it replies, at once. What the file holds already, or an earlier
    transcript (`earlier`), is not asked again: a recording that broke off goes on, and nothing is paid twice."""

    def __init__(self, asked: Backend, file: TranscriptFile, earlier: Transcript | None = None) -> None:
        self._backend, self._file, self._earlier = asked, file, earlier
        self._occurrences: Counter[str] = Counter()

    @property
    def label(self) -> str:
        """That of the backend that is recorded."""
        return self._backend.label

    def ask(self, request: Request) -> RawReply:
        """Return the reply, out of the file or of the backend. Raises what that raises."""
        digest = request.digest
        occurrence = self._occurrences[digest]
        raw = self._answer(request, digest, occurrence)
        self._occurrences[digest] += 1
        return raw

    def _answer(self, request: Request, digest: str, occurrence: int) -> RawReply:
        exchange = self._file.transcript.find(digest, occurrence)
        if exchange is not None:
            return exchange.raw
        exchange = self._earlier.find(digest, occurrence) if self._earlier is not None else None
        raw = exchange.raw if exchange is not None else self._backend.ask(request)
        self._file.append(exchange if exchange is not None else exchange_of(request, raw, self._backend.label))
        return raw


def _missing(transcript: Transcript, request: Request, occurrence: int) -> LanguageFailed:
    excerpt = " ".join(request.messages[-1].text.split())[-LONGEST_EXCERPT:]
    message = f"{transcript.name}: no reply to the prompt {request.digest[:12]} that ends with {excerpt!r}"
    if occurrence:
        message = f"{message}, asked for the {occurrence + 1}. time"
    same = [e for e in transcript if list(e.messages) == described(request.messages)]
    if same and not occurrence:
        recorded = same[0]
        message = f"{message}; it was recorded with {_differences(request, recorded.model, recorded.temperature)}"
    return LanguageFailed(
        "not_recorded",
        message,
        numbers={"exchanges": float(len(transcript)), "occurrence": float(occurrence)},
        hint="record it: --language openai --base-url URL --model MODEL, then its transcript.jsonl as --transcript",
    )


def _differences(request: Request, model: str, temperature: float) -> str:
    differences = []
    if model != request.model:
        differences.append(f"model {model!r} instead of {request.model!r}")
    if temperature != request.temperature:
        differences.append(f"temperature {temperature:g} instead of {request.temperature:g}")
    return " and ".join(differences) or "another schema"
