"""Ours: why a joint of a chosen model is believed. A class name says what such things can do, not that this one does.

A wall that a network calls a fridge gets a fridge's model; a door in it would be a promise that no robot can keep. So
each joint needs a ground: the log shows it move, which is the strongest, or in the map its part stands open, a handle
stands out of its leaf, or a seam runs where the leaf ends. What the camera cannot see (a rack behind a door, a knob of
two centimetres) stands by the rest of its thing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scenewright.schemas.articulations import Articulation
from scenewright.schemas.cad_scene import Ground, JointEvidence
from scenewright.stages.cad.fitting import AJAR
from scenewright.stages.cad.leaf_handles import handle_height
from scenewright.stages.cad.leaf_seams import seam_contrast
from scenewright.stages.cad.leaves import leaf_of, seen_on
from scenewright.stages.cad.made_models import is_of_family
from scenewright.stages.cad.model_surfaces import ModelSurface, to_model
from scenewright.stages.cad.seen_motions import seen_motions
from scenewright.stages.cad.shapes import Placement
from scenewright.stages.kit.formats.cad_models import part_transforms
from scenewright.stages.kit.geometry.transforms import apply
from scipy.spatial import cKDTree

EXPLAINED, NEAR = 0.75, 0.02
"""A model whose joints are believed explains this share of its thing: vertices that lie so near to it [m]. A model that
does not fit opens its doors where that brings them nearer to anything."""
LEAST_OPEN = 0.25
"""Share of an open part's surface at which the map shows something (the inside of a drawer is hardly seen)."""
REACH = 0.03
"""Largest distance from the map at which a point of an open part counts as seen [m]."""


@dataclass(frozen=True)
class Looked:
    """The map's surface of a thing: vertices (N, 3) [m], unit normals (N, 3), world frame, colours (N, 3) uint8."""

    vertices: np.ndarray
    normals: np.ndarray
    colors: np.ndarray


def joint_evidence(
    surface: ModelSurface,
    placement: Placement,
    looked: Looked,
    *,
    vouched: bool,
    articulations: Sequence[Articulation] = (),
) -> dict[str, JointEvidence]:
    """Return joint -> why it is believed, for every joint of a placed model; without grounds it is not.

    `vouched`: somebody says that the thing moves as its model does; `articulations`: what the log shows moving.
    """
    local = to_model(placement, looked.vertices) * placement.scale
    facing = looked.normals @ placement.rotation
    nearest = surface.closest(local / placement.scale, placement.shape.joints)
    near = float(np.mean(placement.scale * nearest.distance < NEAR))
    fits = near >= EXPLAINED or is_of_family(surface.model)  # which was made of what was seen
    motions = seen_motions(surface, placement, articulations)
    evidence: dict[str, JointEvidence] = {}
    for joint in surface.model.joints:
        grounds: list[Ground] = ["user"] if vouched else []
        grounds += ["moved"] if joint.name in motions else []
        value = abs(placement.shape.joints.get(joint.name, 0.0))
        handle, seam = None, None
        if fits and value >= AJAR[joint.type]:
            grounds += ["open"] if _seen_open(surface, placement, joint.part, local) else []
        elif fits:
            leaf = leaf_of(surface, joint, placement.scale)
            leaf_view = None if leaf is None else seen_on(leaf, local, facing, looked.colors)
            if leaf is not None and leaf_view is not None:
                handle, seam = handle_height(leaf, leaf_view), seam_contrast(leaf, leaf_view)
                grounds += ["handle"] if handle is not None else []
                grounds += ["seam"] if seam is not None else []
        evidence[joint.name] = JointEvidence(
            grounds=tuple(grounds), handle_height=handle, seam_contrast=seam, motion=motions.get(joint.name)
        )
    return with_the_rest(evidence)


def _seen_open(surface: ModelSurface, placement: Placement, part: str, local: np.ndarray) -> bool:
    """Whether the map, points (N, 3) in the model's frame, scaled [m], shows the part where its joint puts it."""
    pose = part_transforms(surface.model, placement.shape.joints)[part]
    samples = placement.scale * apply(pose, surface.samples[part])
    return float(np.mean(cKDTree(local).query(samples)[0] < REACH)) >= LEAST_OPEN


def with_the_rest(found: Mapping[str, JointEvidence]) -> dict[str, JointEvidence]:
    """Return the evidence with the ground `thing` for joints without any, where another joint of the thing has one."""
    if not any(entry.grounds for entry in found.values()):
        return dict(found)
    return {
        name: entry if entry.grounds else entry.model_copy(update={"grounds": ("thing",)})
        for name, entry in found.items()
    }
