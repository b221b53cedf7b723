"""A plan as ROS 2 messages: plan.mcap, which `ros2 bag play` and rosbag2 readers open.

`/tableware/poses` (geometry_msgs/PoseArray) holds where the hand goes in an action, in order: a grasp is one pose, a
pull its start and its end, putting down on something where that is. `/tableware/actions` (std_msgs/String) holds the
action as plan.json does. Both are stamped with the seconds at which the action begins when nothing slips. Poses are in
the plan's world (metres, z up); the hand's z points down onto the table, the jaws close along its x.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from scenewright.schemas.tableware_plan import (
    ActionFields,
    GraspFields,
    PullFields,
    PullGraspFields,
    StackFields,
    StackGraspFields,
    TablewarePlanFile,
)
from scenewright.stages.kit.ros2_bag import BagWriter, ros2_header, ros2_types

FRAME = "table"
POSE_ARRAY, STRING = "geometry_msgs/msg/PoseArray", "std_msgs/msg/String"
HandPose = tuple[tuple[float, float, float], float]
"""A point [m] and the direction in which the jaws close [rad]."""


def hand_poses(fields: ActionFields) -> Iterator[HandPose]:
    """Yield where the hand goes in an action, in order (equations 6.1 to 6.5, Srinivas 2024)."""
    match fields:
        case GraspFields():
            yield fields.p_G, fields.theta_G
        case PullFields():
            yield fields.p_S, fields.theta_S
            yield fields.p_E, fields.theta_E
        case PullGraspFields():
            yield from hand_poses(fields.u_P)
            yield from hand_poses(fields.u_G)
        case StackFields():
            yield from hand_poses(fields.u_G)
            yield fields.p_L, fields.theta_L
        case StackGraspFields():
            yield from hand_poses(fields.u_S)
            yield from hand_poses(fields.u_G)


def write_plan_bag(path: Path, file: TablewarePlanFile) -> None:
    """Write the plan's actions as messages; the same plan gives the same bytes."""
    types = ros2_types().types
    seconds = 0.0
    with BagWriter(path, {"tableware plan": {"frame": FRAME, "statement": file.statement}}) as bag:
        for number, step in enumerate(file.steps):
            stamp = round(seconds * 1e9)
            poses = [_pose(point, angle) for point, angle in hand_poses(step.action.fields)]
            bag.add("/tableware/poses", types[POSE_ARRAY](header=ros2_header(stamp, FRAME), poses=poses), stamp, number)
            words = step.action.model_dump_json(exclude_none=True)
            bag.add("/tableware/actions", types[STRING](data=words), stamp, number)
            seconds += step.action.seconds


def _pose(point: tuple[float, float, float], angle: float) -> Any:
    """Return a geometry_msgs/Pose: x along `angle` and z down, which is half a turn about the direction half way."""
    types = ros2_types().types
    x, y, z = (float(value) for value in point)
    return types["geometry_msgs/msg/Pose"](
        position=types["geometry_msgs/msg/Point"](x=x, y=y, z=z),
        orientation=types["geometry_msgs/msg/Quaternion"](
            x=float(np.cos(angle / 2.0)), y=float(np.sin(angle / 2.0)), z=0.0, w=0.0
        ),
    )
