"""The triple-wise count Phi(l, c, p) over segment label, semantic class and instance label (Han 2024, eq. 2.4)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass
class TripleCounts:
    """Sparse counts: only triples that were seen are held. `by_segment[l][(c, p)]` is Phi(l, c, p) > 0."""

    by_segment: dict[int, dict[tuple[int, int], int]] = field(default_factory=dict)

    def add(self, segment: int, class_id: int, instance: int, amount: int = 1) -> None:
        """Increase Phi(segment, class_id, instance) (eq. 2.4)."""
        row = self.by_segment.setdefault(segment, {})
        row[(class_id, instance)] = row.get((class_id, instance), 0) + amount

    def instances(self, segment: int, class_id: int) -> dict[int, int]:
        """Return {p: Phi(segment, class_id, p)} of the positive counts."""
        row = self.by_segment.get(segment, {})
        return {instance: count for (other, instance), count in row.items() if other == class_id}

    def merge_segments(self, removed: int, kept: int) -> None:
        """Move all counts of segment label `removed` to `kept`."""
        for (class_id, instance), count in self.by_segment.pop(removed, {}).items():
            self.add(kept, class_id, instance, count)

    def merge_instances(self, removed: int, kept: int) -> None:
        """Move all counts of instance label `removed` to `kept`, on every segment."""
        for row in self.by_segment.values():
            for class_id, instance in [key for key in row if key[1] == removed]:
                count = row.pop((class_id, instance))
                row[(class_id, kept)] = row.get((class_id, kept), 0) + count

    def best(self, segment: int) -> tuple[int, int] | None:
        """Return (c, p) of a segment label, or None when nothing was counted (eq. 2.6).

        First the class with the largest count over all instances, then the instance with the largest count within that
        class; ties go to the smaller number.
        """
        row = self.by_segment.get(segment)
        if not row:
            return None
        per_class: dict[int, int] = {}
        for (class_id, _), count in row.items():
            per_class[class_id] = per_class.get(class_id, 0) + count
        class_id = min(per_class, key=lambda c: (-per_class[c], c))
        inside = self.instances(segment, class_id)
        return class_id, min(inside, key=lambda p: (-inside[p], p))

    def as_arrays(self) -> dict[str, np.ndarray]:
        """Return `segment`, `class_id`, `instance` (K,) int32 and `count` (K,) int64, sorted by the triple."""
        rows = sorted(
            (segment, class_id, instance, count)
            for segment, row in self.by_segment.items()
            for (class_id, instance), count in row.items()
        )
        table = np.array(rows, dtype=np.int64).reshape(-1, 4)
        names = ("segment", "class_id", "instance")
        return {name: table[:, k].astype(np.int32) for k, name in enumerate(names)} | {"count": table[:, 3]}
