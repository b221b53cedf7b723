"""Kinds `tableware_trial`, one policy clearing one table in a simulator, and `tableware_evaluation`, many of them."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field
from scenewright.schemas.artifact import Artifact, Document
from scenewright.schemas.base import Model, Name, Seed
from scenewright.schemas.tableware_plan import TablewareAction, TimesOfActions
from scenewright.schemas.tableware_scene import TablewareItem


class TrialStep(Model):
    """An action that was carried out, with the true table before and after it."""

    action: TablewareAction
    start: float
    """Seconds since the beginning, and at the end of the action."""
    end: float
    before: tuple[TablewareItem, ...]
    after: tuple[TablewareItem, ...]
    binned: tuple[Name, ...] = ()
    """What came to the bin."""
    dropped: tuple[Name, ...] = ()
    """What fell off the table."""
    troubles: tuple[str, ...] = ()
    """What did not go as planned, in words."""


class TrialCounts(Model):
    """What a trial came to."""

    seconds: float
    trips: int
    moved: int
    pulls: int
    stacks: int
    dropped: int
    left: int
    objects_per_trip: float
    failure: Literal["", "policy", "perception"]
    """`policy`: something was dropped; `perception`: something was left that nobody saw (section 7.1)."""


class TablewareTrialFile(Model):
    """trial.json."""

    policy: str
    """Or `plan` when the actions of a plan were carried out as they stand."""
    simulator: Literal["fast", "physics"]
    robot: str = Field("", exclude_if=lambda name: name in ("", "ur5_bench"))
    """Name of the arm in physics, as its description has it. Absent: the UR5 beside its table, or no arm."""
    sight: Literal["truth", "image"]
    """Whether the policy saw everything, or a new rendered image before each action."""
    times: TimesOfActions | None
    """None: seconds are those of the arm in physics."""
    chances: str
    counts: TrialCounts
    steps: tuple[TrialStep, ...]
    images: int = Field(0, ge=0)
    """Images that were rendered and looked at."""
    statement: str


class TablewareTrial(Artifact):
    """`trial.json`, `trial.txt`, `keyframes.png` (the table before each action), `physics.png` (moments of it, where
    that was in physics), `clearing.gif`, `shapes/<kind>.ply`."""

    kind: ClassVar[str] = "tableware_trial"
    description: ClassVar[str] = "a table being cleared in a simulator"
    info = Document(TablewareTrialFile, "trial.json")


class EvaluatedPolicy(Model):
    """Means over tables of one policy, with 95 % bootstrap intervals; ratios against Random on the same tables."""

    policy: str
    tier: str
    tables: int
    trials: int
    time: float
    time_interval: tuple[float, float]
    objects_per_trip: float
    objects_per_trip_interval: tuple[float, float]
    time_ratio: float | None
    objects_per_trip_ratio: float | None
    failure_rate: float
    failures_policy: int
    failures_perception: int
    no_slower_share: float | None = None
    """Share of the tables on which it took no longer than the better of Pull and Stack (expected seconds)."""


class TablewareEvaluationFile(Model):
    """results.json."""

    chances: str
    sight: Literal["truth", "image"]
    delay: float
    draws: int
    first_scene: Seed
    rows: tuple[EvaluatedPolicy, ...]


class TablewareEvaluation(Artifact):
    """`results.json` and `table.md`."""

    kind: ClassVar[str] = "tableware_evaluation"
    description: ClassVar[str] = "policies compared over many tables"
    info = Document(TablewareEvaluationFile, "results.json")
