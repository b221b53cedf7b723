"""Which of the wanted fragments each piece is to become, where there are several pieces."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache

import numpy as np
from scenewright.stages.cutting.ours.cells import Cloud, Tree, cells
from scenewright.stages.cutting.ours.grammar import Grammar
from scenewright.stages.cutting.ours.items import Item, features, likeness
from scenewright.stages.cutting.ours.structures import (
    MOST_BITS,
    best_trees,
    groupings,
    match,
    misfits,
    proposals,
    rule_bits,
)

MOST_PIECES = 4
"""Most pieces that are filled together; of more, one is filled after the other. By eye."""
MOST_GROUPS = 6
"""Most groups of fragments; by eye."""
BEAM, FINALISTS = 60, 6
"""Ways to share groups among the pieces that are judged on points, and then by whole trees."""
UNLIKE = 0.5
"""Distance of the middles of groups, in deviations of alike fragments, from which pieces may share them apart: like
fragments of two pieces differ by little."""
MOST_WAYS = 4000
"""Partly shared out, that are gone on with."""
SLACK = 0.3
"""Share of a piece's volume by which a way may miss it, by the groups' mean volumes; by eye."""
SETTLED = 12
"""Ways that are settled by volumes."""
VOLUME_DEVIATION = 0.02
"""Standard deviation of a piece's volume beside that of its fragments, as a share: what seeing adds. By eye."""
DONE = 0.9
"""Likeness at which a piece is taken for a fragment that is wanted."""


def allocate(clouds: Sequence[Cloud], items: Sequence[Item], grammar: Grammar) -> list[list[Item]]:
    """Return the items of each piece. Every piece gets at least one where there are enough."""
    if len(clouds) == 1:
        return [list(items)]
    if len(clouds) > MOST_PIECES:
        return _one_by_one(clouds, items)
    wanted_features = features(items)
    foreseen: dict[tuple[int, tuple[int, ...]], tuple[np.ndarray, float]] = {}
    allocations = []
    for groups in groupings(wanted_features, grammar, MOST_GROUPS, UNLIKE):
        means = [wanted_features[group].mean(axis=0) for group in groups]
        foreseen.clear()
        for counts in sharings([len(g) for g in groups], np.exp([m[3] for m in means]), clouds):
            foreseen_features, bits = [], 0.0
            for k, cloud in enumerate(clouds):
                key = (k, tuple(counts[:, k].tolist()))
                if key not in foreseen:
                    foreseen[key] = _sketch(cloud, means, counts[:, k], grammar)
                foreseen_features.append(foreseen[key][0])
                bits += foreseen[key][1]
            foreseen_by_piece = np.concatenate(foreseen_features)
            misfit, order = match(foreseen_by_piece, wanted_features, grammar.scatter)
            allocations.append((misfit + bits, counts.sum(axis=0), order, foreseen_by_piece))
    if not allocations:
        return _one_by_one(clouds, items)
    allocations.sort(key=lambda way: way[0])
    room = np.array([cloud.body.volume for cloud in clouds])
    volumes = np.array([item.volume for item in items])
    finalists: dict[tuple[tuple[int, ...], ...], None] = {}
    for _, counts, order, made_by_piece in allocations[:SETTLED]:
        owner = np.repeat(np.arange(len(clouds)), counts)
        order = settle(misfits(made_by_piece, wanted_features, grammar.scatter), order, owner, volumes, room)
        finalists[tuple(tuple(sorted(order[owner == k].tolist())) for k in range(len(clouds)))] = None
        if len(finalists) == FINALISTS:
            break

    @cache
    def tree_bits(k: int, part: tuple[int, ...]) -> float:
        return best_trees(clouds[k], [items[n] for n in part], grammar)[0].bits

    def bits_of(way: tuple[tuple[int, ...], ...]) -> float:
        volume_of_part = np.array([volumes[list(part)].sum() for part in way])
        return sum(tree_bits(k, part) for k, part in enumerate(way)) + float(volume_bits(volume_of_part, room))

    return [[items[n] for n in part] for part in min(finalists, key=bits_of)]


def volume_bits(held: np.ndarray, room: np.ndarray) -> np.ndarray:
    """Return what it costs (...) [bits] that items of these volumes (..., pieces) come out of these pieces."""
    off = (held - room) / (VOLUME_DEVIATION * room)
    return np.asarray(np.minimum(0.5 * off**2 / np.log(2), MOST_BITS).sum(axis=-1))


def settle(
    table: np.ndarray, order: np.ndarray, owner: np.ndarray, volumes: np.ndarray, room: np.ndarray
) -> np.ndarray:
    """Return which item each fragment becomes, after items changed places between pieces as long as that saves bits.

    `table` (fragments, items) [bits], `order` the items to begin with, `owner` the piece of each fragment.
    """
    order = order.copy()
    pieces = np.arange(len(room))
    fragments = np.arange(len(order))
    for _ in range(len(order)):
        volume_held = np.bincount(owner, volumes[order], len(room))
        mine = table[fragments, order]
        swapped = table[:, order]  # what a fragment would cost with the item of another
        change = swapped + swapped.T - mine[:, None] - mine[None]
        moved = volumes[order][None] - volumes[order][:, None]
        to, away = owner[:, None, None] == pieces, owner[None, :, None] == pieces
        after = volume_held + moved[..., None] * (to.astype(float) - away)
        change += volume_bits(after, room) - volume_bits(volume_held, room)
        change[owner[:, None] == owner[None]] = 0.0
        i, j = np.unravel_index(int(change.argmin()), change.shape)
        if change[i, j] > -1e-6:
            break
        order[i], order[j] = order[j], order[i]
    return order


def sharings(counts: Sequence[int], volumes: np.ndarray, clouds: Sequence[Cloud]) -> list[np.ndarray]:
    """Return ways (groups, pieces) to share groups of so many items of a mean volume [m^3] among the pieces, those
    first that fill the pieces best with the fewest groups in each."""
    room = np.array([cloud.body.volume for cloud in clouds])
    shares = np.zeros((1, 0, len(clouds)), dtype=int)
    filled = np.zeros((1, len(clouds)))
    for count, volume in zip(counts, volumes, strict=True):
        rows = np.array(list(_compositions(count, len(clouds))))
        filled_next = (filled[:, None] + volume * rows[None]).reshape(-1, len(clouds))
        keep = np.flatnonzero((filled_next <= (1.0 + SLACK) * room).all(axis=1))
        if len(keep) > MOST_WAYS:
            keep = keep[np.argsort(np.abs(filled_next[keep] - 0.5 * room).sum(axis=1), kind="stable")[:MOST_WAYS]]
        shares = np.concatenate([shares[keep // len(rows)], rows[keep % len(rows)][:, None]], axis=1)
        filled = filled_next[keep]
    all_used = (shares.sum(axis=1) > 0).all(axis=1)
    misfit = np.abs(filled - room).sum(axis=1) / room.sum() + 0.05 * (shares > 0).sum(axis=(1, 2))
    ranked = np.flatnonzero(all_used)[np.argsort(misfit[all_used], kind="stable")[:BEAM]]
    return list(shares[ranked])


def _compositions(count: int, parts: int) -> Iterator[tuple[int, ...]]:
    if parts == 1:
        yield (count,)
        return
    for first in range(count + 1):
        for later_parts in _compositions(count - first, parts - 1):
            yield (first, *later_parts)


def _sketch(
    cloud: Cloud, means: Sequence[np.ndarray], counts: np.ndarray, grammar: Grammar
) -> tuple[np.ndarray, float]:
    """Return the features and the rules' bits of the first proposal for so many items of each group."""
    groups = [np.tile(mean, (count, 1)) for mean, count in zip(means, counts, strict=True) if count]
    tree: Tree = next(iter(proposals(cloud.edges, groups, grammar)))
    return cells(cloud.coarse, tree), rule_bits(grammar, cloud.edges, tree)


def _one_by_one(clouds: Sequence[Cloud], items: Sequence[Item]) -> list[list[Item]]:
    """Take pieces that are wanted as they are for what they are; fill the others, largest item first, where most room
    is left."""
    shared: list[list[Item]] = [[] for _ in clouds]
    unfilled = list(items)
    pieces = np.stack([cells(cloud, None)[0] for cloud in clouds])
    alike = np.nan_to_num(likeness(pieces[:, None], features(items)[None]))
    for k, n in sorted(np.argwhere(alike >= DONE).tolist(), key=lambda pair: -alike[pair[0], pair[1]]):
        if not shared[k] and items[n] in unfilled:
            shared[k].append(items[n])
            unfilled.remove(items[n])
    room = np.array([cloud.body.volume for cloud in clouds]) - [sum(item.volume for item in part) for part in shared]
    for item in sorted(unfilled, key=lambda item: -item.volume):
        k = int(room.argmax())
        shared[k].append(item)
        room[k] -= item.volume
    return shared
