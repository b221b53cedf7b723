"""Figures of a plan: what its checks say, and how it failed if it did."""

from __future__ import annotations

from scenewright.schemas.plan import PlanFile
from scenewright.stages.evaluate.results import Part
from scenewright.stages.kit.measurement.tables import Table


def measure_plan(part: Part, plan: PlanFile) -> None:
    """Record status, actions, and the checks made after execution."""
    part.set("executed", float(plan.status == "executed"))
    part.set("goal_reached", float(plan.status == "executed" and all(c.holds for c in plan.checks)))
    part.set("actions", len(plan.actions))
    part.set("checks", len(plan.checks))
    part.set("checks_held", sum(check.holds for check in plan.checks))
    part.set("failures_met", len(plan.failures))
    where = f"planned in the {plan.planned_in.replace('_', ' ')} room"
    if plan.executed_in:
        where += f", executed in the {plan.executed_in.replace('_', ' ')} room"
    part.tables.append(
        Table(
            "plan_checks",
            f"Goal conditions ({where})",
            ("condition", "holds", "detail"),
            tuple((c.condition, "yes" if c.holds else "no", c.detail) for c in plan.checks),
        )
    )
    part.tables.append(
        Table(
            "plan_failures",
            "Failures met on the way to the plan",
            ("kind", "action", "message"),
            tuple((f.kind, f.action, f.message) for f in plan.failures),
        )
    )
