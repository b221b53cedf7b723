"""Read the shapes of the true room and of a CAD scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import cast

import numpy as np
import trimesh
from scenewright.schemas.cad_scene import CadCandidate
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.interactive_scene import InteractiveSceneFile, SceneBody
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.evaluate.model_shapes import ModelShape, PartShape, PlacedShape
from scenewright.stages.kit.formats.cad_models import load_collision_parts, load_visual_parts, read_model
from scenewright.stages.kit.measurement.convex_overlap import convex_piece
from scenewright.stages.kit.simulation.shapes import link_shapes
from scenewright.stages.kit.simulation.urdf_split import PART_SEPARATOR, read_urdf, with_absolute_meshes
from trimesh.visual.color import ColorVisuals

GREY = (128.0, 128.0, 128.0)
"""Colour (sRGB) of faces without one."""
BODY = "body"
"""Name of the part that does not move."""


def true_shapes(truth: GroundTruth, world_from_log: np.ndarray) -> dict[str, PlacedShape]:
    """Return object name -> its model as it stands, out of the true room's scene, moved by `world_from_log` (4, 4).

    The room's meshes are scaled already, so the scale is 1. Empty when the ground truth has no room (scans). Raises
    BadInput when the room's files are broken.
    """
    root = truth.path("room")
    if not (root / "scene.json").is_file():
        return {}
    scene = InteractiveSceneFile.read(root / "scene.json")
    if not (root / scene.static_file).is_file():
        return {}
    files = [scene.static_file, *(body.file for body in scene.bodies if body.file is not None)]
    visual: dict[str, list[trimesh.Trimesh]] = {}
    collision: dict[str, list[trimesh.Trimesh]] = {}
    for file in files:
        text = with_absolute_meshes(read_urdf(root / file), (root / file).parent)
        visual |= link_shapes(text, "visual")
        collision |= link_shapes(text, "collision")
    models = {entry.name: entry.model_id for entry in truth.info.objects}
    shapes: dict[str, PlacedShape] = {}
    for body in scene.bodies:
        model_id = models.get(body.name)
        if model_id is not None and visual.get(body.name):
            shape = _shape_of_body(body, model_id, visual, collision)
            prefix = body.name + PART_SEPARATOR
            values = {name.removeprefix(prefix): value for name, value in body.joint_values.items()}
            pose = world_from_log @ np.array(body.world_from_body)
            shapes[body.name] = PlacedShape(shape, pose, 1.0, values)
    return shapes


def _shape_of_body(
    body: SceneBody,
    model_id: str,
    visual: Mapping[str, Sequence[trimesh.Trimesh]],
    collision: Mapping[str, Sequence[trimesh.Trimesh]],
) -> ModelShape:
    prefix = body.name + PART_SEPARATOR
    links = [link for link in visual if link == body.name or link.startswith(prefix)]
    return ModelShape(
        model_id=model_id,
        class_name=body.class_name,
        parts={
            link.removeprefix(prefix) if link != body.name else BODY: _part(visual[link], collision.get(link, ()))
            for link in links
            if visual[link]
        },
        joints=tuple(_without_prefix(joint, prefix) for joint in body.joints),
        movable=body.carriable,
        contains=body.contains,
    )


def _without_prefix(joint: Joint, prefix: str) -> Joint:
    above = None if joint.parent is None else joint.parent.removeprefix(prefix)
    names = {"name": joint.name.removeprefix(prefix), "part": joint.part.removeprefix(prefix), "parent": above}
    return joint.model_copy(update=names)


def model_shape(folder: Path) -> ModelShape:
    """Return the shape of a model folder of a CAD library or a CAD scene. Raises BadInput when it is broken."""
    model = read_model(folder)
    visual, collision = load_visual_parts(folder), load_collision_parts(folder)
    return ModelShape(
        model_id=model.id,
        class_name=model.class_name,
        parts={part: _part([visual[part]], collision.get(part, ())) for part in model.parts if part in visual},
        joints=model.joints,
        movable=model.movable,
        contains=model.contains,
    )


def model_shapes(model_ids: Sequence[str], roots: Sequence[Path]) -> dict[str, ModelShape]:
    """Return model id -> shape for ids that have a folder below one of `roots` (`models/` of a scene or library)."""
    shapes: dict[str, ModelShape] = {}
    for model_id in sorted(set(model_ids)):
        folder = next((root / model_id for root in roots if (root / model_id).is_dir()), None)
        if folder is not None:
            shapes[model_id] = model_shape(folder)
    return shapes


def placed_candidate(
    candidate: CadCandidate, shapes: Mapping[str, ModelShape], held: frozenset[str] = frozenset()
) -> PlacedShape | None:
    """Return a candidate's model where the candidate puts it, without its joints `held`; None when its model is not
    among `shapes`."""
    shape = shapes.get(candidate.model_id)
    if shape is None:
        return None
    return PlacedShape(shape, np.array(candidate.world_from_model), candidate.scale, candidate.joints, held)


def _part(visual: Sequence[trimesh.Trimesh], collision: Sequence[trimesh.Trimesh]) -> PartShape:
    triangles = np.concatenate([np.asarray(mesh.triangles, dtype=float) for mesh in visual])
    areas = np.concatenate([mesh.area_faces for mesh in visual])
    colors = np.concatenate([_face_colors(mesh) for mesh in visual])
    weights = areas / areas.sum() if areas.sum() > 0 else np.full(len(areas), 1.0 / max(len(areas), 1))
    red, green, blue = (float(value) for value in weights @ colors)
    pieces = tuple(piece for mesh in collision if (piece := convex_piece(np.asarray(mesh.vertices))) is not None)
    return PartShape(triangles, (red, green, blue), pieces)


def _face_colors(mesh: trimesh.Trimesh) -> np.ndarray:
    """(T, 3) sRGB colours of the triangles; grey where the mesh has none."""
    if getattr(mesh.visual, "kind", None) in ("face", "vertex"):
        return np.asarray(cast(ColorVisuals, mesh.visual).face_colors, dtype=float)[:, :3]
    return np.tile(GREY, (len(mesh.faces), 1))
