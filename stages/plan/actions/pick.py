"""Pick an item up: off a support, with a load (`lift`), or out of furniture through a door (`take_out`)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scenewright.schemas.plan import Check
from scenewright.stages.kit.motion.segments import Manipulation
from scenewright.stages.kit.simulation.carriers import HAND
from scenewright.stages.kit.tasks.strips import Schema
from scenewright.stages.plan.action import Execution, MotionRequest, PlanAction
from scenewright.stages.plan.believed_tree import TreeState
from scenewright.stages.plan.checks import GoalInRoom
from scenewright.stages.plan.pick_place import plan_pick
from scenewright.stages.plan.world_model import RobotState, WorldModel


def check_held(goal: GoalInRoom) -> Check:
    """Whether the hand holds a thing."""
    detail = f"the hand holds {goal.held or 'nothing'}"
    return Check(condition=goal.literal, holds=goal.held == goal.bodies[0], detail=detail)


class Pick(PlanAction):
    """pick(item, from), lift(item, from), take_out(item, from, door)."""

    name = "pick"
    order = 20
    hand = "takes"
    tied_to = 0
    when_unmet = "back"
    goals = {"holding": check_held}
    schemas = (
        Schema(
            "pick",
            (("?item", "item"), ("?from", "support")),
            (("graspable", "?item"), ("near", "?item"), ("on", "?item", "?from"), ("clear", "?item"), ("hand_empty",)),
            (("holding", "?item"), ("clear", "?from")),
            (("on", "?item", "?from"), ("carried_along", "?item", "?from"), ("unmoved", "?item"), ("hand_empty",)),
        ),
        Schema(
            "lift",
            (("?item", "item"), ("?from", "support")),
            (
                ("graspable", "?item"),
                ("carrier", "?item"),
                ("near", "?item"),
                ("on", "?item", "?from"),
                ("hand_empty",),
            ),
            (("holding", "?item"), ("clear", "?from")),
            (("on", "?item", "?from"), ("unmoved", "?item"), ("hand_empty",)),
        ),
        Schema(
            "take_out",
            (("?item", "item"), ("?from", "container"), ("?door", "door")),
            (
                ("graspable", "?item"),
                ("near", "?item"),
                ("in", "?item", "?from"),
                ("behind", "?item", "?door"),
                ("open", "?door"),
                ("clear", "?item"),
                ("hand_empty",),
            ),
            (("holding", "?item"),),
            (("in", "?item", "?from"), ("behind", "?item", "?door"), ("hand_empty",)),
        ),
    )

    def begin(self, model: WorldModel, arguments: tuple[str, ...]) -> None:
        """What stands on the item becomes one body with it."""
        model.take_aboard(arguments[0])

    def manipulate(self, model: WorldModel, state: RobotState, request: MotionRequest) -> tuple[Manipulation, ...]:
        """Return the grasp and the lift. Raises MotionFailed as `plan_pick` does."""
        item, source = request.arguments[:2]
        return (
            plan_pick(
                model,
                state,
                item,
                source,
                request.budgets,
                request.random,
                request.preferred,
                request.style,
                request.base,
            ),
        )

    def effect(
        self, model: WorldModel, state: RobotState, arguments: tuple[str, ...], manipulation: Manipulation
    ) -> RobotState:
        """The item is in the hand."""
        arm = manipulation.segments[-1].path[-1, 3:]
        return RobotState(
            manipulation.base, arm, arguments[0], manipulation.tool_from_item, manipulation.body_from_tool
        )

    def predicted(self, tree: TreeState, arguments: tuple[str, ...], manipulation: Manipulation) -> TreeState:
        """The hand carries the item."""
        return replace(tree, parents={**tree.parents, arguments[0]: HAND}, held=arguments[0])

    def bodies(self, model: WorldModel, arguments: tuple[str, ...]) -> list[str]:
        """The item, what it stands on and what stands on it."""
        return [body for body in (*arguments[:2], *model.load(arguments[0])) if body in model.records]

    def moved_along(
        self, model: WorldModel, arguments: tuple[str, ...], manipulation: Manipulation, shift: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The grasp is tied to the item."""
        assert manipulation.body_from_tool is not None
        return manipulation.base + np.array([shift[0], shift[1], 0.0]), manipulation.body_from_tool

    def after_motion(self, conduct: Execution, state: RobotState, arguments: tuple[str, ...]) -> RobotState:
        """A laden tray that gave way in the fingers is levelled."""
        return conduct.level(state) if conduct.model.laden(arguments[0]) else state


ACTION = Pick()
