"""What a robot's description comes to: limits, collisions with itself, reach with the hand down, the gripper."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np
from scenewright.stages.kit.formats.link_poses import link_poses
from scenewright.stages.kit.formats.urdf_check import check_urdf
from scenewright.stages.kit.formats.urdf_file import Urdf, parse_urdf
from scenewright.stages.kit.geometry.transforms import apply, inverse
from scenewright.stages.kit.motion.collision import CollisionChecker
from scenewright.stages.kit.motion.kinematics import arm_chain, inverse_kinematics, random_starts, reach
from scenewright.stages.kit.simulation.robot import Configuration, Robot
from scenewright.stages.kit.simulation.robot_description import RobotDescription
from scenewright.stages.kit.simulation.robot_shapes import points_at_tool
from scenewright.stages.kit.simulation.urdf_split import mesh_file, read_urdf
from scenewright.stages.kit.simulation.world import PhysicsWorld

SAMPLES = 400
"""Arms drawn within the limits, by seed 0."""
OUT_STEP, UP_STEP = 0.05, 0.1
"""Distances and heights that are tried with the hand down are so far apart [m]."""
STARTS = 6
"""Starts of inverse kinematics for each."""
LONGEST = 5.0
"""An arm that reaches farther has its lengths in other units [m]."""
NEARLY_ALWAYS = 0.98
"""Links that lie in each other in more of the drawn arms do so by their shapes."""
STRAIGHT = 0.99
"""Least cosine between an axis of the gripper and where it should point."""
SHUT = 0.005
"""Room between the fingers at joint value 0, at most [m]."""
ANGLE_SLACK, LENGTH_SLACK = 1e-3, 1e-4
"""Limits that differ by less are alike [rad, m]."""


@dataclass(frozen=True)
class JointLimits:
    """One arm joint: as the description has it [rad, rad/s, N m]."""

    name: str
    lower: float
    upper: float
    speed: float
    force: float


@dataclass(frozen=True)
class Gripper:
    """The hand, in the frame of the tool link [m]."""

    opening: float
    closes_along: str
    """Axis along which the fingers close."""
    gap_shut: float
    """Between the fingers' shapes at joint value 0."""
    palm_behind: float
    """From the origin of the hand's link forward to the tool point, along z."""


@dataclass(frozen=True)
class Reach:
    """Where the tool point gets with the hand straight down and the arm free of itself, from the first axis [m]."""

    places: np.ndarray
    """(N, 2) distance from the first joint's axis, height over the floor."""
    length: float
    """Bound of the distance from the shoulder's height on the first axis, whatever the hand's direction."""

    @property
    def radii(self) -> tuple[float, float]:
        """Nearest and farthest."""
        return float(self.places[:, 0].min()), float(self.places[:, 0].max())

    @property
    def heights(self) -> tuple[float, float]:
        """Lowest and highest."""
        return float(self.places[:, 1].min()), float(self.places[:, 1].max())


@dataclass
class RobotReport:
    """What was found; `problems` are lines, none where the robot can be planned for as it is."""

    name: str
    drives: bool
    joints: tuple[JointLimits, ...]
    home: str
    """What the arm as it drives collides with of itself, in words; empty: free."""
    colliding: float
    """Share of drawn arms that collide with themselves."""
    pairs: dict[str, int]
    """Links -> drawn arms in which these were the deepest in each other, most first."""
    reach: Reach
    gripper: Gripper
    problems: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    """What may be meant as it is."""

    def as_json(self) -> dict[str, Any]:
        """Return the same for --json."""
        found = len(self.reach.places) > 0
        return {
            "robot": self.name,
            "drives": self.drives,
            "joints": [vars(joint) for joint in self.joints],
            "home": self.home or "free",
            "self_collision": {"samples": SAMPLES, "share": self.colliding, "pairs": self.pairs},
            "reach_hand_down": {
                "distance": _rounded(self.reach.radii) if found else None,
                "height_over_floor": _rounded(self.reach.heights) if found else None,
                "longest": round(self.reach.length, 4),
            },
            "gripper": {key: round(v, 4) if isinstance(v, float) else v for key, v in vars(self.gripper).items()},
            "problems": self.problems,
            "notes": self.notes,
        }


def _rounded(pair: tuple[float, float]) -> list[float]:
    return [round(value, 3) for value in pair]


def check_robot(robot: RobotDescription) -> RobotReport:
    """Look at a robot that `load_robot` took and whose URDF has no faults (`urdf_faults`)."""
    urdf = parse_urdf(robot.urdf)
    limits = zip(robot.arm_joints, robot.lower, robot.upper, robot.arm_forces, strict=True)
    joints = tuple(JointLimits(n, float(lo), float(up), robot.arm_speed, float(force)) for n, lo, up, force in limits)
    gripper, problems = _gripper(robot, urdf)
    with PhysicsWorld() as world:
        own = Robot(world, robot)
        own.set(Configuration(np.zeros(3), robot.carry, robot.opening))
        checker = CollisionChecker(world, own)
        home = checker.check_meshes(np.concatenate([np.zeros(3), robot.carry]))
        share, pairs = _drawn(checker, robot)
        found = _hand_down(checker, robot)
    report = RobotReport(
        robot.name,
        robot.drives,
        joints,
        "" if home is None else f"{home.part} lies {1000 * home.depth:.1f} mm in {home.other}",
        share,
        pairs,
        found,
        gripper,
    )
    efforts = {joint.name: joint.effort for joint in urdf.joints}
    report.notes += [
        f"joint {name}: arm_forces {force:g} N m is above the URDF's {efforts[name]:g}"
        for name, force in zip(robot.arm_joints, robot.arm_forces, strict=True)
        if force > efforts[name] + ANGLE_SLACK
    ]
    report.problems += _beyond_urdf(robot, urdf) + problems + _of_motion(report)
    return report


def urdf_faults(robot: RobotDescription) -> list[str]:
    """Return what is wrong with the URDF itself, so that physics might not load it. Meshes are found as physics finds
    them, `package://` ones from the URDF's folder; links that are fixed to others may be frames without a mass."""
    root = read_urdf(robot.urdf)
    frames = {f"link {child.get('link')!r}" for child in root.findall("joint[@type='fixed']/child")}
    faults = [
        str(fault)
        for fault in check_urdf(robot.urdf)
        if fault.kind != "mesh_outside" and not (fault.kind in ("mass", "inertia") and fault.element in frames)
    ]
    folder = robot.urdf.parent.resolve()
    named = {mesh.get("filename", ""): mesh_file(mesh, folder).resolve() for mesh in root.iter("mesh")}
    faults += [
        f"mesh {n!r} is outside the folder of the URDF" for n, f in named.items() if not f.is_relative_to(folder)
    ]
    faults += [f"mesh {n!r} does not exist" for n, f in named.items() if f.is_relative_to(folder) and not f.is_file()]
    return [f"{robot.urdf.name}: {fault}" for fault in dict.fromkeys(faults)]


def _of_motion(report: RobotReport) -> list[str]:
    lines = [f"home (carry): {report.home}; choose a carry that is free"] if report.home else []
    lines += [
        f"{pair} in each other in {count} of {SAMPLES} drawn arms: their shapes overlap, make them smaller"
        for pair, count in report.pairs.items()
        if count > NEARLY_ALWAYS * SAMPLES
    ]
    if report.reach.length > LONGEST:
        lines.append(f"the arm is {report.reach.length:.1f} m long: lengths of the URDF are in metres")
    if not len(report.reach.places):
        lines.append("no place is reached with the hand straight down: is z of the tool link out of the hand?")
    return lines


def _beyond_urdf(robot: RobotDescription, urdf: Urdf) -> list[str]:
    """Return where the description allows more than its URDF."""
    by_name = {joint.name: joint for joint in urdf.joints}
    lines = []
    for number, name in enumerate(robot.arm_joints):
        joint = by_name[name]
        if joint.type == "revolute" and (
            robot.lower[number] < joint.lower - ANGLE_SLACK or robot.upper[number] > joint.upper + ANGLE_SLACK
        ):
            lines.append(
                f"joint {name}: {robot.lower[number]:g} to {robot.upper[number]:g} rad is wider than the URDF's "
                f"{joint.lower:g} to {joint.upper:g}"
            )
        if robot.arm_speed > joint.velocity + ANGLE_SLACK:
            lines.append(f"joint {name}: arm_speed {robot.arm_speed:g} rad/s is above the URDF's {joint.velocity:g}")
    room = sum(by_name[name].upper for name in robot.finger_joints)
    if robot.opening > room + LENGTH_SLACK:
        lines.append(f"opening {robot.opening:g} m is above what the finger joints go: {room:g} m")
    return lines


def _gripper(robot: RobotDescription, urdf: Urdf) -> tuple[Gripper, list[str]]:
    """Return the hand in the tool's frame, and what is wrong with that frame."""
    arm = dict(zip(robot.arm_joints, robot.carry.tolist(), strict=True))
    shut = link_poses(urdf, arm | dict.fromkeys(robot.finger_joints, 0.0))
    wide = link_poses(urdf, arm | dict.fromkeys(robot.finger_joints, robot.opening / 2))
    tool_from_world = inverse(shut[robot.tool_link])
    ways = [apply(tool_from_world, wide[n][None, :3, 3])[0] - apply(tool_from_world, shut[n][None, :3, 3])[0]
            for n in robot.finger_links]  # fmt: skip
    apart = ways[0] - ways[1]
    length = float(np.linalg.norm(apart))
    problems, axis = [], "xyz"[int(np.argmax(np.abs(apart)))]
    hand = tool_from_world @ shut[robot.hand_link]
    behind = float(-hand[2, 3])
    gap = _gap(robot)
    if length < 0.9 * robot.opening:
        problems.append(
            f"gripper: at opening {1000 * robot.opening:.0f} mm the fingers are {1000 * length:.0f} mm further apart "
            "than shut: each finger joint moves its finger outwards by half the opening"
        )
    elif abs(apart[1]) < STRAIGHT * length:
        problems.append(
            f"gripper: the fingers close along {axis} of {robot.tool_link}: turn that frame so that it is y"
        )
    if gap < -SHUT:
        problems.append(f"gripper: at joint value 0 the fingers lie {-1000 * gap:.0f} mm in each other")
    elif gap > SHUT:
        problems.append(f"gripper: at joint value 0 the fingers are {1000 * gap:.0f} mm apart: 0 is shut")
    if behind < LENGTH_SLACK:
        problems.append(f"gripper: {robot.hand_link} is not behind {robot.tool_link}: its z points out of the hand")
    return Gripper(robot.opening, axis, gap, behind), problems


def _gap(robot: RobotDescription) -> float:
    """Return the room between the closed fingers along y of the tool [m]."""
    fingers = points_at_tool(robot, robot.finger_links, 0.0)
    if not all(map(len, fingers)):
        return 0.0
    spans = sorted((float(points[:, 1].min()), float(points[:, 1].max())) for points in fingers)
    return spans[1][0] - spans[0][1]


def _drawn(checker: CollisionChecker, robot: RobotDescription) -> tuple[float, dict[str, int]]:
    """Return the share of drawn arms that collide with themselves, and by which links."""
    arms = random_starts(arm_chain(robot), SAMPLES, np.random.default_rng(0))
    pairs: Counter[str] = Counter()
    for arm in arms:
        collision = checker.check_meshes(np.concatenate([np.zeros(3), arm]))
        if collision is not None:
            pairs[" and ".join(sorted((collision.part, collision.other)))] += 1
    return pairs.total() / SAMPLES, dict(sorted(pairs.items(), key=lambda entry: (-entry[1], entry[0])))


def _hand_down(checker: CollisionChecker, robot: RobotDescription) -> Reach:
    """Return where the hand gets pointing straight down, ahead of the base."""
    chain = arm_chain(robot)
    length = reach(chain)
    starts = np.concatenate([robot.carry[None], random_starts(chain, STARTS, np.random.default_rng(1))])
    out = np.arange(OUT_STEP, min(length, LONGEST) + OUT_STEP, OUT_STEP)
    up = np.arange(0.0, robot.pedestal_height + min(length, LONGEST) + 0.3, UP_STEP)
    places = []
    for radius, height in product(out, up):
        for closing in ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0)):
            pose = np.eye(4)
            pose[:3, 1], pose[:3, 2] = closing, (0.0, 0.0, -1.0)
            pose[:3, 0] = np.cross(pose[:3, 1], pose[:3, 2])
            pose[:3, 3] = radius, 0.0, height - robot.pedestal_height
            answer = inverse_kinematics(chain, pose, starts)
            if answer.found and checker.check_meshes(np.concatenate([np.zeros(3), answer.arm])) is None:
                places.append((radius, height))
                break
    return Reach(np.array(places).reshape(-1, 2), length)
