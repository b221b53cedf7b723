"""The thesis's rule: what lies in one frame segment is one segment, and equation 2.5 decides on instances."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from itertools import combinations

from scenewright.stages.fuse.association import Prediction, associate_instances
from scenewright.stages.fuse.counts import TripleCounts
from scenewright.stages.fuse.merging import FrameInstance, Grouping, SharedSegment
from scenewright.stages.fuse.parameters import FuseParameters
from scenewright.stages.fuse.regularization import MergedLabels, PairEvidence, merge_instances, merge_segments


class Thesis:
    """A `Merging` (Han 2024, sections 2.3.2 and 2.3.3). Whoever corrects something does it in ours.py."""

    def __init__(self, parameters: FuseParameters, things: frozenset[int]) -> None:
        self.things = things
        self.counts = TripleCounts()
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
        """Associate by the triple-wise count."""
        instances, self._next_instance = associate_instances(predictions, self.counts, self._next_instance)
        for p in predictions:
            self.counts.add(p.segment, p.class_id, instances[p.frame_instance, p.class_id])
        return instances

    def merge_instances(self) -> list[tuple[int, int]]:
        """Equation 2.5."""
        options = self._parameters
        return merge_instances(
            self.counts, self.things, threshold=options.instance_threshold, minimum_count=options.instance_minimum_count
        )

    def forget_lost(self, sightings: Collection[int], held: Callable[[], set[int]]) -> list[int]:
        """Everything is kept."""
        return []

    def grouping(self, seen_in: Mapping[int, int], minimum_votes: int, unnamed: int) -> Grouping:
        """Equation 2.6 says it all."""
        return Grouping(self.counts, {}, seen_in)
