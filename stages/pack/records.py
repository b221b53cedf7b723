"""What the loop and its proposers say to each other: what is seen, plans, what motion planning said to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

from scenewright.schemas.plan import Failure
from scenewright.stages.pack.hand_shape import PUBLISHED, HandShape

TWO = tuple[float, float]


@dataclass(frozen=True)
class BoxState:
    """A box: extents along its own axes, width (x), length (y), height (z) at yaw 0 [m]; centre (x, y) [m] and yaw
    [rad] in the world frame."""

    name: str
    width: float
    length: float
    height: float
    x: float
    y: float
    yaw: float
    in_basket: bool


@dataclass(frozen=True)
class Rectangle:
    """An axis-aligned rectangle of the table's plane, world frame: low and high corner (x, y) [m]."""

    name: str
    low: TWO
    high: TWO


@dataclass(frozen=True)
class Observation:
    """The world as a proposer sees it before the first action of a plan. The robot's reach is not in it."""

    boxes: tuple[BoxState, ...]
    basket: Rectangle
    obstacles: tuple[Rectangle, ...] = ()
    hand: HandShape = PUBLISHED
    """That it is done with."""


@dataclass(frozen=True)
class Action:
    """`pick(box)` or `place(box, x, y, yaw)`: where the box's centre goes [m] and its yaw [rad]; None for a pick."""

    name: Literal["pick", "place"]
    box: str
    x: float | None = None
    y: float | None = None
    yaw: float | None = None


@dataclass(frozen=True)
class StepFeedback:
    """What the motion level said to one action; `failure` None: feasible. Actions after the first failed one were not
    tried and have no feedback. With reasons left out (`without reasons`) the kind stays in the record; the prompt
    does not show it."""

    action: Action
    failure: Failure | None = None
    """Kinds: `goal_in_collision` (objects: what is hit, then what hits it; numbers: depth [m]), `no_inverse_kinematics`
    (numbers: distance [m] to the nearest point in reach, nearest_x, nearest_y [m]), `joint_limit`, `no_path`,
    `unknown_object` (objects: the invented name), `wrong_order` (a place of what is not held, a pick while holding)."""


@dataclass(frozen=True)
class Attempt:
    """One proposed plan and what came of it. `task`: after a plan whose every action was feasible, which boxes are not
    in the basket (kind `not_in_basket`, `objects` their names); None when the goal holds or the plan was cut short."""

    actions: tuple[Action, ...]
    feedback: tuple[StepFeedback, ...]
    task: Failure | None = None


class Proposer(Protocol):
    """Proposes full plans from the initial state. `calls` counts what the thesis calls #LM (re-prompts after an
    unreadable reply are not counted)."""

    name: str
    calls: int

    def propose(self, observation: Observation, trace: Sequence[Attempt]) -> tuple[Action, ...]:
        """A full plan, given every attempt so far, oldest first (the proposer keeps to its last k itself). An empty
        plan is allowed: no action could be read from the reply; the loop gives it the task feedback."""
        ...
