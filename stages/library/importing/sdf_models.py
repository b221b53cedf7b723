"""SDF (Gazebo): models with links, poses, meshes, boxes, cylinders, spheres and joints.

After the SDF specification 1.0 to 1.12. A joint's axis is in the joint's frame, before version 1.5 in that of its
model, unless `use_parent_model_frame` (1.5 and 1.6) or `expressed_in` says otherwise. No plugin runs.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.known_elements import Table, unknown_elements
from scenewright.stages.kit.geometry.solids import Solid, box, cylinder
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.library.importing.description_meshes import Naming, mesh_surfaces
from scenewright.stages.library.importing.limits import (
    MOST_LINKS_OF_A_FILE,
    MOST_SHAPES,
    MOST_TRIANGLES_OF_A_FILE,
    Allowance,
    few_findings,
    one_color,
    refuse_many,
)
from scenewright.stages.library.importing.primitives import ball, capsule
from scenewright.stages.library.importing.sdf_tree import (
    Frame,
    Scope,
    SdfTree,
    included_file,
    pose_element,
    sdf_version,
)
from scenewright.stages.library.importing.source_folder import SourceFolder, numbers
from scenewright.stages.library.importing.source_model import (
    JointKind,
    SourceJoint,
    SourceLink,
    SourceModel,
    Surface,
    coupled,
    held_fast,
    solid_surface,
)

KINDS: dict[str, JointKind] = {
    "fixed": "fixed",
    "revolute": "revolute",
    "prismatic": "prismatic",
    "continuous": "continuous",
}
UNLIMITED = 1e3
"""Limits beyond this many radians or metres mean none (SDF's default is 1e16)."""
AXES_IN_JOINT_FRAMES = (1, 5)
"""The first version in which an axis is in its joint's frame."""
LOOKS = {"material script": "material/script/name", "texture": "material/pbr/metal/albedo_map"}
"""What of a material holds more than a colour, and where it is named."""
NO_PARENT_MODEL_FRAME = (1, 7)
"""The first version without `use_parent_model_frame`."""
KNOWN: Table = {
    "model": frozenset(
        {*("link", "joint", "frame", "model", "include", "pose", "static")}
        | {*("plugin", "self_collide", "allow_auto_disable", "enable_wind", "gripper")}
    ),
    "link": frozenset(
        {*("pose", "inertial", "visual", "collision", "sensor", "light", "projector", "audio_sink", "audio_source")}
        | {*("battery", "particle_emitter", "gravity", "kinematic", "must_be_base_link", "velocity_decay")}
        | {*("self_collide", "enable_wind", "plugin", "damping")}
    ),
    "visual": frozenset(
        {*("pose", "geometry", "material", "transparency", "cast_shadows", "laser_retro", "meta", "plugin")}
        | {"visibility_flags"}
    ),
    "collision": frozenset({"pose", "geometry", "surface", "laser_retro", "max_contacts", "density"}),
    "joint": frozenset(
        {*("pose", "parent", "child", "axis", "axis2", "physics", "sensor", "thread_pitch", "screw_thread_pitch")}
        | {*("gearbox_ratio", "gearbox_reference_body", "plugin")}
    ),
    "axis": frozenset({"xyz", "limit", "dynamics", "mimic", "initial_position", "use_parent_model_frame"}),
    "include": frozenset({"uri", "name", "pose", "placement_frame", "static", "plugin"}),
    "frame": frozenset({"pose"}),
    "sdf": frozenset({"model", "world", "light", "plugin"}),
    "gazebo": frozenset({"model", "world", "light", "plugin"}),
    "world": frozenset(
        {*("model", "include", "physics", "scene", "light", "gravity", "magnetic_field", "wind", "atmosphere", "gui")}
        | {*("state", "spherical_coordinates", "plugin", "audio", "frame")}
    ),
}
"""What is read, and what holds nothing of shape and motion."""
COUNTED = ("model", "include", "link", "joint", "visual", "collision")


def read_sdf_models(folder: SourceFolder, path: Path) -> Iterator[SourceModel]:
    """Yield the models of an SDF file. Raises BadInput; at the end for what lies beside the models and is not read."""
    root = folder.read_xml(path)
    if root.tag not in ("sdf", "gazebo"):
        raise BadInput(f"{path}: root element is <{root.tag}>, expected <sdf>")
    elements = [*root.findall("model"), *root.findall("world/model")]
    refuse_many(str(path), "links", sum(1 for element in elements for _ in element.iter("link")), MOST_LINKS_OF_A_FILE)
    of_file = Allowance(
        str(path), triangles=MOST_TRIANGLES_OF_A_FILE, vertices=3 * MOST_TRIANGLES_OF_A_FILE, shapes=5 * MOST_SHAPES
    )
    for element in elements:
        scope = Scope("", path, sdf_version(root), element)
        model = _Reader(folder, scope, alone=len(elements) == 1).model()
        for link in model.links:
            of_file.take((*link.visual, *link.collision))
        yield model
    lost = _beside_models(folder, path, root)
    if lost:
        raise BadInput(f"{path}: left out: {'; '.join(lost[:5])}")


def _beside_models(folder: SourceFolder, path: Path, root: ElementTree.Element) -> list[str]:
    """Return what lies in a file beside its models and is not read; what a world includes is a model of its own."""
    uris = [(i.findtext("uri") or "").strip() for i in (*root.findall("world/include"), *root.findall("include"))]
    missing = [uri for uri in dict.fromkeys(uris) if included_file(folder, uri, path.parent) is None]
    lines = [f"included model {uri!r:.80} is not in the folder" for uri in missing]
    table = {tag: KNOWN[tag] | {"include"} for tag in ("sdf", "gazebo", "world")}
    return lines + unknown_elements([root], table, COUNTED)


class _Reader:
    def __init__(self, folder: SourceFolder, scope: Scope, *, alone: bool) -> None:
        self.folder, self.path, self.element, self.alone = folder, scope.path, scope.element, alone
        self.findings: list[str] = []
        self.units: set[float] = set()
        self.allowance = Allowance(str(scope.path))
        self.tree = SdfTree(folder, self.findings)
        self.tree.add(scope)

    def model(self) -> SourceModel:
        name = self.element.get("name", "")
        links = tuple(self._link(link) for link in self.tree.links)
        if not links:
            raise BadInput(f"{self.path}: model {name!r:.60} has no links", hint="; ".join(self.findings[:2]))
        self.findings += unknown_elements([scope.element for scope in self.tree.scopes[:1]], KNOWN, COUNTED)
        for scope in self.tree.scopes[1:]:
            if scope.path != self.path:
                self.findings += unknown_elements([scope.element], KNOWN, COUNTED)
        joints = [joint for frame in self.tree.joints if (joint := self._joint(frame)) is not None]
        children = {joint.child for joint in joints}
        loose = [link for link in self.tree.links if link.name not in children]
        for link in loose[1:]:  # links without a joint between them: Gazebo lets them fall apart
            self.findings.append(f"link {link.name!r:.40} hangs on nothing: taken as fixed")
            between = inverse(self.tree.pose(loose[0])) @ self.tree.pose(link)
            joints.append(SourceJoint(f"{link.name}_fixed", "fixed", loose[0].name, link.name, between))
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

    def _link(self, frame: Frame) -> SourceLink:
        link, where = frame.element, frame.where
        mass = link.findtext("inertial/mass")
        kilograms = None if mass is None else float(numbers(mass, 1, f"{where}: mass")[0])
        return SourceLink(
            frame.name,
            tuple(s for child in link.findall("visual") for s in self._shape(child, frame)),
            tuple(s for child in link.findall("collision") for s in self._shape(child, frame)),
            kilograms if kilograms is not None and kilograms > 0 else None,
        )

    def _shape(self, element: ElementTree.Element, link: Frame) -> list[Surface]:
        where, name = link.where, element.get("name", "")
        geometry = element.find("geometry")
        if geometry is None:
            raise BadInput(f"{where}: no geometry")
        pose = pose_in_link(self.tree, element, link)
        color = None
        for kind, looks in LOOKS.items():
            for look in element.iterfind(looks):
                self.findings.append(one_color(kind, (look.text or "").strip()))
        if diffuse := element.findtext("material/diffuse"):
            red, green, blue, _ = numbers(diffuse, 4, f"{where}: diffuse")
            color = (float(red), float(green), float(blue))
        mesh = geometry.find("mesh")
        if mesh is not None:
            scale = np.diag([*numbers(mesh.findtext("scale") or "1 1 1", 3, f"{where}: scale"), 1.0])
            uri = (mesh.findtext("uri") or "").strip()
            naming = Naming(self.folder, link.scope.path, self.findings, self.units, self.allowance)
            surfaces = mesh_surfaces(naming, uri, pose @ scale, color, name)
            return self._submesh(mesh, surfaces, pose, link.name)
        solid = _primitive(geometry, where)
        if solid is None:
            kinds = ", ".join(f"<{child.tag:.40}>" for child in geometry if child.tag != "empty")
            if kinds or not len(geometry):
                self.findings.append(f"a shape of link {link.name!r:.40} is left out: {kinds or 'it is empty'}")
            return []
        self.allowance.take_counts(len(solid.faces), len(solid.vertices))
        return [solid_surface(solid, color, name).moved(pose)]

    def _submesh(
        self, mesh: ElementTree.Element, surfaces: list[Surface], pose: np.ndarray, link: str
    ) -> list[Surface]:
        """Return the surfaces that `<submesh>` names, moved to the middle when it says so."""
        name = (mesh.findtext("submesh/name") or "").strip()
        if not name:
            return surfaces
        chosen = [surface for surface in surfaces if name in surface.name]
        if not chosen:
            self.findings.append(f"link {link!r:.40}: submesh {name!r:.40} is not in its mesh: all of it is taken")
            return surfaces
        if (mesh.findtext("submesh/center") or "").strip() in ("1", "true"):
            points = np.concatenate([surface.vertices for surface in chosen]) @ pose[:3, :3]  # along the mesh's axes
            middle = pose[:3, :3] @ (0.5 * (points.min(axis=0) + points.max(axis=0)))
            shift = np.eye(4)
            shift[:3, 3] = pose[:3, 3] - middle
            chosen = [surface.moved(shift) for surface in chosen]
        return chosen

    def _joint(self, frame: Frame) -> SourceJoint | None:
        """Return a joint between links, None for one to the world."""
        joint, where = frame.element, frame.where
        ends = [
            self.tree.link((joint.findtext(tag) or "").strip(), frame.scope, f"{where}: {tag}")
            for tag in ("parent", "child")
        ]
        parent, child = ends
        if parent is None or child is None:
            return None
        model_from_child, model_from_joint = self.tree.pose(child), self.tree.pose(frame)
        child_from_joint = inverse(model_from_child) @ model_from_joint
        kind = KINDS.get(joint.get("type", ""))
        if kind is None:
            self.findings.append(held_fast(frame.name, joint.get("type", "")))
        result = SourceJoint(
            name=frame.name,
            kind=kind or "fixed",
            parent=parent.name,
            child=child.name,
            parent_from_child=inverse(self.tree.pose(parent)) @ model_from_child,
            anchor=child_from_joint[:3, 3],
        )
        element = joint.find("axis")
        if element is None or result.kind == "fixed":
            return result
        if (mimic := element.find("mimic")) is not None:
            self.findings.append(coupled(frame.name, mimic.get("joint", "")))
        xyz = element.find("xyz")
        axis = numbers("0 0 1" if xyz is None else xyz.text, 3, f"{where}: axis")
        model_from_axis = frame_of_axis(self.tree, frame, element)
        lower, upper = (
            float(numbers(element.findtext(f"limit/{key}") or default, 1, f"{where}: {key}")[0])
            for key, default in (("lower", "-1e16"), ("upper", "1e16"))
        )
        result = replace(
            result, axis=model_from_child[:3, :3].T @ model_from_axis[:3, :3] @ axis, lower=lower, upper=upper
        )
        if max(-lower, upper) <= UNLIMITED:
            return result
        if result.kind == "prismatic":
            self.findings.append(f"joint {frame.name!r:.40} slides without limits: held fast")
        return replace(result, kind="fixed" if result.kind == "prismatic" else "continuous")


def frame_of_axis(tree: SdfTree, joint: Frame, axis: ElementTree.Element) -> np.ndarray:
    """Return model_from_frame (4, 4) of the frame in which a joint's axis is written, model: the outermost one."""
    xyz = axis.find("xyz")
    name = "" if xyz is None else xyz.get("expressed_in", "")
    in_model = (axis.findtext("use_parent_model_frame") or "").strip() in ("1", "true")
    if in_model and joint.scope.version >= NO_PARENT_MODEL_FRAME:
        in_model = False
        tree.findings.append(
            f"joint {joint.name!r:.40}: use_parent_model_frame means nothing since SDF 1.7: its axis is in its own"
            " frame"
        )
    if not name and not in_model and joint.scope.version >= AXES_IN_JOINT_FRAMES:
        return tree.pose(joint)
    frame = tree.named(name or "__model__", joint.scope, f"{joint.where}: axis")
    return tree.pose_of_scope(joint.scope) if frame is None else tree.pose(frame)


def pose_in_link(tree: SdfTree, element: ElementTree.Element, link: Frame) -> np.ndarray:
    """Return link_from_shape (4, 4); a shape's pose may be relative to any frame of its model."""
    pose, said = pose_element(element, link.where), element.find("pose")
    base = "" if said is None else said.get("relative_to") or said.get("frame") or ""
    if not base:
        return pose
    frame = tree.named(base, link.scope, link.where)
    model_from_base = tree.pose_of_scope(link.scope) if frame is None else tree.pose(frame)
    return inverse(tree.pose(link)) @ model_from_base @ pose


def _primitive(geometry: ElementTree.Element, where: str) -> Solid | None:
    """Return the box, cylinder, capsule, ellipsoid or sphere of an SDF geometry, None when it is another."""
    if (block := geometry.find("box")) is not None:
        half = numbers(block.findtext("size"), 3, f"{where}: box size") / 2
        _require_size(half, where)
        x, y, z = (float(v) for v in half)
        return box((-x, x), (-y, y), (-z, z))
    if (element := geometry.find("ellipsoid")) is not None:
        radii = numbers(element.findtext("radii"), 3, f"{where}: radii")
        _require_size(radii, where)
        return ball(radii)
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
