"""Kind `plan`: symbolic plan, motions, what happened when it was executed, or why there is none."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field, model_validator
from pydantic.json_schema import SkipJsonSchema
from scenewright.schemas.artifact import Artifact, Document
from scenewright.schemas.base import Model, Transform
from scenewright.schemas.contact_graph import ContactGraphFile


class Failure(Model):
    """Why something failed, with names and numbers; the same record goes to people and to language models."""

    kind: str
    """`goal_unsatisfiable`, `no_inverse_kinematics`, `goal_in_collision`, `start_in_collision`, `no_path`,
    `joint_limit`, `no_grasp`, `no_placement`, `grasp_lost`, `condition_not_met`, ..."""
    message: str
    action: str | None = None
    objects: tuple[str, ...] = ()
    numbers: dict[str, float] = {}


class TriedPlan(Model):
    """A plan that the task search gave to geometry."""

    actions: tuple[str, ...]
    failed_action: int | None = None
    """Index of the first action without a motion; None: every action has one."""
    failure: Failure | None = None
    """Why that action has none; None exactly where `failed_action` is."""

    @model_validator(mode="after")
    def _names_what_failed(self) -> TriedPlan:
        if (self.failed_action is None) != (self.failure is None):
            raise ValueError("`failed_action` and `failure` go together: give both or neither")
        if self.failed_action is not None and not 0 <= self.failed_action < len(self.actions):
            raise ValueError(f"`failed_action` {self.failed_action} is none of the {len(self.actions)} actions")
        return self


class PlannedAction(Model):
    """One step of the plan with its motion."""

    name: str
    """`drive`, `pick`, `place`, `open`, `close`."""
    arguments: tuple[str, ...]
    start: int
    end: int
    """Half-open range of rows in trajectory.npz."""
    base_pose: Transform
    """world_from_base during the action (at its end, for `drive`)."""


class Check(Model):
    """One condition of the goal, checked after execution."""

    condition: str
    holds: bool
    detail: str
    numbers: dict[str, float] = {}
    margin: float | None = Field(default=None, exclude_if=lambda value: value is None)
    """Distance to the threshold in standard deviations of eight rooms that came to rest from poses 0.1 mm and 0.01
    degrees apart; below 2 it is marginal. Absent where the threshold is far, or there is none."""
    slack: SkipJsonSchema[float | None] = Field(default=None, exclude=True, repr=False)
    """Share of what is allowed that is left before the nearest threshold, negative beyond it. Not in the file."""


class BodyMatch(Model):
    """Which body of the room where the plan was executed a body of the planned scene was taken for."""

    body: str
    matched: str | None
    """None: no body of its class stands near enough."""
    distance: float | None = None
    """Between the centres of their boxes [m]."""


class TreeDifference(Model):
    """Where the kinematic tree after an action is not as planned."""

    action: int
    """Index into `actions`."""
    node: str
    """A body, or a joint."""
    expected: str
    """What was to carry the body (`hand`: held), or `open`, `closed`, `between`."""
    observed: str
    """The same in the room, read off contacts and joint values; `nothing` under it, `room:<name>` for a body of the
    room that the planned scene does not have."""


class PlanFile(Model):
    """plan.json."""

    goal: tuple[str, ...]
    """Ground goal literals, e.g. `on(bottle_7, table_3)`, `closed(fridge_2)`."""
    planned_in: str
    executed_in: str | None
    """`reconstructed` or `ground_truth` room."""
    actions: tuple[PlannedAction, ...]
    failures: tuple[Failure, ...] = ()
    """Every failure met on the way, the last is the one that ended the search when there is no plan."""
    tried: tuple[TriedPlan, ...] = ()
    """Task plans in the order in which geometry tried them."""
    checks: tuple[Check, ...] = ()
    status: Literal["executed", "planned", "infeasible", "execution_failed"]
    matches: tuple[BodyMatch, ...] = ()
    """Bodies that the plan names, and what they are in the room of execution."""
    bumps: dict[str, float] = {}
    """Bodies of the room that something other than hand and fingers touched during execution -> largest force [N]."""
    assumptions: tuple[str, ...] = ()
    """What planning took for given and the execution was allowed to know beyond the planned scene, in words."""
    task: str | None = Field(default=None, exclude_if=lambda value: value is None)
    """The task by name whose goal this is. Absent for goals that were given as literals."""
    planner: str | None = Field(default=None, exclude_if=lambda value: value is None)
    """What searched for the task plan: `builtin` or `fast-downward`. Absent in plans from before there was a choice."""
    learned: tuple[str, ...] = Field(default=(), exclude_if=lambda value: not value)
    """What failed motions taught the task search, in words and in order."""
    replanned: tuple[int, ...] = Field(default=(), exclude_if=lambda value: not value)
    """Indices of the actions at which the robot looked around and planned anew, as something had gone otherwise."""
    margin: float | None = Field(default=None, exclude_if=lambda value: value is None)
    """Of the verdict, as in the checks: of `executed` the least, of `execution_failed` that of all that fails."""
    tree_differences: tuple[TreeDifference, ...] = Field(default=(), exclude_if=lambda value: not value)
    """Where the kinematic tree in the room was not as planned after an action."""


class Plan(Artifact):
    """`plan.json`, `domain.pddl`, `problem.pddl`, `plan.txt`, `trajectory.npz` (`time` (N,), `joints` (N, J + 2),
    `world_from_base` (N, 4, 4), `action` (N,)), `keyframes/<k>_<action>.png`, `execution.mcap` (FrameTransforms
    of every body and link, a CompressedImage stream), `graph.json` (the updated contact graph), `graphs/<k>.json` (the
    graph after action k; drives have none)."""

    kind: ClassVar[str] = "plan"
    description: ClassVar[str] = "task and motion plan, its execution and the updated contact graph"
    info = Document(PlanFile, "plan.json")
    graph = Document(ContactGraphFile, "graph.json")
