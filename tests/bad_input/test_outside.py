"""The door for files from outside: what it refuses, at once and in one line."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from scenewright.schemas.base import Model
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.outside import (
    DEEPEST,
    check_integers,
    file_content,
    file_json,
    file_text,
    file_toml,
    json_of,
    opened,
)
from scenewright.schemas.plain_text import LONGEST_LINE, cleaned, one_line
from scenewright.stages.engine.batch.spec import read_spec
from scenewright.stages.engine.pipelines import pipeline_path
from scenewright.stages.kit.configuration import read_config
from scenewright.stages.kit.language.transcripts import TranscriptFile, read_transcript
from scenewright.stages.library.importing.mapping import read_mapping


def odd_file(folder: Path, what: str) -> Path:
    """Make something that is no regular file, or claims 10 GB."""
    path = folder / "odd"
    if what == "a pipe":
        os.mkfifo(path)
    elif what == "a folder":
        path.mkdir()
    elif what == "a device":
        path.symlink_to("/dev/zero")
    elif what == "a socket":
        here = Path.cwd()
        os.chdir(folder)  # names of sockets are short
        try:
            socket.socket(socket.AF_UNIX).bind("odd")
        finally:
            os.chdir(here)
    elif what == "missing":
        path.symlink_to("nowhere")
    elif what == "larger than":
        path.touch()
        os.truncate(path, 10 * 2**30)
    return path


ODD = ("a pipe", "a folder", "a device", "a socket", "missing", "larger than")
READERS: dict[str, Callable[[Path], object]] = {
    "content": lambda path: file_content(path, 2**20),
    "text": lambda path: file_text(path, 2**20),
    "json": lambda path: file_json(path, 2**20),
    "toml": file_toml,
    "document": Model.read,
    "config": read_config,
    "batch": read_spec,
    "mapping": read_mapping,
    "transcript": read_transcript,
    "transcript to append to": TranscriptFile,
}


@pytest.mark.parametrize("what", ODD)
@pytest.mark.parametrize("reader", READERS)
def test_what_is_no_regular_file_of_bounded_size_is_refused_at_once(tmp_path: Path, reader: str, what: str) -> None:
    if (reader, what) == ("transcript to append to", "missing"):
        return  # it is made
    path = odd_file(tmp_path, what)
    started = time.process_time()
    with pytest.raises((BadInput, UsageError), match=f"odd: .*{what}"):
        READERS[reader](path)
    assert time.process_time() - started < 1


@pytest.mark.parametrize("name", ["a\0b", "x" * 300, "/".join(["y" * 200] * 30)])
def test_names_that_no_file_can_have(name: str) -> None:
    with pytest.raises(BadInput):
        file_content(name, 10)
    with pytest.raises(UsageError, match="no pipeline"):
        pipeline_path(name)


def test_a_loop_of_links(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")
    with pytest.raises(BadInput, match="symbolic links"):
        opened(tmp_path / "a")


def test_files_of_the_kernel_state_no_size_and_are_bounded_all_the_same() -> None:
    assert b"Name:" in file_content("/proc/self/status", 100_000)
    with pytest.raises(BadInput, match="larger than 100 bytes"):
        file_content("/proc/self/status", 100)


def test_content_up_to_the_bound(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"12345")
    assert file_content(tmp_path / "a", 5) == b"12345"
    with pytest.raises(UsageError, match="larger than 4 bytes .look again"):
        file_content(tmp_path / "a", 4, error=UsageError, hint="look again")


JSON_BEYOND = {
    "deep": "[" * (DEEPEST + 1) + "]" * (DEEPEST + 1),
    "an integer of 20 digits": "99999999999999999999",
    "an integer of 6000 digits": '{"a": ' + "9" * 6000 + "}",
    "a word": "nothing",
}


@pytest.mark.parametrize("case", JSON_BEYOND)
def test_json_beyond_the_bounds(case: str) -> None:
    with pytest.raises(BadInput, match="^here: "):
        json_of(JSON_BEYOND[case], "here")


def test_json_within_the_bounds() -> None:
    assert json_of("[" * DEEPEST + "]" * DEEPEST, "here")
    assert json_of(b'{"a": [-9223372036854775807, 1e300, "99999999999999999999"]}', "here")


def test_dots_in_texts_are_no_keys(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text('x = """\n' + "." * 500 + '\n"""\ny = "' + "and so on... " * 100 + '"\n')
    assert set(file_toml(tmp_path / "a.toml")) == {"x", "y"}


@pytest.mark.parametrize("number", ["9223372036854775808", "-9223372036854775808", "9" * 400])
def test_integers_of_documents_fit_into_64_bits(number: str) -> None:
    with pytest.raises(BadInput, match="64 bits"):
        check_integers(b'{"a": [1, %s]}' % number.encode(), "here")


@pytest.mark.parametrize("fine", ["9223372036854775807", "0.1234567890123456789012", '"%s"' % ("1" * 64), "1e30"])
def test_other_long_numbers_of_documents_stay(fine: str) -> None:
    check_integers(b'{"a": [%s, "x\\"12345678901234567890"]}' % fine.encode(), "here")


def test_text_is_cleaned_of_what_terminals_obey() -> None:
    name = "a\x1b]0;owned\x07\x9b31m\x7f\u202e\udcff\r"
    assert cleaned(name).isprintable() and cleaned("caf\u00e9 \u674e\n\t") == "caf\u00e9 \u674e\n\t"
    assert "\x1b" not in str(BadInput(name, hint=name))
    assert len(one_line("x" * 10**6)) < LONGEST_LINE + 100
