"""Whether a robot could stand so that its arm gets to a place from above. How it gets there is for `plan`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.cli.asking.asked_scene import AskedScene
from scenewright.stages.kit.motion.base_placement import in_arm_frame, sample_bases, shoulder_distance
from scenewright.stages.kit.motion.kinematics import arm_chain, inverse_kinematics, random_starts, reach
from scenewright.stages.kit.simulation.robot_description import load_robot
from scipy.spatial import cKDTree

BASES = 200
"""Base poses that are drawn about a place."""
TRIED = 12
"""Of those that stand free, so many are tried with the arm."""
STARTS = 6
"""Arms from which each is tried."""
OVER = 0.1
"""The tool is this far over the place [m]."""
KNEE = 0.08
"""What is lower than this over the floor blocks no base [m]."""
DOWN = np.diag([1.0, -1.0, -1.0, 1.0])
"""A tool that points down."""


@dataclass(frozen=True)
class Reach:
    """What came of it."""

    reached: bool
    base: tuple[float, float, float] | None
    """x, y [m], yaw [rad] of the first base pose from which the arm gets there."""


class Reaching:
    """A robot in a scene's free floor. Raises UsageError for a robot that is not there."""

    def __init__(self, scene: AskedScene, robot: str) -> None:
        self.robot = load_robot(robot)
        self.chain = arm_chain(self.robot)
        points = np.concatenate([mesh.vertices for mesh in scene.meshes.values()])
        layout = [each.thing.instance for each in scene.things if each.class_name == "floor"]
        floors = [scene.meshes[k].vertices[:, 2] for k in layout]
        self.floor = float(np.median(np.concatenate(floors))) if floors else float(points[:, 2].min())
        height = points[:, 2] - self.floor
        blocking = (height > KNEE) & (height < self.robot.pedestal_height + KNEE)
        self.blocks = cKDTree(points[blocking, :2]) if blocking.any() else None
        self.room = points[:, :2].min(axis=0), points[:, :2].max(axis=0)

    def to(self, place: tuple[float, float, float], seed: int = 0) -> Reach:
        """Return whether the arm gets over a place [m, world] from a base that stands free; the same each time."""
        random = np.random.default_rng(seed)
        target = DOWN.copy()
        target[:3, 3] = np.array(place) + (0, 0, OVER - self.floor)
        bases = sample_bases(np.array(place), self.room, BASES, random) if self.robot.drives else np.zeros((1, 3))
        if self.blocks is not None and self.robot.drives:
            bases = bases[self.blocks.query(bases[:, :2])[0] > self.robot.pedestal_radius]
        farthest = reach(self.chain)
        near = [base for base in bases if shoulder_distance(base, target, self.robot, self.chain) <= farthest]
        for base in near[:TRIED]:
            starts = random_starts(self.chain, STARTS, random)
            if inverse_kinematics(self.chain, in_arm_frame(base, target, self.robot), starts).found:
                x, y, yaw = (round(float(value), 3) for value in base)
                return Reach(True, (x, y, yaw))
        return Reach(False, None)
