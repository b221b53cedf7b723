"""Ours: frames that saw two things count as well as those that saw one, and things are a partition at the end."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from copy import deepcopy
from itertools import combinations

from scenewright.stages.fuse.association import Prediction, associate_instances
from scenewright.stages.fuse.class_scores import ClassScores
from scenewright.stages.fuse.counts import TripleCounts
from scenewright.stages.fuse.merging import FrameInstance, Grouping, SharedSegment
from scenewright.stages.fuse.parameters import FuseParameters
from scenewright.stages.fuse.partition import group_things
from scenewright.stages.fuse.regularization import (
    MergedLabels,
    PairEvidence,
    merge_evident_instances,
    merge_instances,
    merge_segments,
    merge_stuff,
    pairs_of_one_class,
)

FIRST_FORGETTING = 4000
"""Segment labels from which on those without a voxel are looked for, each time that their number has doubled."""


class Ours:
    """A `Merging`. Segments merge when they are of one class and more often together than apart; instances also when
    frames saw them as one; every stuff class is one instance; things are grouped when the map is closed."""

    def __init__(
        self, parameters: FuseParameters, things: frozenset[int], bounds: frozenset[int] = frozenset()
    ) -> None:
        self.things = things
        self.bounds = bounds
        self.counts = TripleCounts()
        self.class_scores = ClassScores()
        self.shared = PairEvidence()
        self.segment_evidence = PairEvidence()
        """Segment labels that frames saw in one instance of a thing, or in two."""
        self.instance_evidence = PairEvidence()
        self._parameters = parameters
        self._next_instance = 1
        self._labels_to_forget_at = FIRST_FORGETTING

    def observe_segments(self, segments: Sequence[SharedSegment], matched: Sequence[int]) -> None:
        """Labels of the segment's class speak for their merging; different segments speak against it."""
        groups = [
            pairs_of_one_class(segment.labels, 0 if segment.class_id in self.bounds else segment.class_id, self.counts)
            for segment in segments
        ]
        self.shared.observe(groups, matched)

    def merge_segments(self, labels: MergedLabels) -> list[tuple[int, int]]:
        """Merge what lay together often enough, and less often apart."""
        least = self._parameters.merge_minimum_frames
        merged = merge_segments(self.shared, labels, self.counts, minimum_frames=least, contested=True)
        for removed, kept in merged:
            self.segment_evidence.rename(removed, kept)
            self.class_scores.merge_segments(removed, kept)
        return merged

    def predict(self, predictions: Sequence[Prediction], unpredicted: Sequence[int]) -> dict[FrameInstance, int]:
        """Associate by the triple-wise count; remember what the frame saw as one, and how sure its masks were."""
        for p in predictions:
            self.class_scores.add(p.segment, p.class_id, p.score)
        predictions = [p for p in predictions if p.class_id not in self.bounds]
        self._observe_instances(predictions)
        instances, self._next_instance = associate_instances(predictions, self.counts, self._next_instance)
        for p in predictions:
            self.counts.add(p.segment, p.class_id, instances[p.frame_instance, p.class_id])
        return instances

    def merge_instances(self) -> list[tuple[int, int]]:
        """Merge all of a stuff class, what frames saw as one instance, and by equation 2.5."""
        options = self._parameters
        merged = merge_stuff(self.counts, self.things)
        merged += merge_evident_instances(
            self.instance_evidence, self.counts, minimum_frames=options.instance_minimum_frames
        )
        by_count = merge_instances(
            self.counts, self.things, threshold=options.instance_threshold, minimum_count=options.instance_minimum_count
        )
        for removed, kept in by_count:
            self.instance_evidence.rename(removed, kept)
        return merged + by_count

    def forget_lost(self, sightings: Collection[int], held: Callable[[], set[int]]) -> list[int]:
        """Forget when the labels have doubled.

        No frame can be matched to a label without a voxel again, and a camera that stands still makes some in every
        frame: what is kept would follow the log and not the map.
        """
        if len(sightings) < self._labels_to_forget_at:
            return []
        held_labels = held()
        lost = [label for label in sightings if label not in held_labels]
        for label in lost:
            self.counts.forget(label)
            self.class_scores.forget(label)
            self.shared.forget(label)
            self.segment_evidence.forget(label)
        self._labels_to_forget_at = max(FIRST_FORGETTING, 2 * (len(sightings) - len(lost)))
        return lost

    def grouping(self, seen_in: Mapping[int, int], minimum_votes: int, unnamed: int) -> Grouping:
        """Partition the segments of things by all that frames said of each pair."""
        return group_things(
            self._counts_of_things(),
            self.segment_evidence,
            self.things,
            seen_in,
            minimum_votes,
            scores=self.class_scores.by_segment,
            unnamed=unnamed,
        )

    def _counts_of_things(self) -> TripleCounts:
        """Return the counts without the segments that most masks called a bound of the room."""
        counts = deepcopy(self.counts)
        for label in sorted(self.counts.by_segment):
            row = self.class_scores.by_segment.get(label, {})
            bounding = sum(score for c, score in row.items() if c in self.bounds)
            if 2 * bounding > sum(row.values()):
                counts.forget(label)
        return counts

    def _observe_instances(self, predictions: Sequence[Prediction]) -> None:
        """Count which segments and which instances of things the frame sees as one, and which as two: a frame instance
        stands for the leading instances of the global segments that it lies on."""
        of_things = [p for p in predictions if p.class_id in self.things]
        segments_of: dict[int, set[int]] = {}
        for prediction in of_things:
            segments_of.setdefault(prediction.frame_instance, set()).add(prediction.segment)
        self.segment_evidence.observe(
            [list(combinations(sorted(labels), 2)) for labels in segments_of.values()], {p.segment for p in of_things}
        )
        homes: dict[int, dict[int, set[int]]] = {}
        for prediction in of_things:
            best = self.counts.best(prediction.segment)
            if best is not None and best[0] == prediction.class_id:
                homes.setdefault(best[0], {}).setdefault(prediction.frame_instance, set()).add(best[1])
        for by_instance in homes.values():
            groups = [list(combinations(sorted(labels), 2)) for labels in by_instance.values()]
            self.instance_evidence.observe(groups, set().union(*by_instance.values()))
