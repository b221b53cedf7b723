"""Shapes that somebody drew in a tool for annotation, with a word for each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scenewright.stages.segment.backends.masks.classes import words_numbered
from scenewright.stages.segment.backends.masks.encoded import Crop, flatten_encoded
from scenewright.stages.segment.backends.masks.given import (
    Category,
    GivenFrame,
    GivenMask,
    MaskSource,
    Picture,
    ReadSettings,
)


@dataclass(frozen=True)
class Shape:
    """One thing that was drawn."""

    word: str
    """Its class; empty: none."""
    area: list[np.ndarray] | Crop | None
    """Polygons (K, 2) x, y [pixels], or pixels; None: a point or a line, which encloses nothing."""
    score: float = 1.0


def source_of_shapes(
    pictures: Sequence[Picture], shapes: Sequence[Sequence[Shape]], where: Sequence[str]
) -> MaskSource:
    """Return the masks of pictures, of each its shapes and, for messages, where they stand."""
    numbers = words_numbered((shape.word for rows in shapes for shape in rows if shape.word), {})

    def read(place: int, shape: tuple[int, int], settings: ReadSettings) -> GivenFrame:
        told = [GivenMask(numbers.get(row.word), row.score) for row in shapes[place]]
        areas = [row.area for row in shapes[place]]
        return flatten_encoded(areas, told, settings, shape, where[place], pictures[place].size)

    return MaskSource(tuple(pictures), {number: Category(word) for word, number in numbers.items()}, read, ("scores",))


def points_of(value: Any) -> np.ndarray | None:
    """Return points (K, 2) of a list of pairs of numbers; None when it is none."""
    if not isinstance(value, list) or not all(isinstance(pair, list) and len(pair) == 2 for pair in value):
        return None
    flat = [number for pair in value for number in pair]
    if not all(isinstance(n, int | float) and not isinstance(n, bool) and abs(n) < 1e9 for n in flat):
        return None
    return np.array(flat, dtype=np.float64).reshape(-1, 2)
