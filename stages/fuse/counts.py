"""The triple-wise count Phi(l, c, p) over segment label, semantic class and instance label (Han 2024, eq. 2.4)."""

from __future__ import annotations

from collections.abc import Hashable

import numpy as np

ClassInstance = tuple[int, int]
"""(c, p)"""


class TripleCounts:
    """Sparse counts: only triples that were seen are held. `by_segment[l][(c, p)]` is Phi(l, c, p) > 0; to be read, and
    changed by the methods alone.

    Which segments an instance was counted on, and what was counted since somebody last looked, is kept beside, so that
    a frame costs what it sees, not what the map holds.
    """

    def __init__(self) -> None:
        self.by_segment: dict[int, dict[ClassInstance, int]] = {}
        self._segments: dict[ClassInstance, set[int]] = {}
        self._totals: dict[ClassInstance, int] = {}
        self._classes: dict[int, set[int]] = {}
        self._instances: dict[int, set[int]] = {}
        self._changed: set[int] = set()
        self._rule: Hashable = None

    def add(self, segment: int, class_id: int, instance: int, amount: int = 1) -> None:
        """Increase Phi(segment, class_id, instance) (eq. 2.4)."""
        key = (class_id, instance)
        row = self.by_segment.setdefault(segment, {})
        row[key] = row.get(key, 0) + amount
        self._segments.setdefault(key, set()).add(segment)
        self._totals[key] = self._totals.get(key, 0) + amount
        self._classes.setdefault(instance, set()).add(class_id)
        self._instances.setdefault(class_id, set()).add(instance)
        self._changed.add(segment)

    def total(self, class_id: int, instance: int) -> int:
        """Return the sum of Phi(l, class_id, instance) over all segment labels l."""
        return self._totals.get((class_id, instance), 0)

    def segments(self, class_id: int, instance: int) -> frozenset[int] | set[int]:
        """Return the segment labels on which an instance was counted with a class; not to be changed."""
        return self._segments.get((class_id, instance), frozenset())

    def instances_of(self) -> dict[int, set[int]]:
        """Return {c: instance labels that were counted with class c anywhere}; not to be changed."""
        return self._instances

    def take_changed(self, rule: Hashable) -> set[int]:
        """Return the segment labels whose counts changed since this was last called with the same rule, all of them
        when the rule is another one: what the rule did not find before, it can find there alone."""
        changed = self._changed if rule == self._rule else set(self.by_segment)
        self._changed, self._rule = set(), rule
        return changed

    def instances(self, segment: int, class_id: int) -> dict[int, int]:
        """Return {p: Phi(segment, class_id, p)} of the positive counts."""
        row = self.by_segment.get(segment, {})
        return {instance: count for (row_class, instance), count in row.items() if row_class == class_id}

    def merge_segments(self, removed: int, kept: int) -> None:
        """Move all counts of segment label `removed` to `kept`."""
        for (class_id, instance), count in self.by_segment.pop(removed, {}).items():
            self._segments[class_id, instance].discard(removed)
            self._totals[class_id, instance] -= count
            self.add(kept, class_id, instance, count)

    def merge_instances(self, removed: int, kept: int) -> None:
        """Move all counts of instance label `removed` to `kept`, on every segment."""
        for class_id in sorted(self._classes.pop(removed, ())):
            key = (class_id, removed)
            for segment in sorted(self._segments.pop(key)):
                self.add(segment, class_id, kept, self.by_segment[segment].pop(key))
            del self._totals[key]
            self._instances[class_id].discard(removed)

    def forget(self, segment: int) -> None:
        """Drop all counts of a segment label."""
        for key, count in self.by_segment.pop(segment, {}).items():
            class_id, instance = key
            self._segments[key].discard(segment)
            self._totals[key] -= count
            if not self._segments[key]:
                del self._segments[key], self._totals[key]
                self._classes[instance].discard(class_id)
                self._instances[class_id].discard(instance)
        self._changed.discard(segment)

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
