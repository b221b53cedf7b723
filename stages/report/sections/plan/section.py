"""Declaration of the section `plan`."""

from __future__ import annotations

from scenewright.schemas.plan import Plan
from scenewright.stages.report.section import Section

BECAME = {
    "executed": "a plan that a robot executed",
    "execution_failed": "a plan whose execution failed",
    "planned": "a plan",
}


def _became(plan: Plan) -> str:
    return BECAME.get(plan.info.status, "an attempt to plan that found no way")


SECTION = Section("plan", "Plan", order=70, reads={"plan": Plan}, became={"plan": _became})
