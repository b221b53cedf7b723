"""What is left of the masks of a segmenter in a place that is strange to it.

Ours. A network that was taught in generated rooms recognises little of what it takes for things in a real one. Where
that is so, a thing has to have been one in most views of its surface, and its name has to be agreed on by them:
elsewhere geometry cuts things as well as it can, and what is one thing without a name is an `object`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from stages.fuse.extraction import ExtractedEntity, LabelledSurface

LEAST_THING_SCORE = 0.3
"""Score of the masks of things, averaged over all frame segments that were matched to an entity (0 where no mask was),
from which on it is kept as one thing."""


LEAST_NAME_SCORE = 0.3
"""Score of the masks of a class, averaged likewise, from which on a thing keeps its name: of masks with that score four
in five have the right one in generated rooms that were held back."""


def thing_score(
    segments: Sequence[int],
    scores: Mapping[int, Mapping[int, float]],
    classes: frozenset[int],
    sightings: Mapping[int, int],
) -> float:
    """Return the score of masks of these classes per sighting of an entity's segment labels, 0..1.

    `scores`: by segment label and class the sum of scores (ClassScores); `sightings`: frame segments matched to each.
    """
    total = sum(score for label in segments for c, score in scores.get(label, {}).items() if c in classes)
    return total / max(1, sum(sightings.get(label, 0) for label in segments))


def without_doubtful(
    entities: Sequence[ExtractedEntity],
    labelled: LabelledSurface,
    scores: Mapping[int, Mapping[int, float]],
    sightings: Mapping[int, int],
    things: frozenset[int],
    unnamed: int,
) -> tuple[list[ExtractedEntity], LabelledSurface]:
    """Return the entities without what too few views agree on, and the labels of the surface to match.

    Things whose masks score under LEAST_THING_SCORE are left out, and their surface is unlabelled; those whose class
    scores under LEAST_NAME_SCORE have the class `unnamed`.
    """
    kept: list[ExtractedEntity] = []
    new_class: dict[int, int] = {}
    for entity in entities:
        if entity.class_id in things:
            if thing_score(entity.segments, scores, things, sightings) < LEAST_THING_SCORE:
                new_class[entity.instance] = 0
                continue
            if thing_score(entity.segments, scores, frozenset({entity.class_id}), sightings) < LEAST_NAME_SCORE:
                new_class[entity.instance] = unnamed
                entity = replace(entity, class_id=unnamed)
        kept.append(entity)
    class_id, instance = labelled.class_id.copy(), labelled.instance.copy()
    for number, found in new_class.items():
        own = labelled.instance == number
        class_id[own] = found
        instance[own] = number if found else 0
    return kept, LabelledSurface(labelled.segment, class_id, instance)
