"""What happened during execution, sampled over time: joints, base, poses of bodies and links."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scenewright.stages.kit.geometry.transforms import transform_from_quaternion
from scenewright.stages.kit.simulation.engine import engine
from scenewright.stages.kit.simulation.robot import Robot
from scenewright.stages.kit.simulation.world import PhysicsWorld


@dataclass(frozen=True)
class Snapshot:
    """The room at one moment."""

    time: float
    action: int
    """Index of the action, -1 before the first."""
    body: np.ndarray
    """(3 + J,) base and arm."""
    opening: float
    links: dict[str, np.ndarray]
    """World poses (4, 4) of robot links that have a shape, of movable bodies and of moving parts."""


@dataclass
class Recording:
    """Snapshots at a fixed rate, and the indices of those that make key frames."""

    world: PhysicsWorld
    robot: Robot
    period: float
    snapshots: list[Snapshot] = field(default_factory=list)
    keyframes: list[tuple[int, str]] = field(default_factory=list)
    """(index of snapshot, label)"""
    _next: float = 0.0

    def observe(self, action: int) -> None:
        """Take a snapshot when the next one is due."""
        if self.world.time >= self._next - 1e-9:
            self._next = self.world.time + self.period
            self.take(action)

    def take(self, action: int) -> int:
        """Take a snapshot now and return its index."""
        configuration = self.robot.configuration()
        links = _robot_links(self.robot) | moving_links(self.world)
        self.snapshots.append(
            Snapshot(round(self.world.time, 6), action, configuration.body, configuration.opening, links)
        )
        return len(self.snapshots) - 1

    def keyframe(self, action: int, label: str) -> None:
        """Take a snapshot and mark it as a key frame."""
        self.keyframes.append((self.take(action), label))


def moving_links(world: PhysicsWorld) -> dict[str, np.ndarray]:
    """Return the world poses (4, 4) of movable bodies and of moving parts, as they are now."""
    links = {}
    for name, body in world.bodies.items():
        if body.record.movable:
            links[name] = world.pose(name)
        for joint in body.record.joints:
            if joint.part in body.links:
                links[joint.part] = world.link_pose(name, joint.part)
    return links


def _robot_links(robot: Robot) -> dict[str, np.ndarray]:
    names = list(robot.links)
    states = engine.getLinkStates(
        robot.body_id,
        [robot.links[name] for name in names],
        computeForwardKinematics=1,
        physicsClientId=robot.world.client,
    )
    return {
        f"robot/{name}": transform_from_quaternion(np.array(state[5]), np.array(state[4]))
        for name, state in zip(names, states, strict=True)
    }
