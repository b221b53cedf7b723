"""URDF as records: write, parse. Checking is in urdf_check.py.

Covers what scenes need: links with inertia, meshes and boxes, joints fixed, floating, revolute, continuous, prismatic.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import file_content
from scenewright.stages.kit.formats.known_elements import Table, plain_tag
from scenewright.stages.kit.formats.xml_files import parse_xml
from scenewright.stages.kit.geometry.solids import MassProperties
from scenewright.stages.kit.geometry.substances import ROLLING_FRICTION, SPINNING_FRICTION
from scenewright.stages.kit.geometry.transforms import transform_from
from scipy.spatial.transform import Rotation

JOINT_TYPES = ("fixed", "floating", "revolute", "continuous", "prismatic")
KNOWN_URDF: Table = {
    "robot": frozenset(
        {*("link", "joint", "material"), *("transmission", "gazebo", "ros2_control", "mujoco", "sensor")}
    ),
    "link": frozenset(
        {*("inertial", "visual", "collision"), *("contact", "self_collision_checking", "gravity", "sensor")}
    ),
    "visual": frozenset({"origin", "geometry", "material"}),
    "collision": frozenset({"origin", "geometry", "material", "contact_coefficients", "surface"}),
    "joint": frozenset(
        {*("origin", "parent", "child", "axis", "limit", "mimic"), *("dynamics", "calibration", "safety_controller")}
        | {"joint_properties"}
    ),
}
"""What is read, and what holds nothing of shape and motion (after urdfdom, ROS, Bullet)."""
READ = ("mesh", "box")
COUNTED = ("link", "joint", "visual", "collision")
MAXIMUM_BYTES = 64 * 2**20
"""Largest URDF [bytes]; a bound, by eye."""


@dataclass(frozen=True)
class Primitive:
    """A shape that is neither mesh nor box."""

    kind: str
    """`sphere`, `cylinder` or `capsule` along z; as it was read, another word where URDF has no such shape."""
    sizes: tuple[float, ...]
    """Radius, and length where the kind has one [m], of a capsule between its balls' centres; empty for a kind that
    URDF does not have."""


@dataclass(frozen=True)
class Shape:
    """A mesh file (relative to the URDF), a box, or something round, where it sits in its link, its colour."""

    mesh: str | None = None
    scale: float = 1.0
    box_size: tuple[float, float, float] | None = None
    link_from_shape: np.ndarray = field(default_factory=lambda: np.eye(4))
    color: tuple[float, float, float, float] | None = None
    """RGBA in 0..1; visuals only."""
    round: Primitive | None = None
    """Of scenes that others made; `parse_urdf` keeps those that it reads apart (`Link.primitives`)."""


@dataclass(frozen=True)
class Link:
    """A rigid body: mass properties in its own frame, what it looks like, what it collides with."""

    name: str
    inertial: MassProperties | None = None
    visuals: tuple[Shape, ...] = ()
    collisions: tuple[Shape, ...] = ()
    friction: float | None = None
    """Sliding friction of its surface on one of the same kind; None when the file says nothing."""
    primitives: tuple[Primitive, ...] = ()
    """Read to be checked, without their places."""


@dataclass(frozen=True)
class UrdfJoint:
    """A joint: parent_from_child at value 0, axis in the child's frame, limits [rad, m]."""

    name: str
    type: str
    parent: str
    child: str
    parent_from_child: np.ndarray
    axis: tuple[float, float, float] = (1.0, 0.0, 0.0)
    lower: float = 0.0
    upper: float = 0.0
    effort: float = 100.0
    velocity: float = 2.0
    damping: float = 0.0
    friction: float = 0.0
    mimics: str | None = None
    """Name of the joint that drives this one. Read to be checked; scenes have none, and none is written."""


@dataclass(frozen=True)
class Urdf:
    """A robot element."""

    name: str
    links: tuple[Link, ...]
    joints: tuple[UrdfJoint, ...] = ()

    def link(self, name: str) -> Link:
        """Return the link of this name. Raises KeyError."""
        for entry in self.links:
            if entry.name == name:
                return entry
        raise KeyError(name)

    def roots(self) -> list[str]:
        """Return the links that are no joint's child."""
        children = {joint.child for joint in self.joints}
        return [link.name for link in self.links if link.name not in children]


def number(value: float) -> str:
    """Return a number for XML: 9 significant digits, no negative zero, nothing below a picometre."""
    return f"{0.0 if abs(value) < 1e-12 else float(value):.9g}"


def numbers(values: np.ndarray | tuple[float, ...]) -> str:
    """Return numbers for XML, separated by blanks."""
    return " ".join(number(float(value)) for value in np.asarray(values, dtype=float).ravel())


def write_urdf(path: Path, urdf: Urdf) -> None:
    """Write the URDF with stable bytes."""
    robot = ElementTree.Element("robot", name=urdf.name)
    for link in urdf.links:
        robot.append(_link_element(link))
    for joint in urdf.joints:
        robot.append(_joint_element(joint))
    ElementTree.indent(robot, " ")
    Path(path).write_bytes(ElementTree.tostring(robot, encoding="utf-8", xml_declaration=True) + b"\n")


def _origin(parent: ElementTree.Element, transform: np.ndarray) -> None:
    if np.abs(transform - np.eye(4)).max() < 1e-12:
        return
    angles = Rotation.from_matrix(transform[:3, :3]).as_euler("xyz", suppress_warnings=True)
    ElementTree.SubElement(parent, "origin", xyz=numbers(transform[:3, 3]), rpy=numbers(angles))


def _geometry(parent: ElementTree.Element, shape: Shape) -> None:
    geometry = ElementTree.SubElement(parent, "geometry")
    if shape.mesh is not None:
        attributes = {"filename": shape.mesh}
        if shape.scale != 1.0:
            attributes["scale"] = numbers((shape.scale,) * 3)
        ElementTree.SubElement(geometry, "mesh", attributes)
    elif shape.box_size is not None:
        ElementTree.SubElement(geometry, "box", size=numbers(shape.box_size))
    elif shape.round is not None:
        sizes = zip(("radius", "length"), shape.round.sizes, strict=False)
        ElementTree.SubElement(geometry, shape.round.kind, {key: number(value) for key, value in sizes})
    else:
        raise ValueError("a shape is a mesh, a box, or round")


def _link_element(link: Link) -> ElementTree.Element:
    element = ElementTree.Element("link", name=link.name)
    if link.inertial is not None:
        inertial = ElementTree.SubElement(element, "inertial")
        ElementTree.SubElement(inertial, "origin", xyz=numbers(link.inertial.center), rpy="0 0 0")
        ElementTree.SubElement(inertial, "mass", value=number(link.inertial.mass))
        tensor = link.inertial.inertia
        entries = {
            f"i{a}{b}": f"{tensor['xyz'.index(a), 'xyz'.index(b)]:.9g}" for a, b in ("xx", "xy", "xz", "yy", "yz", "zz")
        }
        ElementTree.SubElement(inertial, "inertia", entries)
    if link.friction is not None and link.collisions:
        # Bullet multiplies the two values of a contact
        contact = ElementTree.SubElement(element, "contact")
        ElementTree.SubElement(contact, "lateral_friction", value=number(link.friction**0.5))
        ElementTree.SubElement(contact, "rolling_friction", value=number(ROLLING_FRICTION))
        ElementTree.SubElement(contact, "spinning_friction", value=number(SPINNING_FRICTION))
    for index, shape in enumerate(link.visuals):
        visual = ElementTree.SubElement(element, "visual")
        _origin(visual, shape.link_from_shape)
        _geometry(visual, shape)
        if shape.color is not None:
            material = ElementTree.SubElement(visual, "material", name=f"{link.name}_color_{index}")
            ElementTree.SubElement(material, "color", rgba=numbers(np.round(shape.color, 4)))
    for shape in link.collisions:
        collision = ElementTree.SubElement(element, "collision")
        _origin(collision, shape.link_from_shape)
        _geometry(collision, shape)
    return element


def _joint_element(joint: UrdfJoint) -> ElementTree.Element:
    element = ElementTree.Element("joint", name=joint.name, type=joint.type)
    _origin(element, joint.parent_from_child)
    ElementTree.SubElement(element, "parent", link=joint.parent)
    ElementTree.SubElement(element, "child", link=joint.child)
    if joint.type in ("revolute", "continuous", "prismatic"):
        ElementTree.SubElement(element, "axis", xyz=numbers(joint.axis))
        limit = {"effort": number(joint.effort), "velocity": number(joint.velocity)}
        if joint.type != "continuous":
            limit = {"lower": number(joint.lower), "upper": number(joint.upper), **limit}
        ElementTree.SubElement(element, "limit", limit)
        if joint.damping or joint.friction:
            ElementTree.SubElement(element, "dynamics", damping=number(joint.damping), friction=number(joint.friction))
    return element


def parse_urdf(path: Path) -> Urdf:
    """Read a URDF. Raises BadInput for what is no XML, no robot, or has missing or unreadable numbers.

    What is well-formed but wrong (a cycle, a negative mass) is left to `check_urdf`.
    """
    path = Path(path)
    robot = parse_xml(file_content(path, MAXIMUM_BYTES), str(path))
    if robot.tag != "robot":
        raise BadInput(f"{path}: root element is <{robot.tag}>, expected <robot>")
    links = tuple(_parse_link(element, path) for element in robot.findall("link"))
    joints = tuple(_parse_joint(element, path) for element in robot.findall("joint"))
    return Urdf(robot.get("name", ""), links, joints)


def _floats(text: str | None, count: int, where: str) -> np.ndarray:
    try:
        values = np.array([float(part) for part in (text or "").split()])
    except ValueError:
        raise BadInput(f"{where}: {text!r} is not {count} numbers") from None
    if len(values) != count:
        raise BadInput(f"{where}: {text!r} is not {count} numbers")
    return values


def _parse_origin(element: ElementTree.Element, where: str) -> np.ndarray:
    origin = element.find("origin")
    if origin is None:
        return np.eye(4)
    angles = _floats(origin.get("rpy", "0 0 0"), 3, f"{where}: origin rpy")
    translation = _floats(origin.get("xyz", "0 0 0"), 3, f"{where}: origin xyz")
    if not np.isfinite(angles).all():
        return np.full((4, 4), np.nan)
    return transform_from(Rotation.from_euler("xyz", angles).as_matrix(), translation)


def _parse_shape(element: ElementTree.Element, where: str) -> Shape | None:
    transform = _parse_origin(element, where)
    color_element = element.find("material/color")
    color = None
    if color_element is not None:
        red, green, blue, alpha = _floats(color_element.get("rgba"), 4, f"{where}: rgba")
        color = (float(red), float(green), float(blue), float(alpha))
    mesh, block = element.find("geometry/mesh"), element.find("geometry/box")
    if mesh is not None:
        scale = _floats(mesh.get("scale", "1 1 1"), 3, f"{where}: scale")
        if np.isfinite(scale).all() and np.ptp(scale) > 1e-9:
            raise BadInput(f"{where}: mesh scale {mesh.get('scale')} is not uniform")
        return Shape(mesh=mesh.get("filename", ""), scale=float(scale[0]), link_from_shape=transform, color=color)
    if block is not None:
        x, y, z = _floats(block.get("size"), 3, f"{where}: box size")
        return Shape(box_size=(float(x), float(y), float(z)), link_from_shape=transform, color=color)
    if element.find("geometry") is None:
        raise BadInput(f"{where}: no geometry")
    return None


def _parse_link(element: ElementTree.Element, path: Path) -> Link:
    name = element.get("name", "")
    where = f"{path}: link {name!r}"
    inertial = element.find("inertial")
    properties = None
    if inertial is not None:
        mass, tensor = inertial.find("mass"), inertial.find("inertia")
        if mass is None or tensor is None:
            raise BadInput(f"{where}: inertial without mass or inertia")
        xx, xy, xz, yy, yz, zz = (
            float(_floats(tensor.get(key, "0"), 1, f"{where}: {key}")[0])
            for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        )
        matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        frame = _parse_origin(inertial, where)
        with np.errstate(all="ignore"):  # what overflows is infinite, and found so by the check
            matrix = frame[:3, :3] @ matrix @ frame[:3, :3].T
        properties = MassProperties(float(_floats(mass.get("value"), 1, f"{where}: mass")[0]), frame[:3, 3], matrix)
    visuals = [_parse_shape(child, where) for child in element.findall("visual")]
    collisions = [_parse_shape(child, where) for child in element.findall("collision")]
    sliding = element.find("contact/lateral_friction")
    friction = None
    if sliding is not None:
        value = float(_floats(sliding.get("value"), 1, f"{where}: lateral_friction")[0])
        friction = value * abs(value)  # a negative one stays negative, for the check to find
    shapes = [
        shape for kind in ("visual", "collision") for child in element.findall(kind) for shape in child.iter("geometry")
    ]
    primitives = tuple(_parse_primitive(child, where) for shape in shapes for child in shape if child.tag not in READ)
    return Link(
        name, properties, tuple(s for s in visuals if s), tuple(s for s in collisions if s), friction, primitives
    )


def _parse_primitive(element: ElementTree.Element, where: str) -> Primitive:
    keys = {"sphere": ("radius",), "cylinder": ("radius", "length"), "capsule": ("radius", "length")}
    sizes = [float(_floats(element.get(key), 1, f"{where}: {key}")[0]) for key in keys.get(element.tag, ())]
    return Primitive(plain_tag(element), tuple(sizes))


def joint_ends(element: ElementTree.Element, where: str) -> tuple[str, str]:
    """Return the names of parent and child link of a joint element. Raises BadInput, which begins with `where`, when
    one is missing."""
    ends = []
    for tag in ("parent", "child"):
        end = element.find(tag)
        if end is None or not end.get("link"):
            raise BadInput(f"{where}: no {tag} link")
        ends.append(end.get("link", ""))
    return ends[0], ends[1]


def _parse_joint(element: ElementTree.Element, path: Path) -> UrdfJoint:
    name = element.get("name", "")
    where = f"{path}: joint {name!r}"
    parent, child = joint_ends(element, where)
    axis_element, limit, dynamics = element.find("axis"), element.find("limit"), element.find("dynamics")
    axis = _floats(axis_element.get("xyz") if axis_element is not None else "1 0 0", 3, f"{where}: axis")

    def value(source: ElementTree.Element | None, key: str, default: str) -> float:
        return float(_floats(default if source is None else source.get(key, default), 1, f"{where}: {key}")[0])

    return UrdfJoint(
        name=name,
        type=element.get("type", ""),
        parent=parent,
        child=child,
        parent_from_child=_parse_origin(element, where),
        axis=(float(axis[0]), float(axis[1]), float(axis[2])),
        lower=value(limit, "lower", "0"),
        upper=value(limit, "upper", "0"),
        effort=value(limit, "effort", "0"),
        velocity=value(limit, "velocity", "0"),
        damping=value(dynamics, "damping", "0"),
        friction=value(dynamics, "friction", "0"),
        mimics=None if (mimic := element.find("mimic")) is None else mimic.get("joint", ""),
    )
