"""One way to ask for a motion: robot and scene (the checker), start, goal, what is held, what may be touched, planner.

The answer is a path that the mesh checker confirmed, or MotionFailed with a typed record: `joint_limit`,
`start_in_collision`, `goal_in_collision`, `no_inverse_kinematics`, `no_path`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from stages.kit.geometry.transforms import quaternion_of
from stages.kit.motion.all_branches import all_solutions, unlimited_solutions
from stages.kit.motion.base_placement import base_query, in_arm_frame
from stages.kit.motion.collision import CollisionChecker
from stages.kit.motion.failures import MotionFailed
from stages.kit.motion.kinematics import ArmChain, arm_chain, forward, inverse_kinematics, random_starts
from stages.kit.motion.optimal import optimal_path
from stages.kit.motion.path_query import Effort, Query
from stages.kit.motion.path_search import find_path
from stages.kit.motion.rrt_connect import SearchSpace
from stages.kit.simulation.robot import base_pose

ARM_RESOLUTION = 0.05
"""Largest step of an arm joint between two checks [rad]; the result is looked at more closely."""
MOST_GOALS = 16
"""Of the solutions of inverse kinematics, those nearest to the start that the search may end in."""
RESTARTS = 24
Planner = Literal["rrt_connect", "bit_star"]


@dataclass(frozen=True)
class ArmGoal:
    """Arm values (K, 7) [rad], any of which will do: one joint goal, or a set of solutions."""

    arms: np.ndarray


@dataclass(frozen=True)
class ToolGoal:
    """A pose of the tool: world_from_tool (4, 4); the base stays where it is."""

    world_from_tool: np.ndarray


@dataclass(frozen=True)
class BaseGoal:
    """Base x, y [m], yaw [rad] (3,) within the floor's corners (2,), (2,) [m]; the arm is held."""

    base: np.ndarray
    room: tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Attachment:
    """A body that moves with the tool."""

    body: str
    tool_from_body: np.ndarray


@dataclass(frozen=True)
class MotionProblem:
    """What is asked. Budgets count samples (iterations of BIT*) and attempts, never seconds."""

    start: np.ndarray
    """(10,) base x, y, yaw and arm."""
    goal: ArmGoal | ToolGoal | BaseGoal
    attachment: Attachment | None = None
    touch: frozenset[str] = frozenset()
    """Links that hand and fingers may touch."""
    rest_on: Mapping[str, float] = field(default_factory=dict)
    """How deep [m] what is held may be in which links."""
    planner: Planner = "rrt_connect"
    samples: int = 2000
    smoothing: int = 60


@dataclass(frozen=True)
class MotionPath:
    """A free path."""

    path: np.ndarray
    """(N, 10) straight pieces."""
    effort: Effort


def solve(problem: MotionProblem, checker: CollisionChecker, random: np.random.Generator) -> MotionPath:
    """Return a free path from the start to the goal.

    Raises MotionFailed: `joint_limit` (joint, outside), `start_in_collision` and `goal_in_collision` (names, depth),
    `no_inverse_kinematics` (distance [m] and angle [rad] of the nearest reachable pose, and that pose), `no_path`
    (samples, what blocked most often). The checker is left as it was found, the robot anywhere.
    """
    effort = Effort()
    with _as_asked(problem, checker):
        query = _query(problem, checker, random)
        if problem.planner == "bit_star":
            values = optimal_path(
                query, checker, random, iterations=problem.samples, smoothing=problem.smoothing, effort=effort
            )  # fmt: skip
        else:
            values = find_path(
                query, checker, random, samples=problem.samples, smoothing=problem.smoothing, effort=effort
            )  # fmt: skip
    return MotionPath(np.array([query.whole(row) for row in values]), effort)


def _query(problem: MotionProblem, checker: CollisionChecker, random: np.random.Generator) -> Query:
    start = np.asarray(problem.start, dtype=float)
    goal = problem.goal
    if isinstance(goal, BaseGoal):
        return base_query(start[:3], goal.base, start[3:], goal.room)
    chain = arm_chain(checker.robot.description)
    space = SearchSpace(chain.lower, chain.upper, np.full(len(chain.lower), ARM_RESOLUTION))
    arms = goal.arms if isinstance(goal, ArmGoal) else tool_solutions(start, goal, checker, chain, random)
    arms = np.atleast_2d(np.asarray(arms, dtype=float))
    if len(arms) > MOST_GOALS:
        arms = arms[np.argsort(np.abs(arms - start[3:]).max(axis=1), kind="stable")]
        free = [arm for arm in arms if checker.check(np.concatenate([start[:3], arm])) is None]
        arms = np.array(free or arms)[:MOST_GOALS]
    return Query(start, np.arange(3, len(start)), start[3:], arms, space)


def tool_solutions(
    start: np.ndarray, goal: ToolGoal, checker: CollisionChecker, chain: ArmChain, random: np.random.Generator
) -> np.ndarray:
    """Return all arm values (K, J) that reach a tool pose from the base of a configuration (10,).

    Raises MotionFailed: `joint_limit` when only values outside the limits do, else `no_inverse_kinematics`.
    """
    description = checker.robot.description
    target = in_arm_frame(start[:3], goal.world_from_tool, description)
    arms = all_solutions(chain, target, random)
    if len(arms):
        return arms
    starts = np.concatenate([start[None, 3:], random_starts(chain, RESTARTS, random)])
    nearest = inverse_kinematics(chain, target, starts)
    if nearest.found:
        return nearest.arm[None]
    beyond = unlimited_solutions(chain, target)
    if len(beyond):
        outside = np.maximum(chain.lower - beyond, beyond - chain.upper)
        best = int(outside.max(axis=1).argmin())
        joint = int(outside[best].argmax())
        raise MotionFailed(
            "joint_limit",
            f"every solution puts a joint outside its limits; at best joint {joint} by {outside[best, joint]:.4f} rad",
            numbers={"joint": joint, "value": beyond[best, joint], "outside": outside[best, joint]},
        )
    reached = base_pose(start[:3], description) @ forward(chain, nearest.arm)
    numbers = {"distance": nearest.position_error, "angle": nearest.rotation_error, "starts": len(starts)}
    numbers |= {f"nearest_{axis}": value for axis, value in zip("xyz", reached[:3, 3].tolist(), strict=True)}
    numbers |= {f"nearest_q{axis}": v for axis, v in zip("xyzw", quaternion_of(reached).tolist(), strict=True)}
    raise MotionFailed(
        "no_inverse_kinematics",
        f"no joint values reach the tool pose; the nearest is {nearest.position_error:.3f} m and "
        f"{nearest.rotation_error:.2f} rad away",
        numbers=numbers,
    )


@contextmanager
def _as_asked(problem: MotionProblem, checker: CollisionChecker) -> Iterator[None]:
    """Make the checker carry and allow what the problem says, and afterwards what it did before."""
    before = checker.state()
    home = None
    held = problem.attachment
    if held is not None and checker.carried != held.body:
        home = checker.world.pose(held.body)
    try:
        if held is None:
            checker.put_down()
        else:
            checker.carry(held.body, held.tool_from_body)
        checker.allow(problem.touch, problem.rest_on)
        yield
    finally:
        checker.put_down(home)
        checker.restore(before)
