"""A glTF in the plain form that readers agree on: sparse and normalised arrays, fans, second texture points, texture
transforms and instances written out (glTF 2.0 sections 3.6.2 and 3.7, KHR_texture_transform, EXT_mesh_gpu_instancing).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.mesh_files import MOST_NODES, whole_number
from scenewright.stages.library.importing.limits import MOST_VERTICES, SIMPLIFY

WRITTEN_OUT = ("KHR_mesh_quantization", "EXT_mesh_gpu_instancing", "KHR_texture_transform")
COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
FLOAT = 5126
FAN = 6


class PlainGltf:
    """The tree of a glTF whose views all lie in one binary, changed in place; what is written out is appended.

    Raises BadInput for more than the bounds; LookupError, TypeError, ValueError, AttributeError for a broken file.
    """

    def __init__(self, tree: dict[str, Any], binary: bytes) -> None:
        self.tree, self.binary = tree, binary
        self.findings: list[str] = []
        self.appended: list[bytes] = []
        self._length = len(binary) + -len(binary) % 4
        self._written = 0
        self._known: dict[tuple[object, ...], int] = {}

    def write_out(self) -> bytes:
        """Change the tree and return the binary that belongs to it."""
        for accessor in [a for a in self.tree.get("accessors", []) if "sparse" in a]:
            self._dense(accessor)
        materials = self.tree.get("materials", [])
        for mesh in self.tree.get("meshes", []):
            for primitive in mesh["primitives"]:
                material = primitive.get("material")
                self._primitive(primitive, {} if material is None else materials[whole_number(material)])
            if any(mesh.get("weights", ())):
                self.findings.append("morph targets are not applied: shapes are those without them")
        for node in list(self.tree.get("nodes", [])):
            self._instances(node)
            if any(node.get("weights", ())):
                self.findings.append("morph targets are not applied: shapes are those without them")
            if node.get("skin") is not None:
                self.findings.append("skins are not applied: shapes are those before any bone moves them")
        self.tree["extensionsRequired"] = [e for e in self.tree.get("extensionsRequired", ()) if e not in WRITTEN_OUT]
        data = self.binary + b"\0" * (-len(self.binary) % 4) + b"".join(self.appended)
        if self.tree.get("buffers") or self.appended:
            self.tree["buffers"] = [{"byteLength": len(data)}]
        return data

    def _primitive(self, primitive: dict[str, Any], material: dict[str, Any]) -> None:
        attributes = primitive["attributes"]
        if primitive.get("mode", 4) == FAN:
            corners = whole_number(self.tree["accessors"][whole_number(attributes["POSITION"])]["count"])
            self._allow(corners)
            given = primitive.get("indices")
            fan = np.arange(corners) if given is None else self._array(whole_number(given))[:, 0].astype(np.int64)
            middle = np.arange(1, max(len(fan) - 1, 1))
            faces = np.stack([np.full(len(middle), fan[0]), fan[middle], fan[middle + 1]], axis=1)
            primitive["indices"], primitive["mode"] = self._append(faces.reshape(-1, 1).astype("<u4"), "SCALAR"), 4
        if "POSITION" in attributes:
            attributes["POSITION"] = self._as_floats(whole_number(attributes["POSITION"]))
        base = material.get("pbrMetallicRoughness", {})
        texture = base.get("baseColorTexture")
        if texture is None:
            if "COLOR_0" in attributes:  # trimesh forgets these where there is a material
                attributes["COLOR_0"] = self._painted(whole_number(attributes["COLOR_0"]), base)
                primitive.pop("material", None)
            return
        moved = texture.get("extensions", {}).get("KHR_texture_transform", {})
        number = whole_number(moved.get("texCoord", texture.get("texCoord", 0)))
        if f"TEXCOORD_{number}" in attributes:
            points = whole_number(attributes[f"TEXCOORD_{number}"])
            attributes["TEXCOORD_0"] = self._texture_points(points, moved)

    def _painted(self, accessor: int, base: dict[str, Any]) -> int:
        """Return the number of an accessor of colours times the factor of their material."""
        factor = np.array(base.get("baseColorFactor", (1, 1, 1, 1)), dtype=float)[:3]
        if ("color", accessor, *factor) not in self._known:
            said = {**self.tree["accessors"][accessor], "normalized": True}  # whole numbers are, by the specification
            values = np.clip(self._array(said)[:, :3] * factor, 0.0, 1.0)
            self._known["color", accessor, *factor] = self._append(values.astype("<f4"), "VEC3")
        return self._known["color", accessor, *factor]

    def _texture_points(self, accessor: int, moved: dict[str, Any]) -> int:
        offset = np.array(moved.get("offset", (0, 0)), dtype=float)
        scale = np.array(moved.get("scale", (1, 1)), dtype=float)
        turn = float(moved.get("rotation", 0.0))
        if not offset.any() and (scale == 1).all() and turn == 0:
            return self._as_floats(accessor)
        key = ("uv", accessor, *offset, *scale, turn)
        if key not in self._known:
            c, s = math.cos(turn), math.sin(turn)  # u' = c u + s v, as readers agree: KhronosGroup/glTF #1563
            points = self._array(accessor) * scale @ np.array([[c, -s], [s, c]]) + offset
            self._known[key] = self._append(points.astype("<f4"), "VEC2")
        return self._known[key]

    def _as_floats(self, accessor: int) -> int:
        """Return the number of an accessor of floats with the same values."""
        if self.tree["accessors"][accessor]["componentType"] == FLOAT:
            return accessor
        if (accessor,) not in self._known:
            values = self._array(accessor).astype("<f4")
            self._known[accessor,] = self._append(values, self.tree["accessors"][accessor]["type"])
        return self._known[accessor,]

    def _dense(self, said: dict[str, Any]) -> None:
        """Write out a sparse accessor, in its place."""
        values = self._array(said, as_stored=True)
        dense = self.tree["accessors"][self._append(values, said["type"])]
        self.tree["accessors"].pop()
        del said["sparse"]
        said.pop("byteOffset", None)
        said["bufferView"] = dense["bufferView"]

    def _allow(self, numbers: int) -> None:
        self._written += numbers
        if self._written > 4 * MOST_VERTICES:
            raise BadInput(f"arrays of more than {4 * MOST_VERTICES} numbers", hint=SIMPLIFY)

    def _array(self, accessor: int | dict[str, Any], *, as_stored: bool = False) -> np.ndarray:
        """Return (count, width) values, normalised ones in -1..1 unless they are wanted as stored."""
        said = self.tree["accessors"][accessor] if isinstance(accessor, int) else accessor
        count, width, kind = (
            whole_number(said["count"]),
            WIDTHS[said["type"]],
            np.dtype(COMPONENTS[said["componentType"]]),
        )
        self._allow(count * width)
        values = np.zeros((count, width), dtype=kind)
        if said.get("bufferView") is not None:
            values = self._stored(said, count, width, kind).copy()
        if (sparse := said.get("sparse")) is not None:
            changed = whole_number(sparse["count"])
            indices, changes = sparse["indices"], sparse["values"]
            at = self._stored(indices, changed, 1, np.dtype(COMPONENTS[indices["componentType"]]))[:, 0]
            values[at.astype(np.int64)] = self._stored(changes, changed, width, kind)
        if as_stored or not said.get("normalized") or kind.kind == "f":
            return values
        return np.maximum(values.astype(np.float64) / np.iinfo(kind).max, -1.0)

    def _stored(self, said: dict[str, Any], count: int, width: int, kind: np.dtype[Any]) -> np.ndarray:
        view = self.tree["bufferViews"][whole_number(said["bufferView"])]
        start = whole_number(view.get("byteOffset", 0)) + whole_number(said.get("byteOffset", 0))
        row = width * kind.itemsize
        step = whole_number(view.get("byteStride", 0)) or row
        end = start + (count - 1) * step + row if count else start
        if end > len(self.binary) or step < row:
            raise BadInput(f"an array ends at byte {end}, its buffer at {len(self.binary)}")
        table = np.ndarray((count, row), np.uint8, self.binary, start, (step, 1))
        return np.ascontiguousarray(table).view(kind).reshape(count, width)

    def _append(self, values: np.ndarray, kind: str) -> int:
        data = values.tobytes()
        self.tree.setdefault("bufferViews", []).append(
            {"buffer": 0, "byteOffset": self._length, "byteLength": len(data)}
        )
        self.appended.append(data + b"\0" * (-len(data) % 4))
        self._length += len(self.appended[-1])
        component = next(number for number, name in COMPONENTS.items() if np.dtype(name) == values.dtype)
        accessor = {
            "bufferView": len(self.tree["bufferViews"]) - 1,
            "componentType": component,
            "count": len(values),
            "type": kind,
        }
        self.tree["accessors"].append(accessor)
        return len(self.tree["accessors"]) - 1

    def _instances(self, node: dict[str, Any]) -> None:
        said = node.get("extensions", {}).get("EXT_mesh_gpu_instancing")
        if said is None or node.get("mesh") is None:
            return
        keys = {"TRANSLATION": "translation", "ROTATION": "rotation", "SCALE": "scale"}
        arrays = {
            keys[name]: self._array(whole_number(index)) for name, index in said["attributes"].items() if name in keys
        }
        count = min((len(rows) for rows in arrays.values()), default=0)
        nodes = self.tree["nodes"]
        if len(nodes) + count > MOST_NODES:
            raise BadInput(f"{count} instances, more than {MOST_NODES}", hint=SIMPLIFY)
        first = len(nodes)
        for k in range(count):
            nodes.append({"mesh": node["mesh"], **{key: rows[k].tolist() for key, rows in arrays.items()}})
        node["children"] = [*node.get("children", ()), *range(first, first + count)]
        del node["mesh"]
