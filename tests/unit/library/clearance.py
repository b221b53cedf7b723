"""How deep the moving links of a model reach into its other links."""

from __future__ import annotations

import numpy as np
import trimesh
from scenewright.schemas.cad_library import CadModel
from scenewright.stages.kit.formats.cad_models import part_transforms


def depths_of_links(
    model: CadModel, collision: dict[str, list[trimesh.Trimesh]], values: dict[str, float]
) -> dict[str, float]:
    """Return part -> depth of its deepest corner in a convex piece of another part at the joint values [m].

    Negative where none is inside. `collision`: pieces of every part in its own frame.
    """
    placed = part_transforms(model, values)
    deepest = {}
    for joint in model.joints:
        points = np.concatenate([piece.vertices for piece in collision[joint.part]])
        points = points @ placed[joint.part][:3, :3].T + placed[joint.part][:3, 3]
        depths = []
        for part in model.parts:
            if part == joint.part:
                continue
            local = (points - placed[part][:3, 3]) @ placed[part][:3, :3]
            for piece in collision[part]:
                height = np.einsum("pfi,fi->pf", local[:, None] - piece.triangles[None, :, 0], piece.face_normals)
                depths.append(float((-height.max(axis=1)).max()))
        deepest[joint.part] = max(depths)
    return deepest
