"""One map against one truth, by counts: large things, names, and things whatever they are called."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.schemas.vocabulary import UNNAMED
from scenewright.stages.evaluate import PredictedMap, TrueRoom, nearest_labels

from benchmarks.board.real.things import false_things, is_layout, overlaps_of, partners, true_things
from benchmarks.graph_scores import OPTIONS

LARGE = frozenset({"table", "chair", "sofa", "monitor", "plant", "cabinet", "wall_cabinet"})
"""Classes whose things are furniture: by class and not by size, as boxes are rough."""


@dataclass(frozen=True)
class Judged:
    """What a truth says of a map."""

    large: int
    """True things of LARGE that were seen."""
    found: int
    """Those that one entity is, in one piece."""
    named: int
    """Found, and of the right class."""
    names: int
    """Entities with a name, with most of their surface where the truth says what is there."""
    false_names: int
    """Of those: on a thing of another class, or on one that another entity is."""
    things: int
    matched: int
    false: int
    """Entities where the truth knows what is there, that are no true thing or a further piece of one."""
    overlap: float
    """Sum of the IoU of the matched."""

    @property
    def quality(self) -> float:
        """Panoptic quality (Kirillov 2019), whatever the class, of what is no layout; 0 without any thing."""
        weight = self.matched + (self.things - self.matched + self.false) / 2
        return self.overlap / weight if weight else 0.0


def judge_map(truth: TrueRoom, predicted: PredictedMap) -> Judged:
    """Hold a map against a truth of the same world."""
    classes = predicted.classes()
    overlaps = overlaps_of(truth, predicted)
    found = partners(truth, overlaps, classes)
    things = true_things(truth)
    large = [thing for thing in things if thing.class_name in LARGE]
    here = [thing for thing in large if thing.instance in found]
    names, wrong = judged_names(truth, predicted, overlaps)
    return Judged(
        large=len(large),
        found=len(here),
        named=sum(classes[found[thing.instance]] == thing.class_name for thing in here),
        names=names,
        false_names=wrong,
        things=len(things),
        matched=len(found),
        false=len(false_things(truth, predicted, found.values())),
        overlap=sum(overlaps[pair] for pair in found.items()),
    )


def judged_names(truth: TrueRoom, predicted: PredictedMap, overlaps: dict[tuple[int, int], float]) -> tuple[int, int]:
    """Return how many entities have a name that can be judged, and how many of those names are false.

    A name is right on the entity that is most alike to the thing on which most of it lies, and on any entity on a thing
    that counts neither way. overlaps: IoU of (true instance, entity).
    """
    owner = nearest_labels(
        predicted.surface.vertices, truth.points, truth.instances, maximum_distance=OPTIONS.label_distance
    )
    alike = {true: entity for (true, entity), _ in sorted(overlaps.items(), key=lambda pair: pair[1])}
    true, names, wrong = truth.by_instance(), 0, 0
    for entity, name in predicted.classes().items():
        own = owner[predicted.vertex_instances == entity]
        told = own[own != 0]
        if name == UNNAMED or is_layout(name) or not len(own) or 2 * len(told) < len(own):
            continue
        values, counts = np.unique(told, return_counts=True)
        most = int(values[counts.argmax()])
        names += 1
        is_it = most in truth.optional or alike.get(most) == entity
        wrong += not (true[most].class_name == name and is_it)
    return names, wrong
