"""A kinematic tree as one binary glTF 2.0 file: a node for each link, for web viewers and headsets.

glTF has y up and z towards the viewer, scenes have z up: the node of the root link, which is called like the tree,
turns by -90 degrees about x, and all nodes below it are in the frames of the URDF. Colours are linear in glTF, sRGB in
URDF. The same scene gives the same bytes.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scenewright.stages.kit.formats.link_meshes import Surface
from scenewright.stages.kit.formats.link_poses import joint_motion
from scenewright.stages.kit.formats.urdf_file import Urdf, UrdfJoint
from scenewright.stages.kit.formats.written_scene import WrittenScene
from scenewright.stages.kit.geometry.transforms import apply, inverse, quaternion_of
from scenewright.stages.urdf.exports import SceneExporter

FLOAT, UNSIGNED_INT, UNSIGNED_SHORT = 5126, 5125, 5123
"""Component types of accessors (glTF 2.0, 3.6.2.2)."""
VERTICES, INDICES = 34962, 34963
"""Targets of buffer views, ARRAY_BUFFER and ELEMENT_ARRAY_BUFFER (glTF 2.0)."""
Y_UP_FROM_Z_UP = (-(0.5**0.5), 0.0, 0.0, 0.5**0.5)
"""Turn from z up to y up, a quaternion (x, y, z, w)."""


def write_scene_glb(
    path: Path,
    urdf: Urdf,
    surfaces: Mapping[str, list[Surface]],
    values: Mapping[str, float],
    one_sided: Collection[str] = (),
) -> None:
    """Write what the links of a tree look like (`surfaces`: link -> its triangles), its joints at `values` [rad, m].

    Nodes are called like the links and hang on each other as those do; a node that moves says its joint in `extras`.
    The links in `one_sided` are seen from their front alone (a room without its near walls).
    """
    build = _Build()
    children: dict[str, list[UrdfJoint]] = {}
    for joint in urdf.joints:
        children.setdefault(joint.parent, []).append(joint)
    numbers = {link.name: k for k, link in enumerate(urdf.links)}
    nodes: list[dict[str, Any]] = []
    joint_of_child = {joint.child: joint for joint in urdf.joints}
    for link in urdf.links:
        node: dict[str, Any] = {"name": link.name}
        if link.name in joint_of_child:
            joint = joint_of_child[link.name]
            value = values.get(joint.name, 0.0)
            pose = joint.parent_from_child @ joint_motion(joint, value)
            node["translation"] = _rounded(pose[:3, 3])
            node["rotation"] = _rounded(quaternion_of(pose))
            if joint.type in ("revolute", "prismatic", "continuous"):
                node["extras"] = {"joint": _joint(joint, value)}
        else:
            node = {"name": urdf.name, "rotation": list(Y_UP_FROM_Z_UP)}  # loaders keep the name `world` for themselves
        if surfaces.get(link.name):
            node["mesh"] = build.mesh(link.name, surfaces[link.name], double_sided=link.name not in one_sided)
        if link.name in children:
            node["children"] = [numbers[below.child] for below in children[link.name]]
        nodes.append(node)
    Path(path).write_bytes(build.file(urdf.name, nodes, [numbers[name] for name in urdf.roots()]))


def _joint(joint: UrdfJoint, value: float) -> dict[str, Any]:
    entry: dict[str, Any] = {"name": joint.name, "type": joint.type, "axis": _rounded(np.array(joint.axis))}
    if joint.type != "continuous":
        entry |= {"lower": joint.lower, "upper": joint.upper}
    return entry | {"value": value}


def _rounded(values: np.ndarray) -> list[float]:
    return [float(v) for v in np.round(np.asarray(values, dtype=float), 9) + 0.0]


def linear(srgb: np.ndarray) -> np.ndarray:
    """Return linear light of sRGB values, both in 0..1 (IEC 61966-2-1)."""
    values = np.asarray(srgb, dtype=float)
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


class _Build:
    """Grows the buffers and tables of one file."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []
        self.materials: list[dict[str, Any]] = []
        self.meshes: list[dict[str, Any]] = []
        self._stored: dict[tuple[bytes, int], int] = {}

    def mesh(self, name: str, surfaces: list[Surface], *, double_sided: bool) -> int:
        primitives = []
        for surface in surfaces:
            attributes = {"POSITION": self._accessor(surface.vertices, VERTICES, "VEC3", bounds=True)}
            color = np.array(surface.color)
            if surface.vertex_colors is not None:
                shades = np.round(65535 * linear(surface.vertex_colors / 255.0)).astype(np.uint16)
                opaque = np.full((len(shades), 1), 65535, np.uint16)  # four of them: rows start at multiples of 4
                attributes["COLOR_0"] = self._accessor(np.hstack([shades, opaque]), VERTICES, "VEC4", normalized=True)
                color = np.array([1.0, 1.0, 1.0, color[3]])
            primitives.append(
                {
                    "attributes": attributes,
                    "indices": self._accessor(surface.faces.ravel(), INDICES, "SCALAR"),
                    "material": self._material(color, double_sided),
                }
            )
        self.meshes.append({"name": name, "primitives": primitives})
        return len(self.meshes) - 1

    def _material(self, color: np.ndarray, double_sided: bool) -> int:
        factor = _rounded(np.r_[np.round(linear(color[:3]), 6), color[3]])
        material: dict[str, Any] = {
            "pbrMetallicRoughness": {"baseColorFactor": factor, "metallicFactor": 0.0, "roughnessFactor": 0.8},
            "doubleSided": double_sided,
        }
        if color[3] < 1.0:
            material["alphaMode"] = "BLEND"
        if material not in self.materials:
            self.materials.append(material)
        return self.materials.index(material)

    def _accessor(
        self, values: np.ndarray, target: int, kind: str, *, bounds: bool = False, normalized: bool = False
    ) -> int:
        data = values.tobytes()
        key = (data, target)
        if key in self._stored:
            return self._stored[key]
        self.views.append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data), "target": target})
        self.data += data + b"\0" * (-len(data) % 4)
        component = {"f": FLOAT, "u": UNSIGNED_INT}[values.dtype.kind] if values.dtype.itemsize == 4 else UNSIGNED_SHORT
        entry: dict[str, Any] = {
            "bufferView": len(self.views) - 1,
            "componentType": component,
            "count": len(values),
            "type": kind,
        }
        if bounds:
            entry |= {
                "min": values.min(axis=0).astype(float).tolist(),
                "max": values.max(axis=0).astype(float).tolist(),
            }
        if normalized:
            entry["normalized"] = True
        self.accessors.append(entry)
        self._stored[key] = len(self.accessors) - 1
        return self._stored[key]

    def file(self, name: str, nodes: list[dict[str, Any]], roots: list[int]) -> bytes:
        """Return the bytes of the GLB container."""
        document: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "scenewright"},
            "scene": 0,
            "scenes": [{"name": name, "nodes": roots}],
            "nodes": nodes,
        }
        if self.meshes:
            document |= {
                "meshes": self.meshes,
                "materials": self.materials,
                "accessors": self.accessors,
                "bufferViews": self.views,
                "buffers": [{"byteLength": len(self.data)}],
            }
        text = json.dumps(document, separators=(",", ":"), sort_keys=True, allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
        if self.data:
            chunks += struct.pack("<II", len(self.data), 0x004E4942) + bytes(self.data)
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def towards(surface: Surface, point: np.ndarray) -> Surface:
    """Return the faces of a surface that look towards a point (3,) in its frame: a closed wall seen from its room."""
    corners = surface.vertices[surface.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    looks = (normals * (point - corners[:, 0])).sum(axis=1) > 0
    used, faces = np.unique(surface.faces[looks], return_inverse=True)
    colors = None if surface.vertex_colors is None else surface.vertex_colors[used]
    faces = faces.reshape(-1, 3).astype(surface.faces.dtype)
    return replace(surface, vertices=surface.vertices[used], faces=faces, vertex_colors=colors)


def _write(path: Path, scene: WrittenScene) -> None:
    surfaces = dict(scene.surfaces)
    centers = np.array([body.box.center for body in scene.info.bodies]).reshape(-1, 3)
    middle = 0.5 * (centers.min(axis=0) + centers.max(axis=0)) if len(centers) else np.zeros(3)
    for name in scene.layout & set(surfaces):
        at = apply(inverse(scene.link_poses[name]), middle)
        surfaces[name] = [part for surface in surfaces[name] if len((part := towards(surface, at)).faces)]
    write_scene_glb(path, scene.urdf, surfaces, scene.joint_values, one_sided=scene.layout)


EXPORTER = SceneExporter("glb", order=20, file="scene.glb", write=_write)
