"""What all looks said of each entity, and the name that it gets from it.

Ours. Each decision leaves its reason with the entity (schemas/panoptic_map.py, `Because`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scenewright.schemas.vocabulary import UNNAMED, Vocabulary
from scenewright.stages.fuse.extraction import ExtractedEntity, LabelledSurface
from scenewright.stages.fuse.names import Naming, Said, name_of, rates_of, said_of
from scenewright.stages.fuse.votes import Votes
from scenewright.stages.kit.class_extents import extent_of
from scipy.spatial import cKDTree

REACH = 4.0
"""A piece stands on what is so close under its foot [voxels]."""
BY_MASKS = "masks"
GROWN = "masks, and the piece of which they have a part"
PIECE = "a piece that geometry cuts"
BOUND = "planes that bound the room"
BY_MOST_LOOKS = "masks of the class, in most looks"
"""How the surface of an entity was found."""


@dataclass(frozen=True)
class Reason:
    """Why an entity is what it is."""

    shape: str
    said: Said
    naming: Naming | None
    """None of what bounds the room, and of other surface that is no thing."""


def _leading(said: Said | None, classes: frozenset[int]) -> int:
    """Return the class that was said most, 0 for none."""
    scores = {} if said is None else {c: s for c, s in said.scores.items() if c in classes}
    return min(scores, key=lambda c: (-scores[c], c), default=0)


def carriers_of(
    vertices: np.ndarray, labelled: LabelledSurface, standing: frozenset[int], voxel: float
) -> dict[int, int]:
    """Return {piece that stands on a top: the instance that is closest under it}."""
    others = np.flatnonzero((labelled.instance > 0) & ~np.isin(labelled.instance, sorted(standing)))
    if not standing or not len(others):
        return {}
    tree, result = cKDTree(vertices[others]), {}
    for piece in sorted(standing):
        points = vertices[labelled.instance == piece]
        if not len(points):
            continue
        foot = points[points[:, 2] <= np.quantile(points[:, 2], 0.1)] - [0.0, 0.0, voxel]
        near, nearest = tree.query(foot, distance_upper_bound=REACH * voxel)
        found = labelled.instance[others[nearest[np.isfinite(near)]]]
        if len(found):
            result[piece] = int(np.bincount(found).argmax())
    return result


def _owners_of_labels(
    entities: Sequence[ExtractedEntity], labelled: LabelledSurface, things: frozenset[int]
) -> dict[int, int]:
    """Return {segment label: the thing of masks that has most of its surface}."""
    wanted = {e.instance for e in entities if e.class_id in things and e.segments}
    pairs, counts = np.unique(np.stack([labelled.segment, labelled.instance]), axis=1, return_counts=True)
    most: dict[int, tuple[int, int]] = {}
    for label, owner, count in zip(*pairs.tolist(), counts.tolist(), strict=True):
        most[label] = max(most.get(label, (0, 0)), (count, owner))
    return {label: owner for label, (_, owner) in most.items() if owner in wanted}


def with_names(
    entities: Sequence[ExtractedEntity],
    labelled: LabelledSurface,
    shapes: Mapping[int, str],
    carriers: Mapping[int, int],
    votes: Votes,
    vocabulary: Vocabulary,
    things: frozenset[int],
) -> tuple[list[ExtractedEntity], LabelledSurface, dict[int, Reason]]:
    """Return entities and labels with names, and the reasons by instance.

    `carriers`: what pieces stand on. What masks call this most, they call a piece on it as long as they take it along.
    """
    unnamed = vocabulary.by_name(UNNAMED).id
    thing_of = _owners_of_labels(entities, labelled, things)
    order = np.argsort(labelled.instance, kind="stable")
    ordered = labelled.instance[order]
    said: dict[int, Said] = {}
    for entity in entities:
        start, end = np.searchsorted(ordered, (entity.instance, entity.instance + 1))
        others = frozenset(label for label, k in thing_of.items() if k != entity.instance)
        said[entity.instance] = said_of(labelled.segment[order[start:end]], votes, others)
    of_masks = [said[e.instance] for e in entities if e.class_id in things and e.segments]
    rates = rates_of(of_masks, things - {unnamed})
    result, reasons, class_id = [], {}, labelled.class_id.copy()
    for entity in entities:
        naming, shape = None, shapes.get(entity.instance, BY_MASKS)
        if entity.class_id in things:
            extent = extent_of(np.asarray(entity.mesh.vertices))
            told = said[entity.instance]
            of_carrier = _leading(said.get(carriers.get(entity.instance, 0)), things - {unnamed})
            if of_carrier and of_carrier == _leading(told, things - {unnamed}):
                told = replace(told, scores={c: s for c, s in told.scores.items() if c != of_carrier})
            naming = name_of(told, rates, extent, vocabulary, unnamed)
            class_id[labelled.instance == entity.instance] = naming.class_id
            entity = replace(entity, class_id=naming.class_id)
        elif entity.instance not in shapes:
            shape = BY_MOST_LOOKS
        reasons[entity.instance] = Reason(shape, said[entity.instance], naming)
        result.append(entity)
    return result, replace(labelled, class_id=class_id), reasons
