"""Masks and geometry agree on the entities of a map: geometry lays out the room, masks testify, names come last.

Ours. Each decision leaves its reason with the entity (schemas/panoptic_map.py, `Because`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scenewright.schemas.vocabulary import UNNAMED, Vocabulary
from scenewright.stages.fuse.belief import doubted, flush_shares
from scenewright.stages.fuse.extraction import ExtractedEntity, LabelledSurface
from scenewright.stages.fuse.layout.evidence import Scene
from scenewright.stages.fuse.layout.room import CEILING, FLOOR, WALL, Layout, find_layout
from scenewright.stages.fuse.names import Naming, Said, name_of, rates_of, said_of
from scenewright.stages.fuse.parts import absorb_pieces
from scenewright.stages.fuse.pieces import Cloud, grown_things, pieces_beside
from scenewright.stages.fuse.relabelling import relabelled
from scenewright.stages.fuse.surface import Surface
from scenewright.stages.fuse.votes import Votes
from scenewright.stages.kit.class_extents import extent_of
from scipy.spatial import cKDTree

SURE = 0.5
"""Share of looks with a mask of a thing from which on no wall takes its surface: a screen that hangs flat on it."""
FRAGMENT = 0.2
"""A piece under this share of a thing of its name that it touches is a part of it."""
REACH = 4.0
"""A piece stands on what is so close under its foot [voxels]."""
BY_MASKS = "masks"
GROWN = "masks, and the piece of which they have a part"
PIECE = "a piece that geometry cuts"
BOUND = "planes that bound the room"
UNHEARD = "masks of the class, in most looks"
"""How the surface of an entity was found."""


@dataclass(frozen=True)
class Reason:
    """Why an entity is what it is."""

    shape: str
    said: Said
    naming: Naming | None
    """None of what bounds the room, and of other surface that is no thing."""


@dataclass(frozen=True)
class Agreement:
    """Entities and labels, the layout, and by instance the reasons; `dropped`: reasons why masks are no entity."""

    entities: list[ExtractedEntity]
    labelled: LabelledSurface
    layout: Layout
    reasons: dict[int, Reason]
    dropped: tuple[str, ...]


def agreed(
    surface: Surface,
    entities: Sequence[ExtractedEntity],
    labelled: LabelledSurface,
    scene: Scene,
    votes: Votes,
    vocabulary: Vocabulary,
    *,
    voxel: float,
    minimum_area: float,
) -> Agreement:
    """Return what masks and geometry agree on.

    `entities`, `labelled`: what masks found, without what bounds the room; `voxel` [m]; `minimum_area` [m^2] of pieces
    that no mask names, 0: there are none.
    """
    unnamed = vocabulary.by_name(UNNAMED).id
    things = frozenset(entry.id for entry in vocabulary.classes if entry.kind == "thing")
    layout = find_layout(scene)
    told = votes.share(labelled.segment, things)
    own_told = votes.own_share(labelled.segment, labelled.class_id)
    dropped = _dropped(entities, labelled, told, own_told, scene, things, voxel)
    instance = np.where(np.isin(labelled.instance, sorted(dropped)), 0, labelled.instance)

    is_thing = np.isin(labelled.class_id, sorted(things)) & (instance > 0)
    bounded = (layout.owner > 0) & ((instance == 0) | (is_thing & (told < SURE)))
    first = 1 + max([int(labelled.instance.max(initial=0)), *(e.instance for e in entities)])
    bounds = {first + k: kind for k, kind in enumerate((FLOOR, WALL, CEILING))}
    for number, kind in bounds.items():
        instance = np.where(bounded & layout.of(kind), number, instance)
    new_classes = {number: vocabulary.by_name(kind).id for number, kind in bounds.items()}

    shapes, standing = dict.fromkeys(bounds, BOUND), frozenset[int]()
    if minimum_area > 0:
        stuff = (instance > 0) & ~(is_thing & ~bounded)
        things_of = np.where(stuff, 0, instance)
        cloud = Cloud(scene.vertices - [0.0, 0.0, layout.floor or 0.0], scene.normals, voxel)
        size = np.maximum(np.bincount(things_of), 1)
        sure = np.flatnonzero(np.bincount(things_of, weights=own_told) >= SURE * size)
        grown = grown_things(cloud, things_of, stuff, frozenset(sure.tolist()), minimum_area)
        of_thing = np.where(grown != things_of, 1.0, own_told)
        found = pieces_beside(cloud, grown, stuff, of_thing, minimum_area)
        shapes |= dict.fromkeys(np.unique(grown[grown != things_of]).tolist(), GROWN)
        start = first + len(bounds) - 1
        instance = np.where(stuff, instance, np.where(found.piece > 0, start + found.piece, found.thing_of))
        pieces = range(start + 1, start + 1 + int(found.piece.max(initial=0)))
        standing = frozenset(start + number for number in found.standing)
        new_classes |= dict.fromkeys(pieces, unnamed)
        shapes |= dict.fromkeys(pieces, PIECE)
    kept, labels = relabelled(surface, entities, labelled, instance.astype(np.int32), new_classes)
    carriers = _carriers(scene.vertices, labels, standing, voxel)
    named, labels, reasons = _named(kept, labels, shapes, carriers, votes, vocabulary, things)
    named, labels = _without_fragments(surface, named, labels, standing, things - {unnamed})
    return Agreement(named, labels, layout, {e.instance: reasons[e.instance] for e in named}, tuple(dropped.values()))


def _dropped(
    entities: Sequence[ExtractedEntity],
    labelled: LabelledSurface,
    told: np.ndarray,
    own_told: np.ndarray,
    scene: Scene,
    things: frozenset[int],
    voxel: float,
) -> dict[int, str]:
    """Return the instances that masks alone do not make, each with the reason."""
    size = np.bincount(labelled.instance)
    mean = np.bincount(labelled.instance, weights=told) / np.maximum(size, 1)
    own_mean = np.bincount(labelled.instance, weights=own_told) / np.maximum(size, 1)
    seen = [e for e in entities if e.instance < len(size) and size[e.instance]]
    flush = flush_shares(scene.vertices, scene.normals, labelled.instance, voxel)
    of_things = [e.instance for e in seen if e.class_id in things]
    reasons = doubted(of_things, {k: float(mean[k]) for k in of_things}, flush)
    for entity in seen:
        if entity.class_id not in things and own_mean[entity.instance] < SURE:
            share = own_mean[entity.instance]
            reasons[entity.instance] = f"a window, door or curtain that masks had in few looks: {share:.2f}"
    return reasons


def _leading(said: Said | None, classes: frozenset[int]) -> int:
    """Return the class that was said most, 0 for none."""
    scores = {} if said is None else {c: s for c, s in said.scores.items() if c in classes}
    return min(scores, key=lambda c: (-scores[c], c), default=0)


def _carriers(
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


def _without_fragments(
    surface: Surface,
    entities: Sequence[ExtractedEntity],
    labelled: LabelledSurface,
    standing: frozenset[int],
    named: frozenset[int],
) -> tuple[list[ExtractedEntity], LabelledSurface]:
    """Return entities where pieces with the name of a much larger thing that they touch are a part of it, but for those
    that stand on it."""
    class_of = {e.instance: e.class_id for e in entities if e.class_id in named and e.instance not in standing}
    whole = absorb_pieces(labelled.instance, surface.faces, class_of, share=FRAGMENT)
    return relabelled(surface, entities, labelled, whole.astype(np.int32), {})


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


def _named(
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
            shape = UNHEARD
        reasons[entity.instance] = Reason(shape, said[entity.instance], naming)
        result.append(entity)
    return result, replace(labelled, class_id=class_id), reasons
