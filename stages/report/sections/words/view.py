"""What words mean, for the page: predicates with their examples, operators, the dialogue, a goal that was tried."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from scenewright.schemas.artifact import Artifact
from scenewright.schemas.kitchen_plan import KitchenEvaluation, KitchenPlan
from scenewright.schemas.learned_domain import LearnedDomain, LearnedDomainFile
from scenewright.schemas.outside import LARGEST_SHOWN, file_text
from scenewright.stages.report.images import Picture, from_file
from scenewright.stages.report.page import Page

WIDTH = 1100
"""Largest width of pictures [px]."""
MOST_TURNS = 400
"""Most turns of the dialogue that are listed."""


@dataclass(frozen=True)
class PredicateRow:
    """A learned predicate."""

    name: str
    said: str
    heard: tuple[str, ...]
    """The complaints that it was learned of; none: it was given."""
    holds: int
    """Examples of which it is known to hold."""
    fails: int


def view(page: Page) -> dict[str, Any] | None:
    """Return what was learned, planned and counted, whichever is there."""
    learned = page.given("learned", LearnedDomain)
    plan = page.given("kitchen_plan", KitchenPlan)
    evaluation = page.given("kitchen_evaluation", KitchenEvaluation)
    if learned is None and plan is None and evaluation is None:
        return None
    file = learned.info if learned is not None else None
    return {
        "learned": file,
        "rows": predicate_rows(file) if file is not None else (),
        "operators": file_text(learned.path("domain.pddl"), LARGEST_SHOWN) if learned is not None else "",
        "turns": file.dialogue[:MOST_TURNS] if file is not None else (),
        "hidden": max(0, len(file.dialogue) - MOST_TURNS) if file is not None else 0,
        "holding": _picture(learned, "predicates", "Where each predicate holds"),
        "learning": _picture(learned, "learning", "Predicates and operators over the steps of training"),
        "plan": plan.info if plan is not None else None,
        "kitchen": _picture(plan, "kitchen", "The kitchen before and after"),
        "evaluation": evaluation.info if evaluation is not None else None,
    }


def predicate_rows(file: LearnedDomainFile) -> tuple[PredicateRow, ...]:
    """Return the predicates with the complaints and the examples behind them."""
    rows = []
    for predicate in file.predicates:
        phrases = [phrase for phrase in file.phrases if phrase.predicate == predicate.name]
        examples = [example.holds for phrase in phrases for example in phrase.examples]
        meaning = predicate.said.split(": ", 1)[-1]
        texts = tuple(phrase.text for phrase in phrases)
        rows.append(PredicateRow(predicate.name, meaning, texts, sum(examples), len(examples) - sum(examples)))
    return tuple(rows)


def _picture(artifact: Artifact | None, name: str, caption: str) -> Picture | None:
    path = artifact.path(f"{name}.png") if artifact is not None else None
    return from_file(path, caption, WIDTH) if path is not None and path.is_file() else None
