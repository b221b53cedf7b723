"""Geometry of doors and drawers: push shut with closed fingers, pull open by the handle."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from schemas.scene_parts import Joint
from stages.kit.geometry.transforms import apply, inverse
from stages.kit.motion.arm_motion import ARM_RESOLUTION, ArmPlanner, Tally
from stages.kit.motion.base_placement import possible_bases, shoulder_distance
from stages.kit.motion.cartesian import follow
from stages.kit.motion.collision import Collision
from stages.kit.motion.doors import ContactPoint, body_from_moved, closing_direction, push_points, tool_poses
from stages.kit.motion.failures import MotionFailed
from stages.kit.motion.rrt_connect import densify
from stages.kit.motion.segments import Manipulation, Segment, whole_body
from stages.kit.simulation.robot import Configuration, base_pose
from stages.plan.action import MotionRequest
from stages.plan.pick_place import Budgets
from stages.plan.world_model import RobotState, WorldModel

STANDOFF = 0.07
OVERSHOOT = 0.02
"""A door is pushed this much beyond shut [rad]; its limit stops it."""
PRESS = 0.006
"""The commanded finger tips are this far inside the door's surface, so that they stay in touch [m]."""
ARC_STEP = 0.05
SLOW = 0.3
TILTS = (0.0, 0.5, -0.5, 0.9, -0.9, 1.2, -1.2)
GRIP_SLACK = 0.012
OPEN = 0.5
"""Share of a joint's range above which it counts as open."""


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


def is_closed(joint: Joint, value: float) -> bool:
    """Whether a joint value counts as shut: below 0.08 rad or 2 cm, whatever the joint's range."""
    return value < (0.08 if joint.type == "revolute" else 0.02)


def open_value(joint: Joint) -> float:
    """Return the value to which a joint is opened: 1.4 rad, or 85 % of a drawer's (or smaller door's) range."""
    return min(1.4, 0.85 * joint.upper) if joint.type == "revolute" else 0.85 * joint.upper


def is_open(joint: Joint, value: float) -> bool:
    """Whether a joint is open enough to reach through: at least 0.9 rad or 60 % of its range."""
    return value >= min(0.9 if joint.type == "revolute" else np.inf, 0.6 * joint.upper)


def plan_close(
    model: WorldModel, state: RobotState, body: str, joint_name: str, request: MotionRequest
) -> tuple[Manipulation, ...]:
    """Return the motions that push a joint shut, one or two (from two places), base poses included; the first from the
    base of the request, if it has one.

    Raises MotionFailed with what ended most attempts.
    """
    joint = model.joint(body, joint_name)
    value = model.joint_value(body, joint_name)
    tally = Tally()
    search = JointSearch(model, state, body, joint, request.budgets, request.random, tally, request.base)
    whole = _push(search, value, -OVERSHOOT)
    if whole is not None:
        return (whole,)
    for share in (0.5, 0.7, 0.3):
        middle = value * share
        first = _push(search, value, middle)
        if first is None:
            continue
        after = RobotState(first.base, first.segments[-1].path[-1, 3:])
        with model.joints_at(body, {joint_name: middle}):
            second = _push(replace(search, state=after, base=None), middle, -OVERSHOOT)
        if second is not None:
            return first, second
    tally.raise_for(f"close({joint_name})", (body, joint_name))
    raise AssertionError("unreachable")


def plan_open(
    model: WorldModel, state: RobotState, body: str, joint_name: str, request: MotionRequest
) -> tuple[Manipulation, ...]:
    """Return the motions that pull a joint open by its handle. Raises MotionFailed; `no_grasp` without a handle."""
    joint = model.joint(body, joint_name)
    if joint.handle is None:
        raise MotionFailed("no_grasp", f"{joint_name} has no handle to pull at", (body, joint_name))
    value = model.joint_value(body, joint_name)
    handle = np.array(joint.handle)
    contact = ContactPoint(handle, closing_direction(joint, handle))
    bar = np.array(joint.handle_axis) if joint.handle_axis is not None else np.array([0.0, 0.0, 1.0])
    roll = 0.0 if abs(bar[2]) > 0.5 else np.pi / 2
    tally = Tally()
    search = JointSearch(model, state, body, joint, request.budgets, request.random, tally, request.base)
    for end in (open_value(joint), max(0.65 * open_value(joint), 0.62 * joint.upper)):
        plan = _drag(search, contact, roll, value, end)
        if plan is not None:
            return (plan,)
    tally.raise_for(f"open({joint_name})", (body, joint_name))
    raise AssertionError("unreachable")


def _values(start: float, end: float) -> np.ndarray:
    count = max(2, int(np.ceil(abs(end - start) / ARC_STEP)) + 1)
    return np.linspace(start, end, count)


def _tilts(count: int) -> Iterator[np.ndarray]:
    """Yield tilts (count,) along the motion: constant ones, then ones that turn by the way."""
    for start in TILTS:
        yield np.full(count, start)
    for start in TILTS:
        for end in TILTS:
            if 0 < abs(start - end) < 1.5:
                yield np.linspace(start, end, count)


def _candidate_bases(search: JointSearch, points: np.ndarray) -> np.ndarray:
    """Return free bases (K, 3) from which all points (N, 3) lie within the arm's length; the one that is asked for."""
    if search.base is not None:
        return search.base[None]
    model, state, budgets = search.model, search.state, search.budgets
    random, tally = search.random, search.tally
    planner_reach = 0.98 * ArmPlanner(model, random, 1).reach
    middle, ring = points.mean(axis=0), {"nearest": 0.2, "farthest": 0.9, "heading": 1.2}
    bases = possible_bases(model.description, state.base, middle, model.room, budgets.bases, random, **ring)
    rows = []
    for base in bases:
        poses = np.tile(np.eye(4), (len(points), 1, 1))
        poses[:, :3, 3] = points
        if max(shoulder_distance(base, pose, model.description, model.chain) for pose in poses) > planner_reach:
            continue
        collision = model.checker.check(np.concatenate([base, state.arm]))
        if collision is None:
            rows.append(base)
            if len(rows) >= budgets.bases // 8:
                break
        else:
            tally.collided(collision)
    return np.array(rows).reshape(-1, 3)


@dataclass(frozen=True)
class JointSearch:
    """The search for a motion of one joint."""

    model: WorldModel
    state: RobotState
    body: str
    joint: Joint
    budgets: Budgets
    random: np.random.Generator
    tally: Tally
    """Counts what ended the attempts."""
    base: np.ndarray | None = None
    """Where the robot stands for it (3,); None: where it can."""


def _push(search: JointSearch, start: float, end: float) -> Manipulation | None:
    model, state, body, joint, tally = search.model, search.state, search.body, search.joint, search.tally
    budgets, random = search.budgets, search.random
    world_from_body = model.pose(body)
    lift = float(world_from_body[2, 3])
    part = model.part_mesh(body, joint.part)
    lowest = min(0.45 - lift, float(part.bounds[1][2]) - 0.05)
    contacts = push_points(joint, part, random, 6, (lowest, 1.25 - lift))
    values = _values(start, end)
    gap = model.description.tip_overhang - PRESS
    planner = ArmPlanner(model, random, budgets.path_samples)
    for contact in contacts:
        route = np.array(
            [apply(world_from_body @ body_from_moved(joint, float(value)), contact.point) for value in values]
        )
        bases = _candidate_bases(search, route)
        for tilt in _tilts(len(values)):
            for roll in (0.0, np.pi / 2):
                arc = Arc(body, joint, contact, values, tilt, roll, gap, 0.0, 0.0)
                for base in bases[:6]:
                    motion = _try_arc(model, state, arc, base, planner, tally)
                    if motion is not None:
                        return motion
    return None


def _drag(search: JointSearch, contact: ContactPoint, roll: float, start: float, end: float) -> Manipulation | None:
    model, state, body, joint, tally = search.model, search.state, search.body, search.joint, search.tally
    budgets, random = search.budgets, search.random
    world_from_body = model.pose(body)
    values = _values(start, end)
    route = np.array([apply(world_from_body @ body_from_moved(joint, float(value)), contact.point) for value in values])
    bases = _candidate_bases(search, route)
    opening = model.description.opening
    planner = ArmPlanner(model, random, budgets.path_samples)
    for tilt in _tilts(len(values)):
        for flip in (0.0, np.pi):
            arc = Arc(body, joint, contact, values, tilt, roll + flip, 0.0, opening, GRIP_SLACK)
            for base in bases[:10]:
                motion = _try_arc(model, state, arc, base, planner, tally)
                if motion is not None:
                    return motion
    return None


def _try_arc(
    model: WorldModel, state: RobotState, arc: Arc, base: np.ndarray, planner: ArmPlanner, tally: Tally
) -> Manipulation | None:
    """Return the motion in which the tool goes along an arc from a base pose, or None (tallied)."""
    world_from_body = model.pose(arc.body)
    body, joint, values, opening, grip = arc.body, arc.joint, arc.values, arc.opening, arc.grip
    # Cheap tests at the ends and in the middle first.
    for pose in arc.poses(world_from_body, [0, len(values) // 2, len(values) - 1]):
        if planner.reachable(base, pose, tally, starts=2) is None:
            return None
    poses = arc.poses(world_from_body)
    model.robot.set(Configuration(base, state.arm, max(opening, grip)))
    start = planner.reachable(base, poses[0], tally)
    if start is None:
        return None
    arms = _arc(model, planner, base, arc, poses, start, tally)
    if arms is None:
        return None
    checker = model.checker
    pulling = opening > 0
    try:
        with model.joints_at(body, {joint.name: float(values[0])}):
            checker.allow(touch=(joint.part,))
            near = poses[0].copy()
            near[:3, 3] -= STANDOFF * near[:3, 2]
            approach = planner.line(base, arms[0], near, tally)
            if approach is None:
                return None
            checker.allow()
            reach = planner.path(base, state.arm, approach[-1])
        with model.joints_at(body, {joint.name: max(0.0, float(values[-1]))}):
            checker.allow(touch=(joint.part,))
            far = poses[-1].copy()
            far[:3, 3] -= STANDOFF * far[:3, 2]
            away = planner.line(base, arms[-1], far, tally)
            if away is None:
                return None
            checker.allow()
            home = planner.path(base, away[-1], model.description.carry)
    except MotionFailed as failed:
        tally.failed(failed)
        return None
    finally:
        checker.allow()
    segments = [
        Segment(whole_body(base, reach), opening),
        Segment(whole_body(base, approach[::-1]), opening, SLOW, label="reach"),
    ]
    if pulling:
        segments.append(Segment(whole_body(base, approach[:1]), grip, SLOW))
    half = len(arms) // 2
    held = grip if pulling else 0.0
    verb = "pull" if pulling else "push"
    segments.append(Segment(whole_body(base, arms[: half + 1]), held, SLOW, label=verb))
    segments.append(Segment(whole_body(base, arms[half:]), held, SLOW, label=verb))
    segments.append(Segment(whole_body(base, away), opening, SLOW))
    segments.append(Segment(whole_body(base, home), opening))
    return Manipulation(base, tuple(segments), joint_values={joint.name: max(0.0, float(values[-1]))})


def _arc(
    model: WorldModel,
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
    checker = model.checker
    checker.allow(touch=(joint.part,))
    collision: Collision | None = None
    with model.joints_at(body, {joint.name: float(values[0])}):
        for index, value in enumerate(values):
            model.world.set_joint(body, joint.name, max(0.0, float(value)))
            rows = densify(arms[max(0, index - 1) : index + 1], np.full(arms.shape[1], ARM_RESOLUTION))
            for row in rows[-2:]:
                collision = collision or checker.check(np.concatenate([base, row]))
            if collision is not None:
                break
    checker.allow()
    if collision is not None:
        tally.collided(collision)
        return None
    return arms


def check_joint(joint: Joint, value: float, action: str, planned: str, reached: Callable[[Joint, float], bool]) -> None:
    """Raises MotionFailed `condition_not_met` when a joint of the room, `planned` in the plan, is not `reached`."""
    if not reached(joint, value):
        raise MotionFailed(
            "condition_not_met",
            f"after {action} the joint {joint.name} stands at {value:.3f} of {joint.upper:.3f}",
            (planned,),
            {"value": value, "upper": joint.upper},
        )
