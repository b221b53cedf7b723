"""Grasps of fused surfaces as motions of the arm, among what it believes around it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scenewright.stages.agent.senses import CANDIDATES
from scenewright.stages.agent.world.physics.beliefs import Beliefs, Box, Hold
from scenewright.stages.agent.world.physics.eyes import Surface
from scenewright.stages.agent.world.physics.grasps import (
    FORWARD_PITCHES,
    FROM_ABOVE,
    MARGIN,
    STRAIGHT,
    TIGHT,
    antipodal_grasps,
    within_reach,
)
from scenewright.stages.kit.acting.hand.attempts import first_motion
from scenewright.stages.kit.acting.hand.grip import hand_axes, narrowest_width
from scenewright.stages.kit.acting.hand.rim_grasps import rim_grasps
from scenewright.stages.kit.acting.query import touching
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.kit.motion.arm_motion import ArmPlanner, Tally
from scenewright.stages.kit.motion.base_placement import in_arm_frame, shoulder_distance
from scenewright.stages.kit.motion.cartesian import drawn_back, raised
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.motion.kinematics import inverse_kinematics, random_starts
from scenewright.stages.kit.motion.segments import Segment, whole_body
from scenewright.stages.kit.simulation.robot import Configuration
from scenewright.stages.kit.simulation.robot_description import RobotDescription

NEXT = 3
"""Grasps that have their turn last after one slipped."""
APPROACH, LIFT, LIFT_INSIDE = 0.08, 0.10, 0.03
"""Ways of the hand before and after it closes, and after it closes behind a front [m]; by eye."""
CLEAR = 0.04
"""What comes out of a shelf is so far before its front before it goes anywhere else [m]."""
SLOW = 0.35
"""Pace of the hand near things, and with something in it."""
ELBOWS = 12
"""Ways to hold the elbow that are tried where the first is in the way."""
SEARCHES = 2
"""Most path searches that fail before a grasp is given up; by eye."""
SAMPLES = 500
"""Most samples of one path search; by eye."""


@dataclass(frozen=True)
class Target:
    """What is to be grasped: a fused surface, its box among the beliefs."""

    surface: Surface
    name: str
    rank: int
    """How often a grasp of it has slipped already: other ones are tried."""
    floor: float
    """Height of what it stands on [m]."""
    behind: float = 0.0
    """How far behind an open front it stands [m]: the hand goes in and comes out straight."""
    inward: float = 0.0
    """Heading that goes straight into that front [rad]."""
    level: bool = False
    """It will go into a shelf: the hand comes from the side."""


@dataclass(frozen=True)
class Motion:
    """A manipulation: to the place, what is done there with the fingers, and away."""

    there: tuple[Segment, ...]
    away: tuple[Segment, ...]
    hold: Hold | None = None


def reachable(
    beliefs: Beliefs,
    base: np.ndarray,
    at: tuple[float, float, float],
    random: np.random.Generator,
    *,
    forward: bool = False,
) -> bool:
    """Whether some hand pose from above or aslant, or `forward` into a shelf, at a position is free from a base pose
    (3,), in the map."""
    planner, tally = ArmPlanner(beliefs, random, SAMPLES), Tally()
    for pitch in FORWARD_PITCHES if forward else (np.pi / 2, 1.1):
        pose = pointing(float(np.arctan2(at[1] - base[1], at[0] - base[0])), pitch)
        pose[:3, 3] = (at[0], at[1], at[2] + (0.05 if forward else 0.10))
        if forward:
            pose = drawn_back(pose, 0.10)
        if shoulder_distance(base, pose, beliefs.description, beliefs.chain) > planner.reach - 0.02:
            continue
        if planner.free_at(base, pose, tally, starts=3) is not None:
            return True
    return False


def pointing(heading: float, pitch: float) -> np.ndarray:
    """Return a tool pose (4, 4) at the origin that comes along a heading, `pitch` [rad] downwards."""
    pose = np.eye(4)
    pose[:3, :3] = hand_axes(heading, pitch)
    return pose


def plan_grasp(
    beliefs: Beliefs, base: np.ndarray, arm: np.ndarray, target: Target, random: np.random.Generator, most: int
) -> Motion:
    """Return the motion that takes a fused surface, `most` grasps tried. Raises MotionFailed: `no_grasp`, or what ended
    most attempts."""
    surface, name = target.surface, target.name
    possible = grasps_of(target, base, beliefs.description)
    if not possible:
        opening, width = beliefs.description.opening, narrowest_width(surface.points[_inside(surface)])
        raise MotionFailed(
            "no_grasp",
            f"no grasp of {name}, seen {width:.3f} m wide at its narrowest; the gripper opens {opening:.3f} m",
            (name,),
            {"width": width, "opening": opening},
        )
    left_out = target.rank * NEXT % len(possible)  # where few are possible, the first has its turn again
    grasps = (possible[left_out:] + possible[:left_out])[:most]
    planner, tally = ArmPlanner(beliefs, random, SAMPLES), Tally()
    attempts = (_one_grasp(planner, base, arm, target, grasp, tally) for grasp in grasps)
    motion = first_motion(attempts, SEARCHES)
    if motion is None:
        tally.raise_for(f"grasp({name})", (name,))
    return motion


def graspable(beliefs: Beliefs, base: np.ndarray, target: Target, random: np.random.Generator) -> bool:
    """Whether the hand gets straight to some grasp of a fused surface from a base pose (3,) and up again, free of all
    that is in the map."""
    planner, tally = ArmPlanner(beliefs, random, SAMPLES), Tally()
    carry, grasps = beliefs.description.carry, grasps_of(target, base, beliefs.description)[:CANDIDATES]
    return any(_way_in(planner, base, carry, target, grasp, tally) is not None for grasp in grasps)


def grasps_of(target: Target, base: np.ndarray, robot: RobotDescription) -> list[np.ndarray]:
    """Return the grasps of what was seen, map_from_tool (4, 4), that an arm on a base pose (3,) may get at."""
    surface = target.surface
    keep = _inside(surface)
    points, normals = surface.points[keep], surface.normals[keep]
    inside, heading = target.behind > 0, np.arctan2(*(surface.middle[:2] - base[:2])[::-1])
    pitches = FORWARD_PITCHES if inside or target.level else FROM_ABOVE
    for margin in (MARGIN, TIGHT):
        grasps = antipodal_grasps(points, normals, robot, target.floor, pitches, margin)
        grasps = within_reach(grasps, target.inward, STRAIGHT) if inside else within_reach(grasps, heading)
        if grasps:
            break
    # what is too wide for the fingers may have a rim: a bowl, a pot, a large cup
    over_rim = (
        [] if inside or target.level or margin == MARGIN else rim_grasps(points, np.eye(4), np.random.default_rng(0))
    )
    walls = [grasp.body_from_tool for grasp in over_rim]  # the near one first: few are tried, and not all are in reach
    return grasps + sorted(walls, key=lambda pose: float(np.hypot(*(pose[:2, 3] - base[:2]))))


def _inside(surface: Surface) -> np.ndarray:
    """Return (N,) bool: points that are no strays of the depth camera."""
    slack = 0.003
    return np.all((surface.points > surface.low - slack) & (surface.points < surface.high + slack), axis=1)


def whole_box(target: Target) -> Box:
    """Return the box of a thing, down to where it ends if it is as high as it is wide, or to what it stands on: the
    lower half of what is round was not seen. Of what stands in a shelf the back was not: it is as deep as wide."""
    low, high = target.surface.low.copy(), target.surface.high.copy()
    low[2] = max(min(low[2], high[2] - (high - low)[:2].min()), min(low[2], target.floor))
    if target.behind > 0:
        inward = np.array([np.cos(target.inward), np.sin(target.inward)])
        along = int(np.abs(inward).argmax())
        back = high if inward[along] > 0 else low
        back[along] += np.sign(inward[along]) * max(0.0, (high - low)[1 - along] - (high - low)[along])
    return low, high


def _one_grasp(
    planner: ArmPlanner, base: np.ndarray, arm: np.ndarray, target: Target, map_from_tool: np.ndarray, tally: Tally
) -> Motion | MotionFailed | None:
    beliefs = planner.model
    assert isinstance(beliefs, Beliefs)
    approach_and_lift = _way_in(planner, base, arm, target, map_from_tool, tally)
    if approach_and_lift is None:
        return None
    try:
        return _taken_along(beliefs, planner, base, arm, target, map_from_tool, *approach_and_lift, tally)
    except MotionFailed as failed:
        tally.failed(failed)
        return failed
    finally:
        beliefs.hold(None)


def _taken_along(
    beliefs: Beliefs,
    planner: ArmPlanner,
    base: np.ndarray,
    arm: np.ndarray,
    target: Target,
    map_from_tool: np.ndarray,
    approach: np.ndarray,
    lift: np.ndarray,
    tally: Tally,
) -> Motion:
    """Return the motion of a grasp with its ways in (N, J) and up (M, J). Raises MotionFailed."""
    opening = beliefs.description.opening
    reach = planner.path(base, arm, approach[-1])
    low, high = whole_box(target)
    box = np.eye(4)
    box[:3, 3] = (low + high) / 2
    hold = Hold(
        high - low,
        inverse(map_from_tool) @ box,
        float(map_from_tool[2, 3] - low[2]),
        map_from_tool[:3, :3],
        beliefs.description.carry,
    )
    beliefs.world.set_pose(target.name, raised(np.eye(4), -5.0))  # out of the way
    in_hand = planner.under(beliefs.hold(hold))
    home = in_hand.folding(base, lift[-1], Tally())
    if home is None:
        folded = in_hand.folded(base, lift[-1], tally)
        home = in_hand.path(base, lift[-1], hold.home if folded is None else folded)
    hold = replace(hold, home=home[-1])
    return Motion(
        (Segment(whole_body(base, reach), opening), Segment(whole_body(base, approach[::-1]), opening, SLOW)),
        (Segment(whole_body(base, lift), 0.0, SLOW), Segment(whole_body(base, home), 0.0, SLOW)),
        hold,
    )


def _way_in(
    planner: ArmPlanner, base: np.ndarray, arm: np.ndarray, target: Target, map_from_tool: np.ndarray, tally: Tally
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return arm values (N, J) from a grasp back to before it, and (M, J) from it to above; None where one is not
    free."""
    beliefs = planner.model
    assert isinstance(beliefs, Beliefs)
    beliefs.robot.set(Configuration(base, arm, beliefs.description.opening))
    planner = planner.under(touching((target.name,)))
    at = planner.reachable(base, map_from_tool, tally, starts=3)
    if at is not None and not planner.free(base, at, tally):
        at = _by_another_elbow(planner, base, map_from_tool, tally) if target.behind > 0 else None
    if at is None:
        return None
    approach = planner.line(base, at, drawn_back(map_from_tool, APPROACH + target.behind), tally)
    if approach is None:
        return None
    above = raised(map_from_tool, LIFT_INSIDE if target.behind > 0 else LIFT)
    lift = planner.line(base, at, above, tally)
    if lift is None or target.behind == 0:
        return None if lift is None else (approach, lift)
    out, (low, high) = above.copy(), whole_box(target)
    out[:2, 3] -= (CLEAR + float((high - low)[:2].max()) + target.behind) * out[:2, 2] / np.linalg.norm(out[:2, 2])
    way_out = planner.line(base, lift[-1], out, tally)
    return None if way_out is None else (approach, np.concatenate([lift, way_out[1:]]))


def _by_another_elbow(
    planner: ArmPlanner, base: np.ndarray, map_from_tool: np.ndarray, tally: Tally
) -> np.ndarray | None:
    """Return free arm values (J,) for a tool pose that the arm gets to with its elbow in the way of something."""
    chain, tool_in_arm_frame = planner.model.chain, in_arm_frame(base, map_from_tool, planner.model.description)
    for start in random_starts(chain, ELBOWS, planner.random):
        solution = inverse_kinematics(chain, tool_in_arm_frame, start[None])
        if solution.found and planner.free(base, solution.arm, tally):
            return solution.arm
    return None
