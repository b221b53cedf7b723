"""Motions of the arm with a laden tray: the tool goes on straight lines and keeps its tilt: nothing slides off."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.acting.query import carrying, touching
from scenewright.stages.kit.geometry.transforms import inverse, transform_from_yaw
from scenewright.stages.kit.motion.arm_motion import ArmPlanner, Tally
from scenewright.stages.kit.motion.cartesian import drawn_back, raised
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.motion.kinematics import forward
from scenewright.stages.kit.motion.segments import Manipulation, Segment, whole_body
from scenewright.stages.kit.simulation.robot import Configuration, base_pose
from scenewright.stages.plan.placements import Placement
from scenewright.stages.plan.world_model import RobotState, WorldModel
from scipy.spatial.transform import Rotation

RAISE = 0.12
"""Height over the surface at which a laden tray is moved sideways [m]."""
RETREAT = 0.14
"""How far the tool goes back along its axis from what was put down [m]; by eye."""
LEVEL_PACE = 0.25
"""Share of the full speed with a load."""
DRAWN_IN = (0.0, 0.1, 0.2)
"""How far the tool is drawn in towards the pedestal before the robot drives, the farthest first that is free [m]."""


def drawn_in(model: WorldModel, planner: ArmPlanner, base: np.ndarray, arm: np.ndarray, tally: Tally) -> np.ndarray:
    """Return arm values (K, J) from `arm` (J,) on a level line towards the pedestal, as far as it goes freely."""
    pose = base_pose(base, model.description) @ forward(model.chain, arm)
    inward = base[:2] - pose[:2, 3]
    inward /= max(float(np.linalg.norm(inward)), 1e-9)
    for distance in sorted(DRAWN_IN, reverse=True):
        goal = pose.copy()
        goal[:2, 3] += distance * inward
        path = planner.line(base, arm, goal, tally) if distance else arm[None]
        if path is not None:
            return path
    return arm[None]


def levelled(world_from_tool: np.ndarray, tool_from_item: np.ndarray) -> np.ndarray:
    """Return the tool pose (4, 4), turned about the tool point, in which what is held stands upright with its yaw."""
    up = (world_from_tool @ tool_from_item)[:3, 2]
    axis = np.cross(up, [0.0, 0.0, 1.0])
    sine = float(np.linalg.norm(axis))
    turned = world_from_tool.copy()
    if sine > 1e-9:
        change = Rotation.from_rotvec(axis / sine * np.arctan2(sine, up[2]))
        turned[:3, :3] = change.as_matrix() @ world_from_tool[:3, :3]
    return turned


def level_place(
    model: WorldModel,
    state: RobotState,
    item: str,
    base: np.ndarray,
    placement: Placement,
    rest: dict[str, float],
    planner: ArmPlanner,
    tally: Tally,
) -> Manipulation | None:
    """Return the motion that puts a laden `item` down from how it is held, or None (counted in the tally).

    The hand keeps its heading to the pedestal, give or take, goes level over the place, down, and away upwards; the arm
    folds then as after every place. `rest`: links that the load may touch, with depths [m].
    """
    assert state.tool_from_item is not None
    in_hand = planner.under(carrying(item, state.tool_from_item, model.links(item)))
    onto = planner.under(carrying(item, state.tool_from_item, model.links(item), rest))
    # The load may have come nearer to the hand than a search likes; going straight up leaves it beside.
    leaving = planner.under(touching(model.world.bodies[item].links))
    held_pose = base_pose(base, model.description) @ forward(model.chain, state.arm) @ state.tool_from_item
    yaw = float(np.arctan2(held_pose[1, 0], held_pose[0, 0]))
    for turn in (0.0, 0.4, -0.4):
        upright = transform_from_yaw(yaw + turn, placement.world_from_item[:3, 3])
        world_from_tool = upright @ inverse(state.tool_from_item)
        if planner.reachable(base, world_from_tool, tally, starts=2) is None:
            continue
        over = in_hand.line(base, state.arm, raised(world_from_tool, RAISE), tally)
        if over is None:
            continue
        down = onto.line(base, over[-1], world_from_tool, tally)
        if down is None:
            continue
        opening = model.description.opening
        model.robot.set(Configuration(base, down[-1], opening))
        with model.world.posed(item, upright):
            away = leaving.line(base, down[-1], drawn_back(world_from_tool, RETREAT), tally)
            if away is None:
                continue
            try:
                home = planner.path(base, away[-1], model.description.carry)
            except MotionFailed as failed:
                tally.failed(failed)
                continue
        return Manipulation(
            base,
            (
                Segment(whole_body(base, over), 0.0, LEVEL_PACE, "", item),
                Segment(whole_body(base, down), 0.0, LEVEL_PACE, "release", item),
                Segment(whole_body(base, away), opening, LEVEL_PACE),
                Segment(whole_body(base, home), opening),
            ),
            item_pose=upright,
        )
    return None
