"""A server of language models, by a stub: good replies, every fault, fall-backs, and a key that is never shown."""

from __future__ import annotations

import base64
import json
import logging
import time
from email.utils import formatdate
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from scenewright.schemas.errors import BadInput, MissingDependency, UsageError
from scenewright.stages.kit.configuration import parameters_for
from scenewright.stages.kit.language.failures import LanguageFailed
from scenewright.stages.kit.language.messages import Image, say
from scenewright.stages.kit.language.openai_compatible import LARGEST_BODY
from scenewright.stages.kit.language.opening import open_chat
from scenewright.stages.kit.language.options import LanguageParameters
from scenewright.stages.kit.services.connection import HIDDEN, Connection
from scenewright.stages.kit.stage import Stage
from scenewright.stages.plan.parameters import STAGE as PLAN

from tests.unit.language.chats import GOOD, KEY, QUESTION, SCHEMA, VARIABLE, opened, scripted
from tests.unit.language.stub_server import (
    Behaviour,
    body,
    breaks_off,
    envelope,
    hangs_up,
    replies,
    serving,
    silent,
    status,
    trickles,
)


def test_a_question_as_it_crosses_the_wire() -> None:
    png = cv2.imencode(".png", np.zeros((2, 3, 3), np.uint8))[1].tobytes()
    jpeg = cv2.imencode(".jpg", np.zeros((8, 8, 3), np.uint8))[1].tobytes()
    messages = (*QUESTION, say("user", "Look:", Image(png), Image(jpeg)))
    with serving(replies(GOOD)) as server:
        chat = opened(server.base_url, temperature=0.25, maximum_tokens=99)
        assert chat.ask(messages, SCHEMA).answer == 4
    asked = server.asked[0]
    assert asked.path == "/v1/chat/completions" and asked.headers["Authorization"] == f"Bearer {KEY}"
    assert asked.body["model"] == "stub" and asked.body["temperature"] == 0.25 and asked.body["max_tokens"] == 99
    assert asked.body["stream"] is False
    assert asked.body["messages"][:2] == [
        {"role": "system", "content": "You count."},
        {"role": "user", "content": "How many?"},
    ]
    parts = asked.body["messages"][2]["content"]
    assert parts[0] == {"type": "text", "text": "Look:"}
    urls = [part["image_url"]["url"].split(",") for part in parts[1:]]
    assert [url[0] for url in urls] == ["data:image/png;base64", "data:image/jpeg;base64"]
    assert [base64.b64decode(url[1]) for url in urls] == [png, jpeg]
    form = asked.body["response_format"]
    assert form["type"] == "json_schema" and form["json_schema"]["strict"] is True
    assert form["json_schema"]["schema"]["required"] == ["answer"]
    record = chat.record
    assert (record.backend, record.calls, record.prompt_tokens, record.completion_tokens) == ("openai:stub", 1, 11, 7)
    assert not record.estimated and record.repeats == record.re_prompts == 0


def test_without_a_variable_no_key_is_sent() -> None:
    with serving(replies(GOOD)) as server:
        opened(server.base_url, key_variable="").ask(QUESTION, SCHEMA)
    assert "Authorization" not in server.asked[0].headers


@pytest.mark.parametrize(
    "usage", [{}, [], {"prompt_tokens": -1, "completion_tokens": 2}, {"prompt_tokens": "9", "completion_tokens": True}]
)
def test_tokens_that_are_not_counted_are_estimated(usage: Any) -> None:
    with serving(replies(GOOD, usage=usage)) as server:
        chat = opened(server.base_url)
        chat.ask(QUESTION, SCHEMA)
    characters = len("You count.") + len("How many?")
    assert chat.record.estimated and chat.prompt_tokens == -(-characters // 4) and chat.completion_tokens == 4


# ---- faults that pass ----------------------------------------------------------------------------------------------


def test_back_off_follows_the_server_and_doubles() -> None:
    waits: list[float] = []
    busy = (status(429, Retry_After="17"), status(500), status(503, b"starting"), replies(GOOD))
    with serving(*busy) as server:
        chat = opened(server.base_url, waits)
        assert chat.ask(QUESTION, SCHEMA).answer == 4
    assert waits == [17.0, 1.0, 2.0]
    assert chat.record.repeats == 3 and chat.record.calls == 1 and chat.record.re_prompts == 0


def test_a_server_may_name_a_date_and_no_eternity() -> None:
    until = formatdate(1_000_040, usegmt=True)
    waits: list[float] = []
    hints = ({"Retry_After": until}, {"Retry_After": "86400"}, {"Retry_After": "soon"})
    with serving(*(status(429, **hint) for hint in hints), replies(GOOD)) as server:
        connection = Connection(
            server.base_url,
            timeout=5,
            retries=3,
            retry_wait=0.5,
            longest_wait=90,
            sleep=waits.append,
            now=lambda: 1_000_000.0,
        )
        assert connection.post("/chat/completions", b"{}", "application/json").body == envelope(json.dumps(GOOD))
    assert waits == [40.0, 90.0, 2.0]


@pytest.mark.parametrize(
    "fault", [hangs_up, breaks_off, body(b'{"choices": [{"mess'), body(b'{"choices": []}'), body(b"[" * 100_000)]
)
def test_a_fault_that_passes_costs_no_call(fault: Behaviour) -> None:
    with serving(fault, replies(GOOD)) as server:
        chat = opened(server.base_url)
        assert chat.ask(QUESTION, SCHEMA).answer == 4
    assert chat.record.calls == 1 and chat.record.re_prompts == 0 and len(server.asked) == 2


@pytest.mark.parametrize("fault", [silent, trickles])
def test_a_late_server_is_given_up(fault: Behaviour) -> None:
    with serving(fault) as server:
        chat = opened(server.base_url, request_timeout=0.1, retries=1)
        begun = time.monotonic()
        with pytest.raises(LanguageFailed, match="no answer within 0.1 s, after 2 tries") as caught:
            chat.ask(QUESTION, SCHEMA)
        assert time.monotonic() - begun < 5
    assert caught.value.failure.kind == "unreachable" and caught.value.exit_code == 6
    assert caught.value.failure.numbers == {"repeats": 1.0} and chat.record.failures[-1] == caught.value.failure


# ---- faults that stay ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (status(401, b'{"error": {"message": "no such\\nkey", "type": "auth"}}'), "status 401 (no such key)"),
        (status(404, b"not found"), "status 404 (not found)"),
        (status(302, Location="http://127.0.0.1:1/"), "status 302"),
        (body(b"<html>", Content_Type="text/html"), "content type is 'text/html'"),
        (body(b"x" * (LARGEST_BODY + 1)), f"more than {LARGEST_BODY} bytes"),
        (body(b"", Content_Length=str(2**40)), f"more than {LARGEST_BODY} bytes"),
    ],
)
def test_refusals_are_one_line_and_asked_once(fault: Behaviour, words: str) -> None:
    with serving(fault) as server:
        with pytest.raises(LanguageFailed) as caught:
            opened(server.base_url).ask(QUESTION, SCHEMA)
        assert len(server.asked) == 1
    assert caught.value.failure.kind == "refused" and caught.value.exit_code == 3
    assert words in caught.value.message and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "behaviour", [replies("x", finish="content_filter"), replies(None, refusal="I would rather not")]
)
def test_a_model_that_declines(behaviour: Behaviour) -> None:
    with serving(behaviour) as server, pytest.raises(LanguageFailed) as caught:
        opened(server.base_url).ask(QUESTION, SCHEMA)
    assert caught.value.failure.kind == "declined" and len(server.asked) == 1


# ---- what servers understand ---------------------------------------------------------------------------------------


def test_forms_of_reply_fall_back_for_good() -> None:
    no_schema = status(400, b'{"error": {"message": "response_format json_schema is not supported"}}')
    no_json = status(422, b'{"detail": "response_format"}')
    with serving(no_schema, no_json, replies(f"Sure! ```json\n{json.dumps(GOOD)}\n```")) as server:
        chat = opened(server.base_url)
        assert chat.ask(QUESTION, SCHEMA).answer == 4
        assert chat.ask(QUESTION, SCHEMA).answer == 4
    forms = [asked.body.get("response_format", {}).get("type") for asked in server.asked]
    assert forms == ["json_schema", "json_object", None, None]
    assert [len(asked.body["messages"]) for asked in server.asked] == [2, 3, 3, 3]
    assert '"required": ["answer"]' in server.asked[2].body["messages"][-1]["content"]
    assert chat.record.calls == 2 and chat.record.re_prompts == 0


def test_a_400_for_another_reason_changes_nothing() -> None:
    too_long = status(400, b'{"error": {"message": "context of 2048 tokens exceeded"}}')
    with serving(too_long, too_long, too_long, replies(GOOD)) as server:
        chat = opened(server.base_url)
        with pytest.raises(LanguageFailed, match="context of 2048 tokens exceeded"):
            chat.ask(QUESTION, SCHEMA)
        chat.ask(QUESTION, SCHEMA)
    assert server.asked[3].body["response_format"]["type"] == "json_schema"


def test_a_server_that_stumbles_over_its_own_form_is_asked_in_a_lower_one_once() -> None:
    """As llama.cpp does (seen with its server of October 2026): 500 when constrained output is cut."""
    stumbles = status(500, b'{"error": {"message": "output that does not match the expected format"}}')
    with serving(stumbles, stumbles, replies('{"answ', finish="length"), replies(GOOD), replies(GOOD)) as server:
        chat = opened(server.base_url, retries=1)
        assert chat.ask(QUESTION, SCHEMA).answer == 4
        chat.ask(QUESTION, SCHEMA)
    forms = [asked.body["response_format"]["type"] for asked in server.asked]
    assert forms == ["json_schema", "json_schema", "json_object", "json_schema", "json_schema"]
    assert (chat.record.calls, chat.record.re_prompts, chat.record.repeats) == (2, 1, 1)


def test_the_newer_name_of_the_limit() -> None:
    words = b'{"error": {"message": "Unsupported parameter: use \'max_completion_tokens\' instead"}}'
    with serving(status(400, words), replies(GOOD)) as server:
        opened(server.base_url).ask(QUESTION, SCHEMA)
    assert "max_tokens" not in server.asked[1].body and server.asked[1].body["max_completion_tokens"] == 4096
    assert server.asked[1].body["response_format"]["type"] == "json_schema"


def test_a_server_that_takes_no_temperature_is_asked_without_and_refused_once_only() -> None:
    words = b'{"error": {"message": "Unsupported value: \'temperature\' does not support 0"}}'
    with serving(status(400, words), replies(GOOD), replies(GOOD)) as server:
        chat = opened(server.base_url)
        chat.ask(QUESTION, SCHEMA)
        chat.ask(QUESTION, SCHEMA)
    assert ["temperature" in asked.body for asked in server.asked] == [True, False, False]
    assert server.asked[1].body["response_format"]["type"] == "json_schema"
    with serving(status(400, words), status(400, words)) as server, pytest.raises(LanguageFailed):
        opened(server.base_url).ask(QUESTION, SCHEMA)


def test_content_in_parts() -> None:
    with serving(replies([{"type": "text", "text": '{"answer"'}, {"type": "x"}, {"text": ": 4}"}])) as server:
        assert opened(server.base_url).ask(QUESTION, SCHEMA).answer == 4


# ---- the key -------------------------------------------------------------------------------------------------------


def leaking(key: str) -> list[Behaviour]:
    """Servers that say the key back wherever they can."""
    escaped = json.dumps(KEY).replace("s", "\\u0073")
    return [
        status(401, f"Incorrect key {key}".encode()),
        status(400, b'{"error": {"message": "' + key.encode() + b'"}}'),
        status(500, key.encode()),
        body(b"{}", Content_Type=f"text/{key}"),
        replies("nonsense " + key),
        replies(None, refusal=f"never, {key}"),
        body(envelope("KEY").replace(b'"KEY"', escaped.encode())),
        replies({"answer": key}),
        status(401, b'{"error": {"message": "Incorrect key ' + escaped[1:].encode() + b"}}"),
        status(500, b'{"error": "' + b"." * 190 + escaped[1:].encode() + b"}"),  # where the excerpt is cut
        status(403, b'{"detail": "Incorrect key ' + escaped[1:].encode() + b"}"),
    ]


@pytest.mark.parametrize("number", range(len(leaking(KEY))))
def test_the_key_is_shown_nowhere(number: int, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with serving(leaking(KEY)[number]) as server, caplog.at_level(logging.DEBUG):
        chat = opened(server.base_url, record=tmp_path / "transcript.jsonl")
        with pytest.raises(LanguageFailed) as caught:
            chat.ask(QUESTION, SCHEMA)
    assert server.asked[0].headers["Authorization"] == f"Bearer {KEY}"
    shown = [str(caught.value), caught.value.failure.model_dump_json(), chat.record.model_dump_json(), caplog.text]
    shown += [path.read_text() for path in tmp_path.iterdir()]
    shown += [json.dumps(asked.body) for asked in server.asked]  # said back to the server in a re-prompt
    assert all(KEY[:8] not in text for text in shown)
    assert any(HIDDEN in text for text in shown)


def test_where_a_key_may_not_go() -> None:
    for address in ("http://10.0.0.7/v1", "HTTP://10.0.0.7/v1"):
        far = LanguageParameters(language="openai", model="m", base_url=address, key_variable=VARIABLE)
        with pytest.raises(UsageError, match="readable by all"):
            open_chat(far, scripted=scripted(), environment={VARIABLE: KEY})
    safe = far.model_copy(update={"base_url": "https://models.example/v1"})
    assert open_chat(safe, scripted=scripted(), environment={VARIABLE: KEY}).backend.label == "openai:m"
    with pytest.raises(MissingDependency, match=r"\$STUB_KEY is empty"):
        open_chat(safe, scripted=scripted(), environment={})
    for torn in (f"{KEY}\nX-Header: 1", f"{KEY} x", "schlüssel"):
        with pytest.raises(BadInput, match="STUB_KEY: the key holds") as caught:
            open_chat(safe, scripted=scripted(), environment={VARIABLE: torn})
        assert torn not in str(caught.value)


@pytest.mark.parametrize(
    "given", [{"key_variable": KEY}, {"base_url": f"https://user:{KEY}@models.example/v1"}, {"base_url": f"x?k={KEY}"}]
)
def test_a_key_given_as_an_option_is_not_said_back(given: dict[str, str]) -> None:
    stage = Stage("probe", "", LanguageParameters, PLAN.reads, PLAN.writes)
    with pytest.raises(UsageError) as caught:
        parameters_for(stage, given)
    assert KEY not in str(caught.value) and next(iter(given)).replace("_", "-") in str(caught.value)
