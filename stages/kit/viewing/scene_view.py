"""Interactive scenes: every link of scene.urdf where it stands, moving parts as far open as they were seen."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from schemas.errors import BadInput
from schemas.interactive_scene import InteractiveScene, InteractiveSceneFile
from stages.kit.formats.urdf_file import Urdf, UrdfJoint, parse_urdf
from stages.kit.geometry.transforms import transform_from
from stages.kit.measurement.palette import instance_color
from stages.kit.viewing.canvas import SHELL, Canvas
from stages.kit.viewing.graph_view import draw_graph
from stages.kit.viewing.meshes import merged, shape_mesh

SHELL_CLASSES = ("wall", "ceiling")


def draw_scene(scene: InteractiveScene, canvas: Canvas) -> None:
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


def link_poses(urdf: Urdf, values: dict[str, float]) -> dict[str, np.ndarray]:
    """Return link -> world_from_link (4, 4) at joint values [rad, m]; joints without a value are at 0, roots at the
    origin. Raises BadInput when the joints are no tree."""
    children: dict[str, list[UrdfJoint]] = {}
    for joint in urdf.joints:
        children.setdefault(joint.parent, []).append(joint)
    poses = {name: np.eye(4) for name in urdf.roots()}
    waiting = list(poses)
    while waiting:
        parent = waiting.pop()
        for joint in children.get(parent, []):
            if joint.child in poses:
                raise BadInput(f"{urdf.name}: link {joint.child!r} has two parents")
            poses[joint.child] = (
                poses[parent] @ joint.parent_from_child @ joint_motion(joint, values.get(joint.name, 0.0))
            )
            waiting.append(joint.child)
    missing = {link.name for link in urdf.links} - poses.keys()
    if missing:
        raise BadInput(f"{urdf.name}: link {sorted(missing)[0]!r} hangs on nothing")
    return poses


def joint_motion(joint: UrdfJoint, value: float) -> np.ndarray:
    """Return the (4, 4) motion of a joint at `value` [rad or m]; fixed and floating ones do not move."""
    axis = np.asarray(joint.axis, dtype=float)
    if joint.type in ("revolute", "continuous"):
        return transform_from(Rotation.from_rotvec(value * axis).as_matrix(), np.zeros(3))
    if joint.type == "prismatic":
        return transform_from(np.eye(3), value * axis)
    return np.eye(4)
