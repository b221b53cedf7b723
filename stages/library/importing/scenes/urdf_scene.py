"""A URDF as a scene: its root stands fast, what hangs on floating joints is free. URDF knows no joint values."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.known_elements import plain_tag, unknown_elements
from scenewright.stages.kit.formats.urdf_file import COUNTED, JOINT_TYPES, KNOWN_URDF, Link, Shape, Urdf, UrdfJoint
from scenewright.stages.kit.formats.urdf_file import joint_ends as ends_of
from scenewright.stages.kit.geometry.solids import MassProperties
from scenewright.stages.kit.geometry.transforms import transform_from
from scenewright.stages.library.importing.description_meshes import Naming, mesh_surfaces
from scenewright.stages.library.importing.limits import MOST_LINKS, Allowance, few_findings, refuse_many
from scenewright.stages.library.importing.scenes.bodies import bodies_of
from scenewright.stages.library.importing.scenes.shapes import Hulls, solid_shape
from scenewright.stages.library.importing.scenes.writing import OthersScene, PlainNames
from scenewright.stages.library.importing.source_folder import SourceFolder, numbers
from scenewright.stages.library.importing.source_model import coupled, held_fast
from scipy.spatial.transform import Rotation

FRICTION = 0.6
"""Friction coefficient of links whose file has none."""
SIZES = {"box": ("size",), "sphere": ("radius",), **dict.fromkeys(("cylinder", "capsule"), ("radius", "length"))}
"""Shape -> attributes with its sizes."""


def urdf_scene(path: Path, root: Path) -> OthersScene:
    """Read a URDF as a scene; its meshes lie in `root`. Raises BadInput."""
    return _Reader(path, root).scene()


class _Reader:
    def __init__(self, path: Path, root: Path) -> None:
        self.path, self.folder = path, SourceFolder(root)
        self.findings: list[str] = []
        self.allowance = Allowance(str(path))
        self.hulls = Hulls(self.findings)
        self.names: dict[tuple[str, str], str] = {}

    def scene(self) -> OthersScene:
        robot = self.folder.read_xml(self.path)
        links, joints = robot.findall("link"), robot.findall("joint")
        refuse_many(str(self.path), "links", len(links), MOST_LINKS)
        self._name(links, joints)
        self.findings += unknown_elements([robot], KNOWN_URDF, COUNTED)
        urdf = Urdf("", tuple(map(self._link, links)), tuple(map(self._joint, joints)))
        if len(urdf.roots()) != 1:
            raise BadInput(f"{self.path}: {len(urdf.roots())} links hang on nothing; a URDF has one root")
        bodies = bodies_of(urdf, {}, str(self.path))
        return OthersScene(self.path, "URDF", tuple(bodies), self.hulls, findings=few_findings(self.findings))

    def _name(self, links: list[ElementTree.Element], joints: list[ElementTree.Element]) -> None:
        plain = PlainNames()
        for element in (*links, *joints):
            key = (element.tag, element.get("name", ""))
            if key in self.names:
                raise BadInput(f"{self.path}: {key[0]} {key[1]!r:.60} stands twice")
            self.names[key] = plain.of(key[1])

    def _link(self, element: ElementTree.Element) -> Link:
        name = element.get("name", "")
        where = f"{self.path}: link {name!r:.60}"
        shapes = [shape for child in element.findall("collision") for shape in self._shapes(child, where)]
        sliding = element.find("contact/lateral_friction")
        told = None if sliding is None else float(numbers(sliding.get("value"), 1, f"{where}: lateral_friction")[0])
        friction = FRICTION if told is None else max(told, 0.0) ** 2  # Bullet multiplies those of the two links
        return Link(self.names["link", name], self._inertial(element, where), (), tuple(shapes), friction)

    def _inertial(self, link: ElementTree.Element, where: str) -> MassProperties | None:
        element = link.find("inertial")
        if element is None:
            return None
        mass, tensor = element.find("mass"), element.find("inertia")
        if mass is None or tensor is None:
            raise BadInput(f"{where}: inertial without mass or inertia")
        kilograms = float(numbers(mass.get("value"), 1, f"{where}: mass")[0])
        xx, xy, xz, yy, yz, zz = (
            float(numbers(tensor.get(key, "0"), 1, f"{where}: {key}")[0])
            for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        )
        frame = _pose(element, where)
        matrix = frame[:3, :3] @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ frame[:3, :3].T
        return MassProperties(kilograms, frame[:3, 3], matrix) if kilograms > 0 else None

    def _shapes(self, element: ElementTree.Element, where: str) -> list[Shape]:
        pose, geometry = _pose(element, where), element.find("geometry")
        if geometry is None:
            raise BadInput(f"{where}: no geometry")
        if (mesh := geometry.find("mesh")) is not None:
            scale = np.diag([*numbers(mesh.get("scale", "1 1 1"), 3, f"{where}: scale"), 1.0])
            naming = Naming(self.folder, self.path, self.findings, set(), self.allowance)
            name = mesh.get("filename", "")
            surfaces = mesh_surfaces(naming, name, pose @ scale, None, "")
            return [self.hulls.shape(np.concatenate([surface.vertices for surface in surfaces]), name)]
        for kind, keys in SIZES.items():
            if (solid := geometry.find(kind)) is not None:
                count = 3 if kind == "box" else 1
                sizes = np.concatenate([numbers(solid.get(key), count, f"{where}: {kind} {key}") for key in keys])
                return [solid_shape(kind, sizes, pose, where)]
        kinds = ", ".join(f"<{plain_tag(child):.40}>" for child in geometry)
        self.findings.append(f"a shape of {where.rpartition(': ')[2]} is left out: {kinds or 'it is empty'}")
        return []

    def _joint(self, element: ElementTree.Element) -> UrdfJoint:
        name = element.get("name", "")
        where = f"{self.path}: joint {name!r:.60}"
        ends = ends_of(element, where)
        for end in ends:
            if ("link", end) not in self.names:
                raise BadInput(f"{where}: link {end!r:.60} does not exist")
        kind = element.get("type", "")
        if kind not in JOINT_TYPES:
            self.findings.append(held_fast(name, kind))
            kind = "fixed"
        if (mimic := element.find("mimic")) is not None:
            self.findings.append(coupled(name, mimic.get("joint", "")))
        axis, limit, dynamics = element.find("axis"), element.find("limit"), element.find("dynamics")
        direction = numbers("1 0 0" if axis is None else axis.get("xyz", "1 0 0"), 3, f"{where}: axis")

        def value(source: ElementTree.Element | None, key: str) -> float:
            return float(numbers("0" if source is None else source.get(key, "0"), 1, f"{where}: {key}")[0])

        return UrdfJoint(
            name=self.names["joint", name],
            type=kind,
            parent=self.names["link", ends[0]],
            child=self.names["link", ends[1]],
            parent_from_child=_pose(element, where),
            axis=unit_axis(direction, where),
            lower=value(limit, "lower"),
            upper=value(limit, "upper"),
            damping=value(dynamics, "damping"),
            friction=value(dynamics, "friction"),
        )


def unit_axis(direction: np.ndarray, where: str) -> tuple[float, float, float]:
    """Return a joint's axis at length 1. Raises BadInput, beginning with `where`, for one of length 0."""
    length = float(np.linalg.norm(direction))
    if length < 1e-9:
        raise BadInput(f"{where}: axis has no length")
    x, y, z = (float(value) / length for value in direction)
    return x, y, z


def _pose(element: ElementTree.Element, where: str) -> np.ndarray:
    origin = element.find("origin")
    if origin is None:
        return np.eye(4)
    angles = numbers(origin.get("rpy", "0 0 0"), 3, f"{where}: rpy")
    turn = Rotation.from_euler("xyz", angles).as_matrix()
    return transform_from(turn, numbers(origin.get("xyz", "0 0 0"), 3, f"{where}: xyz"))
