"""What an action is. Points are world [m], angles in the table's plane [rad]: the direction in which the jaws close."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, Self

from scenewright.schemas.tableware_plan import ActionFields
from scenewright.stages.tableware.planning.rules import letters
from scenewright.stages.tableware.planning.time_model import Chances, TimeModel
from scenewright.stages.tableware.world.items import Item, Table

POINT = tuple[float, float, float]


class Action(ABC):
    """Primitives that are carried out one after the other, without looking in between."""

    name: ClassVar[str]
    """Of its file, and in artifacts."""
    verb: ClassVar[str]

    @property
    @abstractmethod
    def parts(self) -> tuple[Primitive, ...]:
        """What is done, in order."""

    @abstractmethod
    def renamed(self, names: Mapping[str, str]) -> Self:
        """Return the action with its things called by other names; those that have none keep theirs."""

    @abstractmethod
    def fields(self) -> ActionFields:
        """Return the action as artifacts hold it."""

    @classmethod
    @abstractmethod
    def of_fields(cls, fields: Any) -> Self:
        """Return the action of an artifact."""

    @property
    def about(self) -> tuple[str, ...]:
        """The things that are meant: of what is done first."""
        return self.parts[0].about

    @property
    def words(self) -> str:
        """The action as people read it."""
        return self.fields().words

    def seconds(self, model: TimeModel) -> float:
        """Return the seconds when nothing slips."""
        return sum(part.seconds(model) for part in self.parts)

    def risk(self, table: Table, chances: Chances) -> float:
        """Return the chance that something falls off the table."""
        all_held = 1.0
        for part in self.parts:
            all_held *= 1.0 - part.risk(table, chances)
        return 1.0 - all_held

    def meant(self, seen: Table) -> list[Item]:
        """Return the items that the action is about, of those that are seen."""
        return [seen.by_name[name] for name in self.about if name in seen.by_name]

    def in_kinds(self, seen: Table) -> str:
        """Return what is done with which piles, as `take cc|c`, `pull-grasp b to bu`, `stack u on b`."""
        piles = (letters((item, *seen.load(item.name))) for item in self.meant(seen))
        return f"{self.verb} {self.parts[0].preposition.join(piles)}"


class Primitive(Action):
    """One motion; every world knows how to carry it out (simulation/fast.py, simulation/physics.py)."""

    preposition: ClassVar[str]
    """Between the piles that it is about."""

    @property
    def parts(self) -> tuple[Primitive, ...]:
        """Itself."""
        return (self,)

    @property
    @abstractmethod
    def about(self) -> tuple[str, ...]:
        """The things that are meant."""

    @property
    def moves(self) -> tuple[str, POINT] | None:
        """What comes to lie where else on the table; None when it is taken away."""
        return None

    @abstractmethod
    def seconds(self, model: TimeModel) -> float:
        """Return the seconds when nothing slips."""

    @abstractmethod
    def risk(self, table: Table, chances: Chances) -> float:
        """Return the chance that something falls off the table."""

    @abstractmethod
    def after(self, table: Table) -> Table:
        """Return the table when it went as planned."""
