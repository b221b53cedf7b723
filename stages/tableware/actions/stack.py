"""u_S: lift a thing with its load and put it onto another."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from scenewright.schemas.tableware_plan import StackFields
from scenewright.stages.tableware.actions.grasp import Grasp, grasp, jaws_close
from scenewright.stages.tableware.planning.action import POINT, Primitive
from scenewright.stages.tableware.planning.time_model import Chances, TimeModel
from scenewright.stages.tableware.world.items import Item, Table, stand_height


@dataclass(frozen=True)
class Stack(Primitive):
    """u_S: `u_G.items[0]` onto `onto`."""

    name = "stack"
    verb, preposition = "stack", " on "

    u_G: Grasp
    onto: str
    p_L: POINT
    theta_L: float

    @property
    def item(self) -> str:
        """What is lifted."""
        return self.u_G.items[0]

    @property
    def about(self) -> tuple[str, ...]:
        """What is lifted, and onto what it is put."""
        return self.item, self.onto

    @property
    def moves(self) -> tuple[str, POINT]:
        """What is lifted, and where it is put."""
        return self.item, self.p_L

    def renamed(self, names: Mapping[str, str]) -> Stack:
        """Return the stacking of things by other names."""
        return replace(self, u_G=self.u_G.renamed(names), onto=names.get(self.onto, self.onto))

    def fields(self) -> StackFields:
        """Return u_S."""
        return StackFields(u_G=self.u_G.fields(), onto=self.onto, p_L=self.p_L, theta_L=self.theta_L)

    @classmethod
    def of_fields(cls, fields: StackFields) -> Stack:
        """Return the stacking of an artifact."""
        return cls(Grasp.of_fields(fields.u_G), fields.onto, fields.p_L, fields.theta_L)

    def seconds(self, model: TimeModel) -> float:
        """Return the seconds of a stacking."""
        return model.stack

    def risk(self, table: Table, chances: Chances) -> float:
        """Return the chance that something falls off the table."""
        return chances.drop_stack

    def after(self, table: Table) -> Table:
        """Return the table with a higher pile."""
        return after_stack(table, self)


ACTION = Stack


def stack(table: Table, item: str, onto: str, angle: float = 0.0) -> Stack:
    """Return the stacking of a thing with its load onto the top of the pile that `onto` stands in."""
    top = top_of(table, onto)
    z = stand_height(table, table.by_name[item], top.name)
    base = top.position
    return Stack(grasp(table, item, angle), top.name, (base[0], base[1], z), jaws_close(table.by_name[item], angle))


def after_stack(table: Table, action: Stack) -> Table:
    """Return the table after a stacking; tapered walls centre a dish (section 6.3)."""
    base = table.by_name[action.onto].position
    return table.moved(action.item, base[0], base[1], on=action.onto)


def top_of(table: Table, name: str) -> Item:
    """Return the highest thing of the pile that `name` stands in."""
    load = table.load(name)
    return load[-1] if load else table.by_name[name]


def bottom_of(table: Table, name: str) -> Item:
    """Return what the pile that `name` stands in has on the table."""
    item = table.by_name[name]
    while item.on is not None:
        item = table.by_name[item.on]
    return item
