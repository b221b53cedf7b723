"""What is known of a robot: data/robots/<name>.toml and the URDF it names, put on a drivable pedestal."""

from __future__ import annotations

import tomllib
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from schemas.errors import MissingDependency, UsageError
from stages.kit.simulation.urdf_split import read_urdf, with_absolute_meshes, without_visuals

FOLDER = Path(__file__).resolve().parents[3] / "data" / "robots"
BASE_JOINTS = ("base_x", "base_y", "base_yaw")
PEDESTAL_LINK = "pedestal"
GROUND_CLEARANCE = 0.02
"""The pedestal hovers by this much: reconstructed floors are not flat to the millimetre."""


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
    carry: np.ndarray
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
    pedestal_height: float
    pedestal_radius: float
    base_speed: float
    base_turn_speed: float


def load_robot(name: str) -> RobotDescription:
    """Read data/robots/<name>.toml; its URDF lies beside it or in pybullet_data.

    Raises UsageError (no such robot), MissingDependency (its URDF is not there).
    """
    path = FOLDER / f"{name}.toml"
    if not path.is_file():
        names = ", ".join(sorted(entry.stem for entry in FOLDER.glob("*.toml")))
        raise UsageError(f"no robot is called {name!r}", hint=f"known: {names}")
    values = tomllib.loads(path.read_text(encoding="utf-8"))
    urdf = FOLDER / values.pop("urdf")
    if not urdf.is_file():
        urdf = _installed(urdf.relative_to(FOLDER))
    fields: dict[str, Any] = {"urdf": urdf, **values}
    fields |= {key: np.array(fields[key], dtype=float) for key in ("lower", "upper", "carry")}
    fields |= {key: tuple(fields[key]) for key in ("arm_joints", "finger_joints", "finger_links", "palm")}
    return RobotDescription(**fields)


def _installed(urdf: Path) -> Path:
    """Return a URDF of the package pybullet_data. Raises MissingDependency when the package or the file is missing."""
    try:
        import pybullet_data
    except ImportError:
        raise MissingDependency("the package pybullet is not installed", hint="run `make setup`") from None
    path = Path(pybullet_data.getDataPath()) / urdf
    if not path.is_file():
        raise MissingDependency(f"{path}: the robot's URDF is missing", hint="install pybullet again")
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
