"""What an action is to the planner: symbols for the task search, a motion, its effect, and how it is carried out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Literal, Protocol

import numpy as np
from scenewright.schemas.plan import Check
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.kit.declared import declared_in
from scenewright.stages.kit.motion.physical_robot import PhysicalRobot
from scenewright.stages.kit.motion.segments import Manipulation
from scenewright.stages.kit.tasks.strips import Schema
from scenewright.stages.plan.believed_tree import TreeState
from scenewright.stages.plan.checks import GoalInRoom
from scenewright.stages.plan.pick_place import Budgets, GraspStyle
from scenewright.stages.plan.world_model import RobotState, WorldModel


class Execution(Protocol):
    """What an action sees of its own execution in the room (conduct.Conduct)."""

    model: WorldModel
    physical: PhysicalRobot

    def matched(self, body: str) -> str:
        """Return what a body of the plan is called in the room. Raises MotionFailed where it is not there."""
        ...

    def joint_in_room(self, joint: str) -> tuple[Joint, float]:
        """Return a joint of the plan as the room has it, and its value there [rad or m]."""
        ...

    def pose_in_room(self, body: str) -> np.ndarray:
        """Return the pose (4, 4) of a body of the plan in the room, by the frame of the shape that it is seen with."""
        ...

    def level(self, state: RobotState) -> RobotState:
        """Bring what the hand holds level; return the robot's state. Raises MotionFailed."""
        ...


@dataclass(frozen=True)
class MotionRequest:
    """What a motion is asked for with, beside the model and the robot's state."""

    arguments: tuple[str, ...]
    budgets: Budgets
    random: np.random.Generator
    preferred: tuple[np.ndarray, np.ndarray] | None = None
    """Base (3,) and grasp or place (4, 4) that are tried first."""
    style: GraspStyle = "any"
    """What the place where a grasped item goes next asks for."""
    base: np.ndarray | None = None
    """Base (3,) from which it is done; None: wherever that can be done."""
    further: tuple[str, ...] = ()
    """What is put where this is put, later: room is left for it."""


class PlanAction:
    """An action, as a file of `actions/` declares it under the name ACTION. Methods that are not overridden fit an
    action that changes joint values and nothing else."""

    name: str
    """What plans call its motion."""
    order: int
    """Place of its schemas in the domain, which breaks ties of the task search."""
    schemas: tuple[Schema, ...]
    """Symbolic variants: all of them have the one motion."""
    predicates: Mapping[str, tuple[str, ...]] = {}
    """Predicates that no other action needs -> types of their arguments."""
    goals: Mapping[str, Callable[[GoalInRoom], Check]] = {}
    """Predicates that a goal may name because of it -> whether one of them holds in the room."""
    has_motion: bool = True
    """Whether it has a motion of its own. A drive has none: its base pose belongs to the manipulation that follows."""
    hand: Literal["takes", "puts", "free"] = "free"
    """What becomes of the hand: it takes its first argument, puts it somewhere, or holds nothing throughout."""
    tied_to: int | None = None
    """Argument whose body a planned motion moves along with when the room shows it elsewhere; None: planned anew."""
    when_unmet: Literal["again", "stay", "back"] = "again"
    """What follows when its effect does not show: another attempt from there, or failure where the arm is or back on
    its way."""

    # --- planning ---------------------------------------------------------------------------------------------

    def target(self, arguments: tuple[str, ...]) -> str:
        """Return what the robot stands at for it."""
        return arguments[0]

    def begin(self, model: WorldModel, arguments: tuple[str, ...]) -> None:
        """Prepare the model before a motion is sought."""

    def manipulate(self, model: WorldModel, state: RobotState, request: MotionRequest) -> tuple[Manipulation, ...]:
        """Return its motions, one after another; never asked of an action without `has_motion`. Raises MotionFailed."""
        raise NotImplementedError(self.name)

    def grasp_style(self, model: WorldModel, item: str, arguments: tuple[str, ...]) -> GraspStyle | None:
        """Return how an item is to be grasped when this comes next; None when it is about something else."""
        return None

    def effect(
        self, model: WorldModel, state: RobotState, arguments: tuple[str, ...], manipulation: Manipulation
    ) -> RobotState:
        """Bring the model to what it is after a manipulation, and return the robot's state."""
        state = RobotState(manipulation.base, manipulation.segments[-1].path[-1, 3:])
        self.move_things(model, arguments, manipulation)
        for joint, value in manipulation.joint_values.items():
            model.move_joint(joint, value)
        return state

    def move_things(self, model: WorldModel, arguments: tuple[str, ...], manipulation: Manipulation) -> None:
        """Move in the model what the hand has let go of."""

    def predicted(self, tree: TreeState, arguments: tuple[str, ...], manipulation: Manipulation) -> TreeState:
        """Return the kinematic tree after a manipulation."""
        return replace(tree, joints={**tree.joints, **manipulation.joint_values})

    # --- execution --------------------------------------------------------------------------------------------

    def bodies(self, model: WorldModel, arguments: tuple[str, ...]) -> list[str]:
        """Return the planned bodies to look at before it, in order."""
        return [model.owner(arguments[0])]

    def moved_along(
        self, model: WorldModel, arguments: tuple[str, ...], manipulation: Manipulation, shift: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return base and grasp or place of a planned motion whose body stands `shift` (3,) [m] away from there; never
        asked of an action without `tied_to`."""
        raise NotImplementedError(self.name)

    def after_motion(self, conduct: Execution, state: RobotState, arguments: tuple[str, ...]) -> RobotState:
        """Return the state after what is done once the motion was carried out. Raises MotionFailed."""
        return state

    def check_effect(self, conduct: Execution, arguments: tuple[str, ...]) -> None:
        """Raises MotionFailed `condition_not_met` when the room is not as the action should leave it."""


@cache
def all_actions() -> tuple[PlanAction, ...]:
    """Return every declared action in the order of the domain."""
    return declared_in("scenewright.stages.plan.actions", PlanAction, "ACTION", "scenewright.actions")


@cache
def _by_name() -> Mapping[str, PlanAction]:
    by_action_name = {action.name: action for action in all_actions()}
    return {schema.name: action for action in all_actions() for schema in action.schemas} | by_action_name


def action_named(name: str) -> PlanAction:
    """Return the action of a schema or a motion. Raises KeyError."""
    return _by_name()[name]


@cache
def goal_checks() -> Mapping[str, Callable[[GoalInRoom], Check]]:
    """Return the predicates that a goal may name, and what tells whether one of them holds."""
    return {predicate: check for action in all_actions() for predicate, check in action.goals.items()}


def schemas_of_hand(hand: Literal["takes", "puts"]) -> frozenset[str]:
    """Return the names of the schemas by which the hand takes or puts something."""
    return frozenset(schema.name for action in all_actions() if action.hand == hand for schema in action.schemas)
