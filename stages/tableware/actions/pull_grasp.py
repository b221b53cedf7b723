"""u_PG: a pull, and the grasp of both."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from scenewright.schemas.tableware_plan import PullGraspFields
from scenewright.stages.tableware.actions.grasp import Grasp, grasp_two
from scenewright.stages.tableware.actions.pull import Pull, pull
from scenewright.stages.tableware.planning.action import Action, Primitive
from scenewright.stages.tableware.planning.rules import Rules
from scenewright.stages.tableware.world.items import Table


@dataclass(frozen=True)
class PullGrasp(Action):
    """u_PG."""

    name = "pull_grasp"
    verb = "pull-grasp"

    u_P: Pull
    u_G: Grasp

    @property
    def parts(self) -> tuple[Primitive, ...]:
        """The pull, then the grasp."""
        return self.u_P, self.u_G

    def renamed(self, names: Mapping[str, str]) -> PullGrasp:
        """Return pull and grasp of things by other names."""
        return PullGrasp(self.u_P.renamed(names), self.u_G.renamed(names))

    def fields(self) -> PullGraspFields:
        """Return u_PG."""
        return PullGraspFields(u_P=self.u_P.fields(), u_G=self.u_G.fields())

    @classmethod
    def of_fields(cls, fields: PullGraspFields) -> PullGrasp:
        """Return pull and grasp of an artifact."""
        return cls(Pull.of_fields(fields.u_P), Grasp.of_fields(fields.u_G))


ACTION = PullGrasp


def pull_grasp(table: Table, item: str, target: str, rules: Rules) -> PullGrasp:
    """Return a pull and the grasp of both where they then should be."""
    first = pull(table, item, target, rules)
    return PullGrasp(first, grasp_two(first.after(table), target, item))
