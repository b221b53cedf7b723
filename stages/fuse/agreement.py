"""Masks and geometry agree on the entities of a map: geometry lays out the room, masks testify, names come last.

Ours. Each decision leaves its reason with the entity (schemas/panoptic_map.py, `Because`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scenewright.schemas.vocabulary import UNNAMED, Vocabulary
from scenewright.stages.fuse.belief import AS_SURE, doubted, flush_shares, usual_score
from scenewright.stages.fuse.extraction import ExtractedEntity, LabelledSurface
from scenewright.stages.fuse.feet import feet_of
from scenewright.stages.fuse.joining import joined, root, wholes
from scenewright.stages.fuse.layout.evidence import Scene
from scenewright.stages.fuse.layout.room import CEILING, FLOOR, WALL, Layout, find_layout
from scenewright.stages.fuse.looks import Looks
from scenewright.stages.fuse.pieces import Cloud, grown_things, pieces_beside
from scenewright.stages.fuse.relabelling import relabelled
from scenewright.stages.fuse.surface import Surface
from scenewright.stages.fuse.testimony import BOUND, FOOTED, GROWN, JOINED, PIECE, Reason, with_names
from scenewright.stages.fuse.votes import Votes

MOST = 0.5
"""Share of looks from which on masks make a window, door or curtain, and have surface for sure."""


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
    looks: Looks,
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
    seen = [e for e in entities if (labelled.instance == e.instance).any()]
    flush = flush_shares(scene.vertices, scene.normals, labelled.instance, voxel)
    mean, own_mean = (_mean_by(labelled.instance, share) for share in (told, own_told))
    of_things = [e.instance for e in seen if e.class_id in things]
    usual = usual_score(of_things, mean, flush)
    dropped = doubted(of_things, mean, flush, usual)
    few = {e.instance: own_mean[e.instance] for e in seen if e.class_id not in things and own_mean[e.instance] < MOST}
    dropped |= {k: f"a window, door or curtain that masks had in few looks: {share:.2f}" for k, share in few.items()}
    instance = np.where(np.isin(labelled.instance, sorted(dropped)), 0, labelled.instance)

    is_thing = np.isin(labelled.class_id, sorted(things)) & (instance > 0)
    # A screen that hangs flat on a wall is kept by most looks, or by masks as sure of it as of what stands free.
    bounded = (layout.owner > 0) & ((instance == 0) | (is_thing & (told < min(MOST, AS_SURE * usual))))
    first = 1 + max([int(labelled.instance.max(initial=0)), *(e.instance for e in entities)])
    bounds = {first + k: kind for k, kind in enumerate((FLOOR, WALL, CEILING))}
    for number, kind in bounds.items():
        instance = np.where(bounded & layout.of(kind), number, instance)
    new_classes = {number: vocabulary.by_name(kind).id for number, kind in bounds.items()}

    shapes = dict.fromkeys(bounds, BOUND)
    if minimum_area > 0:
        stuff = (instance > 0) & ~(is_thing & ~bounded)
        things_of = np.where(stuff, 0, instance)
        cloud = Cloud(scene.vertices - [0.0, 0.0, layout.floor or 0.0], scene.normals, voxel)
        whole_already = np.flatnonzero(_mean_by(things_of, own_told) >= MOST)
        grown = grown_things(cloud, things_of, stuff, frozenset(whole_already.tolist()), minimum_area)
        of_thing = np.where(grown != things_of, 1.0, own_told)
        found = pieces_beside(cloud, grown, stuff, of_thing, minimum_area)
        shapes |= dict.fromkeys(np.unique(grown[grown != things_of]).tolist(), GROWN)
        start = first + len(bounds) - 1
        instance = np.where(stuff, instance, np.where(found.piece > 0, start + found.piece, found.thing_of))
        pieces = range(start + 1, start + 1 + int(found.piece.max(initial=0)))
        new_classes |= dict.fromkeys(pieces, unnamed)
        shapes |= dict.fromkeys(pieces, PIECE)
    kept, labels = relabelled(surface, entities, labelled, instance.astype(np.int32), new_classes)
    points = looks.on(scene.vertices, labels.instance)
    may_join = frozenset(entity.instance for entity in kept if entity.class_id in things)
    home = joined(scene, labels.instance, may_join, points, voxel)
    nameless = frozenset(entity.instance for entity in kept if entity.class_id == unnamed)
    wall = next(number for number, kind in bounds.items() if kind == WALL)
    feet = feet_of(scene, wholes(labels.instance, home)[labels.instance], may_join, nameless, wall, voxel)
    home |= feet
    parts = {k: root(home, k) for k in home}
    if parts:
        whole = wholes(labels.instance, parts)
        kept, labels = relabelled(surface, kept, labels, whole[labels.instance], {})
        points = [(mask, whole[thing]) for mask, thing in points]
        shapes |= dict.fromkeys(parts.values(), JOINED) | {parts[foot]: FOOTED for foot in feet}
    named, labels, reasons = with_names(kept, labels, shapes, looks.said_of(points), vocabulary, things)
    return Agreement(named, labels, layout, reasons, tuple(dropped.values()))


def _mean_by(instance: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Return by instance (I + 1,) the mean of what vertices (V,) have; 0 of none."""
    return np.asarray(np.bincount(instance, weights=share) / np.maximum(np.bincount(instance), 1))
