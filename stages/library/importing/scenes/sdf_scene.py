"""An SDF world or model as a scene: links that joints tie to one another are one body; a static model, and what a joint
ties to the world, stands fast. SDF knows no joint values: links stand where the file puts them, joints are at 0."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.known_elements import unknown_elements
from scenewright.stages.kit.formats.urdf_file import Link, Shape, Urdf, UrdfJoint
from scenewright.stages.kit.geometry.solids import MassProperties
from scenewright.stages.kit.geometry.transforms import inverse, rotation_between, transform_from
from scenewright.stages.library.importing.description_meshes import Naming, mesh_surfaces
from scenewright.stages.library.importing.limits import Allowance, few_findings
from scenewright.stages.library.importing.scenes.bodies import bodies_of
from scenewright.stages.library.importing.scenes.shapes import Hulls, ground_shape, solid_shape
from scenewright.stages.library.importing.scenes.urdf_scene import SIZES, unit_axis
from scenewright.stages.library.importing.scenes.writing import WORLD, OthersScene, PlainNames
from scenewright.stages.library.importing.sdf_models import (
    COUNTED,
    KINDS,
    KNOWN,
    UNLIMITED,
    frame_of_axis,
    pose_in_link,
)
from scenewright.stages.library.importing.sdf_tree import Frame, Scope, SdfTree, pose_element, sdf_version
from scenewright.stages.library.importing.source_folder import SourceFolder, numbers
from scenewright.stages.library.importing.source_model import coupled, held_fast

FRICTION = 1.0
"""What SDF takes for `<mu>` where the file says none."""
DOWN = (0.0, 0.0, -1.0)


def sdf_scene(path: Path, root: Path) -> OthersScene:
    """Read an SDF file as a scene; its meshes lie in `root`. Raises BadInput."""
    return _Reader(path, root).scene()


class _Reader:
    def __init__(self, path: Path, root: Path) -> None:
        self.path, self.folder = path, SourceFolder(root)
        self.findings: list[str] = []
        self.allowance, self.hulls = Allowance(str(path)), Hulls(self.findings)
        self.root = self.folder.read_xml(path)
        worlds = self.root.findall("world")
        if len(worlds) > 1:
            raise BadInput(f"{path}: {len(worlds)} worlds in one file", hint="leave one in it")
        self.tree = SdfTree(self.folder, self.findings)
        self.tree.add(Scope("", path, sdf_version(self.root), worlds[0] if worlds else self.root))
        self.plain = PlainNames()
        told = [*self.tree.links, *self.tree.joints]
        self.alone = {name for name, count in Counter(map(_last, told)).items() if count == 1}
        """Names without those of models that only one link or joint has."""
        self.names = {link: self.plain.of(self._short(link)) for link in self.tree.links}
        self.joint_names = {joint: self.plain.of(self._told(joint)) for joint in self.tree.joints}
        self.frames = {link: self.tree.pose(link) for link in self.tree.links}
        """Frame of each link as it is written, world: that of its joint where it hangs on one."""
        self.grounds: set[str] = set()

    def scene(self) -> OthersScene:
        for scope in self.tree.scopes:
            self.findings += unknown_elements([scope.element], KNOWN, COUNTED) if scope.path != self.path else []
        self.findings += unknown_elements([self.root], KNOWN, COUNTED)
        gravity = self.root.findtext("world/gravity")
        if gravity is not None:
            check_gravity(numbers(gravity, 3, f"{self.path}: gravity"), str(self.path), self.findings)
        joints = [self._joint(*tie) for tie in self._ties()]
        hanging = {joint.child for joint in joints}
        links = [self._link(frame) for frame in self.tree.links]
        joints += [self._in_the_world(frame) for frame in self.tree.links if self.names[frame] not in hanging]
        bodies = bodies_of(Urdf("", (Link(WORLD), *links), tuple(joints)), {}, str(self.path), models=True)
        return OthersScene(
            self.path,
            "SDF",
            tuple(bodies),
            self.hulls,
            grounds=frozenset(self.grounds & {body.name for body in bodies}),
            findings=few_findings(self.findings),
        )

    def _short(self, link: Frame) -> str:
        """Return the name of its model for the first link of one, else that of the link."""
        prefix = link.scope.prefix.removesuffix("::")
        first = next(other for other in self.tree.links if other.scope.prefix == link.scope.prefix)
        return prefix if prefix and first is link else self._told(link)

    def _told(self, frame: Frame) -> str:
        return _last(frame) if _last(frame) in self.alone else frame.name

    def _is_static(self, scope: Scope) -> bool:
        while scope.frame is not None:
            for element in (scope.frame.element, scope.element):
                told = element.findtext("static")
                if told is not None:
                    if told.strip() in ("1", "true"):
                        return True
                    break
            scope = scope.frame.scope
        return False

    # --- joints ---------------------------------------------------------------------------------------------------

    def _ties(self) -> list[tuple[Frame, Frame | None, Frame]]:
        """Return joint, parent (None: the world) and child of what is not static; each child's frame is its joint's."""
        ties: dict[Frame, tuple[Frame, Frame | None, Frame]] = {}
        for joint in self.tree.joints:
            parent, child = (
                self.tree.link((joint.element.findtext(tag) or "").strip(), joint.scope, f"{joint.where}: {tag}")
                for tag in ("parent", "child")
            )
            if child is None:
                parent, child = None, parent
            if child is None or self._is_static(child.scope):
                continue
            if child in ties:
                raise BadInput(f"{joint.where}: link {child.name!r:.60} is the child of two joints: not read")
            ties[child] = (joint, parent, child)
            self.frames[child] = self.tree.pose(joint)
        return list(ties.values())

    def _in_the_world(self, link: Frame) -> UrdfJoint:
        """Return what holds a link that hangs on no other: static models are one body, others are free."""
        name = self.names[link]
        if not self._is_static(link.scope):
            return UrdfJoint(f"{name}__in_the_world", "floating", WORLD, name, self.frames[link])
        model = link.name.partition("::")[0]
        first = next(other for other in self.tree.links if other.name.partition("::")[0] == model)
        parent, world_from_parent = (WORLD, np.eye(4)) if first is link else (self.names[first], self.frames[first])
        return UrdfJoint(f"{name}__in_the_world", "fixed", parent, name, inverse(world_from_parent) @ self.frames[link])

    def _joint(self, joint: Frame, parent: Frame | None, child: Frame) -> UrdfJoint:
        kind, lower, upper = self._motion(joint)
        world_from_parent = np.eye(4) if parent is None else self.frames[parent]
        world_from_child = self.frames[child]
        axis, dynamics = (1.0, 0.0, 0.0), joint.element.find("axis/dynamics")
        if kind != "fixed" and (element := joint.element.find("axis")) is not None:
            xyz = numbers(element.findtext("xyz") or "0 0 1", 3, f"{joint.where}: axis")
            turn = world_from_child[:3, :3].T @ frame_of_axis(self.tree, joint, element)[:3, :3]
            axis = unit_axis(turn @ xyz, joint.where)
            if (mimic := element.find("mimic")) is not None:
                self.findings.append(coupled(joint.name, mimic.get("joint", "")))
        damping, friction = (
            0.0 if dynamics is None else float(numbers(dynamics.findtext(key) or "0", 1, f"{joint.where}: {key}")[0])
            for key in ("damping", "friction")
        )
        return UrdfJoint(
            self.joint_names[joint],
            kind,
            WORLD if parent is None else self.names[parent],
            self.names[child],
            inverse(world_from_parent) @ world_from_child,
            axis,
            lower,
            upper,
            damping=damping,
            friction=friction,
        )

    def _motion(self, joint: Frame) -> tuple[str, float, float]:
        """Return the type of a joint and its limits [rad, m]."""
        told = joint.element.get("type", "")
        kind = KINDS.get(told)
        if kind is None:
            self.findings.append(held_fast(joint.name, told))
        lower, upper = (
            float(numbers(joint.element.findtext(f"axis/limit/{key}") or default, 1, f"{joint.where}: {key}")[0])
            for key, default in (("lower", "-1e16"), ("upper", "1e16"))
        )
        if kind in (None, "fixed"):
            return "fixed", 0.0, 0.0
        if max(-lower, upper) <= UNLIMITED:
            return str(kind), lower, upper
        if kind == "prismatic":
            self.findings.append(f"joint {joint.name!r:.40} slides without limits: held fast")
            return "fixed", 0.0, 0.0
        return "continuous", 0.0, 0.0

    # --- links ----------------------------------------------------------------------------------------------------

    def _link(self, frame: Frame) -> Link:
        own_from_link = inverse(self.frames[frame]) @ self.tree.pose(frame)
        shapes = [s for child in frame.element.findall("collision") for s in self._shapes(child, frame, own_from_link)]
        if (frame.element.findtext("gravity") or "1").strip() in ("0", "false"):
            self.findings.append(f"link {frame.name!r:.40} is without gravity in its file: here it falls")
        told = frame.element.findtext("collision/surface/friction/ode/mu")
        friction = FRICTION if told is None else float(numbers(told, 1, f"{frame.where}: mu")[0])
        inertial = self._inertial(frame, own_from_link)
        return Link(self.names[frame], inertial, (), tuple(shapes), max(friction, 0.0))

    def _inertial(self, frame: Frame, own_from_link: np.ndarray) -> MassProperties:
        element = frame.element.find("inertial")
        if (element is None or element.find("mass") is None) and not self._is_static(frame.scope):
            self.findings.append(f"link {frame.name!r:.40} has no mass: SDF takes 1 kg and 1 kg m^2")
        if element is None:
            element = ElementTree.Element("inertial")
        mass = float(numbers(element.findtext("mass") or "1", 1, f"{frame.where}: mass")[0])
        xx, xy, xz, yy, yz, zz = (
            float(numbers(element.findtext(f"inertia/{key}") or default, 1, f"{frame.where}: {key}")[0])
            for key, default in zip(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), "100101", strict=True)
        )
        pose = own_from_link @ pose_element(element, frame.where)
        tensor = pose[:3, :3] @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ pose[:3, :3].T
        return MassProperties(mass, pose[:3, 3], tensor)

    def _shapes(self, element: ElementTree.Element, link: Frame, own_from_link: np.ndarray) -> list[Shape]:
        where, geometry = link.where, element.find("geometry")
        if geometry is None:
            raise BadInput(f"{where}: no geometry")
        pose = own_from_link @ pose_in_link(self.tree, element, link)
        if (mesh := geometry.find("mesh")) is not None:
            scale = np.diag([*numbers(mesh.findtext("scale") or "1 1 1", 3, f"{where}: scale"), 1.0])
            naming = Naming(self.folder, link.scope.path, self.findings, set(), self.allowance)
            name = (mesh.findtext("uri") or "").strip()
            surfaces = mesh_surfaces(naming, name, pose @ scale, None, "")
            if (part := (mesh.findtext("submesh/name") or "").strip()) != "":
                surfaces = [surface for surface in surfaces if part in surface.name] or surfaces
            return [self.hulls.shape(np.concatenate([surface.vertices for surface in surfaces]), name)]
        for kind, keys in SIZES.items():
            if (solid := geometry.find(kind)) is not None:
                count = 3 if kind == "box" else 1
                sizes = np.concatenate([numbers(solid.findtext(key), count, f"{where}: {kind} {key}") for key in keys])
                return [solid_shape(kind, sizes, pose, where)]
        if (plane := geometry.find("plane")) is not None:
            if len(link.element.findall("collision")) == 1:
                self.grounds.add(self.names[link])
            normal = numbers(plane.findtext("normal") or "0 0 1", 3, f"{where}: plane normal")
            turn = rotation_between(np.array([0.0, 0.0, 1.0]), np.array(unit_axis(normal, where)))
            return [ground_shape(pose @ transform_from(turn, np.zeros(3)))]
        kinds = ", ".join(f"<{child.tag:.40}>" for child in geometry if child.tag != "empty")
        if kinds:
            self.findings.append(f"a shape of link {link.name!r:.40} is left out: {kinds}")
        return []


def _last(frame: Frame) -> str:
    """Return the name of a link or joint without those of the models around it."""
    return frame.name.rpartition("::")[2]


def check_gravity(gravity: np.ndarray, where: str, findings: list[str]) -> None:
    """Say when a scene's gravity is not that of the protocol. Raises BadInput when it pulls in another direction."""
    strength = float(np.linalg.norm(gravity))
    if strength > 0 and not np.allclose(gravity / strength, DOWN, atol=1e-3):
        raise BadInput(f"{where}: gravity is {gravity.tolist()}, not along -z", hint="turn the scene z up")
    if abs(strength - 9.81) > 0.02:
        findings.append(f"its gravity of {strength:.2f} m/s^2 is taken as 9.81")
