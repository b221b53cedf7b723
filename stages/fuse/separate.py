"""Classes and instances tracked apart, as in Voxblox++ (Grinvald 2019) and the thesis's "w/o joint fusion" (2.5.2)."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from itertools import combinations

from scenewright.stages.fuse.association import Prediction
from scenewright.stages.fuse.counts import TripleCounts
from scenewright.stages.fuse.merging import FrameInstance, Grouping, SharedSegment
from scenewright.stages.fuse.parameters import FuseParameters
from scenewright.stages.fuse.regularization import MergedLabels, PairEvidence, merge_segments


class SeparateCounts(TripleCounts):
    """The two pairwise counts, label with class and label with instance: the sums of the triple-wise count over the
    other index. An instance may then win on a segment whose class was predicted with another instance."""

    def instances(self, segment: int, class_id: int) -> dict[int, int]:
        """Return {p: count} of a segment label, whatever class was predicted with it; `class_id` has no say."""
        result: dict[int, int] = {}
        for (_, instance), count in self.by_segment.get(segment, {}).items():
            result[instance] = result.get(instance, 0) + count
        return result


class Separate:
    """A `Merging`: segments merge as in the thesis, instances never do."""

    def __init__(self, parameters: FuseParameters, things: frozenset[int]) -> None:
        self.things = things
        self.counts = SeparateCounts()
        self.shared = PairEvidence()
        self._parameters = parameters
        self._next_instance = 1

    def observe_segments(self, segments: Sequence[SharedSegment], matched: Sequence[int]) -> None:
        """All labels that share a segment speak for their merging, and nothing against it."""
        self.shared.observe((combinations(sorted(segment.labels), 2) for segment in segments), ())

    def merge_segments(self, labels: MergedLabels) -> list[tuple[int, int]]:
        """Merge what lay together often enough."""
        least = self._parameters.merge_minimum_frames
        return merge_segments(self.shared, labels, self.counts, minimum_frames=least, contested=False)

    def predict(self, predictions: Sequence[Prediction], unpredicted: Sequence[int]) -> dict[FrameInstance, int]:
        """Associate by the instances alone."""
        instances, self._next_instance = associate_separately(
            predictions, unpredicted, self.counts, self._next_instance
        )
        for p in predictions:
            self.counts.add(p.segment, p.class_id, instances[p.frame_instance, p.class_id])
        return instances

    def merge_instances(self) -> list[tuple[int, int]]:
        """Nothing is merged."""
        return []

    def forget_lost(self, sightings: Collection[int], held: Callable[[], set[int]]) -> list[int]:
        """Everything is kept."""
        return []

    def grouping(self, seen_in: Mapping[int, int], minimum_votes: int, unnamed: int) -> Grouping:
        """The counts say it all."""
        return Grouping(self.counts, {}, seen_in)


def associate_separately(
    predictions: Sequence[Prediction], unpredicted: Sequence[int], counts: SeparateCounts, next_instance: int
) -> tuple[dict[tuple[int, int], int], int]:
    """Return {(frame instance, class): global instance} and the next unused global instance label.

    The rule of Voxblox++: the first segment of a frame instance decides for all of them, by the instance that was
    counted most on its label and that no other frame instance has; without one a new label is made. An instance that
    leads on a segment without a prediction in this frame (`unpredicted`, global labels) is taken too.
    """
    used: set[int] = set()
    for label in unpredicted:
        counted = counts.instances(label, 0)
        if counted:
            used.add(min(counted, key=lambda p: (-counted[p], p)))
    result: dict[tuple[int, int], int] = {}
    for prediction in predictions:
        key = (prediction.frame_instance, prediction.class_id)
        if key in result:
            continue
        free = {p: n for p, n in counts.instances(prediction.segment, 0).items() if p not in used}
        if free:
            result[key] = min(free, key=lambda p: (-free[p], p))
            used.add(result[key])
        else:
            result[key] = next_instance
            next_instance += 1
    return result, next_instance
