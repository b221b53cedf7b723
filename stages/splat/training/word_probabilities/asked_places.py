"""Places that were asked in words, and which answers are right: what probabilities are fitted on.

`places.json` lists them: what each is for, the folder of its language map beside the file, its queries, and of each
query which regions of the map are right answers.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from scenewright.schemas.errors import BadInput
from scenewright.schemas.language_map import LanguageMap

FILE = "places.json"
KNOWN, STRANGE = "known", "strange"
"""Places like those that the encoder learned from, and real ones; the others are for the source that is fitted."""


@dataclass(frozen=True)
class Asked:
    """A text, and which regions (R,) are right answers."""

    text: str
    right: tuple[bool, ...]


@dataclass(frozen=True)
class AskedPlace:
    """A place with what it was asked."""

    use: str
    """KNOWN, STRANGE or the source of the answers."""
    language: LanguageMap
    queries: tuple[Asked, ...]


def write_places(folder: Path, places: list[AskedPlace]) -> None:
    """Write the list; language maps lie below the folder."""
    rows = [
        {
            "use": place.use,
            "language": str(place.language.root.relative_to(folder)),
            "queries": [{"text": query.text, "right": list(query.right)} for query in place.queries],
        }
        for place in places
    ]
    (folder / FILE).write_text(json.dumps(rows) + "\n")


def read_places(folder: Path) -> list[AskedPlace]:
    """Read the list. Raises BadInput where there is none."""
    if not (folder / FILE).is_file():
        raise BadInput(f"{folder}: no {FILE}", hint="ask places first: docs/SPLATS.md")
    return [
        AskedPlace(
            row["use"],
            LanguageMap(folder / row["language"], outcome="ok", summary={}),
            tuple(Asked(query["text"], tuple(query["right"])) for query in row["queries"]),
        )
        for row in json.loads((folder / FILE).read_text())
    ]
