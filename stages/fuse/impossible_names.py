"""Names that a thing cannot have: a mask may be cut off by its picture, the map shows how large the thing is.

Ours. A detector that boxed a corner of a keyboard as a chair, or took a wall with a radiator for a plant, is corrected
by a metre rule. Where most of the frames that saw the thing say the same it gives way: the thing may be an unusually
large one, or part of one. Else it has the name that comes next, if enough of its masks said so.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scenewright.schemas.vocabulary import Vocabulary
from scenewright.stages.fuse.extraction import ExtractedEntity, LabelledSurface
from scenewright.stages.fuse.partition import NAMED_SHARE
from scenewright.stages.kit.class_extents import extent_of, is_plausible

BELIEVED = 0.5
"""Score of the masks of a name, averaged over all frame segments that were matched to the thing (0 where no mask was),
from which on no thing is too small for it, and one is too large from UNUSUAL times the usual limit on."""
UNUSUAL = 1.5
"""Set on four generated rooms; no name of the real kitchen, office and living room depends on it."""


def without_impossible_names(
    entities: Sequence[ExtractedEntity],
    labelled: LabelledSurface,
    scores: Mapping[int, Mapping[int, float]],
    sightings: Mapping[int, int],
    vocabulary: Vocabulary,
    unnamed: int,
) -> tuple[list[ExtractedEntity], LabelledSurface]:
    """Return entities and labels in which things that are too small or too large for their class have the next one of
    their masks that they can be of, or class `unnamed`.

    `scores`, `sightings`: as in `strange_places.thing_score`.
    """
    result, class_id = [], labelled.class_id.copy()
    for entity in entities:
        class_scores: Counter[int] = Counter()
        for label in entity.segments:
            class_scores.update(scores.get(label, {}))
        sighting_count = max(1, sum(sightings.get(label, 0) for label in entity.segments))
        extent = extent_of(np.asarray(entity.mesh.vertices))
        if not _possible(entity.class_id, extent, class_scores[entity.class_id] / sighting_count, vocabulary):
            class_id[labelled.instance == entity.instance] = new = _next_name(
                class_scores, extent, sighting_count, vocabulary, unnamed
            )
            entity = replace(entity, class_id=new)
        result.append(entity)
    return result, replace(labelled, class_id=class_id)


def _possible(class_id: int, extent: float, score: float, vocabulary: Vocabulary) -> bool:
    """Whether a thing of this extent [m] can be of the class that its masks named with this score."""
    believed = score >= BELIEVED
    return is_plausible(vocabulary.by_id(class_id).name, extent / (UNUSUAL if believed else 1.0), cut_off=believed)


def _next_name(
    class_scores: Counter[int], extent: float, sighting_count: int, vocabulary: Vocabulary, unnamed: int
) -> int:
    """Return the class with the largest score of those that a thing of this extent [m] can be of, if it has NAMED_SHARE
    of what its masks said of things; else `unnamed`."""
    things = {c: s for c, s in class_scores.items() if c != unnamed and vocabulary.by_id(c).kind == "thing"}
    possible = [c for c, score in things.items() if _possible(c, extent, score / sighting_count, vocabulary)]
    best = min(possible, key=lambda c: (-things[c], c), default=unnamed)
    return best if things.get(best, 0.0) >= NAMED_SHARE * sum(things.values()) else unnamed
