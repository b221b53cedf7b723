"""One chat: replies that are read or asked for again, budgets, records."""

from __future__ import annotations

import json
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.schemas.base import Model
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.language.backend import RawReply, Request, Usage
from scenewright.stages.kit.language.chat import LONGEST_QUOTE, RE_PROMPTS, Chat, ChatSettings, read_reply
from scenewright.stages.kit.language.failures import EXIT_CODES, LanguageFailed
from scenewright.stages.kit.language.messages import Image, say
from scenewright.stages.kit.language.reply_schema import DoesNotFollow, schema_from, schema_of
from scenewright.stages.kit.language.reply_text import LONGEST_REPLY, MOST_OBJECTS, Unreadable, objects_in
from scenewright.stages.kit.language.scripted import ScriptedBackend

from tests.unit.language.chats import QUESTION, SCHEMA, opened, scripted
from tests.unit.language.stub_server import replies, serving

# ---- reading -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ('{"a": 1}', [{"a": 1}]),
        ('Sure {as asked}:\n```json\n{ "a": {"b": [1]}}\n```\nThat is {all}.', [{"a": {"b": [1]}}]),
        ('<think>{"a": 0}</think>{"a": 2}', [{"a": 2}]),
        ('{"a": 1} {"a": 1}', [{"a": 1}]),
        ('{"a": 1} {"a": 2} {}', [{"a": 1}, {"a": 2}, {}]),
        ('{"a": "{\\"b\\": 1}"}', [{"a": '{"b": 1}'}]),
    ],
)
def test_objects_are_found(text: str, found: list[Any]) -> None:
    assert objects_in(text) == found


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "empty"),
        ("<think>{}</think>", "empty"),
        ("I cannot do that.", "no JSON object"),
        ("{'a': 1}", "no JSON object"),
        ("[1, 2]", "no JSON object"),
        ('{"a": [1, {"b": 2}', "cut short"),
        ('{"a": "b', "cut short"),
        ('{"a": 1,}', "malformed"),
        ('{"a": NaN}', "NaN is not a number"),
        ('{"plan": [{"b": 1e999}, {"b": 1}]}', "not a finite number"),
        ('{"a": 1, "a": 2}', "says a name twice"),
        ('{"a": ' + "9" * 400 + "}", "a number of 400 digits"),
        ('{"a": ' + '{"a": ' * 30_000, "nested too deeply"),
        ('{"a": "\\ud800"}', "surrogate"),
        (" " * (LONGEST_REPLY + 1), "characters, more than"),
        ("".join(f'{{"a": {k}}}' for k in range(MOST_OBJECTS + 1)), "more than 16"),
    ],
)
def test_what_is_not_read(text: str, words: str) -> None:
    with pytest.raises(Unreadable, match=words):
        objects_in(text)


@given(st.text(alphabet='{}[]":, aλ1.e-\\\n', max_size=60))
@settings(max_examples=150, deadline=None)
def test_any_text_is_read_or_refused(text: str) -> None:
    try:
        assert all(isinstance(value, dict) for value in objects_in(text))
    except Unreadable as error:
        assert "\n" not in str(error)


@given(
    st.recursive(
        st.none() | st.booleans() | st.integers(-9, 9) | st.text(max_size=5),
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    )
)
@settings(max_examples=50, deadline=None)
def test_what_json_writes_is_read_back(value: Any) -> None:
    assert objects_in("so: " + json.dumps({"value": value}, indent=1) + " done") == [{"value": value}]


# ---- schemas -------------------------------------------------------------------------------------------------------


class Inner(Model):
    """A part."""

    default: float = 1.0
    name: str


class Outer(Model):
    """A whole."""

    parts: tuple[Inner, ...] = ()
    note: str | None = None


def test_the_document_requires_all_and_the_reader_does_not() -> None:
    schema = schema_of(Outer)
    assert schema.document["required"] == ["parts", "note"] and schema.document["additionalProperties"] is False
    inner = schema.document["$defs"]["Inner"]
    assert inner["required"] == ["default", "name"] and "default" not in inner["properties"]["default"]
    assert schema.read({"parts": [{"name": "x"}]}).parts[0].default == 1.0
    for wrong, words in (
        ({"parts": [{"name": 3}]}, "parts.0.name: "),
        ({"note": "a", "more": 1}, "more: "),
        ({"parts": [{"name": "x", "default": "1.5"}]}, "parts.0.default: "),
        ([], "the object: "),
    ):
        with pytest.raises(DoesNotFollow, match=words):
            schema.read(wrong)


def test_a_json_schema_as_it_stands() -> None:
    document = {"type": "object", "properties": {"n": {"type": "integer", "minimum": 2}}, "required": ["n"]}
    schema = schema_from("count", document)
    assert schema.read({"n": 3}) == {"n": 3}
    with pytest.raises(DoesNotFollow, match="n: 1 is less than the minimum of 2"):
        schema.read({"n": 1})
    with pytest.raises(DoesNotFollow) as caught:
        schema.read({"n": "x" * 5000})
    assert len(str(caught.value)) <= 450
    with pytest.raises(ValueError, match="is not a JSON schema"):
        schema_from("bad", {"type": "nothing"})


def test_of_several_answers_one_has_to_follow() -> None:
    def raw(text: str, finish: str = "stop") -> RawReply:
        return RawReply(text, finish, Usage(1, 2, False))

    assert read_reply(raw('first {"draft": 1}, then {"answer": 3}'), SCHEMA).answer == 3
    with pytest.raises(Unreadable, match="2 objects that follow"):
        read_reply(raw('{"answer": 3} or {"answer": 4}'), SCHEMA)
    with pytest.raises(Unreadable, match="cut after 2 tokens"):
        read_reply(raw('{"answer": 3}', "length"), SCHEMA)


# ---- asking again --------------------------------------------------------------------------------------------------


def test_a_bad_reply_is_answered_with_what_is_wrong() -> None:
    bad = ('{"answer": 4', '{"answer": "four"}', "4", '{"answer": 1} {"answer": 2}', '{"reply": 4}')
    seen: list[Request] = []

    def reply(request: Request) -> str:
        seen.append(request)
        return [*bad, '{"answer": 4}'][len(seen) - 1]

    chat = Chat(ScriptedBackend("test", reply))
    assert chat.ask(QUESTION, SCHEMA).answer == 4
    assert [len(request.messages) for request in seen] == [2, 4, 4, 4, 4, 4]
    assert [request.messages[2].text for request in seen[1:]] == list(bad)
    said = [request.messages[3].text for request in seen[1:]]
    for text, words in zip(
        said, ("cut short", "answer: ", "no JSON", "2 objects", "answer: Field required"), strict=True
    ):
        assert words in text
    record = chat.record
    assert (record.calls, record.re_prompts) == (1, 5) and record.estimated
    assert [failure.kind for failure in record.failures] == ["unreadable_reply"] * 5
    assert [failure.numbers["attempt"] for failure in record.failures] == [1, 2, 3, 4, 5]


def test_after_five_it_is_given_up_and_the_chat_goes_on() -> None:
    chat = Chat(scripted(*["nonsense"] * 6, '{"answer": 1}'))
    with pytest.raises(
        LanguageFailed, match="no reply followed the schema Answer in 6 tries; last: there is no"
    ) as caught:
        chat.ask(QUESTION, SCHEMA)
    assert caught.value.failure.kind == "unreadable_reply" and caught.value.failure.numbers == {"tries": 6.0}
    assert chat.ask(QUESTION, SCHEMA).answer == 1
    assert (chat.record.calls, chat.record.re_prompts) == (2, RE_PROMPTS) and len(chat.record.failures) == 7


def test_a_huge_reply_is_not_said_back_in_full() -> None:
    with serving(replies("x" * 300_000), replies({"answer": 4})) as server:
        chat = opened(server.base_url)
        assert chat.ask(QUESTION, SCHEMA).answer == 4
        assert len(server.asked[1].body["messages"][2]["content"]) == LONGEST_QUOTE


def test_half_a_surrogate_pair_comes_back_whole() -> None:
    with serving(replies("\ud83d no"), replies({"answer": 4})) as server:
        assert opened(server.base_url).ask(QUESTION, SCHEMA).answer == 4
        assert server.asked[1].body["messages"][2]["content"] == "? no"


# ---- budgets -------------------------------------------------------------------------------------------------------


def test_the_call_budget_counts_re_prompts() -> None:
    chat = Chat(scripted("no", "no", '{"answer": 1}'), ChatSettings(call_budget=4))
    chat.ask(QUESTION, SCHEMA)
    chat.ask(QUESTION, SCHEMA)
    for _ in range(2):
        with pytest.raises(LanguageFailed, match="asked 4 times, as often as --call-budget allows") as caught:
            chat.ask(QUESTION, SCHEMA)
    assert caught.value.failure.numbers == {"asked": 4.0, "budget": 4.0} and caught.value.exit_code == 2
    assert (chat.record.calls, chat.record.re_prompts) == (2, 2)


def test_the_token_budget() -> None:
    with serving(replies({"answer": 4}, usage={"prompt_tokens": 60, "completion_tokens": 40})) as server:
        chat = opened(server.base_url, token_budget=150)
        chat.ask(QUESTION, SCHEMA)
        chat.ask(QUESTION, SCHEMA)
        with pytest.raises(LanguageFailed, match="200 tokens used of --token-budget 150") as caught:
            chat.ask(QUESTION, SCHEMA)
        assert len(server.asked) == 2
    assert caught.value.failure.kind == "token_budget" and chat.tokens == 200


def test_every_kind_of_failure_has_an_exit_code() -> None:
    for kind in EXIT_CODES:
        assert LanguageFailed(kind, "x").exit_code in (2, 3, 5, 6)


# ---- messages ------------------------------------------------------------------------------------------------------


def test_images_are_checked_and_digested() -> None:
    png = cv2.imencode(".png", np.zeros((2, 2), np.uint8))[1].tobytes()
    other = cv2.imencode(".png", np.ones((2, 2), np.uint8))[1].tobytes()
    digests = {Request((say("user", "x", Image(data)),), SCHEMA, "m", 0.0, 9).digest for data in (png, other, png)}
    assert len(digests) == 2
    for wrong in (b"", b"GIF89a", png[:20], b"\xff\xd8\xff"):
        with pytest.raises(BadInput, match="not a sound PNG or JPEG"):
            Image(wrong)
    with pytest.raises(BadInput, match="not valid Unicode"):
        say("user", "\udc80")


def test_the_digest_knows_all_that_decides_a_reply() -> None:
    base = {"messages": QUESTION, "schema": SCHEMA, "model": "m", "temperature": 0.0, "maximum_tokens": 9}
    changes: list[dict[str, Any]] = [
        {},
        {"messages": QUESTION[1:]},
        {"messages": (QUESTION[0], say("assistant", "How many?"))},
        {"schema": schema_of(Outer)},
        {"model": "n"},
        {"temperature": 0.5},
    ]
    assert len({Request(**{**base, **change}).digest for change in changes}) == len(changes)
    # Fixed, so that a recording of today is found tomorrow.
    fixed = {**base, "schema": schema_from("any", {"type": "object"})}
    assert Request(**fixed).digest == "d51738c5182fc0a9bd64b6fee24e7959c365951d0ed57bdff712d220ab6ec29f"
