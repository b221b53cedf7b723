"""Motions of the hand along with a door or a drawer: pulled by its handle, or pushed shut with closed fingers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.kit.motion.arm_motion import ARM_RESOLUTION, ArmModel, ArmPlanner, Tally
from scenewright.stages.kit.motion.cartesian import drawn_back, follow
from scenewright.stages.kit.motion.collision import Collision
from scenewright.stages.kit.motion.doors import ContactPoint, tool_poses
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.motion.rrt_connect import densify
from scenewright.stages.kit.motion.segments import Manipulation, Segment, whole_body
from scenewright.stages.kit.simulation.robot import Configuration, Robot, base_pose
from scenewright.stages.kit.simulation.world import PhysicsWorld

STANDOFF = 0.07
"""Distance from the handle at which the approach begins [m]; by eye."""
ARC_STEP = 0.05
"""Step of a joint between two poses on its way [rad, m]; by eye."""
SLOW = 0.3
"""Share of the full speed at which the hand moves at and with the handle; by eye."""
TILTS = (0.0, 0.5, -0.5, 0.9, -0.9, 1.2, -1.2)
"""Tilts of the hand against the handle that are tried [rad], the straight one first; by eye."""


class JointedModel(ArmModel, Protocol):
    """What is believed of a room with doors."""

    world: PhysicsWorld
    robot: Robot

    def pose(self, name: str) -> np.ndarray:
        """Return world_from_body (4, 4)."""
        ...


@dataclass(frozen=True)
class Arc:
    """A way of the hand along with a moving part."""

    body: str
    joint: Joint
    contact: ContactPoint
    values: np.ndarray
    """(K,) joint values on the way."""
    tilt: np.ndarray
    """(K,) turn of the approach against the closing direction about the vertical [rad]."""
    roll: float
    gap: float
    """Of the tool point outside the contact point [m]."""
    opening: float
    """Of the fingers on approach [m]; 0: closed, they push."""
    grip: float
    """To which the fingers close on the handle [m]."""

    def poses(self, world_from_body: np.ndarray, rows: list[int] | None = None) -> list[np.ndarray]:
        """Return world_from_tool (4, 4) at all joint values, or at some rows of them."""
        values = self.values if rows is None else self.values[rows]
        tilt = self.tilt if rows is None else self.tilt[rows]
        return tool_poses(self.joint, self.contact, world_from_body, values, tilt=tilt, roll=self.roll, gap=self.gap)


def arc_values(start: float, end: float) -> np.ndarray:
    """Return joint values (K,) from `start` to `end` [rad] or [m], few apart."""
    count = max(2, int(np.ceil(abs(end - start) / ARC_STEP)) + 1)
    return np.linspace(start, end, count)


def tilts(count: int) -> Iterator[np.ndarray]:
    """Yield tilts (count,) along the motion: constant ones, then ones that turn by the way."""
    for start in TILTS:
        yield np.full(count, start)
    for start in TILTS:
        for end in TILTS:
            if 0 < abs(start - end) < 1.5:
                yield np.linspace(start, end, count)


def along_arc(
    model: JointedModel, arm: np.ndarray, arc: Arc, base: np.ndarray, planner: ArmPlanner, tally: Tally
) -> Manipulation | None:
    """Return the motion in which the tool goes along an arc from a base pose, or None (tallied)."""
    world_from_body = model.pose(arc.body)
    body, joint, values, opening, grip = arc.body, arc.joint, arc.values, arc.opening, arc.grip
    # Cheap tests at the ends and in the middle first.
    for pose in arc.poses(world_from_body, [0, len(values) // 2, len(values) - 1]):
        if planner.reachable(base, pose, tally, starts=2) is None:
            return None
    poses = arc.poses(world_from_body)
    model.robot.set(Configuration(base, arm, max(opening, grip)))
    start = planner.reachable(base, poses[0], tally)
    if start is None:
        return None
    at_handle = planner.under(replace(planner.checker.query, may_touch=frozenset({joint.part})))
    arms = _arc(model, at_handle, base, arc, poses, start, tally)
    if arms is None:
        return None
    pulling = opening > 0
    try:
        with model.world.joints_at(body, {joint.name: float(values[0])}):
            approach = at_handle.line(base, arms[0], drawn_back(poses[0], STANDOFF), tally)
            if approach is None:
                return None
            reach = planner.path(base, arm, approach[-1])
        with model.world.joints_at(body, {joint.name: max(0.0, float(values[-1]))}):
            away = at_handle.line(base, arms[-1], drawn_back(poses[-1], STANDOFF), tally)
            if away is None:
                return None
            home = planner.path(base, away[-1], model.description.carry)
    except MotionFailed as failed:
        tally.failed(failed)
        return None
    segments = [
        Segment(whole_body(base, reach), opening),
        Segment(whole_body(base, approach[::-1]), opening, SLOW, label="reach"),
    ]
    if pulling:
        segments.append(Segment(whole_body(base, approach[:1]), grip, SLOW))
    half = len(arms) // 2
    gripped = grip if pulling else 0.0
    verb = "pull" if pulling else "push"
    segments.append(Segment(whole_body(base, arms[: half + 1]), gripped, SLOW, label=verb))
    segments.append(Segment(whole_body(base, arms[half:]), gripped, SLOW, label=verb))
    segments.append(Segment(whole_body(base, away), opening, SLOW))
    segments.append(Segment(whole_body(base, home), opening))
    return Manipulation(base, tuple(segments), joint_values={joint.name: max(0.0, float(values[-1]))})


def _arc(
    model: JointedModel,
    planner: ArmPlanner,
    base: np.ndarray,
    arc: Arc,
    poses: list[np.ndarray],
    start: np.ndarray,
    tally: Tally,
) -> np.ndarray | None:
    """Return arm values (K, J) along the poses, free with the door where it is at each of them."""
    body, joint, values = arc.body, arc.joint, arc.values
    frame = inverse(base_pose(base, model.description))
    try:
        arms = follow(model.chain, [frame @ pose for pose in poses], start)
    except MotionFailed as failed:
        tally.unreachable += 1
        tally.nearest = min(tally.nearest, failed.failure.numbers["distance"])
        return None
    collision: Collision | None = None
    with model.world.joints_at(body, {joint.name: float(values[0])}):
        for index, value in enumerate(values):
            model.world.set_joint(body, joint.name, max(0.0, float(value)))
            rows = densify(arms[max(0, index - 1) : index + 1], np.full(arms.shape[1], ARM_RESOLUTION))
            for row in rows[-2:]:
                collision = collision or planner.checker.check(np.concatenate([base, row]))
            if collision is not None:
                break
    if collision is not None:
        tally.collided(collision)
        return None
    return arms
