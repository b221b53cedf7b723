"""Harnesses of what language models and their servers say, and of transcripts."""

from __future__ import annotations

import json
from collections.abc import Callable

from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.language.actions import ActionLanguage, ActionType, NumberRange, check_calls
from scenewright.stages.kit.language.backend import RawReply, Request, Usage
from scenewright.stages.kit.language.chat import read_reply
from scenewright.stages.kit.language.failures import LanguageFailed
from scenewright.stages.kit.language.messages import say
from scenewright.stages.kit.language.openai_compatible import OpenAICompatibleBackend
from scenewright.stages.kit.language.plan_schema import plan_schema
from scenewright.stages.kit.language.reply_schema import DoesNotFollow
from scenewright.stages.kit.language.reply_text import Unreadable
from scenewright.stages.kit.language.transcripts import exchange_of, read_transcript
from scenewright.stages.kit.services.connection import Answer, Connection, GivenUp, TryAgain

from tests.fuzz.harness import Harness, as_file, refused

LANGUAGE = ActionLanguage(
    (ActionType("pick", ("box",)), ActionType("place", ("box",), {"x": NumberRange(0, 1), "y": NumberRange(-1, 1)})),
    {"box": frozenset({"red_box", "blue_box"})},
)
SCHEMA = plan_schema(LANGUAGE, closed_names=True)
REQUEST = Request((say("user", "Pack."),), SCHEMA, "m", 0.0, 100)
PLAN = {
    "reasoning": "é {so}",
    "plan": [
        {"action": "pick", "objects": ["red_box"], "parameters": {}},
        {"action": "place", "objects": ["red_box"], "parameters": {"x": 0.5, "y": -1e-3}},
    ],
}


def model_reply(data: bytes) -> None:
    """Read a plan out of what a model wrote; one that is taken says only what may be said."""
    raw = RawReply(data.decode("utf-8", "replace"), "stop", Usage(0, 0, True))
    with refused(Unreadable, DoesNotFollow):
        assert not check_calls(read_reply(raw, SCHEMA).plan, LANGUAGE)


def _reply_seeds() -> dict[str, bytes]:
    plan = json.dumps(PLAN, ensure_ascii=False)
    return {"bare": plan.encode(), "prose": f"<think>{{}}</think>Here {{it}} is:\n```json\n{plan}\n```".encode()}


class _Line(Connection):
    """A connection on which one body comes back."""

    def __init__(self, body: bytes) -> None:
        super().__init__("http://127.0.0.1:1", timeout=1, retries=0, retry_wait=0, key="sk-fuzz-0123456789")
        self._body = body

    def post(
        self, path: str, body: bytes, content_type: str, *, judge: Callable[[Answer], None] | None = None
    ) -> Answer:
        answer = Answer(self._body, "application/json")
        try:
            if judge is not None:
                judge(answer)
        except TryAgain as error:
            raise GivenUp(str(error), status=None) from None
        return answer


def model_answer(data: bytes) -> None:
    """Read what a server answered; what is taken can be written and sent on."""
    with refused(LanguageFailed):
        raw = OpenAICompatibleBackend(_Line(data), "m").ask(REQUEST)
        assert raw.finish in ("stop", "length", "declined") and raw.usage.prompt_tokens >= 0
        say("assistant", raw.text)
        exchange_of(REQUEST, raw, "openai:m").model_dump_json()


def _answer_seeds() -> dict[str, bytes]:
    message = {"role": "assistant", "content": json.dumps(PLAN)}
    whole = {
        "choices": [{"index": 0, "finish_reason": "stop", "message": message}],
        "usage": {"prompt_tokens": 12, "completion_tokens": 34},
    }
    parts = {
        "choices": [
            {"finish_reason": "length", "message": {"content": [{"type": "text", "text": "é"}], "refusal": None}}
        ]
    }
    return {"whole": json.dumps(whole).encode(), "parts": json.dumps(parts).encode()}


def transcript(data: bytes) -> None:
    """Read a transcript."""
    with refused(BadInput):
        read = read_transcript(as_file("transcript.jsonl", data))
        assert all(read.find(exchange.digest, 0) is not None for exchange in read)


def _transcript_seeds() -> dict[str, bytes]:
    line = exchange_of(REQUEST, RawReply(json.dumps(PLAN), "stop", Usage(1, 2, False)), "openai:m")
    return {"twice": (line.model_dump_json() + "\n").encode() * 2}


HARNESSES = {
    "model_reply": Harness(model_reply, _reply_seeds),
    "model_answer": Harness(model_answer, _answer_seeds),
    "transcript": Harness(transcript, _transcript_seeds),
}
