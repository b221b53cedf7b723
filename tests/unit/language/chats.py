"""What the tests of language backends ask, and how."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from scenewright.schemas.base import Model
from scenewright.stages.kit.language.chat import Chat
from scenewright.stages.kit.language.messages import say
from scenewright.stages.kit.language.opening import open_chat
from scenewright.stages.kit.language.options import LanguageParameters
from scenewright.stages.kit.language.reply_schema import schema_of
from scenewright.stages.kit.language.scripted import ScriptedBackend

KEY = "sk-stub-0123456789abcdef"
VARIABLE = "STUB_KEY"


class Answer(Model):
    """A reply with one number."""

    answer: int


SCHEMA = schema_of(Answer)
QUESTION = (say("system", "You count."), say("user", "How many?"))
GOOD = {"answer": 4}


def scripted(*texts: str) -> ScriptedBackend:
    """Return a stand-in that says these texts in turn, then the last one."""
    said = list(texts) or ['{"answer": 4}']
    return ScriptedBackend("test", lambda request: said.pop(0) if len(said) > 1 else said[0])


def opened(base_url: str, waits: list[float] | None = None, *, record: Path | None = None, **options: Any) -> Chat:
    """Return a chat with a stub server; waits between tries are noted, not waited."""
    given = {"model": "stub", "retries": 3, "retry_wait": 0.5, "request_timeout": 5.0, "key_variable": VARIABLE}
    parameters = LanguageParameters(language="openai", base_url=base_url, **{**given, **options})
    noted: list[float] = waits if waits is not None else []
    return open_chat(parameters, scripted=scripted(), record=record, environment={VARIABLE: KEY}, sleep=noted.append)
