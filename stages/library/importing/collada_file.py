"""Triangles, unit, up axis and colours out of a COLLADA file (.dae) that nobody vouches for.

Covers what furniture is exported as: geometries of triangles, polylists and polygons, placed by the nodes of the visual
scene, with the diffuse colour or texture of their materials (COLLADA 1.4.1 specification, chapters 5 and 6). Skins,
morphs, splines and external references are left out. The file is read by itself: textures are named, not opened.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from xml.etree import ElementTree

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.known_elements import LONGEST_TAG
from scenewright.stages.kit.formats.xml_files import parse_xml
from scenewright.stages.library.importing.limits import MOST_VERTICES, Allowance
from scenewright.stages.library.importing.source_folder import long_row
from scipy.spatial.transform import Rotation

MOST_INDICES = 30_000_000
"""Most numbers of a list in a file; a bound against damaged files."""
MOST_INSTANCES = 20_000
"""Most instances of geometries in a scene; a bound against damaged files."""
MOST_STEPS = 2_000_000
"""Elements that are looked at, those of an instance each time that it is instanced."""
DEEPEST_NODES = 60
"""Deepest nesting of nodes; a bound against damaged files."""
WITHOUT_SHAPE = frozenset(
    {*("matrix", "translate", "rotate", "scale", "lookat", "skew"), *("instance_camera", "instance_light")}
    | {*("asset", "extra")}
)
"""What stands in a node beside geometry and nodes: transforms, and what holds no shape."""
UP_AXES = {"X_UP": (1.0, 0.0, 0.0), "Y_UP": (0.0, 1.0, 0.0), "Z_UP": (0.0, 0.0, 1.0)}
"""Up directions by the names that COLLADA gives them."""


@dataclass(frozen=True)
class ColladaPatch:
    """Triangles of one material, in the file's frame and unit."""

    name: str
    """Of the node and the geometry."""
    vertices: np.ndarray
    """(V, 3)."""
    faces: np.ndarray
    """(F, 3) int."""
    texture_points: np.ndarray | None
    """(F, 3, 2) u and v of the corners, v up, or None."""
    color: tuple[float, float, float]
    """Diffuse RGB in 0..1; white when a texture says it."""
    texture: str | None
    """Name of the image file, as written."""


@dataclass(frozen=True)
class Collada:
    """What a COLLADA file holds."""

    patches: tuple[ColladaPatch, ...]
    metres_per_unit: float | None
    """None when the file does not say (the specification then means 1)."""
    up: tuple[float, float, float] | None
    """None when the file does not say (the specification then means y)."""
    left_out: tuple[str, ...]
    """Kinds of elements that were passed over."""


def parse_collada(data: bytes, where: str) -> Collada:
    """Return the content of a .dae file. Raises BadInput, beginning with `where`, for what is broken or too large."""
    root = parse_xml(data, where)
    for element in root.iter():  # the namespace says nothing that the names do not
        if isinstance(element.tag, str):
            element.tag = element.tag.rpartition("}")[2]
    if root.tag != "COLLADA":
        raise BadInput(f"{where}: root element is <{root.tag}>, expected <COLLADA>")
    return _Reader(root, where).content()


class _Reader:
    def __init__(self, root: ElementTree.Element, where: str) -> None:
        self.root, self.where = root, where
        self.by_id: dict[tuple[str, str], ElementTree.Element] = {}
        for element in root.iter():  # exporters give a scene and its node the same id
            if element.get("id"):
                self.by_id.setdefault((element.tag, element.get("id", "")), element)
        self.left_out: set[str] = set()
        self.budget = MOST_INDICES
        self.instances = self.steps = 0
        self.allowance = Allowance(where)
        # What a node or a geometry says is read once, however often it is instanced.
        self.transforms: dict[int, np.ndarray] = {}
        self.sources: dict[str, np.ndarray] = {}
        self.corners: dict[int, np.ndarray] = {}
        self.materials: dict[str, tuple[tuple[float, float, float], str | None]] = {}

    def content(self) -> Collada:
        unit, axis = self.root.find("asset/unit"), self.root.findtext("asset/up_axis", "").strip()
        metres = None
        if unit is not None and unit.get("meter") is not None:
            metres = float(self._numbers(unit.get("meter"), "unit")[0])
            if not (np.isfinite(metres) and metres > 0):
                raise BadInput(f"{self.where}: unit of {metres:g} m")
        patches: list[ColladaPatch] = []
        scenes = self.root.findall("library_visual_scenes/visual_scene")
        visual_scene = self._target(self.root.find("scene/instance_visual_scene"), "visual_scene")
        for scene in [visual_scene] if visual_scene is not None else scenes[:1]:
            for node in scene.findall("node"):
                patches += self._node(node, np.eye(4), 0)
        if not scenes:
            for geometry in self.root.findall("library_geometries/geometry"):
                patches += self._geometry(geometry, np.eye(4), geometry.get("id", ""), {})
        return Collada(tuple(patches), metres, UP_AXES.get(axis), tuple(sorted(self.left_out)))

    def _target(self, instance: ElementTree.Element | None, tag: str) -> ElementTree.Element | None:
        if instance is None:
            return None
        url = instance.get("url", "")
        return self.by_id.get((tag, url[1:])) if url.startswith("#") else None

    def _numbers(self, text: str | None, subject: str) -> np.ndarray:
        try:
            values = long_row(text or "", np.float64, MOST_INDICES, f"{self.where}: {subject}")
        except ValueError:
            raise BadInput(f"{self.where}: {subject} holds a value that is not a number") from None
        if values.size == 0:
            raise BadInput(f"{self.where}: {subject} is empty")
        return values

    def _step(self, count: int) -> None:
        self.steps += count
        if self.steps > MOST_STEPS:
            raise BadInput(f"{self.where}: its nodes repeat too much", hint="split it, or leave out what is hidden")

    def _count(self, text: str) -> int:
        if not (text.isascii() and text.isdigit() and len(text) < 4):
            raise BadInput(f"{self.where}: {text!r:.40} is not a stride or offset")
        return int(text)

    def _transform(self, node: ElementTree.Element) -> np.ndarray:
        if id(node) in self.transforms:
            return self.transforms[id(node)]
        world_from_node = np.eye(4)
        for element in node:
            step = np.eye(4)
            if element.tag == "matrix":
                values = self._numbers(element.text, "matrix")
                if len(values) != 16:
                    raise BadInput(f"{self.where}: a matrix of {len(values)} numbers")
                step = values.reshape(4, 4)
            elif element.tag in ("translate", "scale", "rotate"):
                values = self._numbers(element.text, element.tag)
                if len(values) != (4 if element.tag == "rotate" else 3):
                    raise BadInput(f"{self.where}: {element.tag} of {len(values)} numbers")
                if element.tag == "translate":
                    step[:3, 3] = values
                elif element.tag == "scale":
                    step[:3, :3] = np.diag(values)
                else:
                    length = np.linalg.norm(values[:3])
                    turn = np.radians(values[3]) * values[:3] / length if length > 0 else np.zeros(3)
                    step[:3, :3] = Rotation.from_rotvec(turn).as_matrix()
            elif element.tag in ("lookat", "skew"):
                self.left_out.add(element.tag)
            world_from_node = world_from_node @ step
        self.transforms[id(node)] = world_from_node
        return world_from_node

    def _node(self, node: ElementTree.Element, outer: np.ndarray, depth: int) -> Iterator[ColladaPatch]:
        self.instances += 1
        if depth > DEEPEST_NODES or self.instances > MOST_INSTANCES:
            raise BadInput(f"{self.where}: nodes are nested too deeply, or there are too many")
        self._step(len(node))
        pose = outer @ self._transform(node)
        name = node.get("name") or node.get("id") or ""
        for child in node:
            if child.tag == "instance_geometry" and (geometry := self._target(child, "geometry")) is not None:
                self._step(sum(1 for _ in child.iter()))
                bound = {
                    material.get("symbol", ""): material.get("target", "").removeprefix("#")
                    for material in child.iter("instance_material")
                }
                yield from self._geometry(geometry, pose, f"{name} {geometry.get('name', '')}", bound)
            elif child.tag == "node":
                yield from self._node(child, pose, depth + 1)
            elif child.tag == "instance_node" and (target := self._target(child, "node")) is not None:
                yield from self._node(target, pose, depth + 1)
            elif child.tag == "instance_controller":
                self.left_out.add("skinned geometry")
            elif child.tag in ("instance_geometry", "instance_node"):
                self.left_out.add(f"{child.tag} of another file, or of nothing")
            elif child.tag not in WITHOUT_SHAPE:
                self.left_out.add(child.tag[:LONGEST_TAG])

    def _geometry(
        self, geometry: ElementTree.Element, pose: np.ndarray, name: str, bound: dict[str, str]
    ) -> Iterator[ColladaPatch]:
        mesh = geometry.find("mesh")
        if mesh is None:
            self.left_out.add("geometry that is not a mesh")
            return
        self._step(len(mesh))
        for element in mesh:
            if element.tag in ("triangles", "polylist", "polygons"):
                patch = self._patch(element, pose, name, bound)
                if patch is not None:
                    yield patch
                if element.find("ph") is not None:
                    self.left_out.add("polygons with holes")
            elif element.tag not in ("source", "vertices", "extra"):
                self.left_out.add(element.tag[:LONGEST_TAG])

    def _source(self, reference: str) -> np.ndarray:
        if reference not in self.sources:
            self.sources[reference] = self._read_source(reference)
            if sum(table.size for table in self.sources.values()) > 4 * MOST_VERTICES:
                raise BadInput(f"{self.where}: more than {4 * MOST_VERTICES} numbers", hint="simplify it, or split it")
        return self.sources[reference]

    def _read_source(self, reference: str) -> np.ndarray:
        name = reference.removeprefix("#")
        if (vertices := self.by_id.get(("vertices", name))) is not None:
            inner = [i for i in vertices.findall("input") if i.get("semantic") == "POSITION"]
            name = inner[0].get("source", "").removeprefix("#") if inner else ""
        source = self.by_id.get(("source", name))
        array = source.find("float_array") if source is not None else None
        accessor = source.find("technique_common/accessor") if source is not None else None
        if array is None:
            raise BadInput(f"{self.where}: source {reference!r:.60} holds no numbers")
        stride = self._count(accessor.get("stride", "1")) if accessor is not None else 3
        values = self._numbers(array.text, f"source {reference!r:.60}")
        if not 1 <= stride <= 16 or len(values) % stride or not np.isfinite(values).all():
            raise BadInput(f"{self.where}: source {reference!r:.60} is torn or not finite")
        return values.reshape(-1, stride)

    def _patch(
        self, element: ElementTree.Element, pose: np.ndarray, name: str, bound: dict[str, str]
    ) -> ColladaPatch | None:
        inputs = [
            (i.get("semantic"), i.get("source", ""), self._count(i.get("offset", "0")))
            for i in element.findall("input")
        ]
        width = 1 + max((entry[2] for entry in inputs), default=0)
        if id(element) not in self.corners:
            self.corners[id(element)] = self._corners(element, width)
        corners = self.corners[id(element)]
        if len(corners) == 0:
            return None
        positions = next((entry for entry in inputs if entry[0] == "VERTEX"), None)
        if positions is None:
            raise BadInput(f"{self.where}: {element.tag} without vertices")
        vertices = self._source(positions[1])
        if vertices.shape[1] != 3:
            raise BadInput(f"{self.where}: vertices of {vertices.shape[1]} numbers")
        faces = corners[:, :, positions[2]]
        if faces.min() < 0 or faces.max() >= len(vertices):
            raise BadInput(f"{self.where}: a face names a vertex outside of 0..{len(vertices) - 1}")
        if len(vertices) > 3 * len(faces):  # a source that many patches share: each keeps what it uses of it
            used, faces = np.unique(faces, return_inverse=True)
            vertices, faces = vertices[used], faces.reshape(-1, 3)
        self.allowance.take_counts(len(faces), len(vertices))
        color, texture = self._material(bound.get(element.get("material", ""), element.get("material", "")))
        texture_points = None
        mapped = next((entry for entry in inputs if entry[0] == "TEXCOORD"), None)
        if texture is not None and mapped is not None:
            table = self._source(mapped[1])
            chosen = corners[:, :, mapped[2]]
            if table.shape[1] >= 2 and chosen.min() >= 0 and chosen.max() < len(table):
                texture_points = table[chosen][:, :, :2]
        moved = vertices @ pose[:3, :3].T + pose[:3, 3]
        if np.linalg.det(pose[:3, :3]) < 0:  # a mirrored node turns its faces inside out
            faces = faces[:, ::-1]
            texture_points = None if texture_points is None else texture_points[:, ::-1]
        return ColladaPatch(name.strip(), moved, faces, texture_points, color, texture)

    def _corners(self, element: ElementTree.Element, width: int) -> np.ndarray:
        """Return (F, 3, width) indices of triangles; polygons are cut into fans."""
        texts = [p.text or "" for p in element.findall("p")]
        total = sum(text.count(" ") + text.count("\n") + 1 for text in texts)
        self.budget -= total
        if self.budget < 0:
            raise BadInput(f"{self.where}: more than {MOST_INDICES} indices")
        try:
            lists = [long_row(text, np.int64, MOST_INDICES, self.where) for text in texts]
            if any(len(entry) % width for entry in lists):
                raise BadInput(f"{self.where}: {element.tag}: indices are no multiple of {width}")
            rows = [entry.reshape(-1, width) for entry in lists]
            if element.tag == "triangles":
                joined = np.concatenate(rows) if rows else np.zeros((0, width), np.int64)
                return joined[: len(joined) // 3 * 3].reshape(-1, 3, width)
            counts = np.array([len(row) for row in rows], dtype=np.int64)
            if element.tag == "polylist":
                counts = long_row(element.findtext("vcount") or "", np.int64, MOST_INDICES, self.where)
        except (ValueError, OverflowError):  # an index of more than 64 bits
            raise BadInput(f"{self.where}: {element.tag}: indices are not numbers") from None
        joined = np.concatenate(rows) if rows else np.zeros((0, width), np.int64)
        if len(counts) and (
            counts.min() < 0 or counts.max() > len(joined) or float(counts.astype(float).sum()) > len(joined)
        ):
            raise BadInput(f"{self.where}: {element.tag} counts more corners than it has")
        fans = np.maximum(counts - 2, 0)
        start = np.repeat(np.cumsum(counts) - counts, fans)
        step = np.arange(len(start)) - np.repeat(np.cumsum(fans) - fans, fans)
        return joined[np.stack([start, start + step + 1, start + step + 2], axis=1)]

    def _material(self, name: str) -> tuple[tuple[float, float, float], str | None]:
        """Return the diffuse colour and the texture's file name of a material."""
        if name not in self.materials:
            self.materials[name] = self._read_material(name)
        return self.materials[name]

    def _read_material(self, name: str) -> tuple[tuple[float, float, float], str | None]:
        plain = (0.7, 0.7, 0.7)
        material = self.by_id.get(("material", name))
        effect = self._target(material.find("instance_effect"), "effect") if material is not None else None
        if effect is None:
            return plain, None
        diffuse = next(iter(effect.iter("diffuse")), None)
        if diffuse is None:
            return plain, None
        if (texture := diffuse.find("texture")) is not None:
            return (1.0, 1.0, 1.0), self._image(effect, texture.get("texture", ""))
        color = diffuse.find("color")
        if color is None:
            return plain, None
        values = self._numbers(color.text, "diffuse colour")
        if len(values) < 3 or not np.isfinite(values).all():
            return plain, None
        red, green, blue = (float(v) for v in np.clip(values[:3], 0.0, 1.0))
        return (red, green, blue), None

    def _image(self, effect: ElementTree.Element, name: str) -> str | None:
        """Follow a texture to its image: sampler, surface, image; exporters often name the image at once."""
        for _ in range(3):
            image = self.by_id.get(("image", name))
            if image is not None:
                return (image.findtext("init_from") or image.findtext("init_from/ref") or "").strip() or None
            parameter = next((p for p in effect.iter("newparam") if p.get("sid") == name), None)
            if parameter is None:
                return None
            name = (parameter.findtext("sampler2D/source") or parameter.findtext("surface/init_from") or "").strip()
        return None
