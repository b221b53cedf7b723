"""How often things of each class stand in rooms (data/class_counts.toml)."""

from __future__ import annotations

from functools import cache

from scenewright.schemas.base import Model
from scenewright.schemas.outside import file_toml
from scenewright.schemas.places import REINSTALL, data_file

FILE = "class_counts.toml"


class ClassCounts(Model):
    """Counts of annotated things."""

    nameless: int
    """Things whose label is no class of the vocabulary."""
    rare: int
    """What a class counts that is not listed."""
    counts: dict[str, int]

    def of(self, class_name: str) -> int:
        """Return the count of a class."""
        return self.counts.get(class_name, self.rare)


@cache
def class_counts() -> ClassCounts:
    """Read data/class_counts.toml once."""
    return ClassCounts.model_validate(file_toml(data_file(FILE), hint=REINSTALL))
