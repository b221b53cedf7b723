"""Actions as artifacts hold them: the fields of equations 6.1 to 6.5 (Srinivas 2024)."""

from __future__ import annotations

from scenewright.schemas.tableware_plan import TablewareAction
from scenewright.stages.tableware import actions
from scenewright.stages.tableware.found_by_place import module_named
from scenewright.stages.tableware.planning.action import Action
from scenewright.stages.tableware.planning.time_model import Chances, TimeModel
from scenewright.stages.tableware.world.items import Table


def as_record(action: Action, table: Table, model: TimeModel, chances: Chances) -> TablewareAction:
    """Return an action on `table` for JSON, with its seconds when nothing slips and its risk."""
    return TablewareAction.of(
        action.name, action.fields(), seconds=action.seconds(model), risk=action.risk(table, chances)
    )


def as_action(record: TablewareAction) -> Action:
    """Return the action of an artifact."""
    action: Action = module_named(actions, record.name).ACTION.of_fields(record.fields)
    return action
