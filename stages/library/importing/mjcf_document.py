"""An MJCF file with what it includes in place: default classes, assets, and the elements of a body wherever they stand.

After MuJoCo's XML reference: `<frame>` and `<replicate>` place what they hold in the body around them, `<attach>` puts
a body of another file there.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.known_elements import Table, unknown_elements
from scenewright.stages.kit.geometry.transforms import transform_from
from scenewright.stages.library.importing.mjcf_poses import Angles
from scenewright.stages.library.importing.source_folder import SourceFolder, numbers

DEEPEST_INCLUDES = 10
"""Deepest nesting of included and attached files; a bound against circles."""
MOST_INCLUDES = 2000
"""Most included files of a model; a bound, by eye."""
MOST_ELEMENTS = 500_000
"""Most elements of a model, those of a file counted each time that it is included, replicated ones each time."""
DEEPEST_ELEMENTS = 300
"""Deepest nesting of elements; a bound against damaged files."""
MOST_DEFAULTS = 200_000
"""Attributes of all default classes, those that a class inherits counted again."""
MOST_ATTRIBUTES = 200
"""Attributes that a default class gives one kind of element."""
MAIN = "main"
Attributes = dict[str, str]

_OF_A_BODY = frozenset(
    {*("body", "geom", "joint", "freejoint", "site", "inertial", "frame", "replicate", "attach")}
    | {*("camera", "light", "plugin")}
)
KNOWN: Table = {
    "mujoco": frozenset(
        {*("compiler", "default", "asset", "worldbody", "equality", "tendon", "include")}
        | {*("option", "size", "visual", "statistic", "actuator", "sensor", "keyframe", "contact", "custom")}
        | {"extension"}
    ),
    **dict.fromkeys(("worldbody", "body", "frame", "replicate"), _OF_A_BODY),
    "geom": frozenset({"plugin"}),
    "mesh": frozenset({"plugin"}),
    **dict.fromkeys(("joint", "freejoint", "site", "attach", "inertial"), frozenset[str]()),
    "asset": frozenset({"mesh", "material", "texture", "hfield", "model"}),
}
"""What is read, and what holds nothing of shape and motion (cameras, sensors, actuators, contact pairs)."""
COUNTED = ("body", "geom", "joint", "freejoint")


@dataclass(frozen=True)
class Placed:
    """An element of a body, in which file it stands, and where the frames around it put it."""

    element: ElementTree.Element
    document: MjcfDocument
    parent_from_frame: np.ndarray
    child_class: str
    prefix: str = ""
    """What `<attach>` puts before the names of bodies and joints."""

    @property
    def tag(self) -> str:
        """Return its tag."""
        return self.element.tag

    def attributes(self) -> Attributes:
        """Return the element's attributes with those of its default class. Raises BadInput."""
        return self.document.attributes(self.element, self.child_class)

    def pose(self, attributes: Attributes, where: str) -> np.ndarray:
        """Return parent_from_element (4, 4). Raises BadInput, beginning with `where`."""
        return self.parent_from_frame @ self.document.angles.pose(attributes, where)

    def inner(self) -> list[Placed]:
        """Return the elements in this body. Raises BadInput."""
        placed = self.document.placed(self.element, self.element.get("childclass", self.child_class))
        return [replace(part, prefix=self.prefix + part.prefix) for part in placed]

    def unknown(self) -> list[str]:
        """Return a line for each kind of element in this body that is not known."""
        return unknown_elements([self.element], KNOWN, COUNTED)


class MjcfDocument:
    """One file, or one that is attached to another. Raises BadInput for what is none, or beyond the bounds."""

    def __init__(self, folder: SourceFolder, path: Path, attached_to: MjcfDocument | None = None) -> None:
        self.folder, self.path = folder, path
        self.depth: int = 0 if attached_to is None else attached_to.depth + 1
        self.repeated: Iterator[int] = itertools.count() if attached_to is None else attached_to.repeated
        """Counts what is replicated and attached, over all files."""
        self.findings: list[str] = []
        self._included = self._elements = self._default_attributes = 0
        self._parsed: dict[Path, ElementTree.Element] = {}
        self._attached: dict[str, MjcfDocument] = {}
        root = folder.read_xml(path)
        if root.tag != "mujoco":
            raise BadInput(f"{path}: root element is <{root.tag}>, expected <mujoco>")
        self.root = self._expand(root, path, 0, 0)
        self.compiler: Attributes = {}
        for element in self.root.iter("compiler"):
            self.compiler.update(element.attrib)
        if self.compiler.get("coordinate", "local") != "local":
            raise BadInput(f"{path}: global coordinates", hint="save it again with MuJoCo 2.3")
        unit = 1.0 if self.compiler.get("angle", "degree") == "radian" else np.pi / 180
        self.angles = Angles(unit, self.compiler.get("eulerseq", "xyz"))
        self.defaults: dict[str, dict[str, Attributes]] = {MAIN: {}}
        for element in self.root.findall("default"):
            self._gather_defaults(element, MAIN, self.defaults[MAIN])
        self.assets = {
            kind: {self._asset_name(e): e for asset in self.root.findall("asset") for e in asset.findall(kind)}
            for kind in ("mesh", "material", "model")
        }

    def _asset_name(self, element: ElementTree.Element) -> str:
        return element.get("name") or Path(element.get("file", "").replace("\\", "/")).stem

    def unknown(self) -> list[str]:
        """Return a line for each kind of element beside the bodies that is not known. Raises BadInput."""
        beside_bodies, world = ElementTree.Element("mujoco"), ElementTree.Element("worldbody")
        beside_bodies.extend(child for child in self.root if child.tag != "worldbody")
        world.extend(placed.element for placed in self.in_world() if placed.tag != "body")
        return unknown_elements([beside_bodies, world], KNOWN, COUNTED)

    def attributes(self, element: ElementTree.Element, child_class: str) -> Attributes:
        """Return the attributes of an element with those of its default class. Raises BadInput."""
        name = element.get("class", child_class)
        if name not in self.defaults:
            raise BadInput(f"{self.path}: class {name!r:.60} is not defined")
        return {**self.defaults[name].get(element.tag, {}), **element.attrib}

    def in_world(self) -> list[Placed]:
        """Return the elements of the world body. Raises BadInput."""
        return [placed for world in self.root.findall("worldbody") for placed in self.placed(world, MAIN)]

    def placed(
        self, parent: ElementTree.Element, child_class: str, outer: np.ndarray | None = None
    ) -> Iterator[Placed]:
        """Yield the elements of a body, those in frames, replicas and attached files among them. Raises BadInput."""
        pose = np.eye(4) if outer is None else outer
        for child in parent:
            name = child.get("childclass", child_class)
            where = f"{self.path}: {child.tag} in body {parent.get('name', '')!r:.60}"
            if child.tag == "frame":
                yield from self.placed(child, name, pose @ self.angles.pose(child.attrib, where))
            elif child.tag == "replicate":
                yield from self._replicas(child, name, pose, where)
            elif child.tag == "attach":
                yield from self._of_attached(child, pose, where)
            else:
                yield Placed(child, self, pose, child_class)

    def _replicas(
        self, element: ElementTree.Element, child_class: str, pose: np.ndarray, where: str
    ) -> Iterator[Placed]:
        step = transform_from(
            self.angles.euler(element.get("euler", "0 0 0"), where),
            numbers(element.get("offset", "0 0 0"), 3, f"{where}: offset"),
        )
        (count,) = numbers(element.get("count"), 1, f"{where}: count")
        for _ in range(int(min(count, MOST_ELEMENTS))):
            self._count_repeated()
            for placed in self.placed(element, child_class, pose):
                self._count_repeated()
                yield placed
            pose = pose @ step

    def _count_repeated(self) -> None:
        if next(self.repeated) > MOST_ELEMENTS:
            raise BadInput(f"{self.path}: <replicate> and <attach> make more than {MOST_ELEMENTS} elements")

    def _of_attached(self, element: ElementTree.Element, pose: np.ndarray, where: str) -> Iterator[Placed]:
        other, body = self._attached_document(element.get("model", ""), where), element.get("body")
        prefix = element.get("prefix", "")
        self._count_repeated()
        for world in other.root.findall("worldbody"):
            if body is None:
                yield from (replace(part, prefix=prefix + part.prefix) for part in other.placed(world, MAIN, pose))
                continue
            found = next((e for e in world.iter("body") if e.get("name") == body), None)
            if found is not None:
                yield Placed(found, other, pose, MAIN, prefix)
                return
        if body is not None:
            raise BadInput(f"{where}: {other.path.name} has no body {body!r:.60}")

    def _attached_document(self, name: str, where: str) -> MjcfDocument:
        if name not in self._attached:
            asset = self.assets["model"].get(name)
            if asset is None:
                raise BadInput(f"{where}: model {name!r:.60} is not declared in <asset>")
            file = self.folder.find(asset.get("file", ""), self.path.parent)
            if file is None:
                missing = asset.get("file", "")
                raise BadInput(f"{where}: file {missing!r:.100} is not in the folder", hint="copy it there")
            if self.depth >= DEEPEST_INCLUDES:
                raise BadInput(f"{self.path}: attached files are nested too deeply, or in a circle")
            self._attached[name] = MjcfDocument(self.folder, file, self)
        return self._attached[name]

    def with_attached(self) -> Iterator[MjcfDocument]:
        """Yield this file and those that were attached to it so far."""
        yield self
        for other in self._attached.values():
            yield from other.with_attached()

    def _expand(self, element: ElementTree.Element, path: Path, depth: int, level: int) -> ElementTree.Element:
        """Return the element, `level` elements and `depth` files down, with what its <include>s name in their place."""
        self._elements += 1
        if self._elements > MOST_ELEMENTS or level > DEEPEST_ELEMENTS:
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
            self._included += 1
            name = child.get("file", "")
            file = self.folder.find(name, self.path.parent, path.parent)
            if file is None:
                raise BadInput(f"{path}: includes {name!r:.100}, which is not in the folder", hint="copy it there")
            if depth >= DEEPEST_INCLUDES or self._included > MOST_INCLUDES:
                raise BadInput(f"{path}: includes are nested too deeply, or in a circle")
            if ".." in Path(name).parts:
                self.findings.append("files are named elsewhere; those of the same path in the folder were taken")
            children.extend(self._expand(self._parse_included(file), file, depth + 1, level))
        copy = ElementTree.Element(element.tag, dict(element.attrib))
        copy.extend(children)
        return copy

    def _parse_included(self, path: Path) -> ElementTree.Element:
        if path not in self._parsed:
            self._parsed[path] = self.folder.read_xml(path)
            if sum(1 for root in self._parsed.values() for _ in root.iter()) > 2 * MOST_ELEMENTS:
                raise BadInput(f"{self.path}: includes more than {2 * MOST_ELEMENTS} elements")
        return self._parsed[path]

    def _gather_defaults(self, element: ElementTree.Element, name: str, inherited: dict[str, Attributes]) -> None:
        own_defaults = {tag: dict(values) for tag, values in inherited.items()}
        for child in element:
            if child.tag != "default":
                own_defaults[child.tag] = {**own_defaults.get(child.tag, {}), **child.attrib}
        counts = [len(values) for values in own_defaults.values()]
        self._default_attributes += sum(counts) + len(counts)
        if self._default_attributes > MOST_DEFAULTS or max(counts, default=0) > MOST_ATTRIBUTES:
            raise BadInput(
                f"{self.path}: default classes of more than {MOST_DEFAULTS} attributes in all, or ones of"
                f" more than {MOST_ATTRIBUTES}"
            )
        self.defaults[name] = own_defaults
        for child in element.findall("default"):
            self._gather_defaults(child, child.get("class", MAIN), own_defaults)
