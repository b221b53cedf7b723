"""Fragments for goals in words: what grids of a category's shape would make of the objects at hand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scenewright.schemas.cutting_demonstrations import CategoryName
from scenewright.schemas.errors import BadInput
from scenewright.stages.cutting.demonstrations.recipes import CATEGORIES, LONG
from scenewright.stages.cutting.ours.cells import Cloud, Split, Tree, cells, cloud_of
from scenewright.stages.cutting.ours.grammar import Grammar
from scenewright.stages.cutting.ours.items import Item
from scenewright.stages.cutting.ours.structures import factors, nested
from scenewright.stages.cutting.world.body import Body

Words = Sequence[tuple[int, CategoryName]]


def imagine(objects: Sequence[Body], words: Words, grammar: Grammar) -> tuple[list[Item], list[str]]:
    """Return items of the wanted categories and their names.

    Each category gets as much volume as any other, each object of every category a share by its volume; within an
    object categories lie one after the other along its length, as demonstrated. Raises BadInput for a category that
    no demonstration showed.
    """
    for _, name in words:
        if not grammar.named[:, CATEGORIES.index(name)].any():
            raise BadInput(f"the model has not been shown {name}", hint="learn from more demonstrations")
    clouds = [cloud_of(body) for body in objects]
    room = np.array([body.volume for body in objects])
    items: list[Item] = []
    names: list[str] = []
    shares = {name: shared_out(count, room) for count, name in words}
    for number, cloud in enumerate(clouds):
        mine = [(int(shares[name][number]), name) for _, name in words if shares[name][number]]
        if not mine:
            continue
        cells_made = cells(cloud, _tree(cloud, mine, grammar))
        for row in cells_made:
            edges = np.exp(row[:3])
            items.append(Item(len(items), (float(edges[0]), float(edges[1]), float(edges[2])), float(np.exp(row[3]))))
        names += [name for count, name in mine for _ in range(count)]
    return items, names


def shared_out(count: int, room: np.ndarray) -> np.ndarray:
    """Return whole numbers (N,) that add up to the count, in proportion to what room there is (largest remainders)."""
    exact = count * room / room.sum()
    counts = np.floor(exact).astype(int)
    counts[np.argsort(-(exact - counts), kind="stable")[: count - int(counts.sum())]] += 1
    return counts


def _tree(cloud: Cloud, words: Words, grammar: Grammar) -> Tree:
    share = 1.0 / len(words)
    edges = cloud.edges * np.where(np.arange(3) == LONG, share, 1.0)
    grids = tuple(_grid(edges, count, name, grammar) for count, name in words)
    return grids[0] if len(grids) == 1 else Split(LONG, grids, (share,) * len(grids))


def _grid(edges: np.ndarray, count: int, name: CategoryName, grammar: Grammar) -> Tree:
    """Return the grid of so many cells whose shapes are likeliest for a category."""
    grids = factors(count)
    ratios = np.diff(np.sort(np.log(edges / grids), axis=1), axis=1)
    mean, deviation = grammar.ratios[CATEGORIES.index(name)]
    best = int(np.argmin((((ratios - mean) / deviation) ** 2).sum(axis=1)))
    return nested(edges, grids[best].tolist(), grammar)
