"""Interactive scenes: every link of scene.urdf where it stands, moving parts as far open as they were seen."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import numpy as np
import trimesh

from cli.viewing.canvas import SHELL, Canvas, JointedLink
from cli.viewing.graph_view import draw_graph
from cli.viewing.meshes import merged, shape_mesh
from schemas.interactive_scene import InteractiveScene, InteractiveSceneFile
from stages.kit.drawing.palette import instance_color
from stages.kit.formats.link_poses import link_poses
from stages.kit.formats.urdf_file import Urdf, UrdfJoint, parse_urdf

SHELL_CLASSES = ("wall", "ceiling")


def draw_interactive_scene(scene: InteractiveScene, canvas: Canvas) -> None:
    """Draw the links, the boxes and the contact graph."""
    draw_scene_folder(scene.root, canvas)
    draw_graph(scene.graph, canvas)


def draw_scene_folder(root: Path, canvas: Canvas, prefix: str = "scene", *, animated: bool = False) -> tuple[str, ...]:
    """Draw the links of an interactive scene's folder under `prefix`, and return their names.

    `animated`: the poses hold from time 0 on, until others are drawn (in Rerun what is always there never changes).
    """
    description = InteractiveSceneFile.read(root / "scene.json")
    urdf = parse_urdf(root / description.combined_file)
    values = {name: value for body in description.bodies for name, value in body.joint_values.items()}
    poses = link_poses(urdf, values)
    shell = {body.name for body in description.bodies if body.class_name in SHELL_CLASSES}
    drawn = []
    for number, link in enumerate(urdf.links):
        shapes = link.visuals or link.collisions
        if not shapes:
            continue
        mesh = merged([shape_mesh(shape, root) for shape in shapes])
        plain = isinstance(mesh.visual, trimesh.visual.ColorVisuals) and not mesh.visual.defined
        colors = np.tile(np.array(instance_color(number)) * 255, (len(mesh.vertices), 1)).astype(np.uint8)
        path = _path(link.name, shell, prefix)
        if animated:
            canvas.time(0.0)
        canvas.transform(path, poses[link.name])
        canvas.always()
        canvas.mesh(path, mesh, colors if plain else None)
        drawn.append(link.name)
    canvas.joints(jointed_links(urdf, values, {name: _path(name, shell, prefix) for name in drawn}))
    return tuple(drawn)


def _path(link: str, shell: set[str], prefix: str) -> str:
    return f"{SHELL if link in shell else prefix}/{link}"


def jointed_links(urdf: Urdf, values: Mapping[str, float], paths: Mapping[str, str]) -> list[JointedLink]:
    """Return the links of a description, parents first, with where those that are drawn are drawn."""
    path_of = {link.name: paths.get(link.name, f"undrawn/{link.name}") for link in urdf.links}
    children: dict[str, list[UrdfJoint]] = {}
    for joint in urdf.joints:
        children.setdefault(joint.parent, []).append(joint)
    found = [JointedLink(path_of[root], "", np.eye(4)) for root in urdf.roots()]
    waiting = list(urdf.roots())
    while waiting:
        parent = waiting.pop(0)
        for joint in children.get(parent, []):
            kind: Literal["fixed", "turning", "sliding"] = "fixed"
            if joint.type in ("revolute", "continuous"):
                kind = "turning"
            elif joint.type == "prismatic":
                kind = "sliding"
            found.append(
                JointedLink(
                    path_of[joint.child],
                    path_of[parent],
                    joint.parent_from_child,
                    kind,
                    joint.axis,
                    joint.name,
                    joint.lower,
                    joint.upper,
                    values.get(joint.name, 0.0),
                )
            )
            waiting.append(joint.child)
    return found
