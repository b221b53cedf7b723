"""A robot acts: actions, key frames, what was checked afterwards."""

from __future__ import annotations

from typing import Any

from scenewright.schemas.plan import Plan
from scenewright.stages.report.acting import plan_view
from scenewright.stages.report.page import Page

WIDTH = 640
"""Width of pictures [px]."""


def view(page: Page) -> dict[str, Any] | None:
    """Return the plan with its pictures."""
    plan = page.given("plan", Plan)
    if plan is None:
        return None
    drawn = plan_view(plan, page.parameters.keyframes, WIDTH)
    return {"plan": drawn, "plan_ok": all(check.holds for check in plan.info.checks)}
