"""URDF, and the PartNet-Mobility layout around one (mobility.urdf, meta.json, semantics.txt)."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.known_elements import plain_tag, unknown_elements
from scenewright.stages.kit.formats.urdf_file import COUNTED, KNOWN_URDF, joint_ends
from scenewright.stages.kit.geometry.solids import Solid, box, cylinder
from scenewright.stages.kit.geometry.transforms import transform_from
from scenewright.stages.library.importing.description_meshes import Naming, mesh_surfaces
from scenewright.stages.library.importing.limits import MOST_LINKS, Allowance, few_findings, one_color, refuse_many
from scenewright.stages.library.importing.primitives import ball, capsule
from scenewright.stages.library.importing.source_folder import SourceFolder, numbers
from scenewright.stages.library.importing.source_model import (
    Declared,
    JointKind,
    SourceJoint,
    SourceLink,
    SourceModel,
    Surface,
    coupled,
    held_fast,
    solid_surface,
)
from scipy.spatial.transform import Rotation

KINDS: dict[str, JointKind] = {
    "fixed": "fixed",
    "floating": "floating",
    "revolute": "revolute",
    "continuous": "continuous",
    "prismatic": "prismatic",
}
PARTNET_FRONT = (-1.0, 0.0, 0.0)
"""Doors and drawers of PartNet-Mobility models look along -x of mobility.urdf's root frame, z is up."""
LARGEST_TEXT = 2**20
"""Largest text file of a PartNet model [bytes]; a bound, by eye."""


def read_urdf_model(folder: SourceFolder, path: Path) -> SourceModel:
    """Return the model of a URDF file. Raises BadInput."""
    return _Reader(folder, path).model()


def read_partnet_model(folder: SourceFolder, path: Path) -> SourceModel:
    """Return the model of a `mobility.urdf`, with the category of meta.json and the part names of semantics.txt.

    Raises BadInput.
    """
    model = _Reader(folder, path).model()
    words, roles = [path.parent.name], {}
    meta = path.parent / "meta.json"
    if meta.is_file():
        try:
            facts = json.loads(folder.read(meta, LARGEST_TEXT))
            words = [str(facts[key]) for key in ("model_cat", "model_category") if key in facts] + words
        except (ValueError, TypeError, KeyError, RecursionError):
            raise BadInput(f"{meta}: no JSON object", hint="copy the model again") from None
    semantics = path.parent / "semantics.txt"
    if semantics.is_file():
        for line in folder.read(semantics, LARGEST_TEXT).decode("utf-8", "replace").splitlines():
            columns = line.split()
            if len(columns) >= 3:
                roles[columns[0]] = columns[2]
    links = tuple(
        SourceLink(link.name, link.visual, link.collision, link.mass, link.marks, roles.get(link.name, ""))
        for link in model.links
    )
    return SourceModel(
        name=f"{words[0]}_{path.parent.name}",
        source=model.source,
        format="PartNet-Mobility",
        links=links,
        joints=model.joints,
        front=Declared(PARTNET_FRONT, "format"),
        words=tuple(words),
        mesh_unit=model.mesh_unit,
        findings=model.findings,
    )


class _Reader:
    def __init__(self, folder: SourceFolder, path: Path) -> None:
        self.folder, self.path = folder, path
        self.findings: list[str] = []
        self.units: set[float] = set()
        self.allowance = Allowance(str(path))
        self.materials: dict[str, tuple[float, float, float]] = {}
        self.textured: set[str] = set()
        """Names of materials with a texture."""

    def model(self) -> SourceModel:
        robot = self.folder.read_xml(self.path)
        if robot.tag != "robot":
            raise BadInput(f"{self.path}: root element is <{robot.tag}>, expected <robot>")
        for material in robot.findall("material"):
            if material.find("texture") is not None:
                self.textured.add(material.get("name", ""))
            color = material.find("color")
            if color is not None:
                rgba = numbers(color.get("rgba"), 4, f"{self.path}: rgba")
                self.materials[material.get("name", "")] = (float(rgba[0]), float(rgba[1]), float(rgba[2]))
        refuse_many(str(self.path), "links", len(robot.findall("link")), MOST_LINKS)
        self.findings += unknown_elements([robot], KNOWN_URDF, COUNTED)
        links = tuple(self._link(element) for element in robot.findall("link"))
        joints = tuple(self._joint(element) for element in robot.findall("joint"))
        name = self.path.stem
        return SourceModel(
            name=name,
            source=self.folder.relative(self.path),
            format="URDF",
            links=links,
            joints=joints,
            words=(name, robot.get("name", ""), self.path.parent.name),
            mesh_unit=min(self.units) if len(self.units) == 1 else None,
            findings=few_findings(self.findings),
        )

    def _pose(self, element: ElementTree.Element, where: str) -> np.ndarray:
        origin = element.find("origin")
        if origin is None:
            return np.eye(4)
        angles = numbers(origin.get("rpy", "0 0 0"), 3, f"{where}: rpy")
        return transform_from(
            Rotation.from_euler("xyz", angles).as_matrix(), numbers(origin.get("xyz", "0 0 0"), 3, f"{where}: xyz")
        )

    def _link(self, element: ElementTree.Element) -> SourceLink:
        name = element.get("name", "")
        where = f"{self.path}: link {name!r:.60}"
        mass_element = element.find("inertial/mass")
        mass = None
        if mass_element is not None:
            mass = float(numbers(mass_element.get("value"), 1, f"{where}: mass")[0])
        return SourceLink(
            name,
            tuple(s for child in element.findall("visual") for s in self._shape(child, where)),
            tuple(s for child in element.findall("collision") for s in self._shape(child, where)),
            mass if mass is not None and mass > 0 else None,
        )

    def _color(self, element: ElementTree.Element, where: str) -> tuple[float, float, float] | None:
        material = element.find("material")
        if material is None:
            return None
        if material.find("texture") is not None or material.get("name", "") in self.textured:
            self.findings.append(one_color("texture of material", material.get("name", "")))
        color = material.find("color")
        if color is None:
            return self.materials.get(material.get("name", ""))
        rgba = numbers(color.get("rgba"), 4, f"{where}: rgba")
        return (float(rgba[0]), float(rgba[1]), float(rgba[2]))

    def _shape(self, element: ElementTree.Element, where: str) -> list[Surface]:
        pose, color, name = self._pose(element, where), self._color(element, where), element.get("name", "")
        geometry = element.find("geometry")
        if geometry is None:
            raise BadInput(f"{where}: no geometry")
        mesh, solid = geometry.find("mesh"), _primitive(geometry, where)
        if solid is not None:
            self.allowance.take_counts(len(solid.faces), len(solid.vertices))
            return [solid_surface(solid, color, name).moved(pose)]
        if mesh is None:
            kinds = ", ".join(f"<{plain_tag(child):.40}>" for child in geometry)
            self.findings.append(f"a shape of {where.rpartition(': ')[2]} is left out: {kinds or 'it is empty'}")
            return []
        scale = np.diag([*numbers(mesh.get("scale", "1 1 1"), 3, f"{where}: scale"), 1.0])
        file = mesh.get("filename", "")
        naming = Naming(self.folder, self.path, self.findings, self.units, self.allowance)
        return mesh_surfaces(naming, file, pose @ scale, color, name)

    def _joint(self, element: ElementTree.Element) -> SourceJoint:
        name = element.get("name", "")
        where = f"{self.path}: joint {name!r:.60}"
        parent, child = joint_ends(element, where)
        axis, limit = element.find("axis"), element.find("limit")
        kind = KINDS.get(element.get("type", ""))
        if kind is None:
            self.findings.append(held_fast(name, element.get("type", "")))
        if (mimic := element.find("mimic")) is not None:
            self.findings.append(coupled(name, mimic.get("joint", "")))
        lower, upper = (
            float(numbers("0" if limit is None else limit.get(key, "0"), 1, f"{where}: {key}")[0])
            for key in ("lower", "upper")
        )
        return SourceJoint(
            name=name,
            kind=kind or "fixed",
            parent=parent,
            child=child,
            parent_from_child=self._pose(element, where),
            axis=numbers("1 0 0" if axis is None else axis.get("xyz", "1 0 0"), 3, f"{where}: axis"),
            lower=lower,
            upper=upper,
        )


def _primitive(geometry: ElementTree.Element, where: str) -> Solid | None:
    """Return the box, cylinder, capsule or sphere of a URDF geometry, None when it is another.

    The length of a capsule is that of its cylinder, as urdfdom, Bullet and MuJoCo take it.
    """
    round_kinds = {"cylinder": ("radius", "length"), "capsule": ("radius", "length"), "sphere": ("radius",)}
    for tag, keys in {"box": ("size",), **round_kinds}.items():
        element = geometry.find(tag)
        if element is None:
            continue
        if tag == "box":
            x, y, z = numbers(element.get("size"), 3, f"{where}: box size") / 2
        else:
            values = [float(numbers(element.get(key), 1, f"{where}: {key}")[0]) for key in keys]
            x, y, z = values[0], values[0], values[-1] / 2 if len(keys) == 2 else values[0]
        if not 0 < min(x, y, z) <= max(x, y, z) < 1e6:
            raise BadInput(f"{where}: a {tag} without size")
        if tag == "box":
            return box((-x, x), (-y, y), (-z, z))
        if tag == "capsule":
            return capsule(x, z)
        return cylinder(x, (-z, z), count=24) if tag == "cylinder" else ball(np.array([x, y, z]))
    return None
