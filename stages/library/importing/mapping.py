"""What the user says about single models: a TOML file from names to class, unit, up and front."""

from __future__ import annotations

import itertools
import re
from fnmatch import fnmatchcase
from functools import cached_property
from pathlib import Path
from typing import Literal

from pydantic import ValidationError
from scenewright.schemas.base import Model
from scenewright.schemas.errors import BadInput, first_problem
from scenewright.schemas.outside import file_toml
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.known_names import AxisName, UnitName
from scenewright.stages.library.importing.source_model import SourceModel

LARGEST_FILE = 4 * 2**20
"""Largest mapping file [bytes]; a bound, by eye."""
MOST_PATTERNS = 1000
"""Each of them is held against each model; names without * and ? may be many."""
LONGEST_NAME = 1000
"""Characters of a name that are held against a pattern."""
WILD = re.compile(r"[*?\[]")
SKIP = "skip"


class Entry(Model):
    """What is said about the models that a pattern names; empty means nothing."""

    class_name: str = ""
    """A class of the vocabulary, or `skip`."""
    unit: Literal["", UnitName] = ""
    up: Literal["", AxisName] = ""
    front: Literal["", AxisName] = ""
    contains: bool | None = None


class Mapping(Model):
    """Pattern (with * and ?) of a model's name or source -> Entry; the first that fits counts."""

    models: dict[str, Entry | str] = {}

    @cached_property
    def patterns(self) -> list[tuple[int, str]]:
        """Return (place, pattern) of those that are more than a name."""
        return [(k, pattern) for k, pattern in enumerate(self.models) if WILD.search(pattern)]

    @cached_property
    def _names(self) -> dict[str, int]:
        return {pattern: k for k, pattern in enumerate(self.models) if not WILD.search(pattern)}

    def entry(self, source: SourceModel) -> Entry:
        """Return what is said about a model."""
        of_model = (source.name[:LONGEST_NAME], source.source[:LONGEST_NAME])
        best = min((self._names[name] for name in of_model if name in self._names), default=len(self.models))
        for position, pattern in self.patterns:
            if position >= best:
                break
            if any(fnmatchcase(name, pattern) for name in of_model):
                best = position
        entry = next(itertools.islice(self.models.values(), best, None), "")
        return Entry(class_name=entry) if isinstance(entry, str) else entry


def read_mapping(path: Path) -> Mapping:
    """Return the mapping of a TOML file: `[models]`, `"chair_*" = "chair"`, `"a" = {class_name = "box", unit = "cm"}`.

    Raises BadInput for unknown classes, keys and values.
    """
    try:
        mapping = Mapping.model_validate(file_toml(path, LARGEST_FILE, hint="see docs/LIBRARY.md"))
    except ValidationError as error:
        raise BadInput(f"{path}: {first_problem(error)}", hint="see docs/LIBRARY.md") from None
    if len(mapping.patterns) > MOST_PATTERNS:
        raise BadInput(f"{path}: more than {MOST_PATTERNS} patterns with * or ?", hint="see docs/LIBRARY.md")
    names = {entry.name for entry in load_vocabulary().classes} | {SKIP, ""}
    for pattern, entry in mapping.models.items():
        name = entry if isinstance(entry, str) else entry.class_name
        if name not in names:
            raise BadInput(
                f"{path}: {pattern}: class {name!r:.60} is not in the vocabulary", hint="see data/vocabulary.toml"
            )
    return mapping
