"""Stretches joined across crossings: a thread goes straight on.

Crossings that lie close together are one. Its branches are paired so that the turns from one to the other are smallest
together; a branch that no other continues ends there. Where two threads lie on each other for a while the skeleton has
one stretch between two forks: both threads run through it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scenewright.stages.suture.thread.skeleton import Stretch

NEAR = 9.0
"""Crossings joined by a stretch shorter than this [px] are one crossing."""
LONGEST_SHARED = 60.0
"""Two threads lie on each other over this [px] at most."""
REACH = 12
"""Pixels of a branch from which its direction is taken, beyond SKIPPED ones: thinning bends lines at crossings."""
SKIPPED = 3
"""Pixels next to a crossing that say nothing of a branch's direction; by eye."""
LARGEST_TURN = np.radians(80.0)
"""Turn at a crossing beyond which two branches are not one thread [rad]; by eye."""
CLOSE = np.radians(14.0)
"""A pairing is in doubt if another one's turns sum up to less than this more."""
MOST_BRANCHES = 8
"""Branches of a crossing of which all pairs are tried; of more, pairs are taken one after the other, the straightest
first."""

End = tuple[int, int]
"""A stretch's number and which of its ends: 0 or 1."""


@dataclass(frozen=True)
class Strand:
    """A line of thread across crossings: `points` (N, 2) [px] (column, row), and the doubtful crossings on it as
    indices into the points."""

    points: np.ndarray
    doubts: tuple[int, ...]

    @property
    def length(self) -> float:
        """Length along the line [px]."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())

    def reversed(self) -> Strand:
        """Return the same line the other way."""
        return Strand(self.points[::-1], tuple(len(self.points) - 1 - doubt for doubt in self.doubts))


def outward(points: np.ndarray, end: int) -> np.ndarray:
    """Return the unit direction (2,) in which a line (N, 2) goes from its end 0 or 1 into itself."""
    line = points if end == 0 else points[::-1]
    skipped = min(SKIPPED, max(len(line) - 4, 0))
    part = line[skipped : skipped + REACH]
    direction = part[-1] - part[0] if len(part) > 1 else np.zeros(2)
    size = float(np.linalg.norm(direction))
    return direction / size if size > 0 else direction


def strands(stretches: list[Stretch]) -> list[Strand]:
    """Return the strands that the stretches make, the longest first."""
    crossing, inner = _crossings(stretches)
    shared = _find_shared(stretches, crossing, inner)
    branches: dict[int, list[End]] = {}
    for index, stretch in enumerate(stretches):
        if index in inner or index in shared:
            continue
        for end, node in enumerate((stretch.first, stretch.last)):
            if node >= 0:
                branches.setdefault(crossing[node], []).append((index, end))
    onward: dict[End, tuple[End, bool, np.ndarray]] = {}
    for name, ends in branches.items():
        via = next((stretches[k].points for k, names in shared.items() if name in names), np.empty((0, 2)))
        for incoming, outgoing, doubtful in _pair_branches(stretches, ends):
            onward[incoming] = (outgoing, doubtful, _toward(via, stretches, incoming))
            onward[outgoing] = (incoming, doubtful, _toward(via, stretches, outgoing))
    outer = [index for index in range(len(stretches)) if index not in inner and index not in shared]
    return sorted(_walks(stretches, outer, onward), key=lambda strand: -strand.length)


def _crossings(stretches: list[Stretch]) -> tuple[dict[int, int], set[int]]:
    """Return each crossing's name after near ones are joined, and the stretches inside of joined crossings."""
    name = {node: node for stretch in stretches for node in (stretch.first, stretch.last) if node >= 0}

    def root(node: int) -> int:
        while name[node] != node:
            node = name[node]
        return node

    inner = set()
    for index, stretch in enumerate(stretches):
        if stretch.first >= 0 and stretch.last >= 0 and stretch.length < NEAR:
            inner.add(index)
            name[root(stretch.first)] = root(stretch.last)
    return {node: root(node) for node in name}, inner


def _find_shared(stretches: list[Stretch], crossing: dict[int, int], inner: set[int]) -> dict[int, tuple[int, int]]:
    """Return the stretches on which two threads lie, with the name of their joined crossing; `crossing` is changed:
    the forks at both ends of such a stretch become one crossing."""
    ends: dict[int, list[End]] = {}
    for index, stretch in enumerate(stretches):
        if index not in inner:
            for end, node in enumerate((stretch.first, stretch.last)):
                if node >= 0:
                    ends.setdefault(crossing[node], []).append((index, end))
    shared: dict[int, tuple[int, int]] = {}
    joined_ends: set[int] = set()
    for index, stretch in enumerate(stretches):
        if index in inner or stretch.first < 0 or stretch.last < 0 or stretch.length > LONGEST_SHARED:
            continue
        first, last = crossing[stretch.first], crossing[stretch.last]
        if first == last or first in joined_ends or last in joined_ends:
            continue
        if all(_is_fork(stretches, ends[name], index) for name in (first, last)):
            shared[index] = (first, last)
            joined_ends |= {first, last}
    for first, last in shared.values():
        for node, name in crossing.items():
            if name == last:
                crossing[node] = first
    return shared


def _is_fork(stretches: list[Stretch], ends: list[End], stem: int) -> bool:
    """Return whether the crossing has three branches of which two go on from the stem rather than from each other."""
    if len(ends) != 3 or sum(index == stem for index, _ in ends) != 1:
        return False
    directions = {index: outward(stretches[index].points, end) for index, end in ends}
    arms = [direction for index, direction in directions.items() if index != stem]
    if len(arms) != 2:
        return False
    return all(_turn(directions[stem], arm) < LARGEST_TURN for arm in arms) and _turn(*arms) > np.radians(100.0)


def _turn(incoming: np.ndarray, outgoing: np.ndarray) -> float:
    """Return the angle [rad] by which a line turns that comes in along one branch and leaves along another."""
    return float(np.arccos(np.clip(-(incoming @ outgoing), -1.0, 1.0)))


def _pair_branches(stretches: list[Stretch], ends: list[End]) -> Iterator[tuple[End, End, bool]]:
    """Yield pairs of branches that are one thread, and whether that is in doubt."""
    directions = [outward(stretches[index].points, end) for index, end in ends]
    turns = np.array([[_turn(incoming, outgoing) for outgoing in directions] for incoming in directions])
    # a thread has two ends: it does not run in a ring, and a ring's two branches are not left alone
    stretch = np.array([index for index, _ in ends])
    same = stretch[:, None] == stretch[None]
    turns[same] = np.pi
    alone = np.where(same.sum(axis=1) > 1, 2.0 * LARGEST_TURN, LARGEST_TURN / 2.0)
    if len(ends) > MOST_BRANCHES:
        free = set(range(len(ends)))
        order = sorted((turns[i, j], i, j) for i in free for j in free if i < j)
        for turn, i, j in order:
            if turn < LARGEST_TURN and i in free and j in free:
                free -= {i, j}
                yield ends[i], ends[j], True
        return
    costs = sorted(_matchings(tuple(range(len(ends))), turns, alone), key=lambda matching: matching[0])
    best = costs[0][1]
    doubtful = {
        pair
        for pair in best
        for cost, other_pairs in costs[1:]
        if cost - costs[0][0] < CLOSE and pair not in other_pairs
    }
    for i, j in best:
        yield ends[i], ends[j], (i, j) in doubtful


def _matchings(
    free: tuple[int, ...], turns: np.ndarray, alone: np.ndarray
) -> Iterator[tuple[float, tuple[tuple[int, int], ...]]]:
    """Yield (sum of turns, pairs) of every way to pair branches; one left alone costs what `alone` (N,) says."""
    if not free:
        yield 0.0, ()
        return
    first, remaining = free[0], free[1:]
    for cost, pairs in _matchings(remaining, turns, alone):
        yield cost + float(alone[first]), pairs
    for partner in remaining:
        if turns[first, partner] < LARGEST_TURN:
            for cost, pairs in _matchings(tuple(k for k in remaining if k != partner), turns, alone):
                yield cost + float(turns[first, partner]), ((first, partner), *pairs)


def _toward(via: np.ndarray, stretches: list[Stretch], end: End) -> np.ndarray:
    """Return the shared stretch's points in the order in which one meets them who comes out of `end`."""
    if len(via) == 0:
        return via
    points = stretches[end[0]].points
    end_point = points[0] if end[1] == 0 else points[-1]
    return via if np.linalg.norm(via[0] - end_point) <= np.linalg.norm(via[-1] - end_point) else via[::-1]


def _walks(
    stretches: list[Stretch], outer: list[int], onward: dict[End, tuple[End, bool, np.ndarray]]
) -> Iterator[Strand]:
    """Yield the strands: from ends that nothing continues, then what is left, which are rings."""
    used: set[int] = set()
    begins = [(index, end) for index in outer for end in (0, 1) if (index, end) not in onward]
    for index, end in begins + [(index, 0) for index in outer]:
        if index in used:
            continue
        pieces, doubts, count = [], [], 0
        entered: End | None = (index, end)
        while entered is not None and entered[0] not in used:
            used.add(entered[0])
            points = stretches[entered[0]].points
            points = points if entered[1] == 0 else points[::-1]
            pieces.append(points)
            count += len(points)
            leaving = (entered[0], 1 - entered[1])
            entered = None
            if leaving in onward:
                entered, doubtful, via = onward[leaving]
                if doubtful:
                    doubts.append(count - 1)
                pieces.append(via)
                count += len(via)
        yield Strand(np.concatenate(pieces), tuple(doubts))
