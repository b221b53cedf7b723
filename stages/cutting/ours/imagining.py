"""Goals in words: trees of cuts that make fragments which are what the words say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scenewright.schemas.cutting_demonstrations import CategoryName
from scenewright.schemas.errors import BadInput
from scenewright.stages.cutting.demonstrations.recipes import CATEGORIES, LONG
from scenewright.stages.cutting.meaning import EVEN, MEANINGS, Parts, Thing
from scenewright.stages.cutting.ours.cells import Cloud, Split, Tree, cells, cloud_of, spans
from scenewright.stages.cutting.ours.grammar import Grammar
from scenewright.stages.cutting.ours.grids import grids_of
from scenewright.stages.cutting.ours.items import Item
from scenewright.stages.cutting.world.body import Body

Words = Sequence[tuple[int, CategoryName]]
STEPS = 24
"""Steps in which the length of a thing is shared among words."""
TRIED = 24
"""Trees that are tried on the points of a thing; by eye."""


@dataclass(frozen=True)
class Laid:
    """One thing: the tree of its cuts along its directions, and what each leaf is to become."""

    thing: Thing
    tree: Tree
    items: tuple[Item, ...]
    parts: Parts


@dataclass(frozen=True)
class Wish:
    """A goal in words, laid out."""

    laid: tuple[Laid, ...]
    """By object."""
    names: tuple[CategoryName, ...]
    """By item."""
    thinnest: float
    """Thinnest edge of a box that it asks for [m]."""

    @property
    def items(self) -> list[Item]:
        """All that is wanted."""
        return [item for each in self.laid for item in each.items]

    @property
    def wanted(self) -> list[tuple[CategoryName, float]]:
        """The word and the volume [m^3] of each item."""
        return [(name, item.volume) for name, item in zip(self.names, self.items, strict=True)]


def imagine(objects: Sequence[Body], words: Words, grammar: Grammar) -> Wish:
    """Return words laid out.

    Each object gets of every category a share by its volume, of slices by its length, and one fragment at least; within
    an object categories lie one after the other along its length, of which each gets so much that the worst of them is
    met best. Raises BadInput for a category that no demonstration showed.
    """
    for _, name in words:
        if not grammar.named[:, CATEGORIES.index(name)].any():
            raise BadInput(f"the model has not been shown {name}", hint="learn from more demonstrations")
    things = [Thing.of(body) for body in objects]
    counts = _counts(things, words)
    laid: list[Laid] = []
    names: list[CategoryName] = []
    thinnest = np.inf
    for thing, body, mine in zip(things, objects, counts, strict=True):
        if not mine:
            laid.append(Laid(thing, None, (), {}))
            continue
        cloud = cloud_of(body, body.world_from_first @ thing.first_from_axes)
        lengths = _lengths(thing.size, mine)
        tree, thin = _tree(cloud, thing, mine, lengths)
        thinnest = min(thinnest, thin)
        rows = np.exp(cells(cloud, tree, [1.0] * sum(count for count, _ in mine)))
        items = tuple(
            Item(len(names) + k, (float(a), float(b), float(c)), float(v)) for k, (a, b, c, v) in enumerate(rows)
        )
        names += [name for count, name in mine for _ in range(count)]
        ends = np.cumsum([0.0, *lengths]).tolist()
        laid.append(Laid(thing, tree, items, {word[1]: (ends[k], ends[k + 1]) for k, word in enumerate(mine)}))
    return Wish(tuple(laid), tuple(names), float(thinnest))


def _counts(things: Sequence[Thing], words: Words) -> list[list[tuple[int, CategoryName]]]:
    """Return what each thing gets of the words; none is left without a fragment where there are enough."""
    shares = np.array(
        [
            shared_out(
                count, np.array([t.size[LONG] if MEANINGS[name].by_thickness else t.body.volume for t in things])
            )
            for count, name in words
        ]
    )
    while (shares.sum(axis=0) == 0).any() and shares.sum() >= len(things):
        giving = np.where(shares.sum(axis=0) > 1, shares, 0)
        word, giver = np.unravel_index(int(giving.argmax()), giving.shape)
        shares[word, giver] -= 1
        shares[word, int(shares.sum(axis=0).argmin())] += 1
    return [[(int(n), name) for n, (_, name) in zip(column, words, strict=True) if n] for column in shares.T]


def shared_out(count: int, room: np.ndarray) -> np.ndarray:
    """Return whole numbers (N,) that add up to the count, in proportion to what room there is (largest remainders)."""
    exact = count * room / room.sum()
    counts = np.floor(exact).astype(int)
    counts[np.argsort(-(exact - counts), kind="stable")[: count - int(counts.sum())]] += 1
    return counts


def _tree(cloud: Cloud, thing: Thing, words: Words, lengths: Sequence[float]) -> tuple[Tree, float]:
    """Return the cuts of one thing, and the thinnest edge of a box that they make [m]."""
    along = cloud.points[:, LONG]
    at = (along - along.min()) / np.ptp(along)
    ends = np.cumsum([0.0, *lengths])
    trees, thinnest = [], []
    for word, length, low, high in zip(words, lengths, ends[:-1], ends[1:], strict=True):
        region = replace(cloud, points=cloud.points[(at >= low) & (at <= high + 1e-9)])
        tree, thin = _region(region, thing.size, length, *word)
        trees.append(tree)
        thinnest.append(thin)
    return trees[0] if len(trees) == 1 else Split(LONG, tuple(trees), tuple(lengths), slabs=True), min(thinnest)


def _lengths(size: np.ndarray, words: Words) -> list[float]:
    """Return the share of the length of each word, so that the greatest misfit is least."""
    if len(words) == 1:
        return [1.0]
    ways = [np.diff([0, *marks, STEPS]) for marks in combinations(range(1, STEPS), len(words) - 1)]
    misfits = [
        np.array([np.inf, *(grids_of(_part(size, n / STEPS), size, *word)[0].misfit for n in range(1, STEPS))])
        for word in words
    ]
    best = min(ways, key=lambda way: max(misfit[n] for misfit, n in zip(misfits, way, strict=True)))
    return [float(n) / STEPS for n in best]


def _part(size: np.ndarray, share: float) -> np.ndarray:
    return np.where(np.arange(3) == LONG, share, 1.0) * size


def _region(cloud: Cloud, size: np.ndarray, share: float, count: int, name: CategoryName) -> tuple[Tree, float]:
    """Return the tree of the grid whose worst cell is likest to the word, and its thinnest edge [m]: those that are
    likest on boxes are tried on the points, with cells of one volume, and where none of them is met, of one size."""
    meaning = MEANINGS[name]
    grids = grids_of(_part(size, share), size, count, name)[:TRIED]

    def misfit(tree: Tree) -> float:
        edges, volumes = spans(cloud, tree)
        shape = float(meaning.misfit(np.sort(edges, axis=1), edges[:, LONG], size).max())
        return shape if meaning.by_thickness else max(shape, float(volumes.max() / volumes.min()) / EVEN)

    trees: dict[Tree, tuple[float, float]] = {}
    for slabs in (True,) if meaning.by_thickness else (False, True):
        for grid in grids:
            tree = grid.tree(count, slabs)
            if tree not in trees:
                trees[tree] = misfit(tree), grid.thinnest
        if min(trees.values())[0] <= 1.0:
            break
    best = min(trees, key=lambda tree: trees[tree][0])
    return best, trees[best][1]
