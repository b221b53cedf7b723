"""How sure the masks were of the class of every segment, summed over frames."""

from __future__ import annotations


class ClassScores:
    """Sums of mask scores by segment label and class: `by_segment[l][c]`. Beside the counts, which take every mask for
    as good as every other: ours lets a mask that is hardly sure of its class say less about it."""

    def __init__(self) -> None:
        self.by_segment: dict[int, dict[int, float]] = {}

    def add(self, segment: int, class_id: int, score: float) -> None:
        """Add what one frame says of a segment label."""
        row = self.by_segment.setdefault(segment, {})
        row[class_id] = row.get(class_id, 0.0) + score

    def forget(self, segment: int) -> None:
        """Drop all sums of a segment label."""
        self.by_segment.pop(segment, None)

    def merge_segments(self, removed: int, kept: int) -> None:
        """Move all sums of segment label `removed` to `kept`."""
        for class_id, score in self.by_segment.pop(removed, {}).items():
            self.add(kept, class_id, score)
