"""Names for pieces that geometry has cut, where most of what was said of their surface is one of them.

Ours. A cup that a mask took for a part of the desk, and whatever is in a place that a network was not taught in, is cut
better by geometry than by masks, but what most looks at a piece call it is mostly right.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scenewright.schemas.vocabulary import Vocabulary
from scenewright.stages.fuse.extraction import ExtractedEntity, LabelledSurface
from scenewright.stages.kit.class_extents import extent_of, is_plausible

MOST = 0.5
"""Share of what was said of a piece that its name has more than."""


def with_agreed_names(
    entities: Sequence[ExtractedEntity],
    labelled: LabelledSurface,
    scores: Mapping[int, Mapping[int, float]],
    sightings: Mapping[int, int],
    vocabulary: Vocabulary,
    unnamed: int,
    minimum_share: float,
) -> tuple[list[ExtractedEntity], LabelledSurface]:
    """Return entities and labels in which things of the class `unnamed` have the name that has MOST of the scores of
    their masks, those that named nothing included, and at least `minimum_share` a look, if a thing of their extent can
    have it.

    `scores`, `sightings`: as in `strange_places.thing_score`.
    """
    result, class_id = [], labelled.class_id.copy()
    for entity in entities:
        of_entity = labelled.instance == entity.instance
        if entity.class_id == unnamed and of_entity.any():
            class_scores = said_of(labelled.segment[of_entity], scores, sightings)
            things = {c: score for c, score in class_scores.items() if vocabulary.by_id(c).kind == "thing"}
            name = max(things, key=lambda c: (things[c], -c), default=unnamed)
            agreed = things.get(name, 0.0) > max(minimum_share, MOST * sum(things.values()))
            extent = extent_of(np.asarray(entity.mesh.vertices))
            if agreed and is_plausible(vocabulary.by_id(name).name, extent, cut_off=False):
                class_id[of_entity] = name
                entity = replace(entity, class_id=name)
        result.append(entity)
    return result, replace(labelled, class_id=class_id)


def without_claimed(
    scores: Mapping[int, Mapping[int, float]], entities: Sequence[ExtractedEntity]
) -> dict[int, Mapping[int, float]]:
    """Return the scores of the segment labels that no entity has: what masks said of the others they said of that
    entity, and not of what geometry cut from it or of what lies apart from it."""
    claimed = {label for entity in entities for label in entity.segments}
    return {label: row for label, row in scores.items() if label not in claimed}


def said_of(
    segments: np.ndarray, scores: Mapping[int, Mapping[int, float]], sightings: Mapping[int, int]
) -> dict[int, float]:
    """Return by class the score, 0..1, that its masks gave surface of these segment labels (N,) a look."""
    class_scores: dict[int, float] = {}
    labels, counts = np.unique(segments, return_counts=True)
    for label, count in zip(labels.tolist(), counts.tolist(), strict=True):
        for c, score in scores.get(label, {}).items():
            class_scores[c] = class_scores.get(c, 0.0) + count / len(segments) * score / max(1, sightings.get(label, 0))
    return class_scores
