"""What the user says about single models: a TOML file from names to class, unit, up and front."""

from __future__ import annotations

import tomllib
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Literal

from pydantic import ValidationError

from schemas.base import Model
from schemas.errors import BadInput
from schemas.vocabulary import load_vocabulary
from stages.library.importing.source_model import SourceModel

LARGEST_FILE = 4 * 2**20
SKIP = "skip"


class Entry(Model):
    """What is said about the models that a pattern names; empty means nothing."""

    class_name: str = ""
    """A class of the vocabulary, or `skip`."""
    unit: Literal["", "m", "dm", "cm", "mm", "inch", "foot"] = ""
    up: Literal["", "+x", "-x", "+y", "-y", "+z", "-z"] = ""
    front: Literal["", "+x", "-x", "+y", "-y", "+z", "-z"] = ""
    contains: bool | None = None


class Mapping(Model):
    """Pattern (with * and ?) of a model's name or source -> Entry; the first that fits counts."""

    models: dict[str, Entry | str] = {}

    def entry(self, source: SourceModel) -> Entry:
        """Return what is said about a model."""
        for pattern, entry in self.models.items():
            if fnmatchcase(source.name, pattern) or fnmatchcase(source.source, pattern):
                return Entry(class_name=entry) if isinstance(entry, str) else entry
        return Entry()


def read_mapping(path: Path) -> Mapping:
    """Return the mapping of a TOML file: `[models]`, `"chair_*" = "chair"`, `"a" = {class_name = "box", unit = "cm"}`.

    Raises BadInput for unknown classes, keys and values.
    """
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise BadInput(f"{path}: larger than {LARGEST_FILE} bytes")
        mapping = Mapping.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise BadInput(f"{path}: {where}: {first['msg']}", hint="see docs/LIBRARY.md") from None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise BadInput(f"{path}: {getattr(error, 'strerror', None) or error}", hint="see docs/LIBRARY.md") from None
    names = {entry.name for entry in load_vocabulary().classes} | {SKIP, ""}
    for pattern, entry in mapping.models.items():
        name = entry if isinstance(entry, str) else entry.class_name
        if name not in names:
            raise BadInput(
                f"{path}: {pattern}: class {name!r:.60} is not in the vocabulary", hint="see data/vocabulary.toml"
            )
    return mapping
