"""Trees of cuts that may make given fragments of a piece: found on boxes, judged on points, priced in bits."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import permutations

import numpy as np
from scenewright.stages.cutting.ours.cells import Cloud, Split, Tree, cells
from scenewright.stages.cutting.ours.grammar import Grammar
from scenewright.stages.cutting.ours.items import Item, features, likeness
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import pdist

BEAM, FINALISTS = 4, 5
"""Trees of a group that are judged on a few points, and of these on all points, with planes by volume."""
UNLIKE = 1.5
"""Distance of the middles of groups, in deviations of alike fragments, from which they may be set apart."""
MOST_GROUPS = 4
"""Groups of unlike fragments that are set apart within one piece before anything else."""
MOST_BITS = 60.0
"""Highest cost of one fragment which does not fit [bits], so that one odd fragment does not decide; by eye."""


@dataclass(frozen=True)
class Foreseen:
    """A tree, which item each of its fragments is to become, and how well that goes."""

    tree: Tree
    items: tuple[Item, ...]
    """By leaf."""
    bits: float
    """Of the rules, and of what the fragments lack."""
    likeness: float
    """About the overlap that is to be expected, mean over fragments."""


def best_trees(cloud: Cloud, items: Sequence[Item], grammar: Grammar) -> list[Foreseen]:
    """Return foreseen trees that make as many fragments as there are items, fewest bits first; at least one."""
    wanted_features = features(items)
    if len(items) == 1:
        return [_foresee(cloud, None, items, wanted_features, grammar)]
    trees: dict[Tree, None] = {}
    for groups in groupings(wanted_features, grammar):
        trees |= dict.fromkeys(proposals(cloud.edges, [wanted_features[group] for group in groups], grammar))
    chosen = list(trees)
    if len(chosen) > FINALISTS:
        chosen.sort(key=lambda tree: _rough_bits(cloud.coarse, tree, wanted_features, grammar))
    foreseen_trees = [_foresee(cloud, tree, items, wanted_features, grammar) for tree in chosen[:FINALISTS]]
    return sorted(foreseen_trees, key=lambda foreseen: foreseen.bits)


def groupings(
    wanted: np.ndarray, grammar: Grammar, most: int = MOST_GROUPS, unlike: float = UNLIKE
) -> list[list[np.ndarray]]:
    """Return ways to group items (N, 4): all alike, by what their types are called, by clusters of their own."""
    has_size = ~np.isnan(wanted[:, 0])
    labels = [np.zeros(len(wanted), dtype=int)]
    category_labels = np.full(len(wanted), -1)
    category_labels[has_size] = grammar.category_of(wanted[has_size, :3])
    labels.append(category_labels)
    if has_size.sum() > 2:
        tree = linkage(wanted[has_size] / grammar.scatter, "ward")
        for count in range(2, most + 1):
            clusters = np.full(len(wanted), -1)
            clusters[has_size] = fcluster(tree, count, "maxclust")
            if clusters.max() < count:
                break
            middles = [(wanted[clusters == value] / grammar.scatter).mean(axis=0) for value in range(1, count + 1)]
            if pdist(np.array(middles)).min() < unlike:
                break
            labels.append(clusters)
    distinct: dict[tuple[tuple[int, ...], ...], None] = {}
    for each in labels:
        groups = sorted(tuple(np.flatnonzero(each == value).tolist()) for value in np.unique(each))
        if len(groups) <= most and (len(groups) == 1 or len(groups) < len(wanted)):
            distinct[tuple(groups)] = None
    return [[np.array(group) for group in groups] for groups in distinct]


def proposals(edges: np.ndarray, groups: Sequence[np.ndarray], grammar: Grammar) -> Iterator[Tree]:
    """Yield trees for a box of these edges (3,) [m] by axis: each group (n, 4) becomes a grid of its own."""
    if len(groups) == 1:
        yield from _grids(edges, groups[0], grammar)[:BEAM]
        return
    volumes = np.array([np.exp(group[:, 3]).sum() for group in groups])
    shares = volumes / volumes.sum()
    rows = []
    for axis in range(3):
        slabs = [edges * np.where(np.arange(3) == axis, share, 1.0) for share in shares]
        misfit = sum(
            len(group) * float(_grid_bits(slab, factors(len(group)), group, grammar).min())
            for slab, group in zip(slabs, groups, strict=True)
        )
        rows.append((misfit, axis, slabs))
    for rank, (_, axis, slabs) in enumerate(sorted(rows, key=lambda row: row[0])):
        grids = [_grids(slab, group, grammar, 1)[0] for slab, group in zip(slabs, groups, strict=True)]
        orders = list(permutations(range(len(groups))))
        for order in orders if rank == 0 else orders[:1]:
            yield Split(axis, tuple(grids[k] for k in order), tuple(float(shares[k]) for k in order))


def _grids(edges: np.ndarray, group: np.ndarray, grammar: Grammar, most: int = BEAM) -> list[Tree]:
    """Return grids of as many cells as the group has items, those first whose cells fit best."""
    counts = factors(len(group))
    ranked = np.argsort(_grid_bits(edges, counts, group, grammar), kind="stable")[:most]
    return [nested(edges, tuple(counts[k].tolist()), grammar) for k in ranked]


def _grid_bits(edges: np.ndarray, counts: np.ndarray, group: np.ndarray, grammar: Grammar) -> np.ndarray:
    """Return the misfit [bits] (N,) of the cells of grids (N, 3) to the middle of a group."""
    middle = group[~np.isnan(group[:, 0]), :3]
    if not len(middle):
        return np.zeros(len(counts))
    cell = np.sort(np.log(edges / counts), axis=1)
    return np.asarray((((cell - middle.mean(axis=0)) / grammar.scatter[:3]) ** 2).sum(axis=1) * 0.5 / np.log(2))


@lru_cache(maxsize=256)
def factors(count: int) -> np.ndarray:
    """Return all (a, b, c) whose product is the count (N, 3)."""
    return np.array(
        [
            (a, b, count // a // b)
            for a in range(1, count + 1)
            if count % a == 0
            for b in range(1, count // a + 1)
            if count // a % b == 0
        ]
    )


def nested(edges: np.ndarray, counts: Sequence[int], grammar: Grammar) -> Tree:
    """Return the grid as nested splits, in the order of axes that costs the fewest bits."""
    axes = [axis for axis in range(3) if counts[axis] > 1]
    trees = []
    for order in permutations(axes):
        tree: Tree = None
        for axis in reversed(order):
            tree = Split(axis, (tree,) * counts[axis], (1.0,) * counts[axis])
        trees.append(tree)
    if len(trees) == 1:
        return trees[0]
    return min(trees, key=lambda tree: rule_bits(grammar, edges, tree))


def rule_bits(grammar: Grammar, edges: np.ndarray, tree: Tree) -> float:
    """Return the code length [bits] of deriving a tree from a box (3,) [m] by rules that cut in two, halving runs."""
    bits_of_key: dict[tuple[object, ...], float] = {}
    types: dict[tuple[float, ...], int] = {}

    def type_of(box: tuple[float, ...]) -> int:
        if box not in types:
            types[box] = grammar.type_of_box(box)
        return types[box]

    def bits(box: tuple[float, ...], split: Split, first: int, last: int) -> float:
        if last - first == 1:
            part = split.parts[first]
            return 0.0 if part is None else bits(box, part, 0, len(part.parts))
        same = split.weights.count(split.weights[0]) == len(split.weights) and len(set(split.parts)) == 1
        key = (box, id(split), (last - first) if same else (first, last))
        if key not in bits_of_key:
            middle = (first + last) // 2
            weights = split.weights
            total_weight = sum(weights[first:last])
            sides: list[tuple[tuple[float, ...], int, int]] = []
            for low, high in ((first, middle), (middle, last)):
                side = list(box)
                side[split.axis] = round(box[split.axis] * sum(weights[low:high]) / total_weight, 6)
                sides.append((tuple(side), low, high))
            rank = sum(edge < box[split.axis] for k, edge in enumerate(box) if k != split.axis)
            rule = grammar.rule_bits(type_of(box), rank, (type_of(sides[0][0]), type_of(sides[1][0])))
            bits_of_key[key] = rule + sum(bits(cut_box, split, low, high) for cut_box, low, high in sides)
        return bits_of_key[key]

    box = tuple(float(edge) for edge in np.round(edges, 6))
    return 0.0 if tree is None else bits(box, tree, 0, len(tree.parts))


def _rough_bits(cloud: Cloud, tree: Tree, wanted: np.ndarray, grammar: Grammar) -> float:
    return match(cells(cloud, tree), wanted, grammar.scatter)[0] + rule_bits(grammar, cloud.edges, tree)


def _foresee(cloud: Cloud, tree: Tree, items: Sequence[Item], wanted: np.ndarray, grammar: Grammar) -> Foreseen:
    """Match fragments to items by thickness, put the planes where the items' volumes are, and match again."""
    _, order = match(cells(cloud, tree), wanted, grammar.scatter)
    volumes = np.exp(wanted[order, 3])
    features_made = cells(cloud, tree, volumes)
    bits, order = match(features_made, wanted, grammar.scatter)
    alike = np.nan_to_num(likeness(features_made, wanted[order]), nan=1.0)
    return Foreseen(
        tree, tuple(items[k] for k in order), bits + rule_bits(grammar, cloud.edges, tree), float(alike.mean())
    )


def misfits(made: np.ndarray, wanted: np.ndarray, scatter: np.ndarray) -> np.ndarray:
    """Return the bits (N, M) that it takes to tell each of the wanted (M, 4) where a fragment (N, 4) is expected."""
    off = (made[:, None] - wanted[None]) / scatter
    return np.asarray(np.minimum(np.nan_to_num((off**2).sum(axis=2), nan=0.0) * 0.5 / np.log(2), MOST_BITS))


def match(made: np.ndarray, wanted: np.ndarray, scatter: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the least bits by which fragments (N, 4) can be taken for the wanted (N, 4), and which each becomes."""
    table = misfits(made, wanted, scatter)
    rows, columns = linear_sum_assignment(table)
    return float(table[rows, columns].sum()), columns
