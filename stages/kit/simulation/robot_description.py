"""What is known of a robot: a description (data/robots/<name>.toml, or a file of the user's) and the URDF it names, put
on a pedestal that drives or stands."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from scenewright.schemas.errors import BadInput, MissingDependency, UsageError, first_problem
from scenewright.schemas.outside import file_toml
from scenewright.schemas.places import data_file
from scenewright.stages.kit.formats.urdf_file import parse_urdf
from scenewright.stages.kit.simulation.urdf_split import mesh_file, read_urdf, with_absolute_meshes, without_visuals

FOLDER = data_file("robots")
BASE_JOINTS = ("base_x", "base_y", "base_yaw")
PEDESTAL_LINK = "pedestal"
GROUND_CLEARANCE = 0.02
"""The pedestal hovers by this much: reconstructed floors are not flat to the millimetre."""
JOINT_COUNTS = (6, 7)
"""Fewest and most: fewer cannot reach every pose, with more the planner was not tried."""
FINGERS = 2
SHORTEST_AXIS = 1e-6
MOST_RADIANS, MOST_DEGREES = 4 * np.pi, 1500.0
"""No joint turns twice round to either side of zero, nor at two turns a second: what is more is in degrees."""
HINT = "docs/ROBOT.md lists what a description says"


@dataclass(frozen=True)
class RobotDescription:
    """Names, limits and measures of an arm with a two-finger gripper on a planar base. Metres, radians."""

    name: str
    urdf: Path
    arm_base: str
    arm_joints: tuple[str, ...]
    finger_joints: tuple[str, ...]
    hand_link: str
    tool_link: str
    finger_links: tuple[str, ...]
    lower: np.ndarray
    upper: np.ndarray
    arm_speed: float
    arm_acceleration: float
    arm_forces: np.ndarray
    """(J,) most that the motor of each joint gives [N m]."""
    carry: np.ndarray
    look: np.ndarray | None
    """(J,) arm that holds a wrist camera over a surface in front; None: found when it is needed."""
    tip_overhang: float
    opening: float
    palm: tuple[float, float]
    """Length along which the fingers close, and breadth."""
    finger_force: float
    """Of each finger, for things held between both [N]."""
    firm_finger_force: float
    """For things that would turn in the fingers [N]."""
    holding_moment: float
    """Largest moment about the fingers that such a hold bears [N m]."""
    coupled_fingers: bool
    """Whether a gear keeps the fingers at the same distance from the middle; else each has a motor of its own."""
    pedestal_height: float
    pedestal_radius: float
    base_speed: float
    """0 for a pedestal that stands still."""
    base_turn_speed: float

    @property
    def drives(self) -> bool:
        """Whether the base moves."""
        return self.base_speed > 0

    @property
    def speeds(self) -> np.ndarray:
        """(3 + J,) highest speeds of base and arm; tiny ones where the base stands still, as times divide by them."""
        base = np.maximum([self.base_speed, self.base_speed, self.base_turn_speed], 1e-9)
        return np.concatenate([base, np.full(len(self.arm_joints), self.arm_speed)])

    @property
    def accelerations(self) -> np.ndarray:
        """(3 + J,) highest accelerations of base and arm."""
        return np.concatenate([[1.0, 1.0, 2.0], np.full(len(self.arm_joints), self.arm_acceleration)])


Positive = Annotated[float, Field(gt=0, le=1e4)]
NotNegative = Annotated[float, Field(ge=0, le=1e4)]
Angles = tuple[Annotated[float, Field(ge=-100, le=100)], ...]
Names = tuple[str, ...]


class _RobotFile(BaseModel):
    """What a description has to say, each with its range; RobotDescription tells what each is."""

    model_config = ConfigDict(extra="forbid")

    name: str
    urdf: str
    arm_base: str
    arm_joints: Annotated[Names, Field(min_length=min(JOINT_COUNTS), max_length=max(JOINT_COUNTS))]
    finger_joints: tuple[str, str]
    hand_link: str
    tool_link: str
    finger_links: tuple[str, str]
    lower: Angles
    upper: Angles
    arm_speed: Positive
    arm_acceleration: Positive
    arm_forces: tuple[Positive, ...]
    carry: Angles
    look: Angles | None = None
    tip_overhang: NotNegative
    opening: Positive
    palm: tuple[Positive, Positive]
    finger_force: Positive
    firm_finger_force: Positive
    holding_moment: Positive
    coupled_fingers: bool = False
    pedestal_height: Annotated[float, Field(gt=GROUND_CLEARANCE, le=3)]
    pedestal_radius: Annotated[float, Field(gt=0, le=1)]
    base_speed: NotNegative
    base_turn_speed: NotNegative


def description_files(robot: str) -> tuple[Path, ...]:
    """Return the files that describe a robot, as far as they are the project's or the user's: its description, those
    that it is `like`, and its URDF where that is there. Raises as `load_robot` does of a description alone."""
    paths, values, folder = _read(description_path(robot))
    urdf = folder / str(values.get("urdf", ""))
    return (*paths, urdf) if urdf.is_file() else paths


def _read(path: Path) -> tuple[tuple[Path, ...], dict[str, Any], Path]:
    """Return the files of a description and of those that it is `like`, what they say together, and the folder of the
    one that names the URDF. Raises BadInput."""
    paths, values, folder = [path], file_toml(path, error=BadInput, hint=HINT), path.parent
    while (like := values.pop("like", None)) is not None:
        other = FOLDER / f"{like}.toml"
        if not other.is_file() or other in paths:
            raise BadInput(f"{paths[-1]}: like = {like!r} is no other robot of data/robots", hint=HINT)
        folder = folder if "urdf" in values else FOLDER
        values = file_toml(other, error=BadInput, hint=HINT) | values
        paths.append(other)
    return tuple(paths), values, folder


def description_path(robot: str) -> Path:
    """Return the description of a robot, given by the name of one of data/robots or by the path of a .toml file. Raises
    UsageError (no such robot)."""
    path = Path(robot) if robot.endswith(".toml") else FOLDER / f"{robot}.toml"
    if not path.is_file():
        names = ", ".join(robot_names())
        if robot.endswith((".urdf", ".xacro")):
            raise UsageError(
                f"{robot}: a URDF says too little of a robot (gripper, limits, base)",
                hint="write a description that names it (docs/ROBOT.md)",
            )
        raise UsageError(f"no robot is called {robot!r}", hint=f"known: {names}, or a description of your own (.toml)")
    return path


def robot_names() -> list[str]:
    """Return the names of the robots of data/robots."""
    return sorted(entry.stem for entry in FOLDER.glob("*.toml"))


def load_robot(robot: str) -> RobotDescription:
    """Read a description, given by the name of one of data/robots or by the path of a .toml file. Its URDF lies beside
    it or in pybullet_data; a description that is `like` another of data/robots says only what differs.

    Raises UsageError (no such robot), BadInput (a description that is incomplete, out of range, or at odds with its
    URDF), MissingDependency (its URDF is not there).
    """
    path = description_path(robot)
    _, values, folder = _read(path)
    _check_said(values, path)
    try:
        described = _RobotFile(**values).model_dump()
    except ValidationError as error:
        raise BadInput(f"{path}: {first_problem(error)}", hint=HINT) from None
    urdf = folder / described["urdf"]
    if not urdf.is_file():
        urdf = _installed(Path(described["urdf"]))
    for key in ("lower", "upper", "arm_forces", "carry", "look"):
        if described[key] is None:
            continue
        if len(described[key]) != len(described["arm_joints"]):
            wanted = len(described["arm_joints"])
            raise BadInput(f"{path}: {key} has {len(described[key])} values for {wanted} arm joints", hint=HINT)
        described[key] = np.array(described[key], dtype=float)
    description = RobotDescription(**described | {"urdf": urdf})
    _check_joints(description, path)
    return description


def _check_said(values: dict[str, Any], path: Path) -> None:
    """Raise BadInput for what a description lacks, an arm of other joints, a hand of other fingers, degrees, and a URDF
    that lies elsewhere."""
    lacking = [name for name, field in _RobotFile.model_fields.items() if field.is_required() and name not in values]
    if lacking:
        raise BadInput(f"{path}: does not say {', '.join(lacking)}", hint=HINT)
    fewest, most = JOINT_COUNTS
    if (count := _count(values["arm_joints"])) is not None and not fewest <= count <= most:
        raise BadInput(f"{path}: arm_joints names {count}; an arm here has {fewest} or {most} joints", hint=HINT)
    for key, what in (("finger_joints", "sliding joints"), ("finger_links", "links")):
        if (count := _count(values[key])) is not None and count != FINGERS:
            raise BadInput(f"{path}: {key} names {count}; a parallel gripper has {FINGERS} {what}", hint=HINT)
    for key in ("lower", "upper", "carry", "look", "arm_speed"):
        said = values.get(key)
        for number in said if isinstance(said, list) else [said]:
            if isinstance(number, int | float) and MOST_RADIANS < abs(number) <= MOST_DEGREES:
                meant = f"{np.radians(number):.4g}"
                raise BadInput(f"{path}: {key} says {number:g}, which looks like degrees", hint=f"in radians: {meant}")
    named = values["urdf"]
    if isinstance(named, str) and (".." in Path(named).parts or Path(named).is_absolute()):
        raise BadInput(
            f"{path}: urdf {named!r} is outside the folder of the description",
            hint="put the URDF and its meshes beside the description, and name it from there",
        )


def _count(value: Any) -> int | None:
    return len(value) if isinstance(value, list) else None


def _check_joints(robot: RobotDescription, path: Path) -> None:
    """Raise BadInput where a description and its URDF do not fit each other."""
    for number, joint in enumerate(robot.arm_joints):
        low, high = robot.lower[number], robot.upper[number]
        if low >= high:
            raise BadInput(f"{path}: joint {joint!r}: lower {low:g} is not below upper {high:g}", hint=HINT)
        for key, arm in (("carry", robot.carry), ("look", robot.look)):
            if arm is not None and not low <= arm[number] <= high:
                problem = f"joint {joint!r}: {key} {arm[number]:g} is outside its limits {low:g} to {high:g}"
                raise BadInput(f"{path}: {problem}", hint=HINT)
    root = read_urdf(robot.urdf)
    if any("xacro" in element.tag for element in root.iter() if isinstance(element.tag, str)):
        raise BadInput(
            f"{path}: {robot.urdf.name} is xacro, not URDF", hint="expand it first: xacro FILE.xacro > FILE.urdf"
        )
    kinds = {joint.get("name"): joint.get("type") for joint in root.findall("joint")}
    links = {link.get("name") for link in root.findall("link")}
    for name in (robot.arm_base, robot.hand_link, robot.tool_link, *robot.finger_links):
        if name not in links:
            raise BadInput(f"{path}: {robot.urdf.name} has no link {name!r}", hint=HINT)
    for names, allowed in ((robot.arm_joints, ("revolute", "continuous")), (robot.finger_joints, ("prismatic",))):
        for name in names:
            if kinds.get(name) not in allowed:
                found = f"is {kinds[name]}" if name in kinds else "is not there"
                raise BadInput(f"{path}: joint {name!r} of {robot.urdf.name} {found}, not {allowed[0]}", hint=HINT)
    for read in parse_urdf(robot.urdf).joints:
        turns = np.isfinite(read.axis).all() and np.linalg.norm(read.axis) > SHORTEST_AXIS
        if read.name in (*robot.arm_joints, *robot.finger_joints) and not turns:
            raise BadInput(f"{path}: joint {read.name!r} of {robot.urdf.name}: its axis has no direction", hint=HINT)
    parents = Counter(child.get("link", "") for child in root.findall("joint/child"))
    for link, count in parents.items():
        if count > 1:
            raise BadInput(
                f"{path}: link {link!r} of {robot.urdf.name} hangs from {count} joints: the arm is not serial",
                hint="leave the linkage out, one joint to each link",
            )
    moving = [name for name in joints_between(root, robot.arm_base, robot.tool_link) if kinds[name] != "fixed"]
    if moving != list(robot.arm_joints):
        if not joints_between(root, robot.arm_base, robot.tool_link):
            raise BadInput(
                f"{path}: {robot.tool_link!r} does not hang from {robot.arm_base!r}: tool_link, arm_base", hint=HINT
            )
        what = ", ".join(moving) or "none"
        raise BadInput(f"{path}: from arm_base to tool_link move {what}: not arm_joints in their order", hint=HINT)
    for mesh in root.findall("link/collision/geometry/mesh"):
        file = mesh_file(mesh, robot.urdf.parent)
        if not file.is_file():
            name = mesh.get("filename", "")
            raise BadInput(f"{path}: {robot.urdf.name}: mesh {name!r} is not there", hint=f"looked for as {file}")


def joints_between(root: ElementTree.Element, base: str, tip: str) -> list[str]:
    """Return the names of the joints from link `base` to link `tip` of a URDF, in order; none where there is no way."""
    by_child = {}
    for joint in root.findall("joint"):
        parent, child = joint.find("parent"), joint.find("child")
        if parent is not None and child is not None:
            by_child[child.get("link")] = (joint.get("name", ""), parent.get("link"))
    names: list[str] = []
    link: str | None = tip
    while link != base:
        if link not in by_child or len(names) > len(by_child):
            return []
        name, link = by_child[link]
        names.append(name)
    return names[::-1]


def _installed(urdf: Path) -> Path:
    """Return a URDF of the package pybullet_data. Raises MissingDependency when the package or the file is missing."""
    try:
        import pybullet_data
    except ImportError:
        raise MissingDependency("the package pybullet is not installed", hint="run `make setup`") from None
    path = Path(pybullet_data.getDataPath()) / urdf
    if not path.is_file():
        raise MissingDependency(f"{urdf}: the robot's URDF lies neither beside its description nor in pybullet_data")
    return path


def _joint(name: str, kind: str, parent: str, child: str, axis: str, origin: str = "0 0 0") -> str:
    limit = '<limit lower="-100" upper="100" effort="100000" velocity="10"/>' if kind == "prismatic" else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{origin}"/><axis xyz="{axis}"/>{limit}</joint>'
    )


def _light_link(name: str) -> str:
    inertia = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
    return f'<link name="{name}"><inertial><mass value="20"/>{inertia}</inertial></link>'


def mobile_robot_urdf(robot: RobotDescription) -> str:
    """Return URDF text of the robot on its pedestal: world -> base_x -> base_y -> base_yaw -> pedestal -> arm.

    Only collision shapes are kept; mesh paths are absolute.
    """
    arm = ElementTree.fromstring(without_visuals(with_absolute_meshes(read_urdf(robot.urdf), robot.urdf.parent)))
    height = robot.pedestal_height - GROUND_CLEARANCE
    middle = GROUND_CLEARANCE + height / 2
    pedestal = (
        f'<link name="{PEDESTAL_LINK}">'
        f'<inertial><origin xyz="0 0 0.1"/><mass value="80"/>'
        f'<inertia ixx="5" ixy="0" ixz="0" iyy="5" iyz="0" izz="5"/></inertial>'
        f'<collision><origin xyz="0 0 {middle}"/><geometry>'
        f'<cylinder radius="{robot.pedestal_radius}" length="{height}"/></geometry></collision></link>'
    )
    base = [
        '<link name="anchor"><inertial><mass value="0"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>'
        "</inertial></link>",
        _light_link("slide_x"),
        _light_link("slide_y"),
        pedestal,
        _joint("base_x", "prismatic", "anchor", "slide_x", "1 0 0"),
        _joint("base_y", "prismatic", "slide_x", "slide_y", "0 1 0"),
        _joint("base_yaw", "continuous", "slide_y", PEDESTAL_LINK, "0 0 1"),
        _joint("mount", "fixed", PEDESTAL_LINK, robot.arm_base, "0 0 1", f"0 0 {robot.pedestal_height}"),
    ]
    for place, text in enumerate(base):
        arm.insert(place, ElementTree.fromstring(text))
    return ElementTree.tostring(arm, encoding="unicode")
