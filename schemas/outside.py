"""The one door for files from outside: manifests, documents, settings, mappings, transcripts, whatever people bring.

What is no regular file is never waited for, the size is looked at before anything is read, and what a document nests,
counts or writes out in digits is bounded. tests/bad_input/test_one_door.py lists who reads without this door, and why.
"""

from __future__ import annotations

import errno
import io
import json
import os
import re
import stat
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from scenewright.schemas.errors import BadInput, MachineFailure, ScenewrightError

LARGEST_DOCUMENT = 256 * 2**20
"""Bytes of a JSON document of an artifact, where nothing else is said."""
LARGEST_SHOWN = 64 * 2**20
"""Bytes of a picture or a text of an artifact that is shown as it is."""
LARGEST_SETTINGS = 4 * 2**20
"""Bytes of a file that people write by hand."""
DEEPEST = 64
"""Lists and tables within each other."""
MOST_VALUES = 5_000_000
"""Most values of a document."""
LARGEST_INTEGER = 2**63 - 1
"""Largest integer of a file from outside: what 64 bits hold."""

_MACHINE = (errno.EIO, errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.ESTALE)
_KINDS = ((stat.S_ISDIR, "a folder"), (stat.S_ISFIFO, "a pipe"), (stat.S_ISSOCK, "a socket"))
_LONG_DIGITS = re.compile(rb"[0-9]{19}")
_TOKENS = re.compile(rb'"(?:[^"\\]|\\.)*"|-?[0-9]+(?P<rest>[.eE][0-9.eE+-]*)?', re.DOTALL)
_PART = r"(?:[A-Za-z0-9_-]++|\"[^\"\n]*+\"|'[^'\n]*+')"
_DEEP_KEY = re.compile(rf"(?<![A-Za-z0-9_-])(?:{_PART}[ \t]*+\.[ \t]*+){{{DEEPEST}}}")
"""Python's reader of TOML takes time that grows with the square of the parts of a key."""


@contextmanager
def _translate_errors(path: Path | str, error: type[ScenewrightError], hint: str) -> Iterator[None]:
    try:
        yield
    except FileNotFoundError:
        raise error(f"{path}: file is missing", hint=hint) from None
    except OSError as failed:
        if failed.errno in _MACHINE:
            raise MachineFailure(f"{path}: {failed.strerror}", hint="the file may be sound") from None
        raise error(f"{path}: {failed.strerror or failed}", hint=hint) from None
    except ValueError as failed:  # a zero byte, or half a character, in its name
        raise error(f"{path}: {failed}", hint=hint) from None


def opened(path: Path | str, *, error: type[ScenewrightError] = BadInput, hint: str = "") -> io.BufferedReader:
    """Open a regular file for reading, the caller closes it. Raises `error` for anything else, and never waits.

    Raises MachineFailure when the machine is at fault.
    """
    with _translate_errors(path, error, hint):
        _check_regular(os.stat(path).st_mode, path, error, hint)  # first: opening a device may do something
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            _check_regular(os.fstat(descriptor).st_mode, path, error, hint)
            return os.fdopen(descriptor, "rb")
        except BaseException:
            os.close(descriptor)
            raise


def _check_regular(mode: int, path: Path | str, error: type[ScenewrightError], hint: str) -> None:
    if not stat.S_ISREG(mode):
        kind = next((name for test, name in _KINDS if test(mode)), "a device")
        raise error(f"{path}: {kind}, not a regular file", hint=hint)


def file_content(path: Path | str, largest: int, *, error: type[ScenewrightError] = BadInput, hint: str = "") -> bytes:
    """Return the bytes of a regular file of at most `largest` bytes. Raises `error`, MachineFailure."""
    with opened(path, error=error, hint=hint) as file, _translate_errors(path, error, hint):
        size = os.fstat(file.fileno()).st_size
        if size <= largest:
            data = file.read(size + 1)
            if len(data) > size:  # it grew, or is one of those of the kernel that state no size
                data += file.read(largest + 1 - len(data))
            size = len(data)
    if size > largest:
        raise error(f"{path}: larger than {largest} bytes", hint=hint)
    return data


def file_text(path: Path | str, largest: int, *, error: type[ScenewrightError] = BadInput, hint: str = "") -> str:
    """Return the text of a UTF-8 file of at most `largest` bytes; a byte order mark is dropped. Raises `error`."""
    try:
        return file_content(path, largest, error=error, hint=hint).decode("utf-8-sig")
    except UnicodeDecodeError as failed:
        raise error(f"{path}: not a text file (byte {failed.start} is not UTF-8)", hint=hint) from None


def file_json(path: Path | str, largest: int, *, error: type[ScenewrightError] = BadInput, hint: str = "") -> Any:
    """Return the document in a JSON file of at most `largest` bytes. Raises `error`."""
    return json_of(file_content(path, largest, error=error, hint=hint), str(path), error=error, hint=hint)


def file_toml(
    path: Path | str, largest: int = LARGEST_SETTINGS, *, error: type[ScenewrightError] = BadInput, hint: str = ""
) -> dict[str, Any]:
    """Return what a TOML file of at most `largest` bytes says. Raises `error`."""
    text = file_text(path, largest, error=error, hint=hint)
    if _DEEP_KEY.search(text):
        raise error(f"{path}: a key of more than {DEEPEST} parts", hint=hint)
    try:
        values = tomllib.loads(text)
    except RecursionError:
        raise error(f"{path}: nested too deeply", hint=hint) from None
    except ValueError as failed:  # malformed, or a number that Python does not convert
        raise error(f"{path}: {failed}", hint=hint) from None
    check_bounds(values, str(path), error=error, hint=hint)
    return values


def json_of(data: bytes | str, where: str, *, error: type[ScenewrightError] = BadInput, hint: str = "") -> Any:
    """Return a JSON document, in which Python reads NaN as a number too.

    Raises `error`, beginning with `where`, for none, and beyond the bounds above.
    """
    try:
        value = json.loads(data)
    except RecursionError:
        raise error(f"{where}: nested too deeply", hint=hint) from None
    except ValueError as failed:  # malformed, no UTF-8, or a number that Python does not convert
        raise error(f"{where}: no JSON: {failed}", hint=hint) from None
    check_bounds(value, where, error=error, hint=hint)
    return value


def check_bounds(value: Any, where: str, *, error: type[ScenewrightError] = BadInput, hint: str = "") -> None:
    """Raise `error` for what nests deeper than DEEPEST, holds over MOST_VALUES values, or integers over 64 bits."""
    waiting = [(value, 0)]
    count = 0
    while waiting:
        item, depth = waiting.pop()
        if isinstance(item, int) and abs(item) > LARGEST_INTEGER:
            raise error(f"{where}: an integer that 64 bits cannot hold", hint=hint)
        if isinstance(item, dict | list | tuple):
            count += len(item)
            if depth == DEEPEST:
                raise error(f"{where}: nested too deeply", hint=hint)
            if count > MOST_VALUES:
                raise error(f"{where}: more than {MOST_VALUES} values", hint=hint)
            waiting += [(part, depth + 1) for part in (item.values() if isinstance(item, dict) else item)]


def check_integers(data: bytes, where: str, *, error: type[ScenewrightError] = BadInput, hint: str = "") -> None:
    """Raise `error` when a JSON document writes an integer that 64 bits cannot hold; the rest is not looked at."""
    if _LONG_DIGITS.search(data) is None:  # long integers are rare, and looking for digits alone is fast
        return
    for token in _TOKENS.finditer(data):
        word = token[0]
        if len(word) < 19 or word[:1] == b'"' or token["rest"] is not None:
            continue
        if len(word) > 20 or abs(int(word)) > LARGEST_INTEGER:
            raise error(f"{where}: an integer that 64 bits cannot hold", hint=hint)
