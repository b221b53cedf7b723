"""Kinds `cutting_plan` (cuts towards a goal, or why not), `cutting_trial` (on a board), `cutting_evaluation`."""

from __future__ import annotations

from typing import ClassVar

from pydantic import Field, model_validator
from scenewright.schemas.artifact import Artifact, Document
from scenewright.schemas.base import Model, Vector3
from scenewright.schemas.cutting_demonstrations import CategoryName, CuttingPlane, PieceNumber
from scenewright.schemas.plan import Failure


class WantedFragment(Model):
    """A fragment of the goal: edges of the box with its moments, shortest first [m], volume [m^3]."""

    edges: Vector3
    volume: float = Field(gt=0.0)
    name: str = ""
    """What it is called, where the goal was given in words."""


class PlannedCut(Model):
    """A cut of one piece, in the world frame and in the piece's canonical frame [m]."""

    piece: PieceNumber
    plane: CuttingPlane
    in_fragment: CuttingPlane
    results: tuple[PieceNumber, ...]
    said: str
    types: tuple[int, ...] = ()
    """Types, by our grammar, of the piece and of the two largest fragments."""
    chance: float | None = None
    """Probability of that rule, given the type of the piece."""
    stroke: int | None = None
    """Which time the knife went down: one stroke may cut several pieces."""
    likeness: float | None
    """About the overlap that this piece's fragments were expected to reach with what is wanted."""


class WordMet(Model):
    """How many fragments are what a word of the goal says, by their shape."""

    name: CategoryName
    wanted: int = Field(ge=1)
    made: int = Field(ge=0)
    """Fragments that are what the word says."""
    evenness: float = Field(ge=1.0)
    """The largest over the smallest, of one thing: thickness of slices, volume of everything else."""
    said: str


class CuttingScores(Model):
    """How the fragments match those of the goal."""

    iou_thesis: float
    """Mean best-matched intersection over union, unmatched fragments left out."""
    iou: float
    """Unmatched fragments counted as zero."""
    count_error: int
    volume_error: float
    shape_distance: float


class CuttingPlanFile(Model):
    """plan.json."""

    method: str
    goal: str
    """Where the goal comes from, in words."""
    objects: int = Field(ge=1)
    wanted: tuple[WantedFragment, ...] = Field(min_length=1, max_length=256)
    goal_bodies: int = Field(ge=0)
    """Fragments of the goal that are there as bodies."""
    cuts: tuple[PlannedCut, ...]
    refusals: tuple[Failure, ...]
    stopped: Failure | None
    scores: CuttingScores | None
    """None for a goal in words."""
    words: tuple[WordMet, ...] = ()
    """Of a goal in words."""
    sure: float | None
    """Likeness that was expected before the first cut; None for a goal in words."""
    doubt: float | None = Field(None, ge=0.0, le=1.0)
    """By which share the volumes of the goal may be off, where it was seen on pictures."""
    notes: tuple[str, ...] = ()
    """What was mended of the user's meshes."""
    statement: str

    @model_validator(mode="after")
    def _goal_bodies_are_wanted(self) -> CuttingPlanFile:
        if self.goal_bodies not in (0, len(self.wanted)):
            raise ValueError(f"{self.goal_bodies} bodies of {len(self.wanted)} wanted fragments")
        return self


class CuttingPlan(Artifact):
    """`plan.json`, `plan.txt`, `bodies.npz` (objects, then the goal's fragments where they are bodies, then what the
    cuts leave), `fragments.png` (before, after, and the goal, fragments apart),
    `tree.png` (the parse tree with the probabilities of its rules), `cuts.gif`."""

    kind: ClassVar[str] = "cutting_plan"
    description: ClassVar[str] = "cuts towards a goal"
    undigested: ClassVar[tuple[str, ...]] = ("timings.json",)
    info = Document(CuttingPlanFile, "plan.json")


class CuttingTrialFile(Model):
    """trial.json."""

    method: str
    goal: str
    cuts: int = Field(ge=0)
    fragments: int = Field(ge=1)
    wanted: int = Field(ge=1)
    refusals: tuple[Failure, ...]
    stopped: Failure | None
    scores: CuttingScores | None
    words: tuple[WordMet, ...] = ()
    """Of a goal in words."""
    fallen: int = Field(ge=0)
    """Fragments that rolled off the board."""
    missed: int | None = None
    """With cameras: pieces that none of them saw."""
    turned: float
    """Angle through which fragments turned as they came to rest, mean over fragments and cuts [rad]."""
    statement: str


class CuttingTrial(Artifact):
    """`trial.json`, `bodies.npz` (the fragments as they lie), `board.png` (before, after), `board.gif`; with cameras
    `seen/` (pictures of the fragments laid apart, which `cutting plan --goal-pictures` reads)."""

    kind: ClassVar[str] = "cutting_trial"
    description: ClassVar[str] = "things being cut on a board"
    info = Document(CuttingTrialFile, "trial.json")


class EvaluatedCutting(Model):
    """Means over the goals of a cell."""

    method: str
    cell: str
    goals: int
    iou: float
    iou_interval: tuple[float, float]
    iou_thesis: float
    count_exact: float
    count_error: float
    volume_error: float
    shape_distance: float


class CuttingEvaluationFile(Model):
    """results.json."""

    first_goal: int
    rows: tuple[EvaluatedCutting, ...]


class CuttingEvaluation(Artifact):
    """`results.json`, `table.md`."""

    kind: ClassVar[str] = "cutting_evaluation"
    description: ClassVar[str] = "methods of cutting compared over many goals"
    info = Document(CuttingEvaluationFile, "results.json")
