"""Ours: joints of a placed model that the log shows moving (`articulate`): which is which, and what they say of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scenewright.schemas.articulations import Articulation
from scenewright.schemas.base import as_vector
from scenewright.schemas.cad_scene import SeenMotion
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.cad.model_surfaces import ModelSurface, to_model
from scenewright.stages.cad.shapes import Placement
from scenewright.stages.kit.formats.cad_models import part_transforms
from scenewright.stages.kit.geometry.transforms import apply

SAME_WAY = np.radians(15.0)
"""Axes within this are those of one joint."""
HINGE_REACH = 0.12
"""Hinges so far apart are one [m]: a map's cabinet and a model of another width, and half a leaf's thickness."""
ON_LEAF = 0.08
"""The shut face that was seen lies within the box of the model's part and this [m]."""


def seen_motions(
    surface: ModelSurface, placement: Placement, articulations: Sequence[Articulation]
) -> dict[str, SeenMotion]:
    """Return joint -> how it was seen to move, for the joints of a placed model that were. Of several articulations
    that could be a joint's the one whose face lies nearest the middle of its part is taken."""
    best: dict[str, tuple[float, SeenMotion]] = {}
    for entry in articulations:
        for joint in surface.model.joints:
            match = _same_joint(surface, placement, joint, entry)
            if match is not None and (joint.name not in best or match[0] < best[joint.name][0]):
                best[joint.name] = match
    return {name: motion for name, (_, motion) in best.items()}


def _same_joint(
    surface: ModelSurface, placement: Placement, joint: Joint, entry: Articulation
) -> tuple[float, SeenMotion] | None:
    """Return the distance of faces [m] and the motion where an articulation is this joint's; None where it is not."""
    if entry.type != joint.type:
        return None
    axis = placement.rotation.T @ np.asarray(entry.axis)
    along = float(axis @ np.asarray(joint.axis))
    angle = float(np.arccos(np.clip(abs(along), 0.0, 1.0)))
    if angle > SAME_WAY:
        return None
    opening = along > 0  # from the first state to the second
    shut = to_model(placement, np.array(entry.leaf if opening else entry.leaf_after))
    pose = part_transforms(surface.model, {})[joint.part]
    corners = apply(pose, surface.corners[joint.part])
    reach = ON_LEAF / placement.scale
    middle = shut.mean(axis=0)
    if np.any(middle < corners.min(axis=0) - reach) or np.any(middle > corners.max(axis=0) + reach):
        return None
    length = placement.scale if joint.type == "prismatic" else 1.0
    if joint.type == "revolute":
        beside = to_model(placement, np.array([entry.origin]))[0] - np.asarray(joint.origin)
        if placement.scale * float(np.linalg.norm(np.cross(beside, np.asarray(joint.axis)))) > HINGE_REACH:
            return None
    travel = entry.travel / length
    shift = float(np.linalg.norm(middle - corners.mean(axis=0)))
    motion = SeenMotion(axis=as_vector(axis if opening else -axis), angle=angle, travel=travel, upper=travel)
    return placement.scale * shift, motion
