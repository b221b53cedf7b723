"""What is left of the masks of a segmenter in a place that is strange to it.

Ours. A network that was taught in generated rooms recognises less of what it takes for things in a real one, and cuts
worse there than geometry does. Where that is so a thing that most views of its surface had is proposed as one, and
geometry says what becomes of it (`unnamed_pieces`); what it is called is asked afterwards (`agreed_names`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scenewright.stages.fuse.extraction import ExtractedEntity, LabelledSurface

LEAST_THING_SCORE = 0.3
"""Score of the masks of things, averaged over all frame segments that were matched to an entity (0 where no mask was),
from which on it is kept as one thing."""
SURE = 0.5
"""Score over which geometry leaves a thing alone: most looks saw a thing."""


def thing_score(
    segments: Sequence[int],
    scores: Mapping[int, Mapping[int, float]],
    things: frozenset[int],
    sightings: Mapping[int, int],
) -> float:
    """Return the score of masks of things per sighting of an entity's segment labels, 0..1.

    `scores`: by segment label and class the sum of scores (ClassScores); `sightings`: frame segments matched to each.
    """
    total = sum(score for label in segments for c, score in scores.get(label, {}).items() if c in things)
    return total / max(1, sum(sightings.get(label, 0) for label in segments))


def sure_things(
    entities: Sequence[ExtractedEntity], score_of: Mapping[int, float], classes: frozenset[int]
) -> frozenset[int]:
    """Return the instances of these classes that most looks took for a thing: no wall takes a screen that hangs flat on
    it, and a rack is not cut at its boards. `score_of` [by instance]: as in `thing_score`."""
    return frozenset(e.instance for e in entities if e.class_id in classes and score_of[e.instance] > SURE)


def share_told(
    labelled: LabelledSurface, scores: Mapping[int, Mapping[int, float]], sightings: Mapping[int, int]
) -> np.ndarray:
    """Return the score (V,), 0..1, that masks of its class gave the surface per sighting of its segment label."""
    pairs, pair_of_vertex = np.unique(np.stack([labelled.segment, labelled.class_id]), axis=1, return_inverse=True)
    pair_scores = [thing_score((int(s),), scores, frozenset({int(c)}), sightings) for s, c in pairs.T]
    return np.asarray(pair_scores, float)[pair_of_vertex.reshape(-1)]


def without_names(
    entities: Sequence[ExtractedEntity],
    labelled: LabelledSurface,
    score_of: Mapping[int, float],
    things: frozenset[int],
    unnamed: int,
) -> tuple[list[ExtractedEntity], LabelledSurface]:
    """Return the entities with class `unnamed` for every thing, and the labels of the surface to match.

    Things whose `score_of` [by instance] is under LEAST_THING_SCORE are left out, and their surface is unlabelled.
    """
    doubtful = {e.instance for e in entities if e.class_id in things and score_of[e.instance] < LEAST_THING_SCORE}
    certain = [e for e in entities if e.instance not in doubtful]
    gone = np.isin(labelled.instance, sorted(doubtful))
    of_things = np.isin(labelled.class_id, sorted(things)) & ~gone
    class_id = np.where(gone, 0, np.where(of_things, unnamed, labelled.class_id)).astype(np.int32)
    instance = np.where(gone, 0, labelled.instance).astype(np.int32)
    nameless = [replace(e, class_id=unnamed) if e.class_id in things else e for e in certain]
    return nameless, LabelledSurface(labelled.segment, class_id, instance)
