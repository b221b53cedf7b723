"""Transcripts: recorded once, replayed, gone on with, damaged."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.stages.kit.language.failures import LanguageFailed
from scenewright.stages.kit.language.messages import say
from scenewright.stages.kit.language.opening import open_chat
from scenewright.stages.kit.language.options import LanguageParameters
from scenewright.stages.kit.language.transcripts import TranscriptFile, read_transcript

from tests.unit.language.chats import GOOD, QUESTION, SCHEMA, opened, scripted
from tests.unit.language.stub_server import replies, serving, status

OTHER = (say("user", "And tomorrow?"),)


def recorded(path: Path, record: Path | None = None, **options: Any) -> Any:
    parameters = LanguageParameters(language="recorded", **options)
    return open_chat(parameters, scripted=scripted(), transcript=path, record=record)


@pytest.fixture
def transcript(tmp_path: Path) -> Path:
    """One question asked twice (with different replies), another with a reply that had to be asked for again."""
    path = tmp_path / "first" / "transcript.jsonl"
    said = (replies(GOOD), replies({"answer": 5}), replies('{"answer"', finish="length"), replies({"answer": 6}))
    with serving(*said) as server:
        chat = opened(server.base_url, record=path)
        assert [chat.ask(q, SCHEMA).answer for q in (QUESTION, QUESTION, OTHER)] == [4, 5, 6]
    return path


def test_a_recording_is_replayed_without_a_server(transcript: Path) -> None:
    chat = recorded(transcript)
    assert chat.backend.label == "recorded:stub" and chat.settings.model == "stub"
    assert [chat.ask(q, SCHEMA).answer for q in (QUESTION, OTHER, QUESTION)] == [4, 6, 5]
    assert (chat.record.calls, chat.record.re_prompts, chat.record.prompt_tokens) == (3, 1, 44)


def test_a_replay_records_itself(transcript: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy.jsonl"
    chat = recorded(transcript, copy)
    assert chat.ask(OTHER, SCHEMA).answer == 6
    assert recorded(copy).ask(OTHER, SCHEMA).answer == 6 and len(read_transcript(copy)) == 2


@pytest.mark.parametrize(
    ("question", "options", "words"),
    [
        ((say("user", "Who  are\nyou?"),), {}, "ends with 'Who are you?'"),
        (QUESTION, {"temperature": 0.5}, "it was recorded with temperature 0 instead of 0.5"),
    ],
)
def test_a_prompt_that_was_not_recorded(transcript: Path, question: Any, options: Any, words: str) -> None:
    with pytest.raises(LanguageFailed) as caught:
        recorded(transcript, **options).ask(question, SCHEMA)
    assert words in caught.value.message and str(transcript) in caught.value.message
    assert "--language openai" in caught.value.hint and caught.value.exit_code == 5
    assert caught.value.failure.numbers["exchanges"] == 4


def test_a_prompt_asked_more_often_than_recorded(transcript: Path) -> None:
    chat = recorded(transcript)
    chat.ask(QUESTION, SCHEMA)
    chat.ask(QUESTION, SCHEMA)
    with pytest.raises(LanguageFailed, match="asked for the 3. time"):
        chat.ask(QUESTION, SCHEMA)


def test_a_recording_that_broke_off_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "transcript.jsonl"
    with serving(replies(GOOD), status(401)) as server:
        chat = opened(server.base_url, record=path)
        chat.ask(QUESTION, SCHEMA)
        with pytest.raises(LanguageFailed):
            chat.ask(OTHER, SCHEMA)
    with path.open("a") as file:
        file.write('{"backend": "openai:stub", "comple')  # the machine died
    with serving(replies({"answer": 7})) as server:
        chat = opened(server.base_url, record=path)
        assert [chat.ask(q, SCHEMA).answer for q in (QUESTION, OTHER)] == [4, 7]
        assert len(server.asked) == 1
    assert len(read_transcript(path)) == 2


def test_an_earlier_transcript_is_not_paid_twice(transcript: Path, tmp_path: Path) -> None:
    with serving(replies({"answer": 9})) as server:
        parameters = LanguageParameters(language="openai", model="stub", base_url=server.base_url)
        chat = open_chat(parameters, scripted=scripted(), transcript=transcript, record=tmp_path / "new.jsonl")
        assert [chat.ask(q, SCHEMA).answer for q in (QUESTION, OTHER[::-1] + QUESTION)] == [4, 9]
        assert len(server.asked) == 1
    assert len(read_transcript(tmp_path / "new.jsonl")) == 2


def test_replies_may_be_edited_and_prompts_may_not(transcript: Path) -> None:
    lines = [json.loads(line) for line in transcript.read_text().splitlines()]
    lines[0]["reply"] = '{"answer": 44}'
    transcript.write_text("\n".join(json.dumps(line) for line in lines))  # no newline at the end
    assert recorded(transcript).ask(QUESTION, SCHEMA).answer == 44
    TranscriptFile(transcript)
    assert len(read_transcript(transcript)) == 4 and transcript.read_text().endswith("}\n")
    lines[2]["messages"][0]["parts"][0]["text"] = "And today?"
    transcript.write_text("\n".join(json.dumps(line) for line in lines))
    with pytest.raises(BadInput, match="line 3: the prompt is not the one that was recorded"):
        recorded(transcript)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("no JSON\n", "line 1: line: Invalid JSON"),
        ('\n{"format": "x"}\n', "line 2: format"),
        ("\xff", "line 1"),
        ("[" * 9999, "line 1"),
    ],
)
def test_damaged_transcripts(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "transcript.jsonl"
    path.write_text(text, encoding="latin-1")
    with pytest.raises(BadInput) as caught:
        recorded(path)
    assert words in caught.value.message and "\n" not in str(caught.value)
    with pytest.raises(BadInput):
        TranscriptFile(path)
    assert path.read_text(encoding="latin-1").startswith(text)  # nothing of a foreign file is lost


def test_options_that_do_not_go_together(transcript: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="needs --transcript"):
        open_chat(LanguageParameters(language="recorded"), scripted=scripted())
    with pytest.raises(UsageError, match="reads no --transcript"):
        open_chat(LanguageParameters(), scripted=scripted(), transcript=transcript)
    with pytest.raises(UsageError, match="needs --model"):
        open_chat(LanguageParameters(language="openai"), scripted=scripted())
    with pytest.raises(UsageError, match="no replies of model 'other'") as caught:
        recorded(transcript, model="other")
    assert "stub" in caught.value.hint
    with pytest.raises(BadInput, match="file is missing"):
        recorded(tmp_path / "none.jsonl")


def test_the_stand_in_is_the_default_and_says_so(tmp_path: Path) -> None:
    chat = open_chat(LanguageParameters(), scripted=scripted(), record=tmp_path / "transcript.jsonl")
    assert chat.ask(QUESTION, SCHEMA).answer == 4 and chat.record.backend == chat.record.model == "scripted:test"
    again = recorded(tmp_path / "transcript.jsonl")
    assert again.ask(QUESTION, SCHEMA).answer == 4 and again.record.backend == "recorded:scripted:test"
