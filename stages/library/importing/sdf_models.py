"""SDF (Gazebo): models with links, poses, meshes, boxes, cylinders, spheres and joints.

After the SDF specification 1.4 to 1.11: `<pose>` is relative to the model (links), the link (shapes) or the child link
(joints) unless `relative_to` names a link; a joint's axis is in the joint's frame unless `use_parent_model_frame` or
`expressed_in` says otherwise. Included models, plugins and nested models are left out.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.geometry.solids import Solid, box, cylinder
from scenewright.stages.kit.geometry.transforms import inverse, transform_from
from scenewright.stages.library.importing.limits import MOST_SHAPES, MOST_TRIANGLES_OF_A_FILE, Allowance, few_findings
from scenewright.stages.library.importing.primitives import ball, capsule
from scenewright.stages.library.importing.source_folder import SourceFolder, numbers
from scenewright.stages.library.importing.source_model import (
    JointKind,
    SourceJoint,
    SourceLink,
    SourceModel,
    Surface,
    solid_surface,
)
from scenewright.stages.library.importing.urdf_models import Naming, mesh_surfaces
from scipy.spatial.transform import Rotation

KINDS: dict[str, JointKind] = {
    "fixed": "fixed",
    "revolute": "revolute",
    "prismatic": "prismatic",
    "continuous": "continuous",
}
UNLIMITED = 1e3
"""Limits beyond this many radians or metres mean none (SDF's default is 1e16)."""


def read_sdf_models(folder: SourceFolder, path: Path) -> Iterator[SourceModel]:
    """Yield the models of an SDF file. Raises BadInput."""
    root = folder.read_xml(path)
    if root.tag not in ("sdf", "gazebo"):
        raise BadInput(f"{path}: root element is <{root.tag}>, expected <sdf>")
    elements = [*root.findall("model"), *root.findall("world/model")]
    of_file = Allowance(
        str(path), triangles=MOST_TRIANGLES_OF_A_FILE, vertices=3 * MOST_TRIANGLES_OF_A_FILE, shapes=5 * MOST_SHAPES
    )
    for element in elements:
        model = _Reader(folder, path, element, alone=len(elements) == 1).model()
        for link in model.links:
            of_file.take((*link.visual, *link.collision))
        yield model


class _Reader:
    def __init__(self, folder: SourceFolder, path: Path, element: ElementTree.Element, *, alone: bool) -> None:
        self.folder, self.path, self.element, self.alone = folder, path, element, alone
        self.findings: list[str] = []
        self.units: set[float] = set()
        self.allowance = Allowance(str(path))
        self.poses: dict[str, np.ndarray] = {}
        """Link -> (4, 4) model_from_link."""

    def model(self) -> SourceModel:
        name = self.element.get("name", "")
        if self.element.find("model") is not None or self.element.find("include") is not None:
            self.findings.append("models inside the model are left out")
        for link in self.element.findall("link"):
            self.poses[link.get("name", "")] = self._pose_of_link(link)
        links = tuple(self._link(link) for link in self.element.findall("link"))
        if not links:
            raise BadInput(f"{self.path}: model {name!r:.60} has no links")
        joints = [self._joint(joint) for joint in self.element.findall("joint")]
        joints = [joint for joint in joints if joint.parent != "world" and joint.child != "world"]
        children = {joint.child for joint in joints}
        loose = [link.name for link in links if link.name not in children]
        for loose_link in loose[1:]:  # links without a joint between them: Gazebo lets them fall apart
            self.findings.append(f"link {loose_link!r:.40} hangs on nothing: taken as fixed")
            between = inverse(self.poses[loose[0]]) @ self.poses[loose_link]
            joints.append(SourceJoint(f"{loose_link}_fixed", "fixed", loose[0], loose_link, between))
        folder_name = self.path.parent.name if self.path.parent != self.folder.root else ""
        model_name = name or self.path.stem
        return SourceModel(
            name=model_name if self.alone and model_name != "model" else f"{folder_name}_{model_name}",
            source=self.folder.relative(self.path),
            format="SDF",
            links=links,
            joints=tuple(joints),
            words=tuple(word for word in (name, folder_name if self.alone else "") if word),
            mesh_unit=min(self.units) if len(self.units) == 1 else None,
            findings=few_findings(self.findings),
        )

    def _pose(self, element: ElementTree.Element, where: str) -> np.ndarray:
        pose = element.find("pose")
        if pose is None or not (pose.text or "").strip():
            return np.eye(4)
        values = numbers(pose.text, 6, f"{where}: pose")
        angles = np.radians(values[3:]) if pose.get("degrees") == "true" else values[3:]
        return transform_from(Rotation.from_euler("xyz", angles).as_matrix(), values[:3])

    def _pose_of_link(self, link: ElementTree.Element) -> np.ndarray:
        where = f"{self.path}: link {link.get('name', '')!r:.60}"
        pose, element = self._pose(link, where), link.find("pose")
        base = "" if element is None else element.get("relative_to", "")
        if base and base not in ("__model__", *self.poses):
            raise BadInput(f"{where}: pose relative to {base!r:.60}, which no link before it is called")
        return self.poses.get(base, np.eye(4)) @ pose

    def _link(self, link: ElementTree.Element) -> SourceLink:
        name = link.get("name", "")
        where = f"{self.path}: link {name!r:.60}"
        mass = link.findtext("inertial/mass")
        kilograms = None if mass is None else float(numbers(mass, 1, f"{where}: mass")[0])
        return SourceLink(
            name,
            tuple(s for child in link.findall("visual") for s in self._shape(child, where)),
            tuple(s for child in link.findall("collision") for s in self._shape(child, where)),
            kilograms if kilograms is not None and kilograms > 0 else None,
        )

    def _shape(self, element: ElementTree.Element, where: str) -> list[Surface]:
        pose, name = self._pose(element, where), element.get("name", "")
        geometry = element.find("geometry")
        if geometry is None:
            raise BadInput(f"{where}: no geometry")
        color = None
        if diffuse := element.findtext("material/diffuse"):
            red, green, blue, _ = numbers(diffuse, 4, f"{where}: diffuse")
            color = (float(red), float(green), float(blue))
        mesh = geometry.find("mesh")
        if mesh is not None:
            scale = np.diag([*numbers(mesh.findtext("scale") or "1 1 1", 3, f"{where}: scale"), 1.0])
            uri = (mesh.findtext("uri") or "").strip()
            naming = Naming(self.folder, self.path, self.findings, self.units, self.allowance)
            return mesh_surfaces(naming, uri, pose @ scale, color, name)
        solid = _primitive(geometry, where)
        if solid is None:
            self.findings.append(f"a shape of link {name!r:.40} is of a kind that is left out")
            return []
        self.allowance.take_counts(len(solid.faces), len(solid.vertices))
        return [solid_surface(solid, color, name).moved(pose)]

    def _joint(self, joint: ElementTree.Element) -> SourceJoint:
        name = joint.get("name", "")
        where = f"{self.path}: joint {name!r:.60}"
        parent, child = (joint.findtext(tag, "").strip() for tag in ("parent", "child"))
        for link in (parent, child):
            if link != "world" and link not in self.poses:
                raise BadInput(f"{where}: link {link!r:.60} does not exist")
        model_from_child = self.poses.get(child, np.eye(4))
        child_from_joint = self._pose(joint, where)
        axis = np.array([0.0, 0.0, 1.0])
        lower, upper = 0.0, 0.0
        kind = KINDS.get(joint.get("type", ""), "unknown")
        element = joint.find("axis")
        if element is not None and kind not in ("fixed", "unknown"):
            xyz = element.find("xyz")
            axis = numbers("0 0 1" if xyz is None else xyz.text, 3, f"{where}: axis")
            expressed = "" if xyz is None else xyz.get("expressed_in", "")
            if (element.findtext("use_parent_model_frame") or "").strip() in ("1", "true") or expressed == "__model__":
                axis = model_from_child[:3, :3].T @ axis
            elif expressed in self.poses:
                axis = model_from_child[:3, :3].T @ self.poses[expressed][:3, :3] @ axis
            else:
                axis = child_from_joint[:3, :3] @ axis
            lower, upper = (
                float(numbers(element.findtext(f"limit/{key}") or default, 1, f"{where}: {key}")[0])
                for key, default in (("lower", "-1e16"), ("upper", "1e16"))
            )
            if max(-lower, upper) > UNLIMITED:
                if kind == "prismatic":
                    self.findings.append(f"joint {name!r:.40} slides without limits: held fast")
                    kind = "fixed"
                else:
                    kind = "continuous"
        return SourceJoint(
            name=name,
            kind=kind,
            parent=parent,
            child=child,
            parent_from_child=inverse(self.poses.get(parent, np.eye(4))) @ model_from_child,
            anchor=child_from_joint[:3, 3],
            axis=axis,
            lower=lower,
            upper=upper,
        )


def _primitive(geometry: ElementTree.Element, where: str) -> Solid | None:
    """Return the box, cylinder, capsule or sphere of an SDF geometry, None when it is another."""
    if (block := geometry.find("box")) is not None:
        half = numbers(block.findtext("size"), 3, f"{where}: box size") / 2
        _require_size(half, where)
        x, y, z = (float(v) for v in half)
        return box((-x, x), (-y, y), (-z, z))
    for tag in ("cylinder", "capsule", "sphere"):
        element = geometry.find(tag)
        if element is None:
            continue
        radius = float(numbers(element.findtext("radius"), 1, f"{where}: radius")[0])
        if tag == "sphere":
            _require_size(np.array([radius]), where)
            return ball(np.full(3, radius))
        half_length = float(numbers(element.findtext("length"), 1, f"{where}: length")[0]) / 2
        _require_size(np.array([radius, half_length]), where)
        if tag == "capsule":
            return capsule(radius, half_length)
        return cylinder(radius, (-half_length, half_length), count=24)
    return None


def _require_size(values: np.ndarray, where: str) -> None:
    if not 0 < values.min() <= values.max() < 1e6:
        raise BadInput(f"{where}: a shape without size")
