"""What can be perceived in one kind of world: the words of its perception calls."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol


@dataclass(frozen=True)
class Vocabulary:
    """Names of perception calls."""

    of_object: tuple[str, ...]
    """Numbers of an object."""
    of_scene: tuple[str, ...]
    """Numbers of the whole."""
    relations: Mapping[str, int] = field(default_factory=dict)
    """Truths of so many objects that are perceived as such (the links of a contact graph)."""


class Perceived(Protocol):
    """What is perceived at one moment."""

    @property
    def names(self) -> tuple[str, ...]:
        """The objects."""
        ...

    @property
    def tolerance(self) -> float:
        """What `near` allows."""
        ...

    def category(self, name: str) -> str:
        """Return what kind of thing an object is."""
        ...

    def number(self, name: str, call: str) -> float:
        """Return what a perception call says of an object."""
        ...

    def of_scene(self, call: str) -> float:
        """Return what a perception call says of the whole."""
        ...

    def related(self, relation: str, names: tuple[str, ...]) -> bool:
        """Whether a relation of the vocabulary is perceived of objects."""
        ...
