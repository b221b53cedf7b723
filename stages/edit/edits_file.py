"""Reading edits.toml, and adding a line to it: every edit is one line, so that undo is deleting a line."""

from __future__ import annotations

import fcntl
import json
import os
import tempfile
import tomllib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from scenewright.schemas.edits import FORMAT, AnyEdit, EditsFile
from scenewright.schemas.errors import BadInput, MachineFailure, first_problem
from scenewright.schemas.outside import LARGEST_SETTINGS, file_text, file_toml
from scenewright.schemas.plain_text import UNPRINTABLE
from scenewright.stages.kit.digests import sha256_of_file

HINT = "docs/EDIT.md shows one"
UNWRITTEN = "nothing was written: look at what it says now, and try again"
EMPTY = f'format = "{FORMAT}"\nversion = 1\nedits = [\n]\n'


def read_edits(path: Path) -> EditsFile:
    """Read and check edits.toml. Raises BadInput naming the edit and the field that is wrong."""
    values = file_toml(path, LARGEST_SETTINGS, hint=HINT)
    try:
        return EditsFile.model_validate(values)
    except ValidationError as error:
        raise BadInput(f"{path}: {first_problem(error)}", hint=HINT) from None


class Changed(BadInput):
    """The file is no longer the one that was read."""


def revision_of(path: Path) -> str:
    """Return a digest of what edits.toml says now, empty where there is none. Raises BadInput."""
    return sha256_of_file(path) if path.exists() or path.is_symlink() else ""


def append_edits(path: Path, edits: Sequence[AnyEdit], *, as_read: str | None = None) -> EditsFile:
    """Add edits to the end of edits.toml, one line each; it is made where there is none. Return what it then says.

    What else stands there, comments too, stays as it is. Two programs that do this at once wait for each other. Raises
    BadInput when the file is broken or does not end with its list of edits; it is then as it was. Raises Changed when
    `as_read` is given and not the file's revision, MachineFailure when it cannot be written.
    """
    with _one_at_a_time(path):
        _check_unchanged(path, as_read)
        there = path.exists() or path.is_symlink()
        before = read_edits(path) if there else EditsFile(format="scenewright-edits", version=1)
        text = file_text(path, LARGEST_SETTINGS, hint=HINT) if there else EMPTY
        head, bracket, tail = text.rpartition("]")
        new = f"{head.rstrip()}\n" + "".join(f"  {line_of(edit)},\n" for edit in edits) + f"{bracket}{tail}"
        return _replace(path, new, before.model_copy(update={"edits": (*before.edits, *edits)}))


def remove_edit(path: Path, number: int, *, as_read: str) -> EditsFile:
    """Delete the line of an edit, its number from 1; return what the file then says.

    Raises Changed as `append_edits` does, BadInput when the edits do not stand one on a line each.
    """
    with _one_at_a_time(path):
        _check_unchanged(path, as_read)
        before, text = read_edits(path), file_text(path, LARGEST_SETTINGS, hint=HINT)
        lines = text.splitlines(keepends=True)
        rows = [k for k, line in enumerate(lines) if _is_row(line)]
        if not 1 <= number <= len(before.edits) or len(rows) != len(before.edits):
            raise BadInput(f"{path}: edit {number} has no line of its own", hint="delete it in an editor")
        kept = "".join(line for k, line in enumerate(lines) if k != rows[number - 1])
        edits = before.edits[: number - 1] + before.edits[number:]
        return _replace(path, kept, before.model_copy(update={"edits": edits}))


def _check_unchanged(path: Path, as_read: str | None) -> None:
    if as_read is not None and revision_of(path) != as_read:
        raise Changed(
            f"{path}: somebody else has changed it meanwhile", hint="nothing was written: look, and try again"
        )


def _is_row(line: str) -> bool:
    """Whether a line is one table of a list, with or without its comma and a comment."""
    try:
        return len(tomllib.loads(f"rows = [\n{line}\n]")["rows"]) == 1
    except tomllib.TOMLDecodeError:
        return False


def _replace(path: Path, text: str, meant: EditsFile) -> EditsFile:
    """Put `text` into the place of a file, if it says what is `meant`."""
    target = Path(os.path.realpath(path))
    descriptor, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.")
    written = Path(name)
    try:
        with os.fdopen(descriptor, "w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        try:
            says = read_edits(written)
        except BadInput:
            says = None
        if says != meant:
            raise BadInput(
                f"{path}: its list `edits` is not the last thing in it, or its last edit lacks a comma", hint=HINT
            )
        written.chmod(target.stat().st_mode & 0o777 if target.exists() else 0o644)
        written.replace(target)
    except BaseException:
        written.unlink(missing_ok=True)
        raise
    return meant


@contextmanager
def _one_at_a_time(path: Path) -> Iterator[None]:
    """Hold the lock of the folder that the file is in: the file itself is replaced."""
    try:
        descriptor = os.open(Path(os.path.realpath(path)).parent, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    except (OSError, ValueError) as error:
        raise BadInput(f"{path}: no folder to write it into", hint="make the folder first") from error
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    except OSError as error:
        raise MachineFailure(f"{path}: {error.strerror}", hint="choose a place that can be written") from None
    finally:
        os.close(descriptor)


def line_of(edit: AnyEdit) -> str:
    """Return an edit as one line of TOML; what it leaves at its default is left out."""
    values = edit.model_dump(by_alias=True, exclude_defaults=True)
    return _toml({"what": values.pop("what"), **values})


def _toml(value: Any) -> str:
    """Return a value of numbers, text, lists and tables as inline TOML."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_toml(part)}" for key, part in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_toml(part) for part in value) + "]"
    if isinstance(value, str):
        quoted = json.dumps(value, ensure_ascii=False)
        return UNPRINTABLE.sub(lambda found: f"\\u{ord(found[0]):04x}", quoted)
    return json.dumps(value)
