"""A mask's skeleton and the stretches of it between ends and crossings.

Thinning follows Guo and Hall 1989 (the two-subiteration algorithm A1), on the list of the mask's pixels: a thread is
few pixels of a large picture. Pixels are (column, row).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

SPUR = 5
"""Stretches of fewer pixels between an end and a crossing are the mask's ragged outline, not thread."""
SMOOTHING = 2.0
"""Standard deviation [px] of the Gaussian along a stretch that takes the pixels' steps out of it."""
AROUND_CENTRE = 4
"""The middle of the mask is sought in so many pixels on each side of a skeleton's pixel."""
FARTHEST_MOVE = 1.0
"""Farther than this a point is not moved across the line [px]; by eye."""
AROUND = ((-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1))
"""(row, column) of the eight neighbours, clockwise from above."""


@dataclass(frozen=True)
class Stretch:
    """A line of thread between two ends: `points` (N, 2) float, smoothed (column, row), and at either end the crossing
    (a number) that it runs into, or -1 where it ends freely."""

    points: np.ndarray
    first: int
    last: int

    @property
    def length(self) -> float:
        """Length along the line [px]."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())


def thinned(mask: np.ndarray) -> np.ndarray:
    """Return the skeleton (H, W) bool of a mask (H, W) bool: one pixel wide, connected where the mask is."""
    padded = np.zeros((mask.shape[0] + 2, mask.shape[1] + 2), dtype=bool)
    padded[1:-1, 1:-1] = mask
    flat, width = padded.ravel(), padded.shape[1]
    steps = [row * width + column for row, column in AROUND]
    pixels = np.flatnonzero(flat)
    changed = True
    while changed:
        changed = False
        for odd in (False, True):
            n, ne, e, se, s, sw, w, nw = (flat[pixels + step] for step in steps)
            crossings = (~n & (ne | e)).astype(int) + (~e & (se | s)) + (~s & (sw | w)) + (~w & (nw | n))
            first = (nw | n).astype(int) + (ne | e) + (se | s) + (sw | w)
            second = (n | ne).astype(int) + (e | se) + (s | sw) + (w | nw)
            neighbours = np.minimum(first, second)
            protected = ((n | ne | ~se) & e) if not odd else ((s | sw | ~nw) & w)
            gone = (crossings == 1) & (neighbours >= 2) & (neighbours <= 3) & ~protected
            if gone.any():
                changed = True
                flat[pixels[gone]] = False
                pixels = pixels[~gone]
    return padded[1:-1, 1:-1]


def _links(skeleton: np.ndarray) -> tuple[np.ndarray, list[list[int]]]:
    """Return the skeleton's pixels (N, 2; row, column) and each one's neighbours; a diagonal step is no link where two
    straight ones lead the same way, so that a staircase has no crossings."""
    pixels = np.argwhere(skeleton)
    number = np.full((skeleton.shape[0] + 2, skeleton.shape[1] + 2), -1)
    number[pixels[:, 0] + 1, pixels[:, 1] + 1] = np.arange(len(pixels))
    around = np.stack([number[pixels[:, 0] + 1 + r, pixels[:, 1] + 1 + c] for r, c in AROUND], axis=1)
    has_neighbour = around >= 0
    for diagonal in (1, 3, 5, 7):
        has_neighbour[:, diagonal] &= ~has_neighbour[:, diagonal - 1] & ~has_neighbour[:, (diagonal + 1) % 8]
    return pixels, [row[is_link].tolist() for row, is_link in zip(around, has_neighbour, strict=True)]


def stretches(mask: np.ndarray) -> list[Stretch]:
    """Return the stretches of the mask's skeleton; those that meet at a crossing bear its number."""
    pixels, links = _links(thinned(mask))
    chains = _chains(links)
    while True:
        degrees = np.bincount([end for chain in chains for end in (chain[0], chain[-1])], minlength=len(pixels))
        spurs = [
            min(degrees[chain[0]], degrees[chain[-1]]) == 1
            and max(degrees[chain[0]], degrees[chain[-1]]) > 2
            and len(chain) < SPUR
            for chain in chains
        ]
        if not any(spurs):
            break
        chains = _join_chains([chain for chain, spur in zip(chains, spurs, strict=True) if not spur])
    result = []
    for chain in chains:
        ends = [chain[end] if degrees[chain[end]] > 1 and chain[0] != chain[-1] else -1 for end in (0, -1)]
        if chain[0] == chain[-1] and degrees[chain[0]] > 2:
            ends = [chain[0], chain[0]]
        points = _smooth(_centre_on_mask(mask, _smooth(pixels[chain][:, ::-1].astype(float)), pixels[chain]))
        result.append(Stretch(points, *ends))
    return result


def _chains(links: list[list[int]]) -> list[list[int]]:
    """Return the lists of pixels between pixels that have not just two neighbours, and closed rings."""
    chains, used = [], np.zeros(len(links), dtype=bool)
    for node, around in enumerate(links):
        if len(around) == 2 or not around:
            continue
        used[node] = True
        for begin in around:
            chain = [node, begin]
            while len(links[chain[-1]]) == 2:
                used[chain[-1]] = True
                following = [neighbour for neighbour in links[chain[-1]] if neighbour != chain[-2]]
                chain.append(following[0])
            # each chain is met from both of its ends
            if (chain[0], chain[1]) <= (chain[-1], chain[-2]):
                chains.append(chain)
    for begin in range(len(links)):
        if used[begin] or len(links[begin]) != 2:
            continue
        ring = [begin]
        used[begin] = True
        while True:
            following = [neighbour for neighbour in links[ring[-1]] if not used[neighbour]]
            if not following:
                break
            ring.append(following[0])
            used[following[0]] = True
        chains.append(ring)
    return chains


def _join_chains(chains: list[list[int]]) -> list[list[int]]:
    """Return the chains with those joined that alone meet at a pixel since a spur was taken out there."""
    chains = [list(chain) for chain in chains]
    while True:
        at: dict[int, list[int]] = {}
        for index, chain in enumerate(chains):
            for end in {chain[0], chain[-1]}:
                at.setdefault(end, []).append(index)
        pair = next(
            (
                meeting
                for meeting in at.values()
                if len(meeting) == 2 and all(chains[k][0] != chains[k][-1] for k in meeting)
            ),
            None,
        )
        if pair is None:
            return chains
        before, after = chains[pair[0]], chains[pair[1]]
        shared = ({before[0], before[-1]} & {after[0], after[-1]}).pop()
        before = before if before[-1] == shared else before[::-1]
        after = after if after[0] == shared else after[::-1]
        chains = [chain for index, chain in enumerate(chains) if index not in pair] + [before + after[1:]]


def _centre_on_mask(mask: np.ndarray, line: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Return the points (N, 2) of a line moved across it to the middle of the mask around their pixels (N, 2; row,
    column): thinning takes one side of an even width."""
    if len(line) < 5:
        return line
    padded = np.pad(mask, AROUND_CENTRE)
    reach = range(-AROUND_CENTRE, AROUND_CENTRE + 1)
    count, sums = np.zeros(len(line)), np.zeros((len(line), 2))
    for row in reach:
        for column in reach:
            in_mask = padded[pixels[:, 0] + AROUND_CENTRE + row, pixels[:, 1] + AROUND_CENTRE + column]
            count += in_mask
            sums += in_mask[:, None] * (pixels[:, ::-1] + [column, row])
    tangent = np.gradient(line, axis=0)
    across = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1) / np.maximum(
        np.linalg.norm(tangent, axis=1, keepdims=True), 1e-9
    )
    move = ((sums / np.maximum(count, 1)[:, None] - line) * across).sum(axis=1)
    return np.asarray(line + np.where(np.abs(move) < FARTHEST_MOVE, move, 0.0)[:, None] * across)


def _smooth(points: np.ndarray) -> np.ndarray:
    """Return points (N, 2) smoothed along the line; the ends stay."""
    if len(points) < 5:
        return points
    # odd reflection about the ends keeps them in place
    reach = min(len(points) - 1, int(4 * SMOOTHING))
    before, after = 2 * points[0] - points[reach:0:-1], 2 * points[-1] - points[-2 : -reach - 2 : -1]
    long = np.concatenate([before, points, after])
    return gaussian_filter1d(long, SMOOTHING, axis=0)[reach : reach + len(points)]
