"""Which frames are looked at: runs of neighbours (for clocks) and pairs that see one place from two (for poses)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

RUN_LENGTH = 11
"""Neighbouring frames of one run, so that lags up to five frames have pairs."""
RUN_SHARE = 0.6
"""Share of the frames that go into runs."""
PAIR_ANGLE = math.radians(8.0)
"""A pair turns by this where the poses turn; none of the usual pose conventions changes the angle of a turn."""
PAIR_SECONDS, PAIR_FRAMES = 1.0, 30
"""A pair is not farther apart than the nearer of these."""


@dataclass(frozen=True)
class Choice:
    """Indices among the selected frames of one camera."""

    frames: tuple[int, ...]
    runs: tuple[tuple[int, ...], ...]
    """Runs of consecutive frames."""
    pairs: tuple[tuple[int, int], ...]
    """First before second."""


def choose(times: np.ndarray, poses: np.ndarray | None, count: int) -> Choice:
    """Choose at most `count` of the frames at `times` (N,) [s] with `poses` (N, 4, 4), None without.

    The choice depends on nothing but these, so it is the same every time.
    """
    total = len(times)
    if total == 0 or count < 1:
        return Choice((), (), ())
    if total <= count:
        frames = set(range(total))
        runs = tuple(
            tuple(range(start, min(start + RUN_LENGTH, total))) for start in range(0, max(total - 1, 1), RUN_LENGTH)
        )
        anchors = list(range(total - 1))
    else:
        length = min(RUN_LENGTH, count)
        runs = _runs(poses, total, max(1, int(count * RUN_SHARE) // length), length)
        frames = {index for run in runs for index in run}
        anchors_wanted = (count - len(frames)) // 2
        anchors = [int(i) for i in np.unique(np.linspace(0, total - 2, anchors_wanted).astype(int))]
    pairs = {(i, partner(i, times, poses)) for i in anchors}
    if total <= count:
        pairs = set(_thin(sorted(pairs), count))
    for run in runs:
        middle = run[len(run) // 2]
        pairs |= {(run[0], middle), (middle, run[-1]), (run[0], run[-1])}
    pairs = {(i, j) for i, j in pairs if i < j}
    frames |= {index for pair in pairs for index in pair}
    return Choice(tuple(sorted(frames)), runs, tuple(sorted(pairs)))


def partner(first: int, times: np.ndarray, poses: np.ndarray | None) -> int:
    """Return the frame after `first` that has turned far enough from it, or is as far from it as pairs go."""
    last = len(times) - 1
    for index in range(first + 1, last + 1):
        far = index - first >= PAIR_FRAMES or times[index] - times[first] >= PAIR_SECONDS
        if far or index == last:
            return index
        if poses is not None and turn(poses[first], poses[index]) >= PAIR_ANGLE:
            return index
    return first


def turn(first: np.ndarray, second: np.ndarray) -> float:
    """Return the angle [rad] between the rotations of two poses (4, 4)."""
    cosine = (np.trace(first[:3, :3].T @ second[:3, :3]) - 1) / 2
    return float(np.arccos(np.clip(cosine, -1.0, 1.0)))


def _runs(poses: np.ndarray | None, total: int, count: int, length: int) -> tuple[tuple[int, ...], ...]:
    """One run in each of `count` parts of the log, where the camera turns, but not most: there it blurs."""
    bounds = np.linspace(0, total, count + 1).astype(int)
    runs = []
    for low, high in zip(bounds[:-1], bounds[1:], strict=True):
        starts = np.unique(np.linspace(low, max(low, high - length), 41).astype(int))
        starts = starts[starts + length <= total]
        if not len(starts):
            continue
        start = int(starts[len(starts) // 2])
        if poses is not None:
            turns = np.array([turn(poses[s], poses[s + length - 1]) for s in starts])
            start = int(starts[np.argsort(turns, kind="stable")[int(0.8 * (len(starts) - 1))]])
        runs.append(tuple(range(start, start + length)))
    return tuple(runs)


def _thin(pairs: list[tuple[int, int]], count: int) -> list[tuple[int, int]]:
    if len(pairs) <= count:
        return pairs
    return [pairs[i] for i in np.unique(np.linspace(0, len(pairs) - 1, count).astype(int))]
