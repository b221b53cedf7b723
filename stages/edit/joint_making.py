"""Models that edits make: one with another range of a joint, one with a part cut out that moves."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh
from scenewright.schemas.base import as_transform, as_vector
from scenewright.schemas.cad_library import CadModel, ModelState
from scenewright.schemas.cad_scene import CadCandidate, JointEvidence, Replacement
from scenewright.schemas.contact_graph import GraphNode
from scenewright.schemas.edits import AddJoint
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.edit.anchoring import Conflict
from scenewright.stages.edit.scene_state import SceneState, colored
from scenewright.stages.kit.formats.cad_models import MODEL_FILE, URDF_FILE, load_visual_parts, part_transforms
from scenewright.stages.kit.formats.model_writer import PartGeometry, write_model_folder
from scenewright.stages.kit.formats.urdf_file import parse_urdf, write_urdf
from scenewright.stages.kit.geometry.boxes import bottom, box_yaw, points_in_box, upright_box
from scenewright.stages.kit.geometry.convex_pieces import convex_pieces
from scenewright.stages.kit.geometry.planes import moved_planes
from scenewright.stages.kit.geometry.solids import Solid, box, hull, mass_properties
from scenewright.stages.kit.geometry.substances import substance_of
from scenewright.stages.kit.geometry.transforms import apply, inverse, transform_from_yaw
from scipy.spatial import QhullError

FINEST = 0.05
"""Triangles are cut to edges of this length before they are told apart [m]."""
FEWEST_FACES = 8
"""Fewest faces on either side of a cut; by eye."""
THINNEST = 5e-3
"""A piece that is flatter is made a box of this thickness [m]."""
BODY = "body"


def with_limits(state: SceneState, node: GraphNode, joint: str, lower: float, upper: float) -> None:
    """Let a copy of a node's model, with another range [rad, m] of a joint, stand for it."""
    model, folder, _ = state.model_of(node)
    new_id = free_id(state, node)
    target = state.output / "models" / new_id
    shutil.copytree(folder, target)
    urdf = parse_urdf(folder / URDF_FILE)
    joints = tuple(replace(k, lower=lower, upper=upper) if k.name == joint else k for k in urdf.joints)
    write_urdf(target / URDF_FILE, replace(urdf, joints=joints))
    ranged = tuple(
        k.model_copy(update={"lower": lower, "upper": upper}) if k.name == joint else k for k in model.joints
    )
    model.model_copy(update={"id": new_id, "joints": ranged}).write(target / MODEL_FILE)
    _stand(state, node, target, new_id)


def free_id(state: SceneState, node: GraphNode) -> str:
    """Return an id for a model that an edit makes for a node."""
    number = 1
    while state.model_folder(f"{node.id}_edited_{number}") is not None:
        number += 1
    return f"{node.id}_edited_{number}"


def _stand(state: SceneState, node: GraphNode, folder: Path, model_id: str) -> None:
    """Let a model that was made of a node's own stand in its place."""
    before = state.replacements[node.id]
    assert before.chosen is not None
    chosen = before.chosen.model_copy(update={"model_id": model_id})
    state.made[model_id] = folder
    state.put_model(node, folder, before.model_copy(update={"chosen": chosen}))


def with_new_joint(state: SceneState, node: GraphNode, edit: AddJoint) -> str:
    """Let a model with one joint more stand for a node, and return the joint's name. Raises Conflict when the box holds
    nothing of the thing's body, or all of it."""
    joints: tuple[Joint, ...] = ()
    values: dict[str, float] = {}
    if node.model_id is not None:
        model, folder, pose = state.model_of(node)
        scale, joints, values = node.scale or 1.0, model.joints, dict(node.joints)
        closed = part_transforms(model, {})
        meshes = load_visual_parts(folder)
        for part, mesh in meshes.items():
            mesh.apply_transform(closed[part])
        body = model.parts[0]
    else:
        mesh, scale, body = state.mesh_of(node), 1.0, BODY
        assert node.box is not None  # it was found by it
        pose = transform_from_yaw(box_yaw(node.box), np.array([*node.box.center[:2], bottom(node.box)]))
        mesh.apply_transform(inverse(pose))
        meshes = {body: mesh}
    remainder, moving = _cut(meshes[body], edit, pose, scale, node.id)
    name = next(f"hand_{k}" for k in range(1, 1000) if f"hand_{k}" not in {joint.name for joint in joints})
    to_model = inverse(pose)
    length = scale if edit.type == "prismatic" else 1.0
    axis = to_model[:3, :3] @ np.array(edit.axis, dtype=float)
    new_joint = Joint(
        name=name,
        type=edit.type,
        part=name,
        origin=as_vector(apply(to_model, np.array([edit.origin]))[0] / scale),
        axis=as_vector(axis / np.linalg.norm(axis)),
        lower=edit.lower / length,
        upper=edit.upper / length,
        handle=None if edit.handle is None else as_vector(apply(to_model, np.array([edit.handle]))[0] / scale),
    )
    model_id = free_id(state, node)
    target = state.output / "models" / model_id
    planes = moved_planes(node.planes, to_model[:3, :3], to_model[:3, 3])
    planes = moved_planes(planes, np.eye(3), np.zeros(3), 1.0 / scale)
    all_meshes = {**meshes, body: remainder, name: moving}
    _write(target, model_id, node, all_meshes, body, (*joints, new_joint), planes)
    before = state.replacements.get(node.id)
    evidence = (
        {}
        if before is None
        else before.joint_evidence or {joint.name: JointEvidence(grounds=("user",)) for joint in joints}
    )
    state.made[model_id] = target
    state.put_model(
        node,
        target,
        Replacement(
            node=node.id,
            decision="cad",
            reason="a person gave it a joint",
            chosen=CadCandidate(
                model_id=model_id,
                joints={**values, name: max(0.0, new_joint.lower)},
                scale=scale,
                world_from_model=as_transform(pose),
                matching_error=0.0,
                alignment_error=0.0,
            ),
            part_colors={} if before is None else before.part_colors,
            joint_evidence={**evidence, name: JointEvidence(grounds=("user",))},
        ),
    )
    return name


def _cut(
    mesh: trimesh.Trimesh, edit: AddJoint, pose: np.ndarray, scale: float, name: str
) -> tuple[trimesh.Trimesh, trimesh.Trimesh]:
    """Return what of a mesh (model frame) lies outside and inside the edit's box, triangle by triangle."""
    color = colored(mesh).colors.mean(axis=0)
    vertices, faces = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, FINEST / scale, max_iter=12)
    middles = apply(pose, scale * vertices[faces].mean(axis=1))
    inside = points_in_box(upright_box(edit.part), middles)
    if min(int(inside.sum()), int((~inside).sum())) < FEWEST_FACES:
        raise Conflict(f"{int(inside.sum())} of the {len(inside)} triangles of {name} lie in its box")
    halves = []
    for chosen in (~inside, inside):
        part = trimesh.Trimesh(vertices, faces[chosen], process=False)
        part.remove_unreferenced_vertices()
        tint = np.tile(np.array([*color, 255], np.uint8), (len(part.vertices), 1))
        part.visual = trimesh.visual.ColorVisuals(part, vertex_colors=tint)
        halves.append(part)
    return halves[0], halves[1]


def _write(
    folder: Path,
    model_id: str,
    node: GraphNode,
    meshes: Mapping[str, trimesh.Trimesh],
    body: str,
    joints: tuple[Joint, ...],
    planes: tuple,
) -> None:
    """Write a model of parts (model frame, closed)."""
    density = substance_of(node.class_name).hull_density
    origins = {joint.part: np.array(joint.origin) for joint in joints}
    ordered = [body, *(joint.part for joint in joints)]
    geometries = []
    for name in ordered:
        mesh = meshes[name].copy()
        mesh.apply_translation(-origins.get(name, np.zeros(3)))
        solids = [_solid(piece) for piece in convex_pieces(mesh.vertices, mesh.faces)]
        red, green, blue = (int(value) for value in colored(mesh).colors.mean(axis=0))
        drawn_mesh = colored(mesh)
        properties = mass_properties(solids, [density] * len(solids))
        tint = (red, green, blue)
        geometries.append(PartGeometry(name, solids, [tint] * len(solids), properties, [drawn_mesh], [tint]))
    points = np.concatenate([np.asarray(mesh.vertices) for mesh in meshes.values()])
    state = ModelState(
        joints={joint.name: 0.0 for joint in joints},
        box_minimum=as_vector(points.min(axis=0)),
        box_maximum=as_vector(points.max(axis=0)),
        planes=planes,
    )
    model = CadModel(
        id=model_id,
        class_name=node.class_name,
        articulated=True,
        mass=sum(part.properties.mass for part in geometries),
        states=(state,),
        joints=joints,
        movable=False,
        contains=True,
        parts=tuple(ordered),
        recipe={"edited": node.id},
    )
    write_model_folder(folder, model, geometries)


def _solid(points: np.ndarray) -> Solid:
    """Return the hull of points (N, 3), or the box around them where they are too flat for one."""
    try:
        solid = hull(points)
        if np.ptp(solid.vertices, axis=0).min() >= THINNEST:
            return solid
    except (QhullError, ValueError):
        pass
    middle, half = (
        0.5 * (points.min(axis=0) + points.max(axis=0)),
        np.maximum(0.5 * np.ptp(points, axis=0), THINNEST / 2),
    )
    low, high = middle - half, middle + half
    return box((low[0], high[0]), (low[1], high[1]), (low[2], high[2]))
