"""From options to a chat: chooses the backend, reads the key out of the environment, opens the transcript."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from urllib.parse import urlsplit

from scenewright.schemas.errors import BadInput, MissingDependency, UsageError
from scenewright.stages.kit.language.backend import Backend
from scenewright.stages.kit.language.chat import Chat, ChatSettings
from scenewright.stages.kit.language.openai_compatible import (
    LARGEST_BODY,
    LONGEST_WAIT,
    REFUSED_HINT,
    OpenAICompatibleBackend,
)
from scenewright.stages.kit.language.options import LanguageParameters
from scenewright.stages.kit.language.recorded import RecordedBackend, RecordingBackend
from scenewright.stages.kit.language.transcripts import Transcript, TranscriptFile, read_transcript
from scenewright.stages.kit.services.address import stays_on_this_machine
from scenewright.stages.kit.services.connection import Connection


def open_chat(
    parameters: LanguageParameters,
    *,
    scripted: Backend,
    transcript: Path | None = None,
    record: Path | None = None,
    environment: Mapping[str, str] | None = None,
    sleep: Callable[[float], None] = time.sleep,
) -> Chat:
    """Return the chat that the options ask for; `scripted` is the step's stand-in.

    `transcript` is what `recorded` replays, and what `openai` does not ask again (it needs `record` then). To `record`
    every exchange is appended, a replayed one too, so that each artifact holds its own whole transcript. Raises
    UsageError for options that do not go together, MissingDependency when the variable of the key is empty, BadInput
    for a bad transcript.
    """
    earlier = read_transcript(transcript) if transcript is not None else None
    backend, model = _backend(parameters, scripted, earlier, os.environ if environment is None else environment, sleep)
    if record is not None:
        backend = RecordingBackend(
            backend, TranscriptFile(record), earlier if parameters.language == "openai" else None
        )
    settings = ChatSettings(
        model=model,
        temperature=parameters.temperature,
        maximum_tokens=parameters.maximum_tokens,
        call_budget=parameters.call_budget,
        token_budget=parameters.token_budget,
    )
    return Chat(backend, settings)


def _backend(
    parameters: LanguageParameters,
    scripted: Backend,
    transcript: Transcript | None,
    environment: Mapping[str, str],
    sleep: Callable[[float], None],
) -> tuple[Backend, str]:
    if parameters.language == "scripted":
        if transcript is not None:
            raise UsageError("--language scripted reads no --transcript", hint="did you mean --language recorded?")
        return scripted, scripted.label
    if parameters.language == "recorded":
        if transcript is None:
            raise UsageError("--language recorded needs --transcript", hint="the transcript.jsonl of an earlier run")
        model = parameters.model or (transcript.models[0] if len(transcript.models) == 1 else "")
        if model not in transcript.models:
            models = ", ".join(transcript.models) or "none"
            raise UsageError(f"{transcript.name}: no replies of model {model!r}", hint=f"--model is one of: {models}")
        return RecordedBackend(transcript, model), model
    if not parameters.model:
        raise UsageError("--language openai needs --model", hint="as the server calls it: see its /v1/models")
    return OpenAICompatibleBackend(_connection(parameters, environment, sleep), parameters.model), parameters.model


def _connection(
    parameters: LanguageParameters, environment: Mapping[str, str], sleep: Callable[[float], None]
) -> Connection:
    key = _key(parameters, environment)
    try:
        return Connection(
            parameters.base_url,
            timeout=parameters.request_timeout,
            retries=parameters.retries,
            retry_wait=parameters.retry_wait,
            key=key,
            refused_hint=REFUSED_HINT,
            largest_body=LARGEST_BODY,
            longest_wait=LONGEST_WAIT,
            sleep=sleep,
        )
    except BadInput as error:
        raise BadInput(f"${parameters.key_variable}: {error.message}", hint=error.hint) from None


def _key(parameters: LanguageParameters, environment: Mapping[str, str]) -> str:
    if not parameters.key_variable:
        return ""
    key = environment.get(parameters.key_variable, "").strip()
    if not key:
        raise MissingDependency(
            f"${parameters.key_variable} is empty, and --key-variable says that it holds the key",
            hint=f"export {parameters.key_variable}=..., or leave --key-variable out",
        )
    if urlsplit(parameters.base_url).scheme != "https" and not stays_on_this_machine(parameters.base_url):
        raise UsageError(
            f"{parameters.base_url}: the key would cross the network readable by all",
            hint="use https, or a tunnel to this machine",
        )
    return key
