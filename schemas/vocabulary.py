"""The one class vocabulary (data/vocabulary.toml): names, ids, stuff or thing, what kind of graph node."""

from __future__ import annotations

import tomllib
from functools import cache
from typing import Literal

from scenewright.schemas.base import Model
from scenewright.schemas.errors import BadInput
from scenewright.schemas.places import data_file

VOCABULARY_FILE = data_file("vocabulary.toml")
VOID = 0
"""Id of points and pixels without a class."""
UNNAMED = "object"
"""The class of things that were found and not recognised."""
NodeType = Literal["layout", "rigid", "articulated"]


class SemanticClass(Model):
    """One class. `object` (class-agnostic) is a class like any other; id 0 is void and is not listed."""

    name: str
    id: int
    kind: Literal["stuff", "thing"]
    node: NodeType
    movable: bool
    coco: tuple[str, ...] = ()
    nyu40: tuple[str, ...] = ()
    scannet: tuple[str, ...] = ()
    ade20k: tuple[str, ...] = ()
    library: tuple[str, ...] = ()

    @property
    def is_layout(self) -> bool:
        """Whether the class bounds the room (floor, wall, ceiling, door, window, curtain)."""
        return self.node == "layout"


class Vocabulary(Model):
    """All classes, by name, id or alias."""

    classes: tuple[SemanticClass, ...]

    def by_name(self, name: str) -> SemanticClass:
        """Return the class called `name`. Raises BadInput for an unknown name."""
        for entry in self.classes:
            if entry.name == name:
                return entry
        raise BadInput(f"class {name!r} is not in the vocabulary", hint=f"see {VOCABULARY_FILE.name}")

    def by_id(self, class_id: int) -> SemanticClass:
        """Return the class with this id. Raises BadInput for an unknown id."""
        for entry in self.classes:
            if entry.id == class_id:
                return entry
        raise BadInput(f"class id {class_id} is not in the vocabulary", hint=f"see {VOCABULARY_FILE.name}")

    def by_alias(self, alias: str, source: str) -> SemanticClass | None:
        """Return the class that another vocabulary (`coco`, `nyu40`, `scannet`, `ade20k`) calls `alias`, or None."""
        for entry in self.classes:
            if entry.name == alias or alias in getattr(entry, source):
                return entry
        return None


@cache
def load_vocabulary() -> Vocabulary:
    """Read data/vocabulary.toml once."""
    with VOCABULARY_FILE.open("rb") as file:
        return Vocabulary(classes=tuple(SemanticClass(**row) for row in tomllib.load(file)["class"]))
