"""Where a moving part of an imported model is grasped: what is called a handle, or marked."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from scenewright.schemas.base import as_vector
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.library.importing.grouping import Group
from scenewright.stages.library.importing.source_model import Surface

HANDLE = re.compile(r"handle|grip|knob|pull", re.IGNORECASE)


def with_handle(joint: Joint, group: Group, visual: Sequence[Surface], model_from_root: np.ndarray) -> Joint:
    """Return the joint with the place where its part is grasped, when a shape, a link or a mark is called so."""
    points: np.ndarray | None = None
    named_surfaces = [surface.vertices for surface in visual if HANDLE.search(surface.name)]
    for link, pose in group.links:
        if link is not group.links[0][0] and HANDLE.search(f"{link.name} {link.role}"):
            named_surfaces += [apply(model_from_root @ pose, s.vertices) for s in link.visual or link.collision]
    middle = None
    if named_surfaces:
        points = np.concatenate(named_surfaces)
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    else:
        marks = [
            (name, apply(model_from_root @ pose, at[None])[0]) for link, pose in group.links for name, at in link.marks
        ]
        if marks:
            middle = next((at for name, at in marks if HANDLE.search(name)), marks[0][1])
            near_surfaces = [s.vertices for s in visual if _reaches(s.vertices, middle, 0.01)]
            points = min(near_surfaces, key=lambda v: float(np.prod(np.ptp(v, axis=0)))) if near_surfaces else None
    if middle is None:
        return joint
    direction = None
    if points is not None:
        _, extents, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
        if extents[0] > 1.5 * extents[1]:
            direction = axes[0] * (1.0 if axes[0][np.argmax(np.abs(axes[0]))] > 0 else -1.0)
    return joint.model_copy(
        update={
            "handle": as_vector(middle),
            "handle_axis": None if direction is None else as_vector(np.round(direction, 6) + 0.0),
        }
    )


def _reaches(vertices: np.ndarray, point: np.ndarray, margin: float) -> bool:
    return bool((vertices.min(axis=0) - margin <= point).all() and (point <= vertices.max(axis=0) + margin).all())
