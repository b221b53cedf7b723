"""Letting go of what the hand holds: over the rim around a spot, straight down, and back."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scenewright.stages.agent.world.physics.beliefs import HELD, Beliefs, Believed, Hold
from scenewright.stages.agent.world.physics.hands import CLEAR, LIFT_INSIDE, SAMPLES, SLOW, Motion, pointing
from scenewright.stages.kit.motion.arm_motion import ArmPlanner, Tally
from scenewright.stages.kit.motion.cartesian import raised
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.motion.segments import Segment, whole_body
from scenewright.stages.kit.simulation.robot import Configuration
from scipy.spatial.transform import Rotation

DROP = 0.15
"""Height over its target at which the thesis lets go [m]."""
JUST_OVER = 0.008
"""Height at which ours does, if nothing was touched before [m]."""
UP, OVER_RIM = 0.06, 0.015
"""Way of the hand up from where it lets go before it goes anywhere else, and of what it holds over the rim of a box
[m]; by eye."""
SOME_WAY_OVER = 0.06
"""Height at which ours does where the hand has no room farther down [m]."""
TURNS = tuple((turn, tilt) for tilt in (0.0, 0.45) for turn in (0.0, 0.5, -0.5, 1.0, -1.0, 1.6, -1.6))
"""How the hand is turned about the vertical, and leaned away from the robot where it gets no farther upright [rad]."""
INTO_TURNS = ((0.0, 0.0), (0.3, 0.0), (-0.3, 0.0))
"""The same of a hand that goes into a shelf."""
NESTLES = 0.015
"""Boxes of round things are so much wider than they are [m]: fruit may lie that near to fruit."""


@dataclass(frozen=True)
class Spot:
    """Where something is let go."""

    at: tuple[float, float, float]
    """On what was seen there, in the map [m]."""
    rim: float
    """Height of the top of what is around it, as of a box that it is put into [m]."""
    around: dict[str, Believed]
    """All that stands there."""
    beside: dict[str, Believed]
    """The same without what covers the spot, which the hand comes down into."""
    nestled: tuple[str, ...]
    """What lies beside it on the same carrier: what is held may come down against it."""
    behind: float = 0.0
    """How far behind the front of an open shelf it is [m]: the hand comes and goes straight."""
    inward: float = 0.0
    """Heading straight into that front [rad]."""


def plan_release(
    beliefs: Beliefs,
    base: np.ndarray,
    arm: np.ndarray,
    hold: Hold | None,
    spot: Spot,
    height: float,
    random: np.random.Generator,
) -> Motion:
    """Return the motion that lets go with the foot of what is held `height` [m] over a spot: to over the rim around it,
    straight down, and back. Raises MotionFailed with what ended most attempts.
    """
    at, inside = spot.at, spot.behind > 0
    up = LIFT_INSIDE if inside else max(UP, spot.rim + OVER_RIM - spot.at[2] - height)
    planner, tally = ArmPlanner(beliefs, random, SAMPLES), Tally()
    opening, carry = beliefs.description.opening, beliefs.description.carry
    foot = hold.foot if hold is not None else 0.0
    held = beliefs.hold(hold)
    beliefs.robot.set(Configuration(base, arm, opening))
    beliefs.show(spot.beside)
    planner = planner.under(replace(held, rests_on=dict.fromkeys(spot.nestled, NESTLES)))
    heading = spot.inward if inside else float(np.arctan2(at[1] - base[1], at[0] - base[0]))
    clear = spot.behind + CLEAR + (float(hold.size[:2].max()) if hold is not None else 0.0)
    try:
        for turn, tilt in INTO_TURNS if inside else TURNS:
            pose = _tilt(_tool_rotation(hold, heading, turn), heading, tilt)
            pose[:3, 3] = (at[0], at[1], at[2] + height + foot)
            down = planner.straight(base, pose, raised(pose, up), tally, starts=3)
            if down is None:
                continue
            come, away = down[-1:], down
            if inside:
                out = planner.line(base, down[-1], _moved_out(raised(pose, up), clear), tally)
                off = None if out is None else planner.line(base, down[0], _moved_out(pose, clear), tally)
                if out is None or off is None:
                    continue
                come, away = out[::-1], off
            beliefs.show(spot.around)
            try:
                reach = planner.path(base, arm, come[0])
                back = planner.path(base, away[-1], carry)
            except MotionFailed as failed:
                tally.failed(failed)
                break
            there = Segment(whole_body(base, np.concatenate([reach, come[1:]])), 0.0, SLOW if inside else 0.6)
            return Motion(
                (there, Segment(whole_body(base, down[::-1]), 0.0, SLOW)),
                (Segment(whole_body(base, away), opening, SLOW), Segment(whole_body(base, back), opening)),
            )
        tally.raise_for("place", (HELD,))
    finally:
        beliefs.hold(None)
    raise AssertionError("unreachable")


def _tool_rotation(hold: Hold | None, heading: float, turn: float) -> np.ndarray:
    """Return the tool's rotation (4, 4): as it grasped but for the yaw, the hand away from the base."""
    if hold is None:
        return pointing(heading + turn, np.pi / 2)
    approach = hold.rotation[:, 2]
    level = float(np.hypot(approach[0], approach[1]))
    present_heading = (
        np.arctan2(approach[1], approach[0]) if level > 0.2 else np.arctan2(hold.rotation[1, 0], hold.rotation[0, 0])
    )
    c, s = np.cos(heading + turn - present_heading), np.sin(heading + turn - present_heading)
    pose = np.eye(4)
    pose[:3, :3] = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ hold.rotation
    return pose


def _moved_out(pose: np.ndarray, distance: float) -> np.ndarray:
    """Return a tool pose (4, 4) moved level against where the hand points [m]."""
    moved = pose.copy()
    moved[:2, 3] -= distance * pose[:2, 2] / max(float(np.hypot(*pose[:2, 2])), 1e-6)
    return moved


def _tilt(pose: np.ndarray, heading: float, tilt: float) -> np.ndarray:
    """Return a tool's rotation (4, 4) leaned so that the hand is behind its tip, as seen along a heading [rad]."""
    axis = np.array([np.sin(heading), -np.cos(heading), 0.0])
    turn = np.eye(4)
    turn[:3, :3] = Rotation.from_rotvec(tilt * axis).as_matrix()
    return turn @ pose
