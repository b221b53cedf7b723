"""Pull a door or drawer open."""

from __future__ import annotations

from scenewright.stages.kit.motion.doors import is_open
from scenewright.stages.kit.motion.segments import Manipulation
from scenewright.stages.kit.tasks.strips import Schema
from scenewright.stages.plan.action import Execution, MotionRequest, PlanAction
from scenewright.stages.plan.checks import check_joints
from scenewright.stages.plan.door_motion import check_joint, plan_open
from scenewright.stages.plan.world_model import RobotState, WorldModel


class Open(PlanAction):
    """open(joint)."""

    name = "open"
    order = 40
    goals = {"open": lambda goal: check_joints(goal.world, goal.literal, goal.bodies[0], goal.joints, shut=False)}
    schemas = (
        Schema(
            "open",
            (("?door", "door"),),
            (("near", "?door"), ("hand_empty",)),
            (("open", "?door"),),
            (("closed", "?door"),),
        ),
    )

    def manipulate(self, model: WorldModel, state: RobotState, request: MotionRequest) -> tuple[Manipulation, ...]:
        """Return the motions that pull it open by its handle. Raises MotionFailed as `plan_open` does."""
        joint = request.arguments[0]
        return plan_open(model, state, model.owner(joint), joint, request)

    def check_effect(self, conduct: Execution, arguments: tuple[str, ...]) -> None:
        """The joint stands open."""
        check_joint(*conduct.joint_in_room(arguments[0]), self.name, arguments[0], is_open)


ACTION = Open()
