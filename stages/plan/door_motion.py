"""Geometry of doors and drawers: push shut with closed fingers, pull open by the handle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.kit.acting.doors import OVERSHOOT, first_along, pushes
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.kit.motion.arcs import Arc, arc_values, tilts
from scenewright.stages.kit.motion.arm_motion import ArmPlanner, Tally
from scenewright.stages.kit.motion.base_placement import possible_bases, shoulder_distance
from scenewright.stages.kit.motion.doors import (
    ContactPoint,
    body_from_moved,
    closing_direction,
    open_value,
    push_points,
)
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.motion.segments import Manipulation
from scenewright.stages.plan.action import MotionRequest
from scenewright.stages.plan.pick_place import Budgets
from scenewright.stages.plan.world_model import RobotState, WorldModel, as_held

GRIP_SLACK = 0.012
"""Opening to which the fingers close on a handle [m]; by eye."""
OPEN = 0.5
"""Share of a joint's range above which it counts as open."""


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
    single_push = _push(search, value, -OVERSHOOT)
    if single_push is not None:
        return (single_push,)
    for share in (0.5, 0.7, 0.3):
        middle = value * share
        first = _push(search, value, middle)
        if first is None:
            continue
        after = RobotState(first.base, first.segments[-1].path[-1, 3:])
        with model.world.joints_at(body, {joint_name: middle}):
            second = _push(replace(search, state=after, base=None), middle, -OVERSHOOT)
        if second is not None:
            return first, second
    tally.raise_for(f"close({joint_name})", (body, joint_name))


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


def _candidate_bases(search: JointSearch, points: np.ndarray) -> np.ndarray:
    """Return free bases (K, 3) from which all points (N, 3) lie within the arm's length; the one that is asked for."""
    if search.base is not None:
        return search.base[None]
    model, state, budgets = search.model, search.state, search.budgets
    random, tally = search.random, search.tally
    planner_reach = 0.98 * ArmPlanner(model, random, 1).reach
    middle, ring = points.mean(axis=0), {"nearest": 0.2, "farthest": 0.9, "heading": 1.2}
    bases = possible_bases(model.description, state.base, middle, model.room, budgets.bases, random, **ring)
    checker, rows = model.checker.under(as_held(model, state)), []
    for base in bases:
        poses = np.tile(np.eye(4), (len(points), 1, 1))
        poses[:, :3, 3] = points
        if max(shoulder_distance(base, pose, model.description, model.chain) for pose in poses) > planner_reach:
            continue
        collision = checker.check(np.concatenate([base, state.arm]))
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
    lift = float(model.pose(body)[2, 3])
    part = model.part_mesh(body, joint.part)
    lowest = min(0.45 - lift, float(part.bounds[1][2]) - 0.05)
    contacts = push_points(joint, part, random, 6, (lowest, 1.25 - lift))
    values, overhang = arc_values(start, end), model.description.tip_overhang
    planner = ArmPlanner(model, random, budgets.path_samples)
    for contact in contacts:
        bases = _bases_along(search, contact, values)[:6]
        arcs = pushes(body, joint, (contact,), values, tuple(tilts(len(values))), overhang)
        motion = first_along(model, state.arm, arcs, bases, planner, tally)
        if motion is not None:
            return motion
    return None


def _drag(search: JointSearch, contact: ContactPoint, roll: float, start: float, end: float) -> Manipulation | None:
    model, body, joint = search.model, search.body, search.joint
    values, opening = arc_values(start, end), model.description.opening
    bases = _bases_along(search, contact, values)[:10]
    planner = ArmPlanner(model, search.random, search.budgets.path_samples)
    arcs = (
        Arc(body, joint, contact, values, tilt, roll + flip, 0.0, opening, GRIP_SLACK)
        for tilt in tilts(len(values))
        for flip in (0.0, np.pi)
    )
    return first_along(model, search.state.arm, arcs, bases, planner, search.tally)


def _bases_along(search: JointSearch, contact: ContactPoint, values: np.ndarray) -> np.ndarray:
    """Return free bases (K, 3) that reach a contact of the part at all of some joint values (N,)."""
    world_from_body, joint = search.model.pose(search.body), search.joint
    moved = (world_from_body @ body_from_moved(joint, float(value)) for value in values)
    return _candidate_bases(search, np.array([apply(pose, contact.point) for pose in moved]))


def check_joint(joint: Joint, value: float, action: str, planned: str, reached: Callable[[Joint, float], bool]) -> None:
    """Raises MotionFailed `condition_not_met` when a joint of the room, `planned` in the plan, is not `reached`."""
    if not reached(joint, value):
        raise MotionFailed(
            "condition_not_met",
            f"after {action} the joint {joint.name} stands at {value:.3f} of {joint.upper:.3f}",
            (planned,),
            {"value": value, "upper": joint.upper},
        )
