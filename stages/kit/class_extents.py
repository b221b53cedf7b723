"""How large things of a class are: a detector that calls a storage box a telephone is corrected by a metre rule."""

from __future__ import annotations

import numpy as np

LARGEST_EXTENT = {
    "cup": 0.25,
    "bowl": 0.45,
    "bottle": 0.5,
    "mouse": 0.2,
    "remote": 0.3,
    "keyboard": 0.7,
    "laptop": 0.7,
    "book": 0.6,
    "utensil": 0.45,
    "food": 0.5,
    "clock": 0.7,
    "vase": 0.8,
    "microwave": 0.9,
    "backpack": 1.0,
    "toilet": 1.2,
    "chair": 1.8,
    "oven": 1.6,
    "fridge": 2.6,
    "monitor": 2.0,
    "sink": 1.0,
    "plant": 2.5,
    "person": 2.3,
    "table": 4.0,
    "bed": 3.2,
    "sofa": 4.0,
    "bench": 4.0,
}
"""Longest diagonal of a thing of the class [m], with a margin."""

SMALLEST_EXTENT = {
    "microwave": 0.3,
    "oven": 0.35,
    "fridge": 0.45,
    "monitor": 0.25,
    "laptop": 0.2,
    "sink": 0.25,
    "toilet": 0.3,
    "chair": 0.3,
    "table": 0.4,
    "bed": 1.6,
    "sofa": 0.9,
    "bench": 0.4,
    "person": 0.3,
}
"""Shortest diagonal of what is seen of it when nothing cuts it off [m]."""


def extent_of(points: np.ndarray) -> float:
    """Return the diagonal [m] of the middle 96 % of points (N, 3) along each axis: stray points do not count."""
    low, high = np.percentile(points, [2, 98], axis=0)
    return float(np.linalg.norm(high - low))


def is_plausible(class_name: str, extent: float, *, cut_off: bool) -> bool:
    """Whether a thing of the class can have this extent [m]; only its largest size counts when a picture cuts it
    off."""
    if extent > LARGEST_EXTENT.get(class_name, np.inf):
        return False
    return cut_off or extent >= SMALLEST_EXTENT.get(class_name, 0.0)
