"""Errors say what, where and what to do next, in few words and in those of the glossary (docs/WRITING.md)."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

from tests.contract.readability import words

ROOT = Path(__file__).resolve().parents[2]
ERRORS = {"BadInput", "UsageError", "MachineFailure", "MissingDependency"}
CALLER_SAYS = (
    "stages/kit/formats/mesh_files.py",
    "stages/kit/formats/numpy_files.py",
    "stages/kit/formats/zip_files.py",
    "stages/kit/formats/masks.py",
    "stages/kit/services/segmentation_protocol.py",
    "stages/library/",
)
"""Readers whose caller alone knows what the file is for, and adds what to do next."""
LONGEST = 30
"""Words of a message with its hint. A value and a span of code are one word each."""
NOT_OURS = {
    "picture": "image",
    "keyframe": "frame",
    "semantic map": "panoptic map",
    "meter": "metre",
    "color": "colour",
}
"""Word -> the glossary's word for the same thing."""


class Error(NamedTuple):
    """An error as it is raised: texts with `X` where a value stands, None where the program computes them."""

    place: str
    message: str | None
    hints: tuple[str, ...] | None
    """Every form of it; None without a hint."""


@cache
def errors() -> tuple[Error, ...]:
    """Return the errors that the program raises, in order of place."""
    files = [file for folder in ("cli", "schemas", "stages") for file in sorted((ROOT / folder).rglob("*.py"))]
    texts = [(file, file.read_text()) for file in files]
    return tuple(
        error for file, text in texts if any(f"{name}(" in text for name in ERRORS) for error in _errors_of(file, text)
    )


def _errors_of(file: Path, text: str) -> Iterator[Error]:
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in ERRORS:
            hint = next((keyword.value for keyword in node.keywords if keyword.arg == "hint"), None)
            hints = None if hint is None else tuple(_forms(hint))
            place = f"{file.relative_to(ROOT)}:{node.lineno}"
            yield Error(place, next(iter(_forms(node.args[0])), None), hints)


def _forms(node: ast.expr) -> Iterator[str]:
    """Yield the texts that an expression may be, none where it is computed."""
    if isinstance(node, ast.IfExp):
        yield from (*_forms(node.body), *_forms(node.orelse))
    elif isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    elif isinstance(node, ast.JoinedStr):
        yield "".join(str(part.value) if isinstance(part, ast.Constant) else "X" for part in node.values)


def prose(text: str) -> str:
    """Return what is said in words: spans of code, options and names of files are one word each."""
    return re.sub(r"`[^`]*`|--[\w-]+|[\w<>-]*(?:[/_]|[._](?=\w))[\w./<>-]*", "X", text)


def test_errors_say_what_to_do_next() -> None:
    silent = [error for error in errors() if error.hints is None and not error.place.startswith(CALLER_SAYS)]
    assert len(errors()) > 1000 and [error for error in silent if error.message is not None] == []


def test_errors_are_short() -> None:
    whole = {f"{one.place}: {one.message or ''} {hint}" for one in errors() for hint in one.hints or ("",)}
    assert [text for text in sorted(whole) if words(prose(text.partition(": ")[2])) > LONGEST] == []


def test_errors_use_the_words_of_the_glossary() -> None:
    said = [(one.place, prose(text)) for one in errors() for text in (one.message or "", *(one.hints or ()))]
    pattern = re.compile(rf"\b({'|'.join(NOT_OURS)})s?\b", re.IGNORECASE)
    assert [(place, text) for place, text in said if pattern.search(text)] == []
