"""Any other arm in the packing scene, bolted down at the origin: inverse kinematics by search, one pose from the last.

The closed forms of `arm` are of one build. Here a pose is reached from the arm before, along the way in cylinder
coordinates, so that the arm stays on one branch; where that leads nowhere, from seeded starts.
"""

from __future__ import annotations

from math import atan2, ceil, cos, hypot, pi, sin

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.motion.cartesian import follow
from scenewright.stages.kit.motion.compiled_check import link_frames
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.motion.kinematics import (
    ArmChain,
    InverseSolution,
    arm_chain,
    forward,
    inverse_kinematics,
    random_starts,
    reach,
)
from scenewright.stages.kit.simulation.robot_description import RobotDescription
from scenewright.stages.pack.arm import ToolPose

STARTS = 24
"""Seeded starts of inverse kinematics."""
STEP, TURN = 0.03, 0.1
"""Largest steps of the tool on a way [m, rad]."""
HOMES = (ToolPose(0.306891, 0.0, 0.485302, 0.0), ToolPose(0.35, 0.0, 0.4, 0.0), ToolPose(0.4, 0.0, 0.35, 0.0))
"""Where the tool may be at home, the place of the published environment first."""
LOW = 0.2
"""Joints lower than this [m] are among what stands on the table."""
FINE = 0.002
"""How exactly the reach is known [m]."""


class SolvedArm:
    """Inverse kinematics of downward tool poses, as `FixedArm` has it by closed forms."""

    closed = False

    def __init__(self, description: RobotDescription) -> None:
        self.description = description
        self.chain: ArmChain = arm_chain(description)
        seeded = random_starts(self.chain, STARTS, np.random.default_rng(7))
        self._starts = np.concatenate([description.carry[None], seeded])
        self._reaches: dict[float, float] = {}
        self.home_pose, self.home = self._home()

    def _home(self) -> tuple[ToolPose, np.ndarray]:
        for pose in HOMES:
            answers = self._answers(pose, self.description.carry)
            if answers:
                return pose, max(answers, key=self._lowest)
        raise BadInput(
            f"robot {self.description.name}: bolted down at the origin it does not reach "
            f"{HOMES[0].x:.2f} m ahead and {HOMES[0].z:.2f} m up with the hand straight down",
            hint="scenewright robot check shows where it reaches",
        )

    def reach(self, z: float) -> float:
        """Return the largest distance [m] from joint 1's axis at which the tool at height `z` [m] can point down ahead,
        0: none."""
        key = round(z, 4)
        if key not in self._reaches:
            far = reach(self.chain)
            out = [r for r in np.arange(0.1, far, 0.05) if self._search(ToolPose(r, 0.0, key, 0.0), self.home).found]
            low = max(out, default=0.0)
            high = min(far, low + 0.05)
            while out and high - low > FINE:
                middle = (low + high) / 2
                found = self._search(ToolPose(middle, 0.0, key, 0.0), self.home).found
                low, high = (middle, high) if found else (low, middle)
            self._reaches[key] = float(low)
        return self._reaches[key]

    def solve(self, pose: ToolPose, near: np.ndarray) -> np.ndarray:
        """Return joint values (J,) of a pose, on the branch of `near` (J,) where that leads there. Raises MotionFailed
        `no_inverse_kinematics` with the distance [m] to the nearest place that is reached, and that place."""
        way = self.follow(way_between(self.pose_of(near), pose), near)
        if way is not None and self._lowest(way[-1]) > LOW:
            return np.asarray(way[-1])
        answers = self._answers(pose, near)
        if answers:
            return min(answers, key=lambda arm: (self._lowest(arm) < LOW, float(np.abs(arm - near).max())))
        answer = self._search(pose, near)
        farthest, radius = self.reach(pose.z), pose.radius
        scale = farthest / radius if radius > farthest else 1.0
        distance = radius - farthest if radius > farthest else answer.position_error
        raise MotionFailed(
            "no_inverse_kinematics",
            f"the tool cannot reach ({pose.x:.3f}, {pose.y:.3f}) at height {pose.z:.3f} m with yaw {pose.yaw:.2f}: "
            f"{1000 * distance:.0f} mm too far, nearest reachable ({scale * pose.x:.3f}, {scale * pose.y:.3f})",
            numbers={"distance": distance, "nearest_x": scale * pose.x, "nearest_y": scale * pose.y},
        )

    def follow(self, poses: list[ToolPose], start: np.ndarray) -> np.ndarray | None:
        """Return joint values (N, J), one for each pose, from an arm before the first; None where it cannot follow."""
        try:
            return follow(self.chain, [pose.matrix() for pose in poses], start)
        except MotionFailed:
            return None

    def pose_of(self, arm: np.ndarray) -> ToolPose:
        """Return where the tool is, as if it pointed straight down."""
        tool = forward(self.chain, arm)
        return ToolPose(float(tool[0, 3]), float(tool[1, 3]), float(tool[2, 3]), atan2(tool[1, 0], tool[0, 0]))

    def _answers(self, pose: ToolPose, near: np.ndarray) -> list[np.ndarray]:
        """Return the joint values (J,) that each start leads to."""
        found = (inverse_kinematics(self.chain, pose.matrix(), start[None]) for start in (near, *self._starts))
        return [answer.arm for answer in found if answer.found]

    def _lowest(self, arm: np.ndarray) -> float:
        """Return the height [m] of the lowest joint beyond the second: an elbow that hangs sweeps what stands."""
        frames = np.zeros((len(arm) + 1, 3, 4))
        link_frames(self.chain.fixed, 0.0, np.concatenate([np.zeros(3), arm]), frames)
        return float(frames[3:, 2, 3].min())

    def _search(self, pose: ToolPose, near: np.ndarray) -> InverseSolution:
        return inverse_kinematics(self.chain, pose.matrix(), np.concatenate([near[None], self._starts]))


def way_between(start: ToolPose, end: ToolPose) -> list[ToolPose]:
    """Return tool poses from one (excluded) to another (included), straight in cylinder coordinates, the yaw turning by
    the shorter way."""
    first, last = atan2(start.y, start.x), atan2(end.y, end.x)
    turn = (end.yaw - start.yaw + pi) % (2 * pi) - pi
    around, out, up = last - first, end.radius - start.radius, end.z - start.z
    largest = hypot(start.radius, end.radius)
    count = max(1, ceil(max(abs(around) * largest / STEP, abs(turn) / TURN, abs(out) / STEP, abs(up) / STEP)))
    poses = []
    for share in np.arange(1, count + 1) / count:
        radius, azimuth = start.radius + share * out, first + share * around
        poses.append(
            ToolPose(
                float(radius * cos(azimuth)),
                float(radius * sin(azimuth)),
                float(start.z + share * up),
                float(start.yaw + share * turn),
            )
        )
    return poses
