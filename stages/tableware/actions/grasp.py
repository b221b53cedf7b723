"""u_G: lift one thing or two with their loads, and take them to the bin."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import cos, pi, sin

from scenewright.schemas.tableware_plan import GraspFields
from scenewright.stages.tableware.planning.action import POINT, Primitive
from scenewright.stages.tableware.planning.rules import grasp_centre
from scenewright.stages.tableware.planning.time_model import Chances, TimeModel
from scenewright.stages.tableware.world.items import Item, Table

BITE = 0.005
"""How far [m] the fingertips reach below the lowest lip that they hold (ours)."""


@dataclass(frozen=True)
class Grasp(Primitive):
    """u_G."""

    name = "grasp"
    verb, preposition = "take", "|"

    items: tuple[str, ...]
    p_G: POINT
    theta_G: float

    @property
    def about(self) -> tuple[str, ...]:
        """What is grasped."""
        return self.items

    def renamed(self, names: Mapping[str, str]) -> Grasp:
        """Return the grasp of things by other names."""
        return replace(self, items=tuple(names.get(item, item) for item in self.items))

    def fields(self) -> GraspFields:
        """Return u_G."""
        return GraspFields(items=self.items, p_G=self.p_G, theta_G=self.theta_G)

    @classmethod
    def of_fields(cls, fields: GraspFields) -> Grasp:
        """Return the grasp of an artifact."""
        return cls(fields.items, fields.p_G, fields.theta_G)

    def seconds(self, model: TimeModel) -> float:
        """Return the seconds of a trip."""
        return model.whole_trip

    def risk(self, table: Table, chances: Chances) -> float:
        """Return the chance that something falls off the table."""
        return chances.drop_two if len(self.items) == 2 else chances.drop_single

    def after(self, table: Table) -> Table:
        """Return the table without what is taken."""
        return table.without(taken(table, self))


ACTION = Grasp


def jaws_close(item: Item, angle: float) -> float:
    """Return in which direction [rad] jaws close on a thing: across a utensil, at `angle` on a dish's rim."""
    return item.yaw + pi / 2 if not item.is_dish else angle


def grasp(table: Table, name: str, angle: float = 0.0) -> Grasp:
    """Return the grasp of one thing with its load: a dish by the rim at `angle` [rad], perpendicular to the tangent; a
    utensil by its middle, across its axis."""
    item = table.by_name[name]
    x, y, z = item.position
    if item.is_dish:
        reach = item.measures.rim_radius - item.measures.wall / 2
        return Grasp((name,), (x + reach * cos(angle), y + reach * sin(angle), item.lip - BITE), angle)
    return Grasp((name,), (x, y, z), jaws_close(item, angle))


def grasp_two(table: Table, first: str, second: str) -> Grasp:
    """Return the grasp of two things that stand side by side, with their loads."""
    base, beside = table.by_name[first], table.by_name[second]
    x, y, angle = grasp_centre(base, beside)
    z = min(base.lip, beside.lip) - BITE if base.is_dish else 0.0
    return Grasp((first, second), (x, y, z), angle)


def taken(table: Table, action: Grasp) -> frozenset[str]:
    """Return the names of everything that a grasp lifts."""
    return frozenset(name for base in action.items for name in (base, *(carried.name for carried in table.load(base))))
