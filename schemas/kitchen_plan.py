"""Kinds `kitchen_plan` (a goal in words, tried in the kitchen) and `kitchen_evaluation` (sets of tasks, counted)."""

from __future__ import annotations

from typing import ClassVar

from pydantic import Field
from scenewright.schemas.artifact import Artifact, Document
from scenewright.schemas.base import Model
from scenewright.schemas.learned_domain import AtomWords, Name, Text


class KitchenStep(Model):
    """An action, and why it failed (empty: it did not)."""

    action: AtomWords
    failed: Text


class KitchenPlanFile(Model):
    """plan.json."""

    domain: Name
    goal: Text
    wanted: tuple[AtomWords, ...]
    """What the goal means, in learned predicates."""
    success: bool
    """Whether what was wanted holds at the end, by the teacher's truth."""
    steps: tuple[KitchenStep, ...]
    missing: Text
    """What was never taught, when that is why there is no plan."""
    unread: Text = ""
    """What the sentence of a task lacks; then it was planned for what the task wants besides."""
    statement: Text


class KitchenPlan(Artifact):
    """`plan.json`, `kitchen.png` (before, after), `kitchen.gif`."""

    kind: ClassVar[str] = "kitchen_plan"
    description: ClassVar[str] = "a goal in words, tried in the kitchen"
    undigested: ClassVar[tuple[str, ...]] = ("timings.json",)
    info = Document(KitchenPlanFile, "plan.json")


class TriedTask(Model):
    """One task of one's own."""

    name: Name
    sentence: Text
    unread: Text
    """What the sentence lacks; empty: it was understood, as what the task wants."""
    reached: bool
    actions: int = Field(ge=0)
    why: Text
    """Why it was not reached."""


class EvaluatedSet(Model):
    """Tasks of one set."""

    which: Name
    tasks: int = Field(ge=1)
    reached: int = Field(ge=0)
    ceiling: int = Field(ge=0)
    """Reached by the teacher's own operators."""
    unplanned: int = Field(ge=0)
    """Without a plan, or with a goal that nobody explained."""
    failed_actions: int = Field(ge=0)
    understood: int | None = Field(default=None, ge=0)
    """Sentences that mean what the task wants; None where nobody said any."""
    tried: tuple[TriedTask, ...] = ()
    """Tasks of one's own."""


class KitchenEvaluationFile(Model):
    """results.json."""

    domain: Name
    seed: int
    rows: tuple[EvaluatedSet, ...]
    accuracy: dict[Name, float]
    """Learned predicate -> balanced accuracy against what the teacher means, where she means something by it."""


class KitchenEvaluation(Artifact):
    """`results.json`, `table.md`."""

    kind: ClassVar[str] = "kitchen_evaluation"
    description: ClassVar[str] = "what was learned, on sets of tasks"
    undigested: ClassVar[tuple[str, ...]] = ("timings.json",)
    info = Document(KitchenEvaluationFile, "results.json")
