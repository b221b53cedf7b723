"""The motion planner of the packing scene: one call asks for a motion of the arm to a tool pose.

Checks in the published order: inverse kinematics, collision at the goal, path. The path goes up, over and down in
cylinder coordinates, where every configuration is known in closed form; it needs no mesh check when all that stands is
lower than the links come on it. Where it needs one, or is not free, meshes decide and RRT-Connect searches.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import atan2, ceil, cos, hypot, pi, sin

import numpy as np
from scenewright.stages.kit.motion.kinematics import arm_chain
from scenewright.stages.kit.motion.rrt_connect import SearchSpace, densify, first_collision, rrt_connect
from scenewright.stages.kit.simulation.robot_description import load_robot
from scenewright.stages.kit.simulation.robot_option import USUAL_ROBOT
from scenewright.stages.pack.arm import HOME, HOME_POSE, FixedArm, Limits, ToolPose, planar_joints, planar_lengths
from scenewright.stages.pack.arm_scene import ArmScene
from scenewright.stages.pack.hand import Named, end_collision, hand_blocks, held_block, tool_over_centre
from scenewright.stages.pack.hand_shape import PUBLISHED, HandShape, measured
from scenewright.stages.pack.link_heights import BASE_RADIUS, lowest_on_path, lowest_within
from scenewright.stages.pack.records import BoxState
from scenewright.stages.pack.solids import overlap
from scenewright.stages.pack.solved_arm import SolvedArm, way_between

OVER = 0.015
"""What is carried over something passes this far above it [m]."""
STRIDE = 0.03
"""Distance between two configurations of an up-over-down path [m]; by eye."""
RESOLUTION = 0.05
"""Largest step of a joint between two mesh checks [rad]."""
SAMPLES = 60
"""Samples of one search, as many as the published planner draws in its three tries."""


@dataclass(frozen=True)
class Stance:
    """Where the arm stands."""

    arm: np.ndarray
    pose: ToolPose


HOME_STANCE = Stance(HOME, HOME_POSE)


@dataclass(frozen=True)
class Motion:
    """A motion that is free: what makes its joint values (N, J) of straight pieces, and where it ends."""

    make: Callable[[], np.ndarray]
    end: Stance
    searched: bool
    """Whether it took a search by RRT-Connect."""

    @property
    def path(self) -> np.ndarray:
        """The joint values; made when they are asked for, as most motions are only counted."""
        return self.make()


class MotionPlanner:
    """Plans motions of the arm among upright blocks. Holds a pybullet client once one was needed; close it."""

    def __init__(self, limits: Limits = "fr3", seed: int = 0, robot: str = USUAL_ROBOT) -> None:
        self.arm = open_arm(limits, robot)
        self.hand = PUBLISHED if robot == USUAL_ROBOT else measured(self.arm.description)
        self.home = Stance(self.arm.home, self.arm.home_pose)
        self._scene: ArmScene | None = None
        self._seed = seed
        self.mesh_calls = 0
        """Calls in which closed forms did not decide the path."""

    def close(self) -> None:
        """Release the physics client."""
        if self._scene is not None:
            self._scene.close()
            self._scene = None

    def plan(self, start: Stance, goal: ToolPose, held: BoxState | None, others: tuple[Named, ...]) -> Motion:
        """Return a motion from a stance to a tool pose with a held box (or none) among what stands in the way.

        Raises MotionFailed: no_inverse_kinematics, joint_limit, goal_in_collision, no_path.
        """
        arm = self.arm.solve(goal, start.arm)
        end = Stance(arm, goal)
        carried = None if held is None else Named(held.name, held_block(goal, held.width, held.length, held.height))
        failure = end_collision(goal, carried, others, self.hand)
        if failure is not None:
            raise failure
        tops = max((obstacle.block.top for obstacle in others), default=0.0)
        height = _height_over(start, end, held, tops, self.hand)
        if isinstance(self.arm, SolvedArm):
            way = _up_over_down(self.arm, start, goal, height)
            return self._with_meshes(start, end if way is None else Stance(way[-1], goal), held, others, way)
        if self._surely_free(start, end, height, tops, others):
            return Motion(lambda: _require_path(self._over(start, end, height, held, tops, others))[0], end, False)
        path = self._over(start, end, height, held, tops, others)
        if path is not None and path[1]:
            return Motion(lambda: path[0], end, False)
        return self._with_meshes(start, end, held, others, None if path is None else path[0])

    # --- closed form ------------------------------------------------------------------------------------------

    def _surely_free(self, start: Stance, end: Stance, height: float, tops: float, others: tuple[Named, ...]) -> bool:
        """Whether the up-over-down path is free wherever in its range of distances and heights it goes.

        Straight up from a free pose is free, as everything stands on the ground; above `height` nothing stands; and the
        links must be above all that stands in the whole range.
        """
        radii = sorted((start.pose.radius, end.pose.radius))
        heights = min(start.pose.z, end.pose.z), height
        lowest = lowest_within(_closed(self.arm), (radii[0], radii[1]), heights)
        return lowest > tops and not _near_base(others)

    def _over(
        self, start: Stance, end: Stance, height: float, held: BoxState | None, tops: float, others: tuple[Named, ...]
    ) -> tuple[np.ndarray, bool] | None:
        """Return the up-over-down path (N, 7) and whether it is known to be free; None when the arm cannot follow."""
        rise, fall = self._lift(start, height), self._lift(end, height)
        across = _arc(rise[-1], fall[-1])
        points = np.concatenate([rise, across, fall[::-1]])
        joints = planar_joints(_closed(self.arm), points[:, 0], points[:, 2])
        if joints is None:
            return None
        joints[:, 0] += points[:, 1]
        joints[: len(rise), 6] = start.arm[6]
        turn = np.linspace(0.0, 1.0, len(across) + 1)[1:]
        joints[len(rise) : len(rise) + len(across), 6] = start.arm[6] + turn * (end.arm[6] - start.arm[6])
        joints[len(rise) + len(across) :, 6] = end.arm[6]
        # Joint 7 holds the yaw against the plane's turn: on the way up and down it does not turn.
        limits = self.arm.chain
        if np.any(joints < limits.lower) or np.any(joints > limits.upper):
            return None
        if np.abs(joints[0] - start.arm).max() > 0.02 or np.abs(joints[-1] - end.arm).max() > 0.02:
            return None
        free = not _near_base(others) and lowest_on_path(_closed(self.arm), points[:, 0], points[:, 2]) > tops
        free = free and all(
            self._is_free_drawn_in(stance, line, held, others) for stance, line in ((start, rise), (end, fall))
        )
        return joints, free

    def _lift(self, stance: Stance, height: float) -> np.ndarray:
        """Return (N, 3) distance, azimuth and height from a stance upwards; drawn in where it is too far up there."""
        pose = stance.pose
        azimuth = atan2(pose.y, pose.x)
        azimuth += 2 * pi * round((stance.arm[0] - azimuth) / (2 * pi))  # joint 1 may have gone past the half turn
        count = max(1, ceil((height - pose.z) / STRIDE))
        heights = np.linspace(pose.z, height, count + 1)
        radii = np.minimum(pose.radius, _closed(self.arm).reaches(heights) - 1e-6)
        return np.column_stack([radii, np.full(count + 1, azimuth), heights])

    def _is_free_drawn_in(
        self, stance: Stance, rise: np.ndarray, held: BoxState | None, others: tuple[Named, ...]
    ) -> bool:
        """Whether hand and held box are free on the way up: over a free end, straight up is; drawn in may be not."""
        pose = stance.pose
        if rise[:, 0].min() > pose.radius - 1e-4:
            return True
        for radius, azimuth, height in rise.tolist():
            at = ToolPose(radius * cos(azimuth), radius * sin(azimuth), height, pose.yaw)
            blocks = list(hand_blocks(at, self.hand))
            if held is not None:
                blocks.append(held_block(at, held.width, held.length, held.height))
            if any(overlap(block, obstacle.block) > 0 for block in blocks for obstacle in others):
                return False
        return True

    # --- meshes -----------------------------------------------------------------------------------------------

    def _with_meshes(
        self, start: Stance, end: Stance, held: BoxState | None, others: tuple[Named, ...], path: np.ndarray | None
    ) -> Motion:
        self.mesh_calls += 1
        if self._scene is None:
            self._scene = ArmScene(self.arm)
        scene = self._scene
        grasp = None
        if held is not None:
            block = held_block(end.pose, held.width, held.length, held.height)
            grasp = (held.name, block, tool_over_centre(held.height))
        scene.arrange(others, grasp)
        resolution = np.full(len(start.arm), RESOLUTION)
        for candidate in (path, np.array([start.arm, end.arm])):
            if candidate is None:
                continue
            full_path = np.concatenate([start.arm[None], candidate, end.arm[None]])
            if first_collision(densify(full_path, resolution), scene.check) is None:
                return Motion(partial(np.copy, full_path), end, False)
        space = SearchSpace(self.arm.chain.lower, self.arm.chain.upper, resolution)
        if path is not None:
            space = _narrow(space, whole_range=np.concatenate([path, start.arm[None]]))
        planned = rrt_connect(
            start.arm,
            end.arm,
            scene.check,
            space,
            np.random.default_rng([self._seed, 3]),
            samples=SAMPLES,
            smoothing=20,
        )
        return Motion(lambda: planned, end, True)


def open_arm(limits: Limits, robot: str) -> FixedArm | SolvedArm:
    """Return the kinematics of a robot: closed forms for one of the Franka's build, else a search. Raises as
    `load_robot` does, and BadInput for an arm that is too short for the scene."""
    if robot == USUAL_ROBOT:
        return FixedArm(limits)
    description = load_robot(robot)
    return FixedArm("panda", robot) if planar_lengths(arm_chain(description)) is not None else SolvedArm(description)


def _closed(arm: FixedArm | SolvedArm) -> FixedArm:
    assert isinstance(arm, FixedArm)
    return arm


def _up_over_down(arm: SolvedArm, start: Stance, goal: ToolPose, height: float) -> np.ndarray | None:
    """Return joint values (N, J) of the way up, over and down to a tool pose; drawn in where the arm does not get as
    high so far out, None where it cannot follow."""
    over = [
        ToolPose(pose.x * share, pose.y * share, height, pose.yaw)
        for pose in (start.pose, goal)
        for share in [min(1.0, max(arm.reach(height) - 1e-3, 0.0) / max(pose.radius, 1e-6))]
    ]
    poses: list[ToolPose] = []
    before = start.pose
    for corner in (*over, goal):
        poses += way_between(before, corner)
        before = corner
    return arm.follow(poses, start.arm)


def _height_over(start: Stance, end: Stance, held: BoxState | None, tops: float, hand: HandShape) -> float:
    """Return the height [m] of the tool at which hand and held box pass over all that stands."""
    under = hand.tip_below if held is None else tool_over_centre(held.height) + held.height / 2
    return max(tops + OVER + under, start.pose.z, end.pose.z)


def _near_base(others: tuple[Named, ...]) -> bool:
    """Whether something stands where the links below the third could touch it."""
    return any(
        hypot(obstacle.block.x, obstacle.block.y) - obstacle.block.half_width - obstacle.block.half_length < BASE_RADIUS
        for obstacle in others
    )


def _require_path(path: tuple[np.ndarray, bool] | None) -> tuple[np.ndarray, bool]:
    if path is None:
        raise AssertionError("a path that is free everywhere in its range exists")
    return path


def _arc(first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Return (N, 3) points in cylinder coordinates between two, both excluded from nothing but the first."""
    change = np.abs(last - first)
    count = max(2, ceil(max(change[0] / STRIDE, change[1] / RESOLUTION, change[2] / STRIDE)))
    return first + (last - first) * (np.arange(1, count + 1) / count)[:, None]


def _narrow(space: SearchSpace, whole_range: np.ndarray) -> SearchSpace:
    """Keep the first and the last joint, which could go round more than once, near where the motion needs them."""
    lower, upper = space.lower.copy(), space.upper.copy()
    for joint in (0, -1):
        lower[joint] = max(lower[joint], whole_range[:, joint].min() - 1.0)
        upper[joint] = min(upper[joint], whole_range[:, joint].max() + 1.0)
    return SearchSpace(lower, upper, space.resolution)
