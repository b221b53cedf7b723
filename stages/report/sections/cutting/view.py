"""Cutting for the page: statements, before and after, the parse tree with the overlap that each cut promised."""

from __future__ import annotations

from typing import Any

from scenewright.schemas.artifact import Artifact
from scenewright.schemas.cutting_plan import CuttingPlan, CuttingTrial
from scenewright.schemas.outside import LARGEST_SHOWN, file_text
from scenewright.stages.report.images import Picture, from_file
from scenewright.stages.report.page import Page

WIDTH = 1100
"""Largest width of pictures [px]."""


def view(page: Page) -> dict[str, Any] | None:
    """Return the plan and the trial, whichever are there."""
    plan, trial = page.given("cutting_plan", CuttingPlan), page.given("cutting_trial", CuttingTrial)
    if plan is None and trial is None:
        return None
    return {
        "plan": plan.info if plan is not None else None,
        "trial": trial.info if trial is not None else None,
        "tree": file_text(plan.path("plan.txt"), LARGEST_SHOWN) if plan is not None else "",
        "fragments": _picture(plan, "fragments", "Before, after, and what is wanted, fragments apart"),
        "parse": _picture(plan, "tree", "The parse tree, with the probability of each rule"),
        "board": _picture(trial, "board", "On the board: before, as the fragments lie, and apart"),
    }


def _picture(artifact: Artifact | None, name: str, caption: str) -> Picture | None:
    path = artifact.path(f"{name}.png") if artifact is not None else None
    return from_file(path, caption, WIDTH) if path is not None and path.is_file() else None
