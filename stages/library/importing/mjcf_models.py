"""MJCF (MuJoCo): includes, default classes, compiler angles, geoms, bodies and their hinges and slides.

After MuJoCo's XML reference. A world body with several bodies holds several models; bodies that hang on the world by a
hinge or slide make the world body one piece of furniture. Nothing is simulated, and no plugin, texture or script runs.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.geometry.solids import Solid, box, cylinder
from scenewright.stages.kit.geometry.transforms import transform_from
from scenewright.stages.library.importing.limits import MOST_TRIANGLES_OF_A_FILE, Allowance, few_findings
from scenewright.stages.library.importing.mesh_reading import read_mesh_file
from scenewright.stages.library.importing.primitives import ball, capsule
from scenewright.stages.library.importing.source_folder import SourceFolder, list_of_numbers, numbers
from scenewright.stages.library.importing.source_model import (
    JointKind,
    SourceJoint,
    SourceLink,
    SourceModel,
    Surface,
    painted_faces,
    solid_surface,
)
from scipy.spatial.transform import Rotation

DEEPEST_INCLUDES = 10
"""Deepest nesting of included files; a bound against circles."""
MOST_INCLUDES = 2000
"""Most included files of a model; a bound, by eye."""
MOST_ELEMENTS = 500_000
"""Most elements of a model, those of a file counted each time that it is included."""
DEEPEST_ELEMENTS = 300
"""Deepest nesting of elements; a bound against damaged files."""
MOST_DEFAULTS = 200_000
"""Attributes of all default classes, those that a class inherits counted again."""
MOST_ATTRIBUTES = 200
"""Attributes that a default class gives one kind of element."""
DEEPEST_BODIES = 60
"""Deepest nesting of bodies; a bound against damaged files."""
LAST_VISIBLE_GROUP = 2
"""Geoms of groups 0 to 2 are drawn by default, those of 3 and up are not."""
MAIN = "main"
EULER_ORDER = re.compile(r"(?!.?(.)\1)(?:[xyz]{3}|[XYZ]{3})")
"""Three axes, none twice in a row."""
Attributes = dict[str, str]


def is_mjcf(root: ElementTree.Element) -> bool:
    """Whether the root element is that of a whole MJCF model (a `mujocoinclude` is only a part of one)."""
    return root.tag == "mujoco" and root.find("worldbody") is not None


def read_mjcf_models(folder: SourceFolder, path: Path) -> Iterator[SourceModel]:
    """Yield the models of an MJCF file. Raises BadInput."""
    yield from _Reader(folder, path).models()


@dataclass
class _Tree:
    """Links and joints of one model while they are gathered."""

    links: list[SourceLink] = field(default_factory=list)
    joints: list[SourceJoint] = field(default_factory=list)


class _Reader:
    def __init__(self, folder: SourceFolder, path: Path) -> None:
        self.folder, self.path = folder, path
        self.findings: list[str] = []
        self.included = self.elements = self.default_attributes = 0
        self.parsed: dict[Path, ElementTree.Element] = {}
        self.names: dict[str, int] = {}
        self.allowance = Allowance(str(path))
        self.of_file = Allowance(
            str(path), triangles=MOST_TRIANGLES_OF_A_FILE, vertices=3 * MOST_TRIANGLES_OF_A_FILE, shapes=MOST_ELEMENTS
        )
        root = folder.read_xml(path)
        if root.tag != "mujoco":
            raise BadInput(f"{path}: root element is <{root.tag}>, expected <mujoco>")
        self.root = self._expand(root, path, 0, 0)
        self.compiler: Attributes = {}
        for element in self.root.iter("compiler"):
            self.compiler.update(element.attrib)
        if self.compiler.get("coordinate", "local") != "local":
            raise BadInput(f"{path}: global coordinates", hint="save it again with a MuJoCo later than 2.3")
        self.angle = 1.0 if self.compiler.get("angle", "degree") == "radian" else np.pi / 180
        self.defaults: dict[str, dict[str, Attributes]] = {MAIN: {}}
        for element in self.root.findall("default"):
            self._gather_defaults(element, MAIN, self.defaults[MAIN])
        self.assets = {
            kind: {self._asset_name(e): e for asset in self.root.findall("asset") for e in asset.findall(kind)}
            for kind in ("mesh", "material")
        }

    def _asset_name(self, element: ElementTree.Element) -> str:
        return element.get("name") or Path(element.get("file", "").replace("\\", "/")).stem

    def _expand(self, element: ElementTree.Element, path: Path, depth: int, level: int) -> ElementTree.Element:
        """Return the element, `level` elements and `depth` files down, with what its <include>s name in their place."""
        self.elements += 1
        if self.elements > MOST_ELEMENTS or level > DEEPEST_ELEMENTS:
            raise BadInput(
                f"{self.path}: more than {MOST_ELEMENTS} elements, or {DEEPEST_ELEMENTS} levels of them, with what it"
                " includes",
                hint="include every file once",
            )
        children: list[ElementTree.Element] = []
        for child in element:
            if child.tag != "include":
                children.append(self._expand(child, path, depth, level + 1))
                continue
            self.included += 1
            name = child.get("file", "")
            file = self.folder.find(name, self.path.parent, path.parent)
            if file is None:
                raise BadInput(f"{path}: includes {name!r:.100}, which is not in the folder", hint="copy it there")
            if depth >= DEEPEST_INCLUDES or self.included > MOST_INCLUDES:
                raise BadInput(f"{path}: includes are nested too deeply, or in a circle")
            if ".." in Path(name).parts:
                self.findings.append("files are named elsewhere; those of the same path in the folder were taken")
            children.extend(self._expand(self._parse_included(file), file, depth + 1, level))
        copy = ElementTree.Element(element.tag, dict(element.attrib))
        copy.extend(children)
        return copy

    def _parse_included(self, path: Path) -> ElementTree.Element:
        if path not in self.parsed:
            self.parsed[path] = self.folder.read_xml(path)
            if sum(1 for root in self.parsed.values() for _ in root.iter()) > 2 * MOST_ELEMENTS:
                raise BadInput(f"{self.path}: includes more than {2 * MOST_ELEMENTS} elements")
        return self.parsed[path]

    def _gather_defaults(self, element: ElementTree.Element, name: str, inherited: dict[str, Attributes]) -> None:
        own_defaults = {tag: dict(values) for tag, values in inherited.items()}
        for child in element:
            if child.tag != "default":
                own_defaults[child.tag] = {**own_defaults.get(child.tag, {}), **child.attrib}
        counts = [len(values) for values in own_defaults.values()]
        self.default_attributes += sum(counts) + len(counts)
        if self.default_attributes > MOST_DEFAULTS or max(counts, default=0) > MOST_ATTRIBUTES:
            raise BadInput(
                f"{self.path}: default classes of more than {MOST_DEFAULTS} attributes in all, or ones of"
                f" more than {MOST_ATTRIBUTES}"
            )
        self.defaults[name] = own_defaults
        for child in element.findall("default"):
            self._gather_defaults(child, child.get("class", MAIN), own_defaults)

    def _attributes(self, element: ElementTree.Element, child_class: str) -> Attributes:
        name = element.get("class", child_class)
        if name not in self.defaults:
            raise BadInput(f"{self.path}: class {name!r:.60} is not defined")
        return {**self.defaults[name].get(element.tag, {}), **element.attrib}

    def models(self) -> Iterator[SourceModel]:
        """Yield the models one by one, as they may be many. Raises BadInput."""
        bodies = [body for world in self.root.findall("worldbody") for body in world.findall("body")]
        geoms = [geom for world in self.root.findall("worldbody") for geom in world.findall("geom")]
        if geoms:
            self.findings.append(f"{len(geoms)} geoms of the world body are left out")
        if any(_moves(body) for body in bodies):
            yield self._model(bodies, self.path.stem, (self.path.stem, self.root.get("model", "")))
            return
        elements = [element for body in bodies for element in _things(body)]
        if len(elements) == 1:
            names = (self.path.stem, self.root.get("model", ""), *_body_names(elements[0]))
            yield self._model(elements, self.path.stem, names)
            return
        for number, element in enumerate(elements):
            names = tuple(_body_names(element)) or (f"{self.path.stem}_{number}",)
            yield self._model([element], f"{self.path.stem}_{names[0]}", names)

    def _model(self, bodies: list[ElementTree.Element], name: str, words: tuple[str, ...]) -> SourceModel:
        tree, self.names = _Tree(), {"model": 1}
        self.allowance = Allowance(str(self.path))
        of_file = len(self.findings)
        tree.links.append(SourceLink("model"))
        for body in bodies:
            self._body(tree, body, "model", np.eye(4), MAIN, 0)
        findings = few_findings(self.findings)
        del self.findings[of_file:]  # what was said of this model is not said of the next
        return SourceModel(
            name=name,
            source=self.folder.relative(self.path),
            format="MJCF",
            links=tuple(tree.links),
            joints=tuple(tree.joints),
            words=tuple(word for word in words if word),
            findings=findings,
        )

    def _body(
        self, tree: _Tree, body: ElementTree.Element, parent: str, pose: np.ndarray, child_class: str, depth: int
    ) -> None:
        if depth > DEEPEST_BODIES:
            raise BadInput(f"{self.path}: bodies are nested too deeply")
        child_class = body.get("childclass", child_class)
        name = self._unique(body.get("name", "body"))
        where = f"{self.path}: body {name!r:.60}"
        parent_from_body = pose @ self._pose(body.attrib, where)
        tree.joints.append(self._joint(body, parent, name, parent_from_body, child_class, where))
        visual, collision, masses, marks = [], [], [], []
        for geom in body.findall("geom"):
            attributes = self._attributes(geom, child_class)
            surfaces = self._geom(attributes, where)
            if float(numbers(attributes.get("group", "0"), 1, f"{where}: group")[0]) <= LAST_VISIBLE_GROUP:
                visual += surfaces
            if attributes.get("contype", "1") != "0" or attributes.get("conaffinity", "1") != "0":
                collision += surfaces
            if "mass" in attributes:
                masses.append(float(numbers(attributes["mass"], 1, f"{where}: mass")[0]))
        for site in body.findall("site"):
            attributes = self._attributes(site, child_class)
            marks.append((attributes.get("name", ""), numbers(attributes.get("pos", "0 0 0"), 3, where)))
        inertial = body.find("inertial")
        mass = float(numbers(inertial.get("mass"), 1, where)[0]) if inertial is not None else sum(masses)
        tree.links.append(SourceLink(name, tuple(visual), tuple(collision), mass if mass > 0 else None, tuple(marks)))
        for child in body.findall("body"):
            self._body(tree, child, name, np.eye(4), child_class, depth + 1)

    def _unique(self, name: str) -> str:
        unique, number = name, self.names.get(name, 0)
        while unique in self.names:
            number += 1
            unique = f"{name}_{number}"
        self.names[unique] = 1
        self.names[name] = max(number, 1)
        return unique

    def _joint(
        self,
        body: ElementTree.Element,
        parent: str,
        name: str,
        parent_from_body: np.ndarray,
        child_class: str,
        where: str,
    ) -> SourceJoint:
        fixed = SourceJoint(f"{name}_fixed", "fixed", parent, name, parent_from_body)
        moving = [self._attributes(joint, child_class) for joint in body.findall("joint")]
        if body.find("freejoint") is not None or any(joint.get("type") == "free" for joint in moving):
            return replace(fixed, kind="floating")
        usable = [joint for joint in moving if joint.get("type", "hinge") in ("hinge", "slide")]
        if len(usable) < len(moving):
            self.findings.append(f"body {name!r:.40}: ball joints are held fast")
        if not usable:
            return fixed
        if len(usable) > 1:
            self.findings.append(f"body {name!r:.40}: only the first of {len(usable)} joints moves")
        attributes = usable[0]
        hinge = attributes.get("type", "hinge") == "hinge"
        limited = attributes.get("limited", "auto")
        kind: JointKind = "revolute" if hinge else "prismatic"
        lower = upper = 0.0
        if "range" in attributes and limited != "false":
            factor = self.angle if hinge else 1.0
            low, high = numbers(attributes["range"], 2, f"{where}: range")
            reference = float(numbers(attributes.get("ref", "0"), 1, f"{where}: ref")[0])
            lower, upper = float(low - reference) * factor, float(high - reference) * factor
        elif hinge:
            kind = "continuous"
        else:
            self.findings.append(f"slide {attributes.get('name', name)!r:.40} has no range: held fast")
            return fixed
        return SourceJoint(
            name=attributes.get("name", f"{name}_joint"),
            kind=kind,
            parent=parent,
            child=name,
            parent_from_child=parent_from_body,
            anchor=numbers(attributes.get("pos", "0 0 0"), 3, f"{where}: joint pos"),
            axis=numbers(attributes.get("axis", "0 0 1"), 3, f"{where}: joint axis"),
            lower=lower,
            upper=upper,
        )

    def _pose(self, attributes: Attributes, where: str) -> np.ndarray:
        return transform_from(
            self._rotation(attributes, where), numbers(attributes.get("pos", "0 0 0"), 3, f"{where}: pos")
        )

    def _rotation(self, attributes: Attributes, where: str) -> np.ndarray:
        if "quat" in attributes:
            return _turn_of(attributes["quat"], f"{where}: quat")
        if "euler" in attributes:
            angles = numbers(attributes["euler"], 3, f"{where}: euler") * self.angle
            order = self.compiler.get("eulerseq", "xyz")
            if EULER_ORDER.fullmatch(order) is None:
                raise BadInput(f"{where}: eulerseq {order!r:.20}")
            # MuJoCo: small letters turn with the frame. SciPy: large letters do.
            return Rotation.from_euler(order.swapcase(), angles).as_matrix()
        if "axisangle" in attributes:
            values = numbers(attributes["axisangle"], 4, f"{where}: axisangle")
            return Rotation.from_rotvec(_unit(values[:3], where) * values[3] * self.angle).as_matrix()
        if "zaxis" in attributes:
            return _z_towards(_unit(numbers(attributes["zaxis"], 3, f"{where}: zaxis"), where))
        if "xyaxes" in attributes:
            values = numbers(attributes["xyaxes"], 6, f"{where}: xyaxes")
            x_axis = _unit(values[:3], where)
            y_axis = _unit(values[3:] - (values[3:] @ x_axis) * x_axis, where)
            return np.column_stack([x_axis, y_axis, np.cross(x_axis, y_axis)])
        return np.eye(3)

    def _geom(self, attributes: Attributes, where: str) -> list[Surface]:
        name = attributes.get("name", "")
        color = self._color(attributes, where)
        pose = self._pose(attributes, where)
        if "mesh" in attributes:
            return self._mesh(attributes["mesh"], pose, color, name, where)
        kind = attributes.get("type", "sphere")
        size = list_of_numbers(attributes.get("size", ""), f"{where}: size")
        length = None
        if "fromto" in attributes and kind in ("capsule", "cylinder", "box", "ellipsoid"):
            ends = numbers(attributes["fromto"], 6, f"{where}: fromto")
            direction = ends[:3] - ends[3:]
            length = float(np.linalg.norm(direction)) / 2
            pose = transform_from(_z_towards(_unit(direction, where)), (ends[:3] + ends[3:]) / 2)
        solid = _primitive(kind, size, length, where)
        if solid is None:
            self.findings.append(f"geoms of type {kind!r:.20} are left out")
            return []
        self.allowance.take_counts(len(solid.faces), len(solid.vertices))
        self.of_file.take_counts(len(solid.faces), len(solid.vertices))
        return [solid_surface(solid, color, name).moved(pose)]

    def _color(self, attributes: Attributes, where: str) -> tuple[float, float, float] | None:
        text = attributes.get("rgba")
        if text is None and "material" in attributes:
            material = self.assets["material"].get(attributes["material"])
            if material is not None:
                text = {**self.defaults[MAIN].get("material", {}), **material.attrib}.get("rgba", "1 1 1 1")
                if material.get("texture") and material.get("rgba") in (None, "1 1 1 1"):
                    text = "0.7 0.7 0.7 1"  # a picture on it that is not looked at
        if text is None:
            return None
        red, green, blue, _ = numbers(text, 4, f"{where}: rgba")
        return (float(red), float(green), float(blue))

    def _mesh(
        self, name: str, pose: np.ndarray, color: tuple[float, float, float] | None, label: str, where: str
    ) -> list[Surface]:
        element = self.assets["mesh"].get(name)
        if element is None:
            raise BadInput(f"{where}: mesh {name!r:.60} is not declared")
        attributes = self._attributes(element, MAIN)
        file = attributes.get("file", "")
        shelf = self.compiler.get("meshdir") or self.compiler.get("assetdir") or ""
        mesh_path = self.folder.find(f"{shelf}/{file}" if shelf else file, self.path.parent)
        mesh_path = mesh_path or self.folder.find(file, self.path.parent)
        if mesh_path is None:
            raise BadInput(f"{self.path}: mesh {file!r:.100} is not in the folder", hint="copy it there")
        scale = np.diag([*numbers(attributes.get("scale", "1 1 1"), 3, f"{where}: mesh scale"), 1.0])
        shift = np.eye(4)
        if "refpos" in attributes or "refquat" in attributes:
            reference = transform_from(
                _turn_of(attributes.get("refquat", "1 0 0 0"), f"{where}: refquat"),
                numbers(attributes.get("refpos", "0 0 0"), 3, where),
            )
            shift = np.linalg.inv(reference)
        moved = []
        content = read_mesh_file(self.folder, mesh_path)
        self.allowance.take(content.surfaces)
        self.of_file.take(content.surfaces)
        for surface in content.surfaces:
            colors = surface.colors if color is None else painted_faces(len(surface.faces), color)
            labelled = Surface(surface.vertices, surface.faces, colors, f"{label} {name} {surface.name}".strip())
            moved.append(labelled.moved(pose @ shift @ scale))
        return moved


def _moves(body: ElementTree.Element) -> bool:
    """Whether the body hangs on its parent by a hinge or slide."""
    return any(joint.get("type", "hinge") in ("hinge", "slide") for joint in body.findall("joint"))


def _things(body: ElementTree.Element) -> list[ElementTree.Element]:
    """Return the body, or the bodies that an unnamed frame around several of them holds, moved into its frame."""
    inner = body.findall("body")
    if body.get("name") or len(inner) < 2 or body.find("geom") is not None or any(_moves(child) for child in inner):
        return [body]
    return inner


def _body_names(body: ElementTree.Element) -> Iterator[str]:
    """Yield the names of the body and of those in it, outermost first; of the inner ones only the first."""
    while True:
        if body.get("name"):
            yield body.get("name", "")
            return
        inner = body.find("body")
        if inner is None:
            return
        body = inner


def _turn_of(text: str, where: str) -> np.ndarray:
    """Return the rotation (3, 3) of a quaternion w x y z of any length but 0. Raises BadInput."""
    w, x, y, z = numbers(text, 4, where)
    length = float(np.linalg.norm([w, x, y, z]))
    if length < 1e-10:
        raise BadInput(f"{where} of length 0")
    return Rotation.from_quat([x, y, z, w]).as_matrix()


def _unit(vector: np.ndarray, where: str) -> np.ndarray:
    length = float(np.linalg.norm(vector))
    if length < 1e-12:
        raise BadInput(f"{where}: a direction of length 0")
    return vector / length


def _z_towards(direction: np.ndarray) -> np.ndarray:
    """Return the smallest rotation (3, 3) that turns z into a unit direction."""
    z = np.array([0.0, 0.0, 1.0])
    turn = np.cross(z, direction)
    sine, cosine = float(np.linalg.norm(turn)), float(z @ direction)
    if sine < 1e-12:
        return np.eye(3) if cosine > 0 else np.diag([1.0, -1.0, -1.0])
    return Rotation.from_rotvec(turn / sine * np.arctan2(sine, cosine)).as_matrix()


def _primitive(kind: str, size: np.ndarray, half_length: float | None, where: str) -> Solid | None:
    """Return a geom of MuJoCo's sizes (half lengths) as a solid along z, None for one that is left out."""
    needed = {"box": 3, "ellipsoid": 3, "sphere": 1, "capsule": 2, "cylinder": 2}.get(kind)
    if needed is None:
        return None
    if half_length is not None:
        size = np.array([size[0], half_length] if needed == 2 else [*size[:2], half_length]) if len(size) else size
    if len(size) < needed or not (size[:needed].min() > 0 and size[:needed].max() < 1e6):
        raise BadInput(f"{where}: a {kind} without size")
    if kind == "box":
        x, y, z = (float(v) for v in size[:3])
        return box((-x, x), (-y, y), (-z, z))
    if kind == "cylinder":
        return cylinder(float(size[0]), (-float(size[1]), float(size[1])), count=24)
    if kind == "capsule":
        return capsule(float(size[0]), float(size[1]))
    return ball(size[:3] if kind == "ellipsoid" else np.full(3, size[0]))
