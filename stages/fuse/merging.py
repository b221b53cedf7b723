"""What decides which segment labels of the map are one, and which instance they are of. The rules are in stage.py."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from scenewright.stages.fuse.association import Prediction
from scenewright.stages.fuse.counts import ClassInstance, TripleCounts
from scenewright.stages.fuse.regularization import MergedLabels

FrameInstance = tuple[int, int]
"""(o, c): instance within the frame, class."""


@dataclass(frozen=True)
class SharedSegment:
    """A frame segment and the global labels that fill enough of it."""

    class_id: int
    """0: background."""
    labels: Sequence[int]


@dataclass(frozen=True)
class Grouping:
    """Segments with the thing that they are part of."""

    counts: TripleCounts
    """The counts with one instance label for all segments of a thing."""
    best: Mapping[int, ClassInstance]
    """Segment label -> (class, instance) where equation 2.6 has no say; (0, 0): nothing."""
    seen_in: Mapping[int, int]
    """Frames in which each instance was predicted, as bits."""
    class_scores: Mapping[int, Mapping[int, float]] = field(default_factory=dict)
    """By segment label and class the sum of the scores of all masks, where the rule counts them."""


class Merging(Protocol):
    """A rule and all that it remembers of the frames, for one map. Copied whole to close a partial map."""

    @property
    def counts(self) -> TripleCounts:
        """Phi(l, c, p) (eq. 2.4)."""
        ...

    @property
    def things(self) -> frozenset[int]:
        """Class ids of countable objects; all other classes are stuff."""
        ...

    def observe_segments(self, segments: Sequence[SharedSegment], matched: Sequence[int]) -> None:
        """Take in which global labels one frame saw in one segment; `matched`: all labels of the frame."""
        ...

    def merge_segments(self, labels: MergedLabels) -> list[tuple[int, int]]:
        """Merge the segment labels that are one by now, all that was counted for them included; return the (removed,
        kept) pairs in order."""
        ...

    def predict(self, predictions: Sequence[Prediction], unpredicted: Sequence[int]) -> dict[FrameInstance, int]:
        """Return the global instance of every (frame instance, class), and count the predictions (eq. 2.4).

        `unpredicted`: global labels of the frame's segments without a class.
        """
        ...

    def merge_instances(self) -> list[tuple[int, int]]:
        """Merge the instance labels that are one by now; return the (removed, kept) pairs in order."""
        ...

    def forget_lost(self, sightings: Collection[int], held: Callable[[], set[int]]) -> list[int]:
        """Drop what was counted for labels that hold no voxel any more and return them.

        `sightings`: all labels that were ever matched; `held` finds those that hold a voxel, which takes time.
        """
        ...

    def grouping(self, seen_in: Mapping[int, int], minimum_votes: int, unnamed: int) -> Grouping:
        """Return the things of the map. `unnamed`: class of things that masks found and did not recognise."""
        ...
