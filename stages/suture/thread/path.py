"""One thread's way through an eye's picture: strands one after the other, gaps bridged along their tangents."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scenewright.stages.suture.thread.strands import Strand

SHORTEST = 6.0
"""Strands of less length [px] are not followed."""
LONGEST_GAP = 110.0
"""Gaps are bridged up to this [px]: a driver's shaft is 40 px thick, seen at a slant."""
FIRST_GAP = 90.0
"""The thread begins within this [px] of where it should."""
GAP_UNIT, HIGHEST_COST = 45.0, 3.2
"""A gap costs its length in this unit [px] and its two turns [rad]; it is bridged up to the highest cost."""
BLUNT = 7.0
"""Length of a gap [px] below which its own direction says nothing; by eye."""
CUT, MARGIN = 4.0, 8.0
"""Extra distance of a beginning in a strand's middle, and distance within which beginnings are alike [px]: of these the
one with the longest thread is taken, in doubt if another one's is longer than RIVAL of it."""
RIVAL = 0.3
"""Length of another way, as a share of the best one's, from which on the start is in doubt; by eye."""
FOLD, FOLD_COST = 40, 1.8
"""A strand whose first so many points lie beside the path's end, or that begins beside the path's last points, may go
on from there: the thread turned back on itself."""
CLEAR = 0.5
"""The next way must cost so much more, or the gap is in doubt."""
DIRECTION_OVER = 14
"""Points of a line's end from which its direction is taken; by eye."""


@dataclass(frozen=True)
class Path:
    """The thread in one eye: `points` (N, 2) [px], whether each was seen (N,) (False: in a bridged gap), the lengths of
    the gaps [px] and how many of them, and how many crossings, are in doubt. `start_gap` [px]: from where the thread
    should begin to where it is first seen (0 if nothing said where); `doubtful_start`: another beginning is as good;
    `left_over` [px]: the length of strands that are not part of it."""

    points: np.ndarray
    seen: np.ndarray
    gaps: tuple[float, ...]
    doubtful_gaps: int
    doubtful_crossings: int
    start_gap: float
    doubtful_start: bool
    left_over: float


def followed(strands: Sequence[Strand], start: np.ndarray | None) -> Path | None:
    """Return the thread's path from `start` (2,) [px] on, or, without one, of the longest strand and what continues it
    on both sides; None where no strand is long enough, or none begins near the start."""
    free = [strand for strand in strands if strand.length >= SHORTEST]
    if not free:
        return None
    if start is None:
        longest = max(range(len(free)), key=lambda index: free[index].length)
        first = free.pop(longest)
        chain, gaps, doubtful = _continue_strand(first, free)
        back, gaps_before, doubtful_before = _continue_strand(chain[0].reversed(), free)
        chain = [strand.reversed() for strand in reversed(back)] + chain[1:]
        return _path(chain, free, gaps_before[::-1] + gaps, doubtful + doubtful_before, 0.0)
    candidates = []
    for first, others, gap in _beginnings(free, np.asarray(start, dtype=float)):
        chain, gaps, doubtful = _continue_strand(first, others)
        candidates.append((sum(strand.length for strand in chain), _path(chain, others, gaps, doubtful, gap)))
    if not candidates:
        return None
    candidates.sort(key=lambda way: -way[0])
    best = candidates[0][1]
    return replace(best, doubtful_start=len(candidates) > 1 and candidates[1][0] > RIVAL * candidates[0][0])


def _path(chain: list[Strand], others: list[Strand], gaps: list[float], doubtful: int, start_gap: float) -> Path:
    """Return the path over the chain's strands with its gaps filled; `others` are the strands that it leaves."""
    points, visible = [chain[0].points], [np.ones(len(chain[0].points), dtype=bool)]
    for strand in chain[1:]:
        bridge = _bridge(points[-1], strand.points)
        points += [bridge, strand.points]
        visible += [np.zeros(len(bridge), dtype=bool), np.ones(len(strand.points), dtype=bool)]
    crossings = sum(len(strand.doubts) for strand in chain)
    left_over = sum(strand.length for strand in others)
    points_and_visible = np.concatenate(points), np.concatenate(visible)
    return Path(*points_and_visible, tuple(gaps), doubtful, crossings, start_gap, False, left_over)


def _beginnings(free: list[Strand], start: np.ndarray) -> list[tuple[Strand, list[Strand], float]]:
    """Return the strands, turned to leave it, that may begin at the start, with the other strands and the gap [px].

    Ends, and strands that pass the start and are cut there, count up to MARGIN farther away than the nearest.
    """
    places = []
    for index, strand in enumerate(free):
        distances = np.linalg.norm(strand.points - start, axis=1)
        middle = int(np.argmin(distances))
        last = len(distances) - 1
        places += [(float(distances[0]), index, 0, 1), (float(distances[last]), index, last, -1)]
        if MARGIN < middle < last - MARGIN:
            places += [(float(distances[middle]) + CUT, index, middle, step) for step in (1, -1)]
    nearest = min(beginning[0] for beginning in places)
    beginnings = []
    for distance, index, cut_index, step in sorted(places):
        if distance > min(nearest + MARGIN, FIRST_GAP):
            break
        strand = free[index]
        if step > 0:
            doubts = tuple(doubt - cut_index for doubt in strand.doubts if doubt >= cut_index)
            first = Strand(strand.points[cut_index:], doubts)
        else:
            first = Strand(strand.points[: cut_index + 1], tuple(d for d in strand.doubts if d <= cut_index)).reversed()
        if first.length >= SHORTEST:
            beginnings.append((first, [other_strand for k, other_strand in enumerate(free) if k != index], distance))
    return beginnings


def _continue_strand(first: Strand, free: list[Strand]) -> tuple[list[Strand], list[float], int]:
    """Return the strand and those that continue it, the gaps between them [px], and how many gaps are in doubt; what is
    used is taken out of `free`."""
    chain, gaps, doubtful = [first], list[float](), 0
    while True:
        ranked = sorted(
            (_joining_cost(chain[-1].points, turned.points), index, side)
            for index, strand in enumerate(free)
            for side, turned in enumerate((strand, strand.reversed()))
        )
        if not ranked or ranked[0][0] > HIGHEST_COST:
            return chain, gaps, doubtful
        cost, index, side = ranked[0]
        if len(ranked) > 1 and ranked[1][0] < min(cost + CLEAR, HIGHEST_COST):
            doubtful += 1
        strand = free.pop(index)
        following = strand.reversed() if side else strand
        gaps.append(float(np.linalg.norm(following.points[0] - chain[-1].points[-1])))
        chain.append(following)


def _heading(points: np.ndarray) -> np.ndarray:
    """Return the unit direction (2,) in which a line (N, 2) ends."""
    part = points[-DIRECTION_OVER:]
    direction = part[-1] - part[0]
    return np.asarray(direction / max(float(np.linalg.norm(direction)), 1e-9))


def _joining_cost(before: np.ndarray, after: np.ndarray) -> float:
    """Return what it costs to go on from one line's end to another's beginning."""
    gap = after[0] - before[-1]
    distance = float(np.linalg.norm(gap))
    if distance > LONGEST_GAP:
        return np.inf
    tail, head = before[-FOLD:], after[:FOLD]
    beside = min(np.linalg.norm(tail - after[0], axis=1).min(), np.linalg.norm(head - before[-1], axis=1).min())
    fold = FOLD_COST + float(beside) / 3.0
    leaving, arriving = _heading(before), -_heading(after[::-1])
    if distance < BLUNT:
        return min(distance / GAP_UNIT + _angle(leaving, arriving), fold)
    along = gap / distance
    return min(distance / GAP_UNIT + _angle(leaving, along) + _angle(along, arriving), fold)


def _angle(leaving: np.ndarray, arriving: np.ndarray) -> float:
    return float(np.arccos(np.clip(leaving @ arriving, -1.0, 1.0)))


def _bridge(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Return points (N, 2) about a pixel apart on the cubic that leaves one line and enters the other along their
    tangents, without its ends."""
    gap = float(np.linalg.norm(after[0] - before[-1]))
    count = round(gap)
    share = np.linspace(0.0, 1.0, count + 2)[1:-1, None]
    leaving, arriving = gap * _heading(before), -gap * _heading(after[::-1])
    return np.asarray(
        (2 * share**3 - 3 * share**2 + 1) * before[-1]
        + (share**3 - 2 * share**2 + share) * leaving
        + (3 * share**2 - 2 * share**3) * after[0]
        + (share**3 - share**2) * arriving
    )
