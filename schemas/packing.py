"""Kind `packing`: boxes packed into a basket by proposals and motion-planning feedback, or why not."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator
from scenewright.schemas.artifact import Artifact, Document
from scenewright.schemas.base import Model, Name
from scenewright.schemas.plan import Failure

Side = Annotated[float, Field(ge=0.01, le=0.4)]
Height = Annotated[float, Field(ge=0.02, le=0.4)]
Coordinate = Annotated[float, Field(ge=-1.5, le=1.5)]
MOST_BOXES, MOST_OBSTACLES = 16, 16
"""Most boxes and obstacles; bounds, by eye."""
TABLE_TOP, BASKET_TOP = 0.005, 0.007
"""World z [m] of the table's surface and of the basket's, as in the published environment."""
BASKET_SLAB = 0.01
"""Thickness of the basket [m]: a slab without walls."""


class PackingBox(Model):
    """A box where it starts on the table: extents along its own axes, centre (x, y) [m], yaw [rad]."""

    name: Name
    width: Side
    length: Side
    height: Height
    x: Coordinate
    y: Coordinate
    yaw: float = Field(0.0, ge=-3.15, le=3.15)


class PackingArea(Model):
    """An axis-aligned rectangle of the table's plane: low and high corner (x, y) [m]."""

    low: tuple[Coordinate, Coordinate]
    high: tuple[Coordinate, Coordinate]

    @model_validator(mode="after")
    def _has_an_area(self) -> PackingArea:
        if any(high - low < 0.01 for low, high in zip(self.low, self.high, strict=True)):
            raise ValueError("`high` must be at least 0.01 m beyond `low` in x and in y")
        return self


class PackingObstacle(PackingArea):
    """A fixed block that stands on the table or in the basket, up to the world height `top` [m]."""

    name: Name
    top: float = Field(ge=0.02, le=1.0)


class PackingInstanceFile(Model):
    """instance.json, and what `pack --problem` reads. The robot stands at the origin and faces +x; the table's surface
    is at z = 0.005 m, the basket is a slab without walls."""

    boxes: tuple[PackingBox, ...] = Field(min_length=1, max_length=MOST_BOXES)
    basket: PackingArea
    obstacles: tuple[PackingObstacle, ...] = Field((), max_length=MOST_OBSTACLES)

    @model_validator(mode="after")
    def _names_differ(self) -> PackingInstanceFile:
        names = [box.name for box in self.boxes] + [obstacle.name for obstacle in self.obstacles]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"two things are called {name!r}")
            if name in ("basket", "table", "hand"):
                raise ValueError(f"{name!r} is taken: choose another name")
        return self


class PackingStep(Model):
    """An action of a proposed plan and what motion planning said to it."""

    name: Literal["pick", "place"]
    box: str
    x: float | None = None
    y: float | None = None
    yaw: float | None = None
    tried: bool
    """Actions after the first failed one are not tried."""
    failure: Failure | None = None


class PackingAttempt(Model):
    """One proposed plan."""

    steps: tuple[PackingStep, ...]
    task: Failure | None = None
    """`not_in_basket`: every action was feasible and the goal does not hold."""


class PackingFile(Model):
    """packing.json."""

    name: str
    """`published/<cell>/<instance>`, `hard/<cell>/<instance>`, or the name of the user's file."""
    proposer: str
    robot: str = Field("panda", exclude_if=lambda name: name == "panda")
    """Name of the arm, as its description has it. Absent: the Panda."""
    success: bool
    proposer_calls: int
    """What the thesis calls #LM."""
    motion_planner_calls: int
    """What the thesis calls #MP: every action that was not carried over from the plan before."""
    attempts: tuple[PackingAttempt, ...]
    stopped: Failure | None = None
    """Why a proposer gave up: a language model's budget, or no answer."""


class Packing(Artifact):
    """`packing.json`, `instance.json`, `plan.txt`, `trajectory.npz` (`joints` (N, J), `action` (N,) row of the plan),
    `layout.png` (basket from above), `attempts.png` (plans with the reason at each cut branch), `scene.png` (the end);
    `transcript.jsonl` when a language model was asked."""

    kind: ClassVar[str] = "packing"
    description: ClassVar[str] = "boxes packed by proposals and motion-planning feedback"
    info = Document(PackingFile, "packing.json")
    instance = Document(PackingInstanceFile, "instance.json")
