"""Interactive scenes: every link of scene.urdf where it stands, moving parts as far open as they were seen."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

from cli.viewing.canvas import SHELL, Canvas
from cli.viewing.graph_view import draw_graph
from cli.viewing.meshes import merged, shape_mesh
from schemas.interactive_scene import InteractiveScene, InteractiveSceneFile
from stages.kit.drawing.palette import instance_color
from stages.kit.formats.link_poses import link_poses
from stages.kit.formats.urdf_file import parse_urdf

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
        path = f"{SHELL if link.name in shell else prefix}/{link.name}"
        if animated:
            canvas.time(0.0)
        canvas.transform(path, poses[link.name])
        canvas.always()
        canvas.mesh(path, mesh, colors if plain else None)
        drawn.append(link.name)
    return tuple(drawn)
