"""A scene as the text that MoveIt's `PlanningScene::loadGeometryFromStream` reads: what an arm must not meet.

An object a body: its pose, every collision shape as a box or a mesh with its pose in the object and its colour, then
a subframe for every further link.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import trimesh
from scenewright.stages.export.scene_bodies import BodyToExport, SceneToExport
from scenewright.stages.export.scene_registry import Written
from scenewright.stages.kit.formats.link_meshes import GREY
from scenewright.stages.kit.formats.mesh_files import read_mesh
from scenewright.stages.kit.formats.urdf_file import Shape, numbers
from scenewright.stages.kit.geometry.transforms import inverse, quaternion_of


def write(folder: Path, scene: SceneToExport) -> Written:
    """Write scene.scene and a copy of scene.srdf into `folder`. Raises BadInput for broken meshes."""
    lines = ["scene"]
    for body in scene.bodies:
        lines.extend(_object(body, scene))
    lines.append(".")
    (folder / "scene.scene").write_text("\n".join(lines) + "\n", encoding="ascii")
    shutil.copyfile(scene.written.root / "scene.srdf", folder / "scene.srdf")
    return Written()


def _object(body: BodyToExport, scene: SceneToExport) -> Iterator[str]:
    world_from_body = scene.pose(body.links[0])
    yield f"* {body.name}"
    yield from _pose(world_from_body)
    yield str(sum(len(link.collisions) for link in body.links))
    for link in body.links:
        body_from_link = inverse(world_from_body) @ scene.pose(link)
        color = next((shape.color for shape in link.visuals if shape.color is not None), GREY)
        for shape in link.collisions:
            yield from _shape(shape, scene.written.root)
            yield from _pose(body_from_link @ shape.link_from_shape)
            yield numbers(np.round(color, 4))
    yield str(len(body.links) - 1)
    for link in body.links[1:]:
        yield link.name
        yield from _pose(inverse(world_from_body) @ scene.pose(link))


def _shape(shape: Shape, root: Path) -> Iterator[str]:
    if shape.box_size is not None:
        yield "box"
        yield numbers(shape.box_size)
        return
    assert shape.mesh is not None
    solid: trimesh.Trimesh = read_mesh(root / shape.mesh, hint="make the scene again").convex_hull
    yield "mesh"
    yield f"{len(solid.vertices)} {len(solid.faces)}"
    yield from (numbers(shape.scale * vertex) for vertex in solid.vertices)
    yield from (" ".join(map(str, face)) for face in solid.faces.tolist())


def _pose(pose: np.ndarray) -> tuple[str, str]:
    """Position, then the quaternion as x, y, z, w."""
    return numbers(pose[:3, 3]), numbers(quaternion_of(pose))
