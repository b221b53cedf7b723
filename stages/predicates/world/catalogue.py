"""Objects and domains of the kitchen (data/kitchen/kitchen.toml)."""

from __future__ import annotations

from functools import cache
from typing import Literal

from pydantic import Field, model_validator
from scenewright.schemas.base import Model
from scenewright.schemas.outside import file_toml
from scenewright.schemas.places import REINSTALL, data_file

KITCHEN = data_file("kitchen/kitchen.toml")
DOMAINS = ("store_objects", "set_table", "cook_meal")
Goal = tuple[str, ...]
"""Literals as `on bread plate`."""


class Kind(Model):
    """A kind of object, lengths in the kitchen's units."""

    category: str
    width: float = Field(gt=0.0, le=60.0)
    height: float = Field(gt=0.0, le=60.0)
    shape: Literal["block", "container", "mat", "plate"]
    wall: float = Field(0.5, gt=0.0)
    at: float | None = None
    """Where it always stands at the beginning."""


class DomainSetup(Model):
    """A domain: actions, objects and goals of its sets of tasks."""

    actions: tuple[str, ...]
    objects: tuple[str, ...]
    more: tuple[str, ...]
    goals: tuple[tuple[Goal, ...], ...]
    more_goals: tuple[tuple[Goal, ...], ...]
    stacked: float = Field(ge=0.0, le=1.0)
    """How often a block stands on another thing at the beginning, where that may be."""
    novel: Goal
    combined: Goal


class KitchenFile(Model):
    """kitchen.toml."""

    objects: dict[str, Kind]
    domains: dict[str, DomainSetup]

    @model_validator(mode="after")
    def _objects_are_known(self) -> KitchenFile:
        for name, domain in self.domains.items():
            for object_name in (*domain.objects, *domain.more):
                if object_name not in self.objects:
                    raise ValueError(f"domain {name}: there is no object {object_name!r}")
        return self


@cache
def kitchen_file() -> KitchenFile:
    """Return the kitchen's catalogue."""
    return KitchenFile.model_validate(file_toml(KITCHEN, hint=REINSTALL))
