"""Figures of tasks: pure functions of their records. Intervals over rooms are made of `by_room`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from benchmarks.board.tasks.running import TaskRecord


@dataclass(frozen=True)
class Share:
    """A share that rooms have each for themselves."""

    by_room: dict[str, float]
    """Rooms in which nothing counts are left out."""
    hits: int
    tries: int

    @property
    def value(self) -> float | None:
        """The mean over rooms, which an interval over rooms is of; None without any."""
        return float(np.mean(list(self.by_room.values()))) if self.by_room else None


def task_shares(records: Iterable[TaskRecord]) -> dict[str, Share]:
    """Return `<eyes>/success` of all tasks, `<eyes>/literals`: true literals that hold in the end, and
    `<eyes>/success in the map` of tasks whose things the map has all."""
    kept = list(records)
    shares = {}
    for eyes in sorted({record.eyes for record in kept}):
        own = [record for record in kept if record.eyes == eyes]
        shares[f"{eyes}/success"] = _share(own, lambda record: (record.success,))
        shares[f"{eyes}/literals"] = _share(own, lambda record: record.holds)
        mapped = [record for record in own if not record.lacking and record.failure != "no_scene"]
        shares[f"{eyes}/success in the map"] = _share(mapped, lambda record: (record.success,))
    return shares


def failure_counts(records: Iterable[TaskRecord]) -> dict[str, dict[str, int]]:
    """Return eyes -> kind of failure -> how many tasks it ended, the most frequent first."""
    counts: dict[str, Counter[str]] = {}
    for record in records:
        kinds = counts.setdefault(record.eyes, Counter())
        if record.failure:
            kinds[record.failure] += 1
    return {eyes: dict(sorted(kinds.items(), key=lambda kind: (-kind[1], kind[0]))) for eyes, kinds in counts.items()}


def _share(records: Iterable[TaskRecord], outcomes: Callable[[TaskRecord], tuple[bool, ...]]) -> Share:
    rooms: dict[str, list[bool]] = {}
    for record in records:
        rooms.setdefault(record.room, []).extend(outcomes(record))
    every = [outcome for room in rooms.values() for outcome in room]
    return Share({room: float(np.mean(values)) for room, values in rooms.items() if values}, sum(every), len(every))
