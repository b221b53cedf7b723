"""A posed CAD model whose parts wear the colours that the map shows there."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import cast

import numpy as np
import trimesh
from scenewright.schemas.cad_library import CadModel
from scenewright.schemas.cad_scene import CadCandidate
from scenewright.stages.kit.formats.cad_models import load_visual_parts, part_transforms, posed_mesh
from scenewright.stages.kit.formats.part_colors import recolored, vertex_colors


def painted_mesh(
    folder: Path, model: CadModel, candidate: CadCandidate, colors: Mapping[str, tuple[int, int, int]] | None = None
) -> trimesh.Trimesh:
    """Return the visual mesh of a candidate in its model frame, scaled, joints at their values.

    `colors`: part -> mean colour (sRGB, 0..255) that it is to have, as in the exported scene; the others, and parts
    without colours of their own, stay as they are. Raises BadInput for a broken model.
    """
    if not colors:
        return posed_mesh(folder, model, candidate.joints, candidate.scale)
    part_meshes, poses = load_visual_parts(folder), part_transforms(model, candidate.joints)
    placed = []
    for name in model.parts:
        if name in part_meshes:
            mesh = part_meshes[name]
            if name in colors:
                _paint(mesh, colors[name])
            mesh.apply_transform(poses[name])
            placed.append(mesh)
    combined = placed[0] if len(placed) == 1 else cast(trimesh.Trimesh, trimesh.util.concatenate(placed))
    combined.apply_scale(candidate.scale)
    return combined


def _paint(mesh: trimesh.Trimesh, color: tuple[int, int, int]) -> None:
    colors = vertex_colors(mesh)
    if colors is None:
        return
    share = np.zeros(len(mesh.vertices))  # each corner of a triangle stands for a third of it
    np.add.at(share, np.asarray(mesh.faces), np.repeat(mesh.area_faces[:, None] / 3.0, 3, axis=1))
    painted = recolored(colors / 255.0, share, np.array(color) / 255.0)
    mesh.visual = trimesh.visual.ColorVisuals(mesh, vertex_colors=np.round(255.0 * painted).astype(np.uint8))
