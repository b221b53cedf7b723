"""Kinds `suture_trial`, running sutures in the simulator, and `suture_evaluation`, figures of trials and poses."""

from __future__ import annotations

from typing import ClassVar

from pydantic import Field, model_validator
from scenewright.schemas.artifact import Artifact, Document
from scenewright.schemas.base import Model, Seed
from scenewright.schemas.evaluation import MetricsFile


class SutureRun(Model):
    """What a trial came to. Errors are of classes I, E, H, T (Srinivas 2024, section 4.1), in order, with reason, the
    suture (0 first) and the second at which they happened; all but the last of a supervised trial were recovered.

    `sutures`: inserted, extracted, tensioned (section 4.1); `sutures_neutral`: also back at a neutral place without a
    tangle (section 2.2). `looks`, `right`, `abstained` count estimates of the needle.
    """

    arm: str
    seed: Seed
    sutures: int = Field(ge=0)
    sutures_neutral: int = Field(ge=0)
    attempts: int = Field(ge=0)
    seconds: float = Field(ge=0.0)
    errors: str = Field("", pattern="^[IEHT]*$")
    reasons: tuple[str, ...] = ()
    error_sutures: tuple[int, ...] = ()
    error_seconds: tuple[float, ...] = ()
    interventions: int = Field(0, ge=0)
    looks: int = Field(0, ge=0)
    right: int = Field(0, ge=0)
    abstained: int = Field(0, ge=0)
    stopped_short: int = Field(0, ge=0)
    thread_length: float = Field(0.0, ge=0.0)
    """[m]"""

    @model_validator(mode="after")
    def _every_error_has_a_reason(self) -> SutureRun:
        if len(self.reasons) != len(self.errors):
            raise ValueError(f"{len(self.errors)} errors have {len(self.reasons)} reasons")
        return self


class SutureEvent(Model):
    """A named moment of the recorded trial: a panel of figure 3.2, or a failure."""

    seconds: float
    suture: int
    what: str


class SuturePerception(Model):
    """How an arm sees the needle: an error model."""

    arm: str
    model: str
    measured: bool
    """False while its figures are assumed."""
    provenance: str


class SutureTrialFile(Model):
    """trial.json."""

    statement: str
    runs: tuple[SutureRun, ...] = Field(min_length=1)
    perception: tuple[SuturePerception, ...]
    world: dict[str, float]
    """The simulator's parameters, the same for every arm (docs/STITCH.md)."""
    recorded_arm: str
    recorded_seed: Seed
    events: tuple[SutureEvent, ...]
    """Of the recorded trial, as are frames.npz, motions.npz and the pictures."""


class SutureTrial(Artifact):
    """`trial.json`, `trial.txt`; of the recorded trial `frames.npz` (key frames: `panel`, `suture`, `seconds`,
    `world_from_tool` (F, 2, 4, 4; right, left), `world_from_needle` (F, 4, 4), `thread` (F, N, 3)), `motions.npz`
    (`seconds`, `arm` 0 right 1 left, `world_from_tool` (M, 4, 4), `world_from_needle` (M, 4, 4), `joints` (M, 6; NaN
    where no solution follows)), `strip.png` (the panels of figure 3.2)."""

    kind: ClassVar[str] = "suture_trial"
    description: ClassVar[str] = "running sutures thrown in a simulator"
    info = Document(SutureTrialFile, "trial.json")


class SutureEvaluation(Artifact):
    """`metrics.json` (`<arm>/<case>/<measure>` -> number), `table.md` (table 4.1 with the printed figures, and the
    needle's poses), `plots/*.png` (figure 4.1; errors of poses)."""

    kind: ClassVar[str] = "suture_evaluation"
    description: ClassVar[str] = "figures of suture trials and needle poses"
    info = Document(MetricsFile, "metrics.json")
