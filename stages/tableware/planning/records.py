"""Actions as artifacts hold them: the fields of equations 6.1 to 6.5."""

from __future__ import annotations

from schemas.tableware_plan import (
    GraspFields,
    PullFields,
    PullGraspFields,
    StackFields,
    StackGraspFields,
    TablewareAction,
)
from stages.tableware.planning.actions import Action, Grasp, Pull, PullGrasp, Stack, StackGrasp
from stages.tableware.planning.time_model import Chances, TimeModel
from stages.tableware.world.items import Table


def as_record(action: Action, table: Table, model: TimeModel, chances: Chances) -> TablewareAction:
    """Return an action on `table` for JSON, with its seconds when nothing slips and its risk."""
    seconds, risk = seconds_of(action, model), risk_of(action, table, chances)
    if isinstance(action, Grasp):
        return TablewareAction(name="grasp", u_G=_grasp(action), seconds=seconds, risk=risk)
    if isinstance(action, Pull):
        return TablewareAction(name="pull", u_P=_pull(action), seconds=seconds, risk=risk)
    if isinstance(action, Stack):
        return TablewareAction(name="stack", u_S=_stack(action), seconds=seconds, risk=risk)
    if isinstance(action, PullGrasp):
        both = PullGraspFields(u_P=_pull(action.u_P), u_G=_grasp(action.u_G))
        return TablewareAction(name="pull_grasp", u_PG=both, seconds=seconds, risk=risk)
    fields = StackGraspFields(u_S=_stack(action.u_S), u_G=_grasp(action.u_G))
    return TablewareAction(name="stack_grasp", u_SG=fields, seconds=seconds, risk=risk)


def as_action(record: TablewareAction) -> Action:
    """Return the action of an artifact."""
    if record.u_P is not None:
        return _as_pull(record.u_P)
    if record.u_PG is not None:
        return PullGrasp(_as_pull(record.u_PG.u_P), _as_grasp(record.u_PG.u_G))
    if record.u_S is not None:
        return _as_stack(record.u_S)
    if record.u_SG is not None:
        return StackGrasp(_as_stack(record.u_SG.u_S), _as_grasp(record.u_SG.u_G))
    assert record.u_G is not None  # the model has checked that one of the five is set
    return _as_grasp(record.u_G)


def seconds_of(action: Action, model: TimeModel) -> float:
    """Return the seconds of an action when nothing slips."""
    if isinstance(action, Pull):
        return model.pull
    if isinstance(action, Stack):
        return model.stack
    extra = model.pull if isinstance(action, PullGrasp) else model.stack if isinstance(action, StackGrasp) else 0.0
    return model.whole_trip + extra


def risk_of(action: Action, table: Table, chances: Chances) -> float:
    """Return the chance that an action lets something fall off the table."""

    def grasp(one: Grasp) -> float:
        return chances.drop_two if len(one.items) == 2 else chances.drop_single

    def pull(one: Pull) -> float:
        return chances.drop_loaded_pull if table.carried.get(one.item) else chances.drop_pull

    if isinstance(action, Grasp):
        return grasp(action)
    if isinstance(action, Pull):
        return pull(action)
    if isinstance(action, Stack):
        return chances.drop_stack
    first = pull(action.u_P) if isinstance(action, PullGrasp) else chances.drop_stack
    return 1.0 - (1.0 - first) * (1.0 - grasp(action.u_G))


def _grasp(action: Grasp) -> GraspFields:
    return GraspFields(items=action.items, p_G=action.p_G, theta_G=action.theta_G)


def _pull(action: Pull) -> PullFields:
    return PullFields(
        item=action.item, target=action.target, p_S=action.p_S, theta_S=action.theta_S, p_E=action.p_E,
        theta_E=action.theta_E,
    )  # fmt: skip


def _stack(action: Stack) -> StackFields:
    return StackFields(u_G=_grasp(action.u_G), onto=action.onto, p_L=action.p_L, theta_L=action.theta_L)


def _as_grasp(fields: GraspFields) -> Grasp:
    return Grasp(fields.items, fields.p_G, fields.theta_G)


def _as_pull(fields: PullFields) -> Pull:
    return Pull(fields.item, fields.target, fields.p_S, fields.theta_S, fields.p_E, fields.theta_E)


def _as_stack(fields: StackFields) -> Stack:
    return Stack(_as_grasp(fields.u_G), fields.onto, fields.p_L, fields.theta_L)
