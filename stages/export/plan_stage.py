"""The step `export plan`: the motions of a plan as joint trajectories, for controllers and for spreadsheets."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.exported_trajectory import STATEMENT, ExportedMotion, ExportedTrajectory, TrajectoryExportFile
from scenewright.schemas.plan import Plan
from scenewright.stages.export.parameters import PlanExportParameters
from scenewright.stages.export.retiming import Points, retime
from scenewright.stages.export.trajectory_files import Motion, csv_text, write_bag, yaml_text
from scenewright.stages.kit.formats.numpy_files import read_arrays
from scenewright.stages.kit.formats.urdf_file import parse_urdf
from scenewright.stages.kit.simulation.robot_description import RobotDescription, load_robot
from scenewright.stages.kit.simulation.robot_option import USUAL_ROBOT
from scenewright.stages.kit.stage import Context

STARTS_ELSEWHERE = 1e-6
"""Joints that an action finds farther from where the last one left them begin there [rad, m]."""
DRIVEN = 1e-6
"""A base that moves by less stands still [m, rad]."""


def run(plan: Plan, *, parameters: PlanExportParameters, context: Context) -> ExportedTrajectory:
    """Write the planned motion of every action. Raises BadInput for a plan of another robot."""
    robot = load_robot(parameters.robot)
    planned_for = str(plan.manifest.parameters.get("robot", USUAL_ROBOT)) if plan.manifest else parameters.robot
    if Path(planned_for).name != Path(parameters.robot).name:  # a description may be named from elsewhere
        raise BadInput(
            f"{plan.root}: planned for --robot {planned_for}, not for {parameters.robot}",
            hint=f"give --robot {planned_for}",
        )
    motions = _motions(plan, robot)
    context.output.joinpath("motions").mkdir()
    records = []
    for number, motion in enumerate(motions):
        file = f"motions/{number}_{re.sub(r'[^A-Za-z0-9]+', '_', motion.name).strip('_')[:60]}.yaml"
        context.output.joinpath(file).write_text(yaml_text(motion, _joints(robot), STATEMENT), encoding="utf-8")
        records.append(_record(motion, file))
    context.output.joinpath("trajectory.csv").write_text(csv_text(motions, _joints(robot), STATEMENT), encoding="utf-8")
    write_bag(context.output / "trajectory.mcap", motions, _joints(robot), STATEMENT)
    TrajectoryExportFile(
        statement=STATEMENT,
        robot=robot.name,
        joints=_joints(robot),
        speeds=tuple(_speeds(robot).tolist()),
        acceleration=robot.arm_acceleration,
        motions=tuple(records),
    ).write(context.output / "export.json")
    end = motions[-1].start + float(motions[-1].points.times[-1]) if motions else 0.0
    summary: dict[str, object] = {"robot": robot.name, "motions": len(motions), "seconds": round(end, 1)}
    summary["note"] = STATEMENT
    if not motions:
        summary["reason"] = "the plan has no actions"
    return ExportedTrajectory(context.output, outcome="ok" if motions else "empty", summary=summary)


def _joints(robot: RobotDescription) -> tuple[str, ...]:
    return (*robot.arm_joints, *robot.finger_joints)


def _speeds(robot: RobotDescription) -> np.ndarray:
    """Return the limits of speed (J + 2,): of the arm the lower of the description's and the URDF's."""
    said = {joint.name: joint.velocity for joint in parse_urdf(robot.urdf).joints}
    arm = [min(robot.arm_speed, said[name]) for name in robot.arm_joints]
    return np.array([*arm, *(said[name] for name in robot.finger_joints)])


def _motions(plan: Plan, robot: RobotDescription) -> list[Motion]:
    path = plan.path("trajectory.npz")
    names, shapes = ("time", "joints", "world_from_base"), ("N", "N J", "N 4 4")
    time, joints, bases = read_arrays(path, *names, shapes=shapes, hint="plan again")
    if len(time) and joints.shape[1] != len(_joints(robot)):
        raise BadInput(
            f"{path}: rows of {joints.shape[1]} joints, the robot {robot.name} has {len(_joints(robot))}",
            hint="give the robot that the plan is for",
        )
    speeds = _speeds(robot)
    fingers = [np.inf] * len(robot.finger_joints)
    accelerations = np.array([robot.arm_acceleration] * len(robot.arm_joints) + fingers)
    motions, clock = [], 0.0
    for action in plan.info.actions:
        if not 0 <= action.start < action.end <= len(time):
            raise BadInput(
                f"{path}: {action.name} has rows {action.start} to {action.end} of {len(time)}", hint="plan again"
            )
        rows = slice(action.start, action.end)
        period = float(np.diff(time[rows]).min(initial=np.inf)) if action.end - action.start > 1 else 1.0
        planned, base = np.asarray(joints[rows], float), bases[rows]
        if action.start > 0 and np.abs(planned[0] - joints[action.start - 1]).max() > STARTS_ELSEWHERE:
            # a controller begins where the last action left the fingers
            planned = np.concatenate([joints[action.start - 1][None], planned])
            base = np.concatenate([base[:1], base])
        points = retime(planned, period, speeds, accelerations)
        base = np.column_stack([base[:, 0, 3], base[:, 1, 3], _yaw(base)])
        motions.append(Motion(f"{action.name}({', '.join(action.arguments)})", clock, points, base))
        clock += float(points.times[-1])
    return motions


def _yaw(bases: np.ndarray) -> np.ndarray:
    return np.asarray(np.unwrap(np.arctan2(bases[:, 1, 0], bases[:, 0, 0])))


def _record(motion: Motion, file: str) -> ExportedMotion:
    points: Points = motion.points
    return ExportedMotion(
        name=motion.name,
        file=file,
        start=round(motion.start, 6),
        seconds=round(float(points.times[-1]), 6),
        points=len(points.times),
        stretch=round(points.stretch, 6),
        top_speed=round(points.top_speed, 6),
        top_acceleration=round(points.top_acceleration, 6),
        base_moves=bool(np.ptp(motion.base, axis=0).max() > DRIVEN),
    )
