"""What people want: categories of fragments as nested equal parts, per object, and the cells of the thesis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

Category = Literal["chunks", "slices", "strips", "cubes"]
CATEGORIES: tuple[Category, ...] = get_args(Category)
THIN, WIDE, LONG = 0, 1, 2
"""Canonical axes of an object, shortest first."""


@dataclass(frozen=True)
class Split:
    """Parts along an axis of the object, by shares of its length; what becomes of each part."""

    axis: int
    shares: tuple[float, ...]
    below: tuple[Split | Category, ...]


Recipe = Split | Category
"""A category alone: leave it as it is, a fragment of that category."""


@dataclass(frozen=True)
class Cell:
    """A cell of table 6.1: objects, and categories in the goal; `trials` are demonstrated."""

    objects: int
    categories: int
    trials: int

    @property
    def name(self) -> str:
        """E.g. `n2m3`."""
        return f"n{self.objects}m{self.categories}"


CELLS = {
    cell.name: cell
    for cell in (Cell(1, 1, 50), Cell(1, 2, 12), Cell(2, 1, 12), Cell(2, 2, 12), Cell(2, 3, 12), Cell(3, 4, 12))
}
"""110 trials in all, as in section 6.4.1, which does not say how many each; 40 % of n1m1 are for training."""
TRAINING_SHARE = 0.4
"""Share of the trials of n1m1 that are for training."""


def equal_parts(axis: int, count: int, then: Recipe) -> Recipe:
    """Return `count` equal parts along an axis, each becoming `then`."""
    return then if count == 1 else Split(axis, (1.0 / count,) * count, (then,) * count)


def recipe_of(category: Category, random: np.random.Generator, *, half: bool = False) -> Recipe:
    """Return how an object, or half of one, is cut into a category."""
    fewer = int(half)
    match category:
        case "chunks":
            return equal_parts(LONG, int(random.integers(2, 5 - fewer)), category)
        case "slices":
            return equal_parts(LONG, int(random.integers(5 - fewer, 10 - 3 * fewer)), category)
        case "strips":
            wide, thin = ((2, 2), (3, 1), (3, 2))[int(random.integers(3 - fewer))]
            return equal_parts(WIDE, wide, equal_parts(THIN, thin, category))
        case "cubes":
            long = int(random.integers(2, 5 - 2 * fewer))
            return equal_parts(LONG, long, equal_parts(WIDE, 2, equal_parts(THIN, 2, category)))


def recipes_of(cell: Cell, random: np.random.Generator) -> list[Recipe]:
    """Return a recipe for each object of a trial of a cell; the first objects carry two categories where they must."""
    chosen = [CATEGORIES[k] for k in random.permutation(len(CATEGORIES))[: cell.categories]]
    doubled = max(0, cell.categories - cell.objects)
    recipes: list[Recipe] = []
    while len(recipes) < cell.objects:
        if len(recipes) < doubled:
            share = float(random.uniform(0.42, 0.58))
            halves = (recipe_of(chosen.pop(), random, half=True), recipe_of(chosen.pop(), random, half=True))
            recipes.append(Split(LONG, (share, 1.0 - share), halves))
        else:
            recipes.append(recipe_of(chosen[0] if len(chosen) == 1 else chosen.pop(), random))
    return recipes


def count_of(recipe: Recipe) -> int:
    """Return how many fragments a recipe makes."""
    return 1 if isinstance(recipe, str) else sum(count_of(part) for part in recipe.below)
