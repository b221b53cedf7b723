"""Fragments by what does not depend on their pose: edges of the box with their moments, and volume."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scenewright.stages.cutting.world.body import Body
from scenewright.stages.cutting.world.canonical import box_edges


@dataclass(frozen=True)
class Item:
    """A fragment that is wanted; `number` is its place in the goal."""

    number: int
    edges: tuple[float, float, float]
    """Shortest first [m]."""
    volume: float
    """[m^3]."""


def item_of(body: Body, number: int) -> Item:
    """Return a body as an item."""
    short, middle, long = box_edges(body.moments[1])
    return Item(number, (float(short), float(middle), float(long)), body.volume)


def features(items: Sequence[Item]) -> np.ndarray:
    """Return logarithms of edges and volume (N, 4)."""
    return np.log([(*item.edges, item.volume) for item in items]).reshape(-1, 4)


def likeness(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return about the overlap that fragments with these features (..., 4) can have: of their boxes about one centre,
    times how alike the boxes are filled."""
    a, b = np.exp(first[..., :3]), np.exp(second[..., :3])
    common = np.minimum(a, b).prod(axis=-1)
    boxes = common / (a.prod(axis=-1) + b.prod(axis=-1) - common)
    filled = (first[..., 3] - first[..., :3].sum(axis=-1)) - (second[..., 3] - second[..., :3].sum(axis=-1))
    return np.asarray(boxes * np.exp(-np.abs(filled)))
