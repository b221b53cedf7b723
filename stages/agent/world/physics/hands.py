"""What the arm believes around it, and motions in it: boxes of what was seen, grasps on fused surfaces, letting go."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from schemas.base import as_transform
from stages.agent.world.physics.eyes import Surface
from stages.agent.world.physics.fronts import Front
from stages.agent.world.physics.grasps import FORWARD_PITCHES, STRAIGHT, antipodal_grasps, within_reach
from stages.agent.world.physics.shapes import record_of, slab, urdf_of
from stages.kit.geometry.transforms import inverse
from stages.kit.motion.arm_motion import ArmPlanner, Tally
from stages.kit.motion.base_placement import in_arm_frame, shoulder_distance
from stages.kit.motion.collision import CollisionChecker
from stages.kit.motion.failures import MotionFailed
from stages.kit.motion.grasps import narrowest_width
from stages.kit.motion.kinematics import arm_chain, inverse_kinematics, random_starts
from stages.kit.motion.segments import Segment, whole_body
from stages.kit.simulation.robot import Configuration, Robot
from stages.kit.simulation.robot_description import RobotDescription
from stages.kit.simulation.world import PhysicsWorld

CANDIDATES = 20
"""Grasps that are tried, those from above first (Han 2024, 3.3.3)."""
NEXT = 3
"""Grasps that have their turn last after one slipped."""
APPROACH, LIFT, LIFT_INSIDE = 0.08, 0.10, 0.03
"""Of the hand before and after it closes, and after it does behind a front [m]."""
CLEAR = 0.04
"""What comes out of a shelf is so far before its front before it goes anywhere else [m]."""
DROP = 0.15
"""Height over its target at which the thesis lets go [m]."""
JUST_OVER = 0.008
"""Height at which ours does, if nothing was touched before [m]."""
UP, OVER_RIM = 0.06, 0.015
"""Of the hand from where it lets go before it goes anywhere else, and of what it holds over the rim of a box [m]."""
SOME_WAY_OVER = 0.06
"""Height at which ours does where the hand has no room farther down [m]."""
TURNS = tuple((turn, tilt) for tilt in (0.0, 0.45) for turn in (0.0, 0.5, -0.5, 1.0, -1.0, 1.6, -1.6))
"""How the hand is turned about the vertical, and leaned away from the robot where it gets no farther upright [rad]."""
SLOW = 0.35
ELBOWS = 12
"""Ways to hold the elbow that are tried where the first is in the way."""
SAMPLES = 500
"""Of one path search."""
NESTLES = 0.015
"""Boxes of round things are so much wider than they are [m]: fruit may lie that near to fruit."""
HELD = "held"
"""Name of the box of what is in the hand."""
Box = tuple[np.ndarray, np.ndarray]
Believed = Box | Front


@dataclass(frozen=True)
class Hold:
    """What the robot believes to have in its hand: the box of what it grasped, and where it is in the hand."""

    size: np.ndarray
    tool_from_box: np.ndarray
    foot: float
    """Height of the tool point over the foot of what is held [m], the hand as it grasped."""
    rotation: np.ndarray
    """Of the hand then, base frame."""
    home: np.ndarray
    """Arm (7,) with which it is carried about: folded, and the hand as upright as it grasped, since what is held above
    its middle swings between the fingers when they turn."""


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


@dataclass(frozen=True)
class Motion:
    """A manipulation: to the place, what is done there with the fingers, and away."""

    there: tuple[Segment, ...]
    away: tuple[Segment, ...]
    hold: Hold | None = None


class Beliefs:
    """Boxes and doors around the robot, for collision checks. A `JointedModel` of the kit."""

    def __init__(self, description: RobotDescription) -> None:
        self.description = description
        self.chain = arm_chain(description)
        self.world = PhysicsWorld()
        self.robot = Robot(self.world, description)
        self.checker = CollisionChecker(self.world, self.robot, 0.004)
        self.robot.set(Configuration(np.zeros(3), description.carry, description.opening))
        self._boxes: dict[str, object] = {}

    def close(self) -> None:
        """End the pybullet world."""
        self.world.close()

    def show(self, boxes: dict[str, Believed]) -> None:
        """Believe in these boxes, name -> lower and upper corner (3,) [m] in the map frame, in these fronts, and in
        nothing else but what is held."""
        wanted = {name: _told(entry) for name, entry in boxes.items()}
        for name in [n for n, box in self._boxes.items() if n != HELD and wanted.get(n) != box]:
            self.world.remove_body(name)
            del self._boxes[name]
        for name, box in wanted.items():
            if name in self._boxes:
                continue
            entry = boxes[name]
            if isinstance(entry, Front):
                self._add_front(name, entry)
            else:
                assert isinstance(box, tuple)
                part = slab(box[:3], tuple(max(h, low + 0.004) for low, h in zip(box[:3], box[3:], strict=True)))  # type: ignore[arg-type]
                self.world.add_body(record_of(name, "box", (0, 0, 0), 0), urdf_of(name, (part,), 1.0))
            self.checker.add_body(name)
            self._boxes[name] = box

    def _add_front(self, name: str, front: Front) -> None:
        record = record_of(name, "front", (0, 0, 0), 0).model_copy(
            update={
                "world_from_body": as_transform(front.map_from_front),
                "joints": (front.joint,),
                "joint_values": {front.joint.name: front.value},
            }
        )
        self.world.add_body(record, front.urdf())

    def pose(self, name: str) -> np.ndarray:
        """Return map_from_body (4, 4) of what is believed in."""
        return self.world.pose(name)

    def hold(self, hold: Hold | None) -> None:
        """Let checks carry the box of what is held."""
        self.checker.put_down()
        if HELD in self._boxes:
            self.world.remove_body(HELD)
            del self._boxes[HELD]
        if hold is None:
            return
        half = hold.size / 2
        part = slab(tuple(-half), tuple(half))  # type: ignore[arg-type]
        self.world.add_body(record_of(HELD, "box", (0, 0, 0), 0), urdf_of(HELD, (part,), 1.0))
        self.checker.add_body(HELD)
        self._boxes[HELD] = tuple(half)
        self.checker.carry(HELD, hold.tool_from_box)


def _told(entry: Believed) -> object:
    """Return what tells a box or a front from another one: numbers to the millimetre."""
    if not isinstance(entry, Front):
        return (*np.round(entry[0], 3).tolist(), *np.round(entry[1], 3).tolist())
    pose = tuple(np.round(entry.map_from_front, 3).ravel().tolist())
    return (pose, entry.size, entry.panel, entry.bar, round(entry.value, 3), entry.floor)


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
        pose = _pointing(float(np.arctan2(at[1] - base[1], at[0] - base[0])), pitch)
        pose[:3, 3] = (at[0], at[1], at[2] + (0.05 if forward else 0.10))
        if forward:
            pose[:3, 3] -= 0.10 * pose[:3, 2]
        if shoulder_distance(base, pose, beliefs.description, beliefs.chain) > planner.reach - 0.02:
            continue
        arm = planner.reachable(base, pose, tally, starts=3)
        if arm is not None and planner.free(base, arm, tally):
            return True
    return False


def _pointing(heading: float, pitch: float) -> np.ndarray:
    """Return a tool pose (4, 4) at the origin that comes along a heading, `pitch` [rad] downwards."""
    approach = np.array([np.cos(heading) * np.cos(pitch), np.sin(heading) * np.cos(pitch), -np.sin(pitch)])
    closing = np.array([-np.sin(heading), np.cos(heading), 0.0])
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([np.cross(closing, approach), closing, approach])
    return pose


def plan_grasp(
    beliefs: Beliefs, base: np.ndarray, arm: np.ndarray, target: Target, random: np.random.Generator
) -> Motion:
    """Return the motion that takes a fused surface. Raises MotionFailed: `no_grasp`, or what ended most attempts."""
    surface, name = target.surface, target.name
    possible = _grasps_of(target, base, beliefs.description.opening)
    if not possible:
        opening, width = beliefs.description.opening, narrowest_width(surface.points[_inside(surface)])
        raise MotionFailed(
            "no_grasp",
            f"no grasp of {name}, seen {width:.3f} m wide at its narrowest; the gripper opens {opening:.3f} m",
            (name,),
            {"width": width, "opening": opening},
        )
    left_out = target.rank * NEXT % len(possible)  # where few are possible, the first has its turn again
    grasps = (possible[left_out:] + possible[:left_out])[:CANDIDATES]
    planner, tally = ArmPlanner(beliefs, random, SAMPLES), Tally()
    searches = 2
    for grasp in grasps:
        try:
            motion = _one_grasp(planner, base, arm, target, grasp, tally)
        except MotionFailed as failed:
            tally.failed(failed)
            searches -= 1
            if not searches:
                break
            continue
        finally:
            beliefs.hold(None)
            beliefs.checker.allow()
        if motion is not None:
            return motion
    tally.raise_for(f"grasp({name})", (name,))
    raise AssertionError("unreachable")


def graspable(beliefs: Beliefs, base: np.ndarray, target: Target, random: np.random.Generator) -> bool:
    """Whether the hand gets straight to some grasp of a fused surface from a base pose (3,) and up again, free of all
    that is in the map."""
    planner, tally = ArmPlanner(beliefs, random, SAMPLES), Tally()
    carry, grasps = beliefs.description.carry, _grasps_of(target, base, beliefs.description.opening)[:CANDIDATES]
    try:
        return any(_way_in(planner, base, carry, target, grasp, tally) is not None for grasp in grasps)
    finally:
        beliefs.checker.allow()


def _grasps_of(target: Target, base: np.ndarray, opening: float) -> list[np.ndarray]:
    """Return the grasps of what was seen, map_from_tool (4, 4), that an arm on a base pose (3,) may get at."""
    surface = target.surface
    keep = _inside(surface)
    heading = np.arctan2(*(surface.middle[:2] - base[:2])[::-1])
    if target.behind > 0:
        grasps = antipodal_grasps(surface.points[keep], surface.normals[keep], opening, target.floor, FORWARD_PITCHES)
        return within_reach(grasps, target.inward, STRAIGHT)
    grasps = antipodal_grasps(surface.points[keep], surface.normals[keep], opening, target.floor)
    return within_reach(grasps, heading)


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
) -> Motion | None:
    beliefs = planner.model
    assert isinstance(beliefs, Beliefs)
    checker, opening = beliefs.checker, beliefs.description.opening
    way = _way_in(planner, base, arm, target, map_from_tool, tally)
    if way is None:
        return None
    approach, lift = way
    checker.allow()
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
    beliefs.world.set_pose(target.name, _far())
    beliefs.hold(hold)
    checker.allow(touch=(HELD,))
    home = planner.folding(base, lift[-1], Tally())
    if home is None:
        folded = planner.folded(base, lift[-1], tally)
        home = planner.path(base, lift[-1], hold.home if folded is None else folded)
    hold = replace(hold, home=home[-1])
    return Motion(
        (Segment(whole_body(base, reach), opening), Segment(whole_body(base, approach[::-1]), opening, SLOW)),
        (Segment(whole_body(base, lift), 0.0, SLOW), Segment(whole_body(base, home), 0.0, SLOW)),
        hold,
    )


def _way_in(
    planner: ArmPlanner, base: np.ndarray, arm: np.ndarray, target: Target, map_from_tool: np.ndarray, tally: Tally
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return arm values (N, 7) from a grasp back to before it, and (M, 7) from it to above; None where one is not
    free."""
    beliefs = planner.model
    assert isinstance(beliefs, Beliefs)
    beliefs.robot.set(Configuration(base, arm, beliefs.description.opening))
    beliefs.checker.allow(touch=(target.name,))
    at = planner.reachable(base, map_from_tool, tally, starts=3)
    if at is not None and not planner.free(base, at, tally):
        at = _by_another_elbow(planner, base, map_from_tool, tally) if target.behind > 0 else None
    if at is None:
        return None
    before = map_from_tool.copy()
    before[:3, 3] -= (APPROACH + target.behind) * before[:3, 2]
    approach = planner.line(base, at, before, tally)
    if approach is None:
        return None
    above = map_from_tool.copy()
    above[2, 3] += LIFT_INSIDE if target.behind > 0 else LIFT
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
    """Return free arm values (7,) for a tool pose that the arm gets to with its elbow in the way of something."""
    chain, wanted = planner.model.chain, in_arm_frame(base, map_from_tool, planner.model.description)
    for start in random_starts(chain, ELBOWS, planner.random):
        found = inverse_kinematics(chain, wanted, start[None])
        if found.found and planner.free(base, found.arm, tally):
            return found.arm
    return None


def _far() -> np.ndarray:
    pose = np.eye(4)
    pose[2, 3] = -5.0
    return pose


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
    at, up = spot.at, max(UP, spot.rim + OVER_RIM - spot.at[2] - height)
    planner, tally = ArmPlanner(beliefs, random, SAMPLES), Tally()
    opening, carry = beliefs.description.opening, beliefs.description.carry
    foot = hold.foot if hold is not None else 0.0
    beliefs.hold(hold)
    beliefs.robot.set(Configuration(base, arm, opening))
    beliefs.show(spot.beside)
    beliefs.checker.allow((HELD,) if hold is not None else (), dict.fromkeys(spot.nestled, NESTLES))
    heading = float(np.arctan2(at[1] - base[1], at[0] - base[0]))
    try:
        for turn, tilt in TURNS:
            pose = _tilted(_turned(hold, heading, turn), heading, tilt)
            pose[:3, 3] = (at[0], at[1], at[2] + height + foot)
            goal = planner.reachable(base, pose, tally, starts=3)
            if goal is None or not planner.free(base, goal, tally):
                continue
            above = pose.copy()
            above[2, 3] += up
            down = planner.line(base, goal, above, tally)
            if down is None:
                continue
            beliefs.show(spot.around)
            try:
                reach = planner.path(base, arm, down[-1])
                back = planner.path(base, down[-1], carry)
            except MotionFailed as failed:
                tally.failed(failed)
                break
            return Motion(
                (Segment(whole_body(base, reach), 0.0, 0.6), Segment(whole_body(base, down[::-1]), 0.0, SLOW)),
                (Segment(whole_body(base, down), opening, SLOW), Segment(whole_body(base, back), opening)),
            )
        tally.raise_for("place", (HELD,))
    finally:
        beliefs.hold(None)
        beliefs.checker.allow()
    raise AssertionError("unreachable")


def _turned(hold: Hold | None, heading: float, turn: float) -> np.ndarray:
    """Return the tool's rotation (4, 4): as it grasped but for the yaw, the hand away from the base."""
    if hold is None:
        return _pointing(heading + turn, np.pi / 2)
    approach = hold.rotation[:, 2]
    level = float(np.hypot(approach[0], approach[1]))
    own = np.arctan2(approach[1], approach[0]) if level > 0.2 else np.arctan2(hold.rotation[1, 0], hold.rotation[0, 0])
    c, s = np.cos(heading + turn - own), np.sin(heading + turn - own)
    pose = np.eye(4)
    pose[:3, :3] = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ hold.rotation
    return pose


def _tilted(pose: np.ndarray, heading: float, tilt: float) -> np.ndarray:
    """Return a tool's rotation (4, 4) leaned so that the hand is behind its tip, as seen along a heading [rad]."""
    axis = np.array([np.sin(heading), -np.cos(heading), 0.0])
    turn = np.eye(4)
    turn[:3, :3] = Rotation.from_rotvec(tilt * axis).as_matrix()
    return turn @ pose
