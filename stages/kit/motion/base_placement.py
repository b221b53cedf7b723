"""Where the base may stand: poses around a target within reach, and paths of the base over the floor."""

from __future__ import annotations

from collections import Counter

import numpy as np
from scenewright.stages.kit.geometry.transforms import inverse, wrapped
from scenewright.stages.kit.motion.collision import CollisionChecker
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.motion.kinematics import ArmChain, shoulder_height
from scenewright.stages.kit.motion.path_query import Query
from scenewright.stages.kit.motion.path_search import find_path
from scenewright.stages.kit.motion.rrt_connect import SearchSpace
from scenewright.stages.kit.simulation.robot import base_pose
from scenewright.stages.kit.simulation.robot_description import RobotDescription

BASE_RESOLUTION = np.array([0.03, 0.03, 0.06])
"""Steps at which a motion of the base is checked [m, m, rad]; by eye."""


def sample_bases(
    target: np.ndarray,
    room: tuple[np.ndarray, np.ndarray],
    count: int,
    random: np.random.Generator,
    *,
    nearest: float = 0.3,
    farthest: float = 0.8,
    heading: float = 0.9,
) -> np.ndarray:
    """Return (K, 3) base poses x, y, yaw on a ring around a target (2,) or (3,) [m], facing it within `heading` [rad].

    `room` are the lower and upper corner (2,) of the floor; samples outside are left out.
    """
    angle = random.uniform(-np.pi, np.pi, count)
    distance = np.sqrt(random.uniform(nearest**2, farthest**2, count))
    x, y = target[0] + distance * np.cos(angle), target[1] + distance * np.sin(angle)
    yaw = wrapped(angle + np.pi + random.uniform(-heading, heading, count))
    inside = (x > room[0][0]) & (x < room[1][0]) & (y > room[0][1]) & (y < room[1][1])
    return np.column_stack([x, y, yaw])[inside]


def possible_bases(
    robot: RobotDescription,
    here: np.ndarray,
    target: np.ndarray,
    room: tuple[np.ndarray, np.ndarray],
    count: int,
    random: np.random.Generator,
    **ring: float,
) -> np.ndarray:
    """Return `sample_bases` of a robot that drives; (1, 3) `here`, where it stands, of one that does not."""
    return sample_bases(target, room, count, random, **ring) if robot.drives else here[None]


def free_bases(
    bases: np.ndarray, arm: np.ndarray, checker: CollisionChecker, blockers: Counter[str], most: int
) -> np.ndarray:
    """Return the first `most` of the bases (K, 3) at which the robot with its arm (J,) held so is free.

    What blocks the others is counted in `blockers`.
    """
    rows = []
    for base in bases:
        collision = checker.check(np.concatenate([base, arm]))
        if collision is None:
            rows.append(base)
            if len(rows) == most:
                break
        else:
            blockers[collision.other] += 1
    return np.array(rows).reshape(-1, 3)


def shoulder_distance(base: np.ndarray, world_from_tool: np.ndarray, robot: RobotDescription, chain: ArmChain) -> float:
    """Return the distance [m] of a tool position from the shoulder of the robot at a base pose (3,)."""
    shoulder = np.array([base[0], base[1], robot.pedestal_height + shoulder_height(chain)])
    return float(np.linalg.norm(world_from_tool[:3, 3] - shoulder))


def in_arm_frame(base: np.ndarray, world_from_tool: np.ndarray, robot: RobotDescription) -> np.ndarray:
    """Return armbase_from_tool (4, 4) of a tool pose in the world, for a base pose (3,)."""
    return inverse(base_pose(base, robot)) @ world_from_tool


def plan_drive(
    start: np.ndarray,
    goal: np.ndarray,
    arm: np.ndarray,
    checker: CollisionChecker,
    room: tuple[np.ndarray, np.ndarray],
    random: np.random.Generator,
    *,
    samples: int = 1500,
) -> np.ndarray:
    """Return a free path (N, 3) of the base from `start` to `goal`, x, y [m], yaw [rad], the arm (J,) held still.

    The yaw of the last point may differ from the goal's by whole turns. Raises MotionFailed as `find_path` does.
    """
    query = base_query(np.asarray(start, dtype=float), goal, arm, room)
    try:
        return find_path(query, checker, random, samples=samples)
    except MotionFailed as failed:
        failure = failed.failure
        raise MotionFailed(
            failure.kind, f"driving: {failure.message}", failure.objects, dict(failure.numbers)
        ) from None


def base_query(start: np.ndarray, goal: np.ndarray, arm: np.ndarray, room: tuple[np.ndarray, np.ndarray]) -> Query:
    """Return the search for a way of the base from `start` to `goal` (3,) with the arm (J,) held.

    The yaw goes the shorter way round; start and goal may stand outside the floor's corners.
    """
    turn = float(wrapped(np.array(goal[2] - start[2])))
    target = np.array([goal[0], goal[1], start[2] + turn])
    low = np.array([*np.minimum(room[0], np.minimum(start, goal)[:2]), start[2] - np.pi - abs(turn)])
    high = np.array([*np.maximum(room[1], np.maximum(start, goal)[:2]), start[2] + np.pi + abs(turn)])
    space = SearchSpace(low, high, BASE_RESOLUTION)
    return Query(np.concatenate([start, arm]), np.arange(3), start, target[None], space)
