"""Interactive scenes: every link of scene.urdf where it stands, moving parts as far open as they were seen."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import numpy as np
import trimesh
from scenewright.schemas.cad_scene import CadSceneFile
from scenewright.schemas.interactive_scene import InteractiveScene, InteractiveSceneFile
from scenewright.stages.kit.drawing.palette import instance_color
from scenewright.stages.kit.formats.link_poses import link_poses
from scenewright.stages.kit.formats.urdf_file import Urdf, UrdfJoint, parse_urdf
from scenewright.stages.kit.geometry.transforms import inverse, transform_from_quaternion
from scenewright.stages.kit.simulation.margins import is_marginal
from scenewright.stages.kit.viewing.canvas import SHELL, Canvas, JointedLink, Trust
from scenewright.stages.kit.viewing.graphs import draw_graph
from scenewright.stages.kit.viewing.meshes import merged, shape_mesh

NEAR, FAR = 0.02, 0.1
"""A model this near to what was seen is that; one this far is not [m]."""
SHELL_CLASSES = ("wall", "ceiling")


def draw_scene_with_graph(scene: InteractiveScene, cad_scene: CadSceneFile | None, canvas: Canvas) -> None:
    """Draw the links, how they settle, the boxes and the contact graph, and what is known of models and joints."""
    draw_settling(scene, canvas)
    draw_graph(scene.graph, canvas, trusted=trust_of_models(cad_scene) if cad_scene is not None else None)


def trust_of_models(cad_scene: CadSceneFile) -> dict[str, Trust]:
    """Return how far what stands for the nodes can be trusted: a model by how near it lies to what was seen and by the
    grounds for its joints, a scanned mesh only for what was seen of it."""
    trusts = {}
    for replacement in cad_scene.replacements:
        share, reasons = 1.0, []
        if replacement.decision == "mesh":
            share, reasons = 0.5, [f"no model: {replacement.reason}" if replacement.reason else "no model"]
        elif replacement.decision == "cad" and replacement.chosen is not None:
            error = replacement.chosen.alignment_error
            share = max(0.0, 1.0 - error / FAR)
            if error > NEAR:
                reasons.append(f"its model lies {1000 * error:.0f} mm from what was seen")
        if replacement.held:
            names = ", ".join(sorted(replacement.held))
            share, reasons = min(share, 0.5), [*reasons, f"nothing in the map speaks for its joints: {names}"]
        if replacement.decision != "layout":
            trusts[replacement.node] = Trust(share, tuple(reasons))
    return trusts


def draw_scene_folder(
    root: Path, canvas: Canvas, prefix: str = "scene", *, animated: bool = False
) -> dict[str, np.ndarray]:
    """Draw the links of an interactive scene's folder under `prefix`; return link -> (4, 4) world_from_link.

    `animated`: the poses hold from time 0 on, until others are drawn (in Rerun what is always there never changes).
    """
    description = InteractiveSceneFile.read(root / "scene.json")
    urdf = parse_urdf(root / description.combined_file)
    values = {name: value for body in description.bodies for name, value in body.joint_values.items()}
    poses = link_poses(urdf, values)
    shell = {body.name for body in description.bodies if body.class_name in SHELL_CLASSES}
    drawn = {}
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
        drawn[link.name] = poses[link.name]
    canvas.joints(jointed_links(urdf, values, {name: _path(name, shell, prefix) for name in drawn}))
    return drawn


def draw_settling(scene: InteractiveScene, canvas: Canvas, prefix: str = "scene") -> None:
    """Draw the links of a scene, and the settle test, where one was made: bodies as they went when they were let go,
    what left its place and when, and what else is wrong."""
    settling = scene.settling
    drawn = draw_scene_folder(scene.root, canvas, prefix, animated=settling is not None)
    if settling is None:
        return
    begun = {body.name: np.array(body.world_from_body) for body in scene.info.bodies}
    shell = {body.name for body in scene.info.bodies if body.class_name in SHELL_CLASSES}
    for body in settling.bodies:
        links = [name for name in drawn if name.split("__")[0] == body.name]
        for time, row in zip(settling.times, body.poses, strict=False):
            moved = transform_from_quaternion(np.array(row[3:]), np.array(row[:3])) @ inverse(begun[body.name])
            canvas.time(time)
            for link in links:
                canvas.transform(_path(link, shell, prefix), moved @ drawn[link])
        if body.leaves is not None:
            fate = "falls through the floor" if body.fell_through else "does not stay"
            text = f"{body.name} {fate}: {1000 * body.moved:.0f} mm, {np.degrees(body.turned):.0f} degrees in the end"
            canvas.moment(body.leaves, text, bad=True)
    canvas.always()
    canvas.moment(0.0, "let go")
    for name, margin in settling.margins.items():
        if is_marginal(margin):
            canvas.moment(0.0, f"{name} is marginal: {margin:.1f} standard deviations to its limit")
    for trouble in settling.troubles:
        canvas.moment(0.0, trouble, bad=True)
    if settling.times:
        canvas.moment(settling.times[-1], settling.reason, bad=settling.verdict != "ok")


def _path(link: str, shell: set[str], prefix: str) -> str:
    return f"{SHELL if link in shell else prefix}/{link}"


def jointed_links(urdf: Urdf, values: Mapping[str, float], paths: Mapping[str, str]) -> list[JointedLink]:
    """Return the links of a description, parents first, with where those that are drawn are drawn."""
    path_of = {link.name: paths.get(link.name, f"undrawn/{link.name}") for link in urdf.links}
    children: dict[str, list[UrdfJoint]] = {}
    for joint in urdf.joints:
        children.setdefault(joint.parent, []).append(joint)
    links = [JointedLink(path_of[root], "", np.eye(4)) for root in urdf.roots()]
    waiting = list(urdf.roots())
    while waiting:
        parent = waiting.pop(0)
        for joint in children.get(parent, []):
            kind: Literal["fixed", "turning", "sliding"] = "fixed"
            if joint.type in ("revolute", "continuous"):
                kind = "turning"
            elif joint.type == "prismatic":
                kind = "sliding"
            links.append(
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
    return links
