"""What a case is: a command line and edits of what it reads, as a small JSON file that says all of it."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from scenewright.stages.engine.discovery import all_stages


@dataclass(frozen=True)
class Edit:
    """One change of a file: `how` is a function of `edits.py`, called with these arguments."""

    target: str
    """Name of a base artifact or of a thing from outside, without the @."""
    file: str
    """Path within it."""
    how: str
    arguments: tuple[Any, ...] = ()


@dataclass(frozen=True)
class Case:
    """A command line; `@name` in a word is the (edited) base artifact of this name, `@out` where it may write."""

    words: tuple[str, ...]
    edits: tuple[Edit, ...] = ()
    long: bool = False
    """Asks for more work than the options do by default: it may take longer than the limit."""

    def text(self) -> str:
        """Return the case as JSON."""
        return json.dumps(asdict(self), indent=1) + "\n"

    @property
    def command(self) -> str:
        """The command's name, for tables: `library add`, `inspect`."""
        groups = {name.split()[0] for name in all_stages() if " " in name}
        return " ".join(self.words[: 2 if self.words[0] in groups else 1])


def read_case(path: Path) -> Case:
    """Return the case that a file holds."""
    data = json.loads(path.read_text())
    edits = tuple(
        Edit(edit["target"], edit["file"], edit["how"], tuple(edit["arguments"])) for edit in data.get("edits", ())
    )
    return Case(tuple(data["words"]), edits, data.get("long", False))
