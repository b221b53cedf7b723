"""trajectory.npz: the planned motion (and the executed one) as time, joints, base and action."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scenewright.stages.kit.geometry.transforms import transform_from_yaw
from scenewright.stages.kit.motion.recording import Snapshot
from scenewright.stages.kit.motion.timing import sample_times, time_path
from scenewright.stages.kit.simulation.robot_description import RobotDescription
from scenewright.stages.plan.refinement import Step

PERIOD = 0.05
"""Time between rows of the planned motion [s]."""
GRIPPER_SECONDS = 0.6
"""How long the fingers take to close or open [s]; **assumed**."""


def planned_rows(steps: list[Step], robot: RobotDescription) -> tuple[dict[str, np.ndarray], list[tuple[int, int]]]:
    """Return the arrays of the planned motion and the half-open range of rows of each step."""
    speed, acceleration = robot.speeds, robot.accelerations
    times: list[np.ndarray] = []
    bodies: list[np.ndarray] = []
    openings: list[np.ndarray] = []
    actions: list[np.ndarray] = []
    ranges = []
    clock, count = 0.0, 0
    for number, step in enumerate(steps):
        start = count
        for segment in step.segments:
            at, points = time_path(segment.path, speed * segment.pace, acceleration * segment.pace)
            rows = np.concatenate([points[:1], sample_times(at, points, PERIOD)]) if len(points) > 1 else points[:1]
            opening = 0.0 if segment.item is not None and segment.event != "grasp" else segment.opening
            widths = np.full(len(rows), opening)
            if segment.event:
                held_rows = round(GRIPPER_SECONDS / PERIOD)
                rows = np.concatenate([rows, np.tile(rows[-1], (held_rows, 1))])
                widths = np.concatenate(
                    [widths, np.full(held_rows, 0.0 if segment.event == "grasp" else robot.opening)]
                )
            times.append(clock + PERIOD * np.arange(len(rows)))
            clock += PERIOD * len(rows)
            bodies.append(rows)
            openings.append(widths)
            actions.append(np.full(len(rows), number, dtype=np.int32))
            count += len(rows)
        ranges.append((start, count))
    if not bodies:
        return _arrays(np.zeros(0), np.zeros((0, len(speed))), np.zeros(0), np.zeros(0, dtype=np.int32)), ranges
    columns = [np.concatenate(chunks) for chunks in (times, bodies, openings, actions)]
    return _arrays(*columns), ranges


def executed_rows(snapshots: list[Snapshot]) -> dict[str, np.ndarray]:
    """Return the arrays of what the joints did, names prefixed `executed_`."""
    rows = _arrays(
        np.array([entry.time for entry in snapshots]),
        np.array([entry.body for entry in snapshots]),
        np.array([entry.opening for entry in snapshots]),
        np.array([entry.action for entry in snapshots], dtype=np.int32),
    )
    return {f"executed_{name}": values for name, values in rows.items()}


def _arrays(times: np.ndarray, body: np.ndarray, opening: np.ndarray, action: np.ndarray) -> dict[str, np.ndarray]:
    joints = np.concatenate([body[:, 3:], np.repeat(opening[:, None] / 2, 2, axis=1)], axis=1)
    bases = np.array([transform_from_yaw(float(row[2]), np.array([row[0], row[1], 0.0])) for row in body])
    return {"time": times, "joints": joints, "world_from_base": bases.reshape(-1, 4, 4), "action": action}


def write_trajectory(path: Path, arrays: dict[str, np.ndarray]) -> None:
    """Write a compressed NPZ; numpy gives its members a fixed date, so that the same arrays give the same bytes."""
    np.savez_compressed(path, allow_pickle=False, **arrays)
