"""What a fuzz harness is: a door for bytes from outside, bytes for it, and the only errors it may raise."""

from __future__ import annotations

import atexit
import contextlib
import functools
import os
import shutil
import struct
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from scenewright.schemas.plain_text import LONGEST_LINE

CORPUS = Path(__file__).resolve().parent / "corpus"
_answers: list[str] = []


@contextlib.contextmanager
def refused(*errors: type[Exception]) -> Iterator[None]:
    """Take these errors as refusals: each is one line of bounded length."""
    try:
        yield
        _answers.append("read")
    except errors as error:
        words = str(error)
        assert words and "\n" not in words and len(words) <= LONGEST_LINE + 200, words
        _answers.append("refused")


@dataclass(frozen=True)
class Harness:
    """A parser under test."""

    target: Callable[[bytes], None]
    """Feeds bytes to the parser. Returns when they were read or refused as they should be; anything raised is a bug."""
    seeds: Callable[[], dict[str, bytes]]
    """Name -> bytes of valid samples, from which the corpus is made."""
    largest: int = 8192
    """Bytes that a fuzzer may come up with."""
    choosing: int = 0
    """Leading bytes that choose among several readers; the content follows."""

    def outcome(self, data: bytes) -> str:
        """Return what comes of bytes: "read", "refused", or "in part" where only some was read, or by some readers."""
        _answers.clear()
        self.target(data)
        return "in part" if len(set(_answers)) > 1 else "".join(_answers[:1])


def corpus_of(name: str) -> list[Path]:
    """Return the committed inputs of a harness, sorted."""
    return sorted(path for path in (CORPUS / name).glob("*") if path.is_file())


@functools.cache
def scratch() -> Path:
    """Return a folder of this process for files that harnesses write; in memory where that is possible."""
    memory = Path("/dev/shm")
    parent = memory if memory.is_dir() and os.access(memory, os.W_OK) else None
    folder = Path(tempfile.mkdtemp(prefix="fuzz-", dir=parent))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def as_file(name: str, data: bytes) -> Path:
    """Write bytes to a file of this name and return its path."""
    path = scratch() / name
    path.write_bytes(data)
    return path


def edited(base: bytes, script: bytes) -> bytes:
    """Return `base` with the edits of a script: place (4 bytes), removed and inserted length (a byte each), bytes.

    Lets a fuzzer reach into files that are larger than what it can handle itself.
    """
    data = bytearray(base)
    for place, removed, content in edits_of(script):
        place %= len(data) + 1
        data[place : place + removed] = content
    return bytes(data)


def edits_of(script: bytes) -> Iterator[tuple[int, int, bytes]]:
    """Yield (place, bytes removed, bytes inserted) of an edit script."""
    start = 0
    while start + 6 <= len(script):
        place, removed, inserted = struct.unpack_from("<IBB", script, start)
        yield place, removed, script[start + 6 : start + 6 + inserted]
        start += 6 + inserted


def script(*edits: tuple[int, int, bytes]) -> bytes:
    """Return the script of edits (place, bytes removed, bytes inserted)."""
    return b"".join(struct.pack("<IBB", place, removed, len(content)) + content for place, removed, content in edits)


def chosen(data: bytes, number: int) -> tuple[int, bytes]:
    """Return (which of `number` things, what follows): the first byte chooses."""
    return (data[0] % number if data else 0), data[1:]
