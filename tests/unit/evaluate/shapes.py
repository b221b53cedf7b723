"""Box-shaped CAD models made by hand."""

from __future__ import annotations

import numpy as np
import trimesh
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.evaluate.model_shapes import ModelShape, PartShape
from scenewright.stages.kit.measurement.convex_overlap import convex_piece


def part(low, high, color=(200.0, 100.0, 50.0)) -> PartShape:
    """A box between two corners [m], one colour, one convex piece."""
    mesh = trimesh.creation.box(bounds=[low, high])
    piece = convex_piece(np.asarray(mesh.vertices))
    return PartShape(np.asarray(mesh.triangles, dtype=float), color, (piece,) if piece else ())


def box_model(model_id: str, class_name: str, size, *, color=(200.0, 100.0, 50.0), **more) -> ModelShape:
    """A box of `size` (3,) [m] that stands on the middle of its bottom."""
    x, y, z = size
    body = part((-x / 2, -y / 2, 0), (x / 2, y / 2, z), color)
    return ModelShape(model_id, class_name, {"body": body}, **more)


def cupboard(model_id: str, size=(0.8, 0.5, 1.0), *, hinge_x=0.4, upper=1.6, drawers=()) -> ModelShape:
    """A box with a door hinged at `hinge_x` on its front, and drawers at the given heights [m]."""
    x, y, z = size
    parts = {"body": part((-x / 2, -y / 2, 0), (x / 2, y / 2, z)), "door": part((-x, -0.02, 0), (0, 0, z))}
    joints = [
        Joint(
            name="door_hinge",
            type="revolute",
            part="door",
            origin=(hinge_x, -y / 2, 0.5),
            axis=(0, 0, 1),
            lower=0.0,
            upper=upper,
        )
    ]
    for k, height in enumerate(drawers):
        parts[f"drawer_{k}"] = part((-0.3, 0, 0), (0.3, 0.3, 0.1))
        joints.append(
            Joint(
                name=f"drawer_{k}_slide",
                type="prismatic",
                part=f"drawer_{k}",
                origin=(0, -y / 2, height),
                axis=(0, -1, 0),
                lower=0.0,
                upper=0.3,
            )
        )
    return ModelShape(model_id, "cabinet", parts, tuple(joints), contains=True)
