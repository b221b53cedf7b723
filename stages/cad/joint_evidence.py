"""Ours: why a joint of a chosen model is believed. A class name says what such things can do, not that this one does.

A wall that a network calls a fridge gets a fridge's model; a door in it would be a promise that no robot can keep. So
each joint needs a ground in the map: its part stands open, a handle stands out of its leaf, or a seam runs where the
leaf ends. What the camera cannot see (a rack behind a door, a knob of two centimetres) stands by the rest of its thing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from schemas.cad_scene import Ground, JointEvidence
from stages.cad.fitting import AJAR
from stages.cad.leaf_handles import handle_height
from stages.cad.leaf_seams import seam_contrast
from stages.cad.leaves import leaf_of, seen_on
from stages.cad.model_surfaces import ModelSurface, to_model
from stages.cad.shapes import Placement


@dataclass(frozen=True)
class Looked:
    """The map's surface of a thing: vertices (N, 3) [m], unit normals (N, 3), world frame, colours (N, 3) uint8."""

    vertices: np.ndarray
    normals: np.ndarray
    colors: np.ndarray


def joint_evidence(
    surface: ModelSurface, placement: Placement, looked: Looked, *, vouched: bool
) -> dict[str, JointEvidence]:
    """Return joint -> why it is believed, for every joint of a placed model; without grounds it is not.

    `vouched`: somebody says that the thing moves as its model does.
    """
    local = to_model(placement, looked.vertices) * placement.scale
    facing = looked.normals @ placement.rotation
    found: dict[str, JointEvidence] = {}
    for joint in surface.model.joints:
        grounds: list[Ground] = ["user"] if vouched else []
        value = abs(placement.shape.joints.get(joint.name, 0.0))
        handle, seam = None, None
        if value >= AJAR[joint.type]:
            grounds.append("open")
        else:
            leaf = leaf_of(surface, joint, placement.scale)
            seen = None if leaf is None else seen_on(leaf, local, facing, looked.colors)
            if leaf is not None and seen is not None:
                handle, seam = handle_height(leaf, seen), seam_contrast(leaf, seen)
                grounds += ["handle"] if handle is not None else []
                grounds += ["seam"] if seam is not None else []
        found[joint.name] = JointEvidence(grounds=tuple(grounds), handle_height=handle, seam_contrast=seam)
    return with_the_rest(found)


def with_the_rest(found: Mapping[str, JointEvidence]) -> dict[str, JointEvidence]:
    """Return the evidence with the ground `thing` for joints without any, where another joint of the thing has one."""
    if not any(entry.grounds for entry in found.values()):
        return dict(found)
    return {
        name: entry if entry.grounds else entry.model_copy(update={"grounds": ("thing",)})
        for name, entry in found.items()
    }
