"""Put down what is held: on a support, on what is lifted later (`stack`), or into furniture (`put_in`)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.motion.segments import Manipulation
from scenewright.stages.kit.simulation.carriers import carried_by, carrier
from scenewright.stages.kit.tasks.strips import Schema
from scenewright.stages.plan.action import Execution, MotionRequest, PlanAction
from scenewright.stages.plan.believed_tree import TreeState
from scenewright.stages.plan.checks import check_in, check_on
from scenewright.stages.plan.pick_place import GraspStyle, plan_place
from scenewright.stages.plan.placements import PUT_DOWN_HEIGHT, nearest_level, placement_style
from scenewright.stages.plan.world_model import RobotState, WorldModel

MOST_TILT = 0.35
"""Largest tilt of what was put down and stands [rad]."""


class Place(PlanAction):
    """place(item, on), stack(item, on), put_in(item, in, door)."""

    name = "place"
    order = 30
    hand = "puts"
    tied_to = 1
    when_unmet = "stay"
    goals = {
        "on": lambda goal: check_on(goal.world, goal.literal, *goal.bodies[:2]),
        "carried_along": lambda goal: check_on(goal.world, goal.literal, *goal.bodies[:2]),
        "in": lambda goal: check_in(goal.world, goal.literal, *goal.bodies[:2]),
    }
    schemas = (
        Schema(
            "place",
            (("?item", "item"), ("?on", "support")),
            (("flat", "?on"), ("fits", "?item", "?on"), ("holding", "?item"), ("near", "?on")),
            (("on", "?item", "?on"), ("hand_empty",)),
            (("holding", "?item"), ("clear", "?on")),
        ),
        Schema(
            "stack",
            (("?item", "item"), ("?on", "item")),
            (
                ("carrier", "?on"),
                ("unmoved", "?on"),
                ("flat", "?on"),
                ("fits", "?item", "?on"),
                ("holding", "?item"),
                ("near", "?on"),
            ),
            (("on", "?item", "?on"), ("carried_along", "?item", "?on"), ("hand_empty",)),
            (("holding", "?item"), ("clear", "?on")),
        ),
        Schema(
            "put_in",
            (("?item", "item"), ("?in", "container"), ("?door", "door")),
            (
                ("entrance", "?door", "?in"),
                ("fits", "?item", "?door"),
                ("holding", "?item"),
                ("near", "?in"),
                ("open", "?door"),
            ),
            (("in", "?item", "?in"), ("behind", "?item", "?door"), ("hand_empty",)),
            (("holding", "?item"),),
        ),
    )

    def target(self, arguments: tuple[str, ...]) -> str:
        """What it is put on or into."""
        return arguments[1]

    def manipulate(self, model: WorldModel, state: RobotState, request: MotionRequest) -> tuple[Manipulation, ...]:
        """Return the motion that puts it down. Raises MotionFailed as `plan_place` does."""
        item, target = request.arguments[:2]
        door = _door(request.arguments)
        return (
            plan_place(
                model,
                state,
                item,
                target,
                door,
                request.budgets,
                request.random,
                request.preferred,
                request.base,
                request.further,
            ),
        )

    def grasp_style(self, model: WorldModel, item: str, arguments: tuple[str, ...]) -> GraspStyle | None:
        """As the place where it goes asks for."""
        return placement_style(model, item, arguments[1], _door(arguments)) if arguments[0] == item else None

    def move_things(self, model: WorldModel, arguments: tuple[str, ...], manipulation: Manipulation) -> None:
        """The item stands where it was put."""
        if manipulation.item_pose is not None:
            model.world.set_pose(arguments[0], manipulation.item_pose)
            model.set_down()
            model.put_on(arguments[0], arguments[1])

    def predicted(self, tree: TreeState, arguments: tuple[str, ...], manipulation: Manipulation) -> TreeState:
        """The item stands on its target, and what stands on the item has moved with it."""
        if manipulation.item_pose is None:
            return super().predicted(tree, arguments, manipulation)
        item = arguments[0]
        change = manipulation.item_pose @ np.linalg.inv(tree.poses[item])
        moved = (item, *carried_by(tree.parents, item))
        poses = {**tree.poses, **{name: change @ tree.poses[name] for name in moved}}
        return replace(tree, parents={**tree.parents, item: arguments[1]}, poses=poses, held=None)

    def bodies(self, model: WorldModel, arguments: tuple[str, ...]) -> list[str]:
        """What it is put on or into."""
        return [body for body in arguments[1:2] if body in model.records]

    def moved_along(
        self, model: WorldModel, arguments: tuple[str, ...], manipulation: Manipulation, shift: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The place is tied to the target, at the height at which the target is seen there."""
        assert manipulation.item_pose is not None
        goal_pose = manipulation.item_pose.copy()
        goal_pose[:3, 3] += shift
        bottom = goal_pose[2, 3] + model.foot(arguments[0])
        goal_pose[2, 3] += nearest_level(model, arguments[1], goal_pose[:2, 3], bottom) - bottom + PUT_DOWN_HEIGHT
        return manipulation.base + np.array([shift[0], shift[1], 0.0]), goal_pose

    def check_effect(self, conduct: Execution, arguments: tuple[str, ...]) -> None:
        """It stands on its target as it was to stand."""
        item, target = arguments[:2]
        item_body, target_body = conduct.matched(item), conduct.matched(target)
        parent = carrier(conduct.physical.world, item_body)
        standing = conduct.model.standing(item)
        tilt = float(np.arccos(np.clip((conduct.pose_in_room(item) @ standing.T)[2, 2], -1.0, 1.0)))
        fell = tilt > MOST_TILT and abs(standing[2, 2]) > 0.5
        if parent != target_body or fell:
            raise MotionFailed(
                "condition_not_met",
                f"{item} was let go over {target} and is now on {parent or 'nothing'}, {np.degrees(tilt):.0f} degrees "
                "from how it was to stand",
                (item, target),
                {"tilt": tilt},
            )


def _door(arguments: tuple[str, ...]) -> str | None:
    return arguments[2] if len(arguments) > 2 else None


ACTION = Place()
