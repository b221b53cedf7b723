"""u_P: pull a thing over the table to another; a dish from inside, a utensil in a cage."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import atan2, pi

from scenewright.schemas.tableware_plan import PullFields
from scenewright.stages.tableware.planning.action import POINT, Primitive
from scenewright.stages.tableware.planning.rules import Rules, pull_end
from scenewright.stages.tableware.planning.time_model import Chances, TimeModel
from scenewright.stages.tableware.world.items import Table


@dataclass(frozen=True)
class Pull(Primitive):
    """u_P: `item` to `target`, from p_S to p_E."""

    name = "pull"
    verb, preposition = "pull", " to "

    item: str
    target: str
    p_S: POINT
    theta_S: float
    p_E: POINT
    theta_E: float

    @property
    def about(self) -> tuple[str, ...]:
        """What is pulled, and to what."""
        return self.item, self.target

    @property
    def moves(self) -> tuple[str, POINT]:
        """What is pulled, and where to."""
        return self.item, self.p_E

    def renamed(self, names: Mapping[str, str]) -> Pull:
        """Return the pull of things by other names."""
        return replace(self, item=names.get(self.item, self.item), target=names.get(self.target, self.target))

    def fields(self) -> PullFields:
        """Return u_P."""
        return PullFields(
            item=self.item, target=self.target, p_S=self.p_S, theta_S=self.theta_S, p_E=self.p_E, theta_E=self.theta_E
        )

    @classmethod
    def of_fields(cls, fields: PullFields) -> Pull:
        """Return the pull of an artifact."""
        return cls(fields.item, fields.target, fields.p_S, fields.theta_S, fields.p_E, fields.theta_E)

    def seconds(self, model: TimeModel) -> float:
        """Return the seconds of a pull."""
        return model.pull

    def risk(self, table: Table, chances: Chances) -> float:
        """Return the chance that something falls off the table."""
        return chances.drop_loaded_pull if table.carried.get(self.item) else chances.drop_pull

    def after(self, table: Table) -> Table:
        """Return the table when the pull does not miss."""
        return after_pull(table, self)


ACTION = Pull


def pull(table: Table, item: str, target: str, rules: Rules) -> Pull:
    """Return the pull of a thing to another."""
    pulled = table.by_name[item]
    x, y, yaw = pull_end(pulled, table.by_name[target], rules)
    z = pulled.position[2] + (
        pulled.measures.wall + 0.01 if pulled.is_dish else 0.0
    )  # a finger's breadth above the floor
    angle = atan2(y - pulled.position[1], x - pulled.position[0])
    start, end = (angle, angle) if pulled.is_dish else (pulled.yaw + pi / 2, yaw + pi / 2)
    return Pull(item, target, (pulled.position[0], pulled.position[1], z), start, (x, y, z), end)


def after_pull(table: Table, action: Pull, error: tuple[float, float] = (0.0, 0.0)) -> Table:
    """Return the table after a pull that missed its end by `error` (x, y) [m]."""
    item = table.by_name[action.item]
    yaw = None if item.is_dish else action.theta_E - pi / 2
    return table.moved(action.item, action.p_E[0] + error[0], action.p_E[1] + error[1], yaw=yaw)
