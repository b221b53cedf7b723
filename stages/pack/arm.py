"""The arm of the packing scene: a Franka bolted down at the origin that holds its tool straight down.

With the tool axis vertical and joints 3 and 5 at zero the arm lies in one vertical plane, so that inverse kinematics
is the cosine rule: joint 1 turns the plane, joint 7 undoes it. That family contains the farthest reach. Where its
answer breaks a joint limit, a numeric search with several seeds looks among the configurations outside the family, so
that `joint_limit` is only said after it, and `no_inverse_kinematics` only beyond what the links can span.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import acos, atan2, cos, hypot, pi, sin, sqrt
from typing import Literal

import numpy as np
from scenewright.stages.kit.motion.compiled_check import link_frames
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.motion.kinematics import ArmChain, arm_chain, forward, inverse_kinematics, random_starts
from scenewright.stages.kit.simulation.robot_description import RobotDescription, load_robot
from scenewright.stages.kit.simulation.robot_option import USUAL_ROBOT

Limits = Literal["fr3", "panda"]
FR3_LOWER = np.array([-5.3093, -1.5133, -2.4937, -2.7478, -2.48, 0.8521, -5.7995])
"""Lower joint limits [rad] of the published environment (docs/LLM3.md)."""
FR3_UPPER = np.array([5.3093, 1.5133, 2.4937, -0.4461, 2.48, 4.2094, 5.7995])
"""Upper joint limits [rad] of the published environment (docs/LLM3.md)."""
HOME = np.array([0.0, -pi / 4, 0.0, -3 * pi / 4, 0.0, pi / 2, pi / 4])
"""Home configuration [rad], Franka's own."""
SEARCHES = 10
"""Random seeds of the numeric search, beside the nearest planar configuration and the home one."""
LEAN_OUT = np.array([0.0, 0.0, 0.4, 0.0, 0.0, 0.0, 0.0])
"""Turn of the elbow out of the plane in which a search starts [rad]; by eye."""


@dataclass(frozen=True)
class ToolPose:
    """Tool point in the world [m] with its axis straight down, and the yaw of its x axis [rad]."""

    x: float
    y: float
    z: float
    yaw: float

    @property
    def radius(self) -> float:
        """Distance [m] from the axis of joint 1."""
        return hypot(self.x, self.y)

    def matrix(self) -> np.ndarray:
        """Return world_from_tool (4, 4)."""
        c, s = cos(self.yaw), sin(self.yaw)
        return np.array([[c, s, 0, self.x], [s, -c, 0, self.y], [0, 0, -1, self.z], [0, 0, 0, 1.0]])


HOME_POSE = ToolPose(0.306891, 0.0, 0.485302, 0.0)
"""Pose of the tool at the home configuration."""


@dataclass(frozen=True)
class _Lengths:
    """The measures of the planar arm [m], out of the chain."""

    shoulder: float
    upper: float
    forearm: float
    elbow: float
    """Offset of the elbow from the lines shoulder-elbow and elbow-wrist."""
    wrist: float
    """Horizontal offset of the tool from the wrist."""
    hand: float
    """Height of the wrist over the tool point."""
    yaw_offset: float
    """Joint 7 at which the tool's x axis lies in the plane."""


class FixedArm:
    """Inverse kinematics of downward tool poses of the arm at the origin."""

    closed = True
    home, home_pose = HOME, HOME_POSE

    def __init__(self, limits: Limits = "fr3", robot: str = USUAL_ROBOT) -> None:
        description = load_robot(robot)
        if limits == "fr3":
            description = replace(description, lower=FR3_LOWER, upper=FR3_UPPER)
        self.limits, self.robot = limits, robot
        self.description: RobotDescription = description
        self.chain: ArmChain = arm_chain(description)
        self._lengths = _measures(self.chain)
        self.span = hypot(self._lengths.upper, self._lengths.elbow) + hypot(self._lengths.forearm, self._lengths.elbow)
        self._numeric: dict[tuple[float, float], np.ndarray | None] = {}

    def reach(self, z: float) -> float:
        """Return the largest distance [m] from joint 1's axis at which a tool at height `z` can point down, 0: none."""
        height = z + self._lengths.hand - self._lengths.shoulder
        squared = self.span**2 - height**2
        return self._lengths.wrist + sqrt(squared) if squared > 0 else 0.0

    def reaches(self, heights: np.ndarray) -> np.ndarray:
        """Return `reach` of heights (N,)."""
        squared = self.span**2 - (heights + self._lengths.hand - self._lengths.shoulder) ** 2
        return np.where(squared > 0, self._lengths.wrist + np.sqrt(np.maximum(squared, 0.0)), 0.0)

    def solve(self, pose: ToolPose, near: np.ndarray = HOME) -> np.ndarray:
        """Return joint values (7,) of a pose within the limits, joint 7 as near as can be to that of `near`.

        Raises MotionFailed: `no_inverse_kinematics` (beyond the links' span; distance [m] to the nearest reachable
        point and that point), `joint_limit` (the links span it; the joint, its value and by how much it is outside).
        """
        radius = pose.radius
        farthest = self.reach(pose.z)
        if radius > farthest:
            scale = farthest / radius
            raise MotionFailed(
                "no_inverse_kinematics",
                f"the tool cannot reach ({pose.x:.3f}, {pose.y:.3f}) at height {pose.z:.3f} m: "
                f"{1000 * (radius - farthest):.0f} mm too far, "
                f"nearest reachable ({scale * pose.x:.3f}, {scale * pose.y:.3f})",
                numbers={"distance": radius - farthest, "nearest_x": scale * pose.x, "nearest_y": scale * pose.y},
            )
        azimuth = atan2(pose.y, pose.x)
        canonical = self._planar(radius, pose.z)
        if self._outside(canonical)[1] > 0:
            planar = self._search(radius, pose.z)
            if planar is None:
                joint, outside = self._outside(canonical)
                raise MotionFailed(
                    "joint_limit",
                    f"joint {joint + 1} would be {outside:.3f} rad outside its limits at ({pose.x:.3f}, {pose.y:.3f})",
                    numbers={"joint": joint + 1, "value": float(canonical[joint]), "outside": outside},
                )
            canonical = planar
        arm = canonical.copy()
        arm[0] = self._turn(0, canonical[0] + azimuth, near[0])
        arm[6] = self._turn(6, canonical[6] + azimuth - pose.yaw, near[6])
        joint, outside = self._outside(arm)
        if outside > 0:
            raise MotionFailed(
                "joint_limit",
                f"joint {joint + 1} would be {outside:.3f} rad outside its limits for a yaw of {pose.yaw:.2f}",
                numbers={"joint": joint + 1, "value": float(arm[joint]), "outside": outside},
            )
        return arm

    def tool(self, arm: np.ndarray) -> np.ndarray:
        """Return world_from_tool (4, 4) of joint values (7,)."""
        return forward(self.chain, arm)

    def frames(self, arm: np.ndarray) -> np.ndarray:
        """Return world_from_link (7, 3, 4) of links 1 to 7 at joint values (7,)."""
        frames = np.zeros((len(arm) + 1, 3, 4))
        link_frames(self.chain.fixed, 0.0, np.concatenate([np.zeros(3), arm]), frames)
        return frames[1:]

    def _planar(self, radius: float, z: float) -> np.ndarray:
        """Return the configuration (7,) in the plane y = 0 with the tool's yaw 0, limits and reach not looked at."""
        lengths = self._lengths
        out, up = radius - lengths.wrist, z + lengths.hand - lengths.shoulder
        first, second = hypot(lengths.upper, lengths.elbow), hypot(lengths.forearm, lengths.elbow)
        cosine = (out * out + up * up - first**2 - second**2) / (2 * first * second)
        bend = acos(min(1.0, max(-1.0, cosine)))
        upper_offset, lower_offset = atan2(lengths.elbow, lengths.upper), atan2(lengths.elbow, lengths.forearm)
        lean = atan2(out, up) - atan2(second * sin(bend), first + second * cos(bend)) - upper_offset
        elbow = -(bend + upper_offset + lower_offset)
        return np.array([0.0, lean, 0.0, elbow, 0.0, lean - elbow, lengths.yaw_offset])

    def planar(self, radii: np.ndarray, heights: np.ndarray) -> np.ndarray:
        """Return (N, 7) configurations in the plane y = 0, tool's yaw 0, limits and reach not looked at."""
        return np.array([self._planar(*pair) for pair in zip(radii.tolist(), heights.tolist(), strict=True)])

    def _outside(self, arm: np.ndarray) -> tuple[int, float]:
        """Return the joint that is farthest outside its limits and by how much [rad]."""
        outside = np.maximum(self.chain.lower - arm, arm - self.chain.upper)
        joint = int(np.argmax(outside))
        return joint, float(outside[joint])

    def _turn(self, joint: int, value: float, near: float) -> float:
        """Return `value` plus the whole turns that keep it within the limits and nearest to `near`."""
        turned = [value + 2 * pi * k for k in (-2, -1, 0, 1, 2)]
        lower, upper = self.chain.lower[joint], self.chain.upper[joint]
        inside = [entry for entry in turned if lower <= entry <= upper]
        return min(inside or turned, key=lambda entry: abs(entry - near))

    def _search(self, radius: float, z: float) -> np.ndarray | None:
        """Look for a configuration outside the planar family, with fixed seeds; the answer is kept."""
        key = (radius, z)  # not rounded: an answer must not depend on which pose near it was asked for first
        if key not in self._numeric:
            # The planar answer, pushed into the limits and out of its plane, is near: neighbouring poses then get
            # neighbouring answers.
            planar_start = np.clip(self._planar(radius, z) + LEAN_OUT, self.chain.lower, self.chain.upper)
            others = random_starts(self.chain, SEARCHES, np.random.default_rng(7))
            starts = np.concatenate([planar_start[None], HOME[None], others])
            target = ToolPose(radius, 0.0, z, 0.0).matrix()
            answer = inverse_kinematics(self.chain, target, starts)
            self._numeric[key] = answer.arm if answer.found else None
        return self._numeric[key]


def planar_lengths(chain: ArmChain) -> np.ndarray | None:
    """Return shoulder height, upper arm, elbow offset, forearm, wrist offset (5,) [m]; None for another build."""
    if len(chain.fixed) != 7:
        return None
    fixed = chain.fixed
    lengths = np.array([fixed[0, 2, 3], -fixed[2, 1, 3], fixed[3, 0, 3], fixed[4, 1, 3], fixed[6, 0, 3]])
    model = np.tile(np.eye(4), (7, 1, 1))
    for joint, turn in enumerate((0.0, -1.0, 1.0, 1.0, -1.0, 1.0, 1.0)):
        if turn:
            model[joint, 1:3, 1:3] = [[0.0, -turn], [turn, 0.0]]
    model[0, 2, 3], model[2, 1, 3], model[3, 0, 3] = lengths[0], -lengths[1], lengths[2]
    model[4, 0, 3], model[4, 1, 3], model[6, 0, 3] = -lengths[2], lengths[3], lengths[4]
    return lengths if np.abs(model - fixed).max() < 1e-6 else None


def _measures(chain: ArmChain) -> _Lengths:
    """Read the planar arm's measures out of the chain; raises ValueError when it is no arm of this shape."""
    lengths = planar_lengths(chain)
    if lengths is None or lengths[1:].min() <= 0:
        raise ValueError("not an arm of the Franka's shape")
    shoulder, upper, elbow, forearm, wrist = lengths.tolist()
    hand, yaw_offset = float(chain.tool[2, 3]), float(np.arctan2(chain.tool[0, 1], chain.tool[0, 0]))
    return _Lengths(shoulder, upper, forearm, elbow, wrist, hand, yaw_offset)


def planar_joints(arm: FixedArm, radii: np.ndarray, heights: np.ndarray) -> np.ndarray | None:
    """Return the planar configurations (N, 7) of tool positions (N,), (N,); None when one is out of reach or limits.

    Joints 1 and 7 are those of azimuth and yaw 0.
    """
    if np.any(radii > arm.reaches(heights) + 1e-9):
        return None
    joints = arm.planar(radii, heights)
    inner = joints[:, 1:6]
    if np.any(inner < arm.chain.lower[1:6]) or np.any(inner > arm.chain.upper[1:6]):
        return None
    return joints
