"""Joint trajectories as files: YAML of one ROS 2 message each, a bag of messages, CSV."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scenewright.stages.export.retiming import Points
from scenewright.stages.kit.ros2_bag import BagWriter, ros2_header, ros2_types

TRAJECTORY, POINT = "trajectory_msgs/msg/JointTrajectory", "trajectory_msgs/msg/JointTrajectoryPoint"
PATH, POSE, STRING = "nav_msgs/msg/Path", "geometry_msgs/msg/PoseStamped", "std_msgs/msg/String"
MAP_FRAME = "map"
"""Frame of the base's poses: the plan's world."""


@dataclass(frozen=True)
class Motion:
    """One action: its name, when it begins [s], the points of arm and fingers, and the base (N, 3) x, y [m], yaw."""

    name: str
    start: float
    points: Points
    base: np.ndarray


def yaml_text(motion: Motion, joints: tuple[str, ...], statement: str) -> str:
    """Return a trajectory_msgs/JointTrajectory as `ros2 topic pub` reads it."""
    lines = [f"# {motion.name}: {statement}", "header: {stamp: {sec: 0, nanosec: 0}, frame_id: ''}"]
    lines += [f"joint_names: [{', '.join(joints)}]", "points:"]
    for time, position, velocity in zip(
        motion.points.times, motion.points.positions, motion.points.velocities, strict=True
    ):
        seconds, nanoseconds = divmod(round(float(time) * 1e9), 10**9)
        lines.append(
            f"- {{positions: [{_numbers(position)}], velocities: [{_numbers(velocity)}], accelerations: [], "
            f"effort: [], time_from_start: {{sec: {seconds}, nanosec: {nanoseconds}}}}}"
        )
    return "\n".join(lines) + "\n"


def csv_text(motions: list[Motion], joints: tuple[str, ...], statement: str) -> str:
    """Return all motions, one after the other: a row for each point, after a line `# <statement>`."""
    header = ["time", "action", "name", "base_x", "base_y", "base_yaw"]
    header += [*joints, *(f"{joint}_velocity" for joint in joints)]
    lines = [f"# {statement}; seconds, metres, radians", ",".join(header)]
    for number, motion in enumerate(motions):
        points = motion.points
        for row, time in enumerate(points.times):
            name = motion.name.replace(",", ";")
            values = [f"{motion.start + float(time):.6f}", str(number), f'"{name}"']
            values += [_numbers(motion.base[row], ","), _numbers(points.positions[row], ",")]
            lines.append(",".join([*values, _numbers(points.velocities[row], ",")]))
    return "\n".join(lines) + "\n"


def write_bag(path: Path, motions: list[Motion], joints: tuple[str, ...], statement: str) -> None:
    """Write the motions as messages: `/joint_trajectory` (one for each action, stamped when it begins), `/base_path`
    (where the base is meanwhile, each pose with its time), `/action` (its name and the statement). The same motions
    give the same bytes."""
    types = ros2_types().types
    with BagWriter(path, {"joint trajectories": {"statement": statement}}) as bag:
        for number, motion in enumerate(motions):
            stamp = round(motion.start * 1e9)
            bag.add("/action", types[STRING](data=f"{motion.name}: {statement}"), stamp, number)
            bag.add("/joint_trajectory", _trajectory(motion, joints, stamp), stamp, number)
            bag.add("/base_path", _path(motion), stamp, number)


def _trajectory(motion: Motion, joints: tuple[str, ...], stamp: int) -> Any:
    types = ros2_types().types
    points, none = motion.points, np.zeros(0)
    messages = []
    for time, position, velocity in zip(points.times, points.positions, points.velocities, strict=True):
        seconds, nanoseconds = divmod(round(float(time) * 1e9), 10**9)
        messages.append(
            types[POINT](
                positions=np.ascontiguousarray(position, dtype=float),
                velocities=np.ascontiguousarray(velocity, dtype=float),
                accelerations=none,
                effort=none,
                time_from_start=types["builtin_interfaces/msg/Duration"](sec=seconds, nanosec=nanoseconds),
            )
        )
    return types[TRAJECTORY](header=ros2_header(stamp, ""), joint_names=list(joints), points=messages)


def _path(motion: Motion) -> Any:
    types = ros2_types().types
    poses = []
    for time, (x, y, yaw) in zip(motion.points.times, motion.base.tolist(), strict=True):
        pose = types["geometry_msgs/msg/Pose"](
            position=types["geometry_msgs/msg/Point"](x=x, y=y, z=0.0),
            orientation=types["geometry_msgs/msg/Quaternion"](
                x=0.0, y=0.0, z=float(np.sin(yaw / 2)), w=float(np.cos(yaw / 2))
            ),
        )
        poses.append(types[POSE](header=ros2_header(round((motion.start + float(time)) * 1e9), MAP_FRAME), pose=pose))
    return types[PATH](header=ros2_header(round(motion.start * 1e9), MAP_FRAME), poses=poses)


def _numbers(values: np.ndarray, separator: str = ", ") -> str:
    return separator.join(f"{value + 0.0:.6f}" for value in np.round(values, 6))
