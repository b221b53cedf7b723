"""InterPreT: what was learned in sentences, a plan in words and pictures, tables."""

from __future__ import annotations

from scenewright.schemas.kitchen_plan import KitchenEvaluation, KitchenPlan
from scenewright.schemas.learned_domain import LearnedDomain
from scenewright.schemas.outside import LARGEST_SHOWN, file_text
from scenewright.stages.kit.viewing.canvas import Canvas


def draw_learned_domain(learned: LearnedDomain, canvas: Canvas) -> None:
    """Show what each predicate means, and what was said."""
    canvas.document("predicates", file_text(learned.path("predicates.txt"), LARGEST_SHOWN))
    turns = [
        f"{turn.speaker}: {turn.text}{'' if turn.believed else ' (no longer believed)'}"
        for turn in learned.info.dialogue
    ]
    canvas.document("dialogue", "\n\n".join(turns))


def draw_kitchen_plan(plan: KitchenPlan, canvas: Canvas) -> None:
    """Show what came of a goal."""
    steps = [f"- {' '.join(step.action)}{': ' + step.failed if step.failed else ''}" for step in plan.info.steps]
    canvas.document("plan", "\n".join([plan.info.statement, "", *steps]))


def draw_kitchen_evaluation(evaluation: KitchenEvaluation, canvas: Canvas) -> None:
    """Show the tables."""
    canvas.document("sets", file_text(evaluation.path("table.md"), LARGEST_SHOWN))
