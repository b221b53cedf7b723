"""Push a door or drawer shut."""

from __future__ import annotations

from scenewright.stages.kit.motion.doors import is_closed
from scenewright.stages.kit.motion.segments import Manipulation
from scenewright.stages.kit.tasks.strips import Schema
from scenewright.stages.plan.action import Execution, MotionRequest, PlanAction
from scenewright.stages.plan.checks import check_joints
from scenewright.stages.plan.door_motion import check_joint, plan_close
from scenewright.stages.plan.world_model import RobotState, WorldModel


class Close(PlanAction):
    """close(joint)."""

    name = "close"
    order = 50
    goals = {"closed": lambda goal: check_joints(goal.world, goal.literal, goal.bodies[0], goal.joints, shut=True)}
    schemas = (
        Schema(
            "close",
            (("?door", "door"),),
            (("near", "?door"), ("hand_empty",)),
            (("closed", "?door"),),
            (("open", "?door"),),
        ),
    )

    def manipulate(self, model: WorldModel, state: RobotState, request: MotionRequest) -> tuple[Manipulation, ...]:
        """Return the motions that push it shut. Raises MotionFailed as `plan_close` does."""
        joint = request.arguments[0]
        return plan_close(model, state, model.owner(joint), joint, request)

    def check_effect(self, conduct: Execution, arguments: tuple[str, ...]) -> None:
        """The joint stands shut."""
        check_joint(*conduct.joint_in_room(arguments[0]), self.name, arguments[0], is_closed)


ACTION = Close()
