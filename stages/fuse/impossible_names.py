"""Names that a thing cannot have: a mask may be cut off by its picture, the map shows how large the thing is.

Ours. A detector that boxed a corner of a keyboard as a chair, or took a wall with a radiator for a plant, is corrected
by a metre rule, unless most of the frames that saw the thing say the same: then the thing is an unusual one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from schemas.vocabulary import Vocabulary
from stages.fuse.extraction import ExtractedEntity, LabelledSurface
from stages.fuse.strange_places import thing_score
from stages.kit.class_extents import extent_of, is_plausible

BELIEVED = 0.5
"""Score of the masks of a name, averaged over all frame segments that were matched to the thing (0 where no mask was),
from which on it is believed whatever the size."""


def without_impossible_names(
    entities: Sequence[ExtractedEntity],
    labelled: LabelledSurface,
    scores: Mapping[int, Mapping[int, float]],
    sightings: Mapping[int, int],
    vocabulary: Vocabulary,
    unnamed: int,
) -> tuple[list[ExtractedEntity], LabelledSurface]:
    """Return entities and labels with class `unnamed` for doubtful things that are too small or too large for theirs.

    `scores`, `sightings`: as in `strange_places.thing_score`.
    """
    result, class_id = [], labelled.class_id.copy()
    for entity in entities:
        doubted = thing_score(entity.segments, scores, frozenset({entity.class_id}), sightings) < BELIEVED
        name = vocabulary.by_id(entity.class_id).name
        if doubted and not is_plausible(name, extent_of(np.asarray(entity.mesh.vertices)), cut_off=False):
            class_id[labelled.instance == entity.instance] = unnamed
            entity = replace(entity, class_id=unnamed)
        result.append(entity)
    return result, replace(labelled, class_id=class_id)
