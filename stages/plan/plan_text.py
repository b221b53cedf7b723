"""plan.txt: the plan and what came of it, for people."""

from __future__ import annotations

from scenewright.schemas.plan import PlanFile
from scenewright.stages.kit.simulation.margins import is_marginal
from scenewright.stages.plan.refinement import Step


def plan_text(plan: PlanFile, steps: list[Step]) -> str:
    """Return the plan as plain text: goal, actions, checks, failures, assumptions."""
    lines = [f"goal: {', '.join(plan.goal) or 'none'}", f"status: {plan.status}{marginal(plan.margin)}"]
    where = f"planned in the {plan.planned_in} scene"
    if plan.executed_in is not None:
        where += f", executed in the {plan.executed_in.replace('_', ' ')} room"
    lines += [where, "", "actions:"]
    for number, (action, step) in enumerate(zip(plan.actions, steps, strict=True), start=1):
        if number - 1 in plan.replanned:
            lines.append("     looked around and planned anew:")
        x, y = action.base_pose[0][3], action.base_pose[1][3]
        lines.append(f"{number:3d}. {step.text}   base at ({x:.2f}, {y:.2f}) m, rows {action.start} to {action.end}")
    if not steps:
        lines.append("  none")
    if plan.checks:
        lines += ["", "checked after execution:"]
        lines += [
            f"  {'yes' if check.holds else 'NO '} {check.condition}: {check.detail}{marginal(check.margin)}"
            for check in plan.checks
        ]
    if plan.matches:
        lines += ["", "bodies of the plan in the room:"]
        for match in plan.matches:
            away = "" if match.distance is None else f" ({match.distance:.3f} m apart)"
            lines.append(f"  {match.body} is {match.matched or 'nowhere'}{away}")
    if plan.bumps:
        lines += ["", "touched by something other than hand and fingers:"]
        lines += [f"  {name}: {force:.0f} N" for name, force in plan.bumps.items()]
    if plan.failures:
        lines += ["", "failures on the way:"]
        for failure in plan.failures:
            in_action = f" in {failure.action}" if failure.action else ""
            lines.append(f"  {failure.kind}{in_action}: {failure.message}")
    if plan.assumptions:
        lines += ["", "what the execution was allowed to know:"]
        lines += [f"  - {text}" for text in plan.assumptions]
    return "\n".join([*lines, ""])


def marginal(margin: float | None) -> str:
    """Return what is added to a verdict that is nearly as likely to be the contrary."""
    return f" (marginal: {margin:.1f} standard deviations to its limit)" if is_marginal(margin) else ""
