"""u_SG: a stacking, and the grasp of the pile."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from scenewright.schemas.tableware_plan import StackGraspFields
from scenewright.stages.tableware.actions.grasp import Grasp, grasp
from scenewright.stages.tableware.actions.stack import Stack, bottom_of, stack
from scenewright.stages.tableware.planning.action import Action, Primitive
from scenewright.stages.tableware.world.items import Table


@dataclass(frozen=True)
class StackGrasp(Action):
    """u_SG."""

    name = "stack_grasp"
    verb = "stack-grasp"

    u_S: Stack
    u_G: Grasp

    @property
    def parts(self) -> tuple[Primitive, ...]:
        """The stacking, then the grasp."""
        return self.u_S, self.u_G

    def renamed(self, names: Mapping[str, str]) -> StackGrasp:
        """Return stacking and grasp of things by other names."""
        return StackGrasp(self.u_S.renamed(names), self.u_G.renamed(names))

    def fields(self) -> StackGraspFields:
        """Return u_SG."""
        return StackGraspFields(u_S=self.u_S.fields(), u_G=self.u_G.fields())

    @classmethod
    def of_fields(cls, fields: StackGraspFields) -> StackGrasp:
        """Return stacking and grasp of an artifact."""
        return cls(Stack.of_fields(fields.u_S), Grasp.of_fields(fields.u_G))


ACTION = StackGrasp


def stack_grasp(table: Table, item: str, onto: str) -> StackGrasp:
    """Return a stacking and the grasp of the pile."""
    put = stack(table, item, onto)
    return StackGrasp(put, grasp(put.after(table), bottom_of(table, onto).name))
