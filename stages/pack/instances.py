"""A packing problem: boxes with their start poses on the table, a basket, obstacles; and the published ones by seed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.stages.pack.hand_shape import PUBLISHED, HandShape
from scenewright.stages.pack.records import Action, BoxState, Observation, Rectangle
from scenewright.stages.pack.solids import Block, block_over


@dataclass(frozen=True)
class Obstacle:
    """A fixed block that stands on the table or in the basket."""

    rectangle: Rectangle
    top: float
    """World z [m] of its upper face."""

    @property
    def block(self) -> Block:
        """The space that it fills, from the ground up."""
        return block_over(self.rectangle.low, self.rectangle.high, 0.0, self.top)


@dataclass(frozen=True)
class Instance:
    """One problem. `boxes` lie where they are at rest; `certificate` is a plan that is known to solve it."""

    name: str
    boxes: tuple[BoxState, ...]
    basket: Rectangle
    obstacles: tuple[Obstacle, ...] = ()
    certificate: tuple[Action, ...] = ()
    hand: HandShape = PUBLISHED
    """That packs them."""

    @property
    def observation(self) -> Observation:
        """What a proposer sees: everything but the heights of obstacles and the robot's reach."""
        rectangles = tuple(obstacle.rectangle for obstacle in self.obstacles)
        return Observation(self.boxes, self.basket, rectangles, self.hand)

    @property
    def fill(self) -> float:
        """Area of the boxes over the basket's area that no obstacle covers."""
        area = _area(self.basket) - sum(_area(obstacle.rectangle) for obstacle in self.obstacles)
        return sum(box.width * box.length for box in self.boxes) / area


def _area(rectangle: Rectangle) -> float:
    return (rectangle.high[0] - rectangle.low[0]) * (rectangle.high[1] - rectangle.low[1])


def centred(name: str, x: float, y: float, width: float, length: float) -> Rectangle:
    """Return the rectangle of extents `width` (x) and `length` (y) [m] about a centre."""
    return Rectangle(name, (x - width / 2, y - length / 2), (x + width / 2, y + length / 2))


# Extents in metres, in the order of the fixed plan of the sampler study (docs/LLM3.md; thesis figure 4.5).
BOX_SETS: dict[str, tuple[tuple[str, float, float, float], ...]] = {
    "easy": (
        ("red_box", 0.035, 0.035, 0.07),
        ("blue_box", 0.07, 0.07, 0.07),
        ("green_box", 0.035, 0.035, 0.07),
        ("tan_box", 0.035, 0.035, 0.07),
    ),
    "medium": (
        ("red_box", 0.035, 0.035, 0.04),
        ("blue_box", 0.07, 0.07, 0.07),
        ("cyan_box", 0.07, 0.07, 0.07),
        ("yellow_box", 0.035, 0.035, 0.04),
    ),
    "hard": (
        ("red_box", 0.07, 0.07, 0.07),
        ("blue_box", 0.07, 0.07, 0.07),
        ("green_box", 0.105, 0.035, 0.07),
        ("tan_box", 0.035, 0.035, 0.07),
    ),
}
"""Name of a set -> its boxes: name and extents [m]."""
BASKETS: dict[str, Rectangle] = {
    "small": centred("basket", 0.65, 0.0, 0.22, 0.21),
    "medium": centred("basket", 0.70, 0.0, 0.32, 0.21),
    "large": centred("basket", 0.75, 0.0, 0.42, 0.21),
}
"""Name -> the basket in the table's plane [m]."""
PUBLISHED_CELLS: dict[str, tuple[str, str]] = {
    "easy": ("easy", "small"),
    "medium": ("medium", "small"),
    "hard": ("hard", "small"),
    "hard_medium_basket": ("hard", "medium"),
    "hard_large_basket": ("hard", "large"),
}
"""Columns of table 4.1 -> (box set, basket). `hard` is also the column Small of setting 2: the same run."""
GRIPPER_GAP = 0.09
"""Room for the hand between two boxes at the start [m]; by eye."""


def published_instance(cell: str, seed: int) -> Instance:
    """Return an instance of a cell of table 4.1: start poses drawn as in the published environment.

    x ~ U(.385, .395); box i has y ~ U(max(-.6 + .3 i, far edge of the one before and a hand's gap), -.6 + .3 (i+1)).
    """
    set_name, basket = PUBLISHED_CELLS[cell]
    random = np.random.default_rng([seed, 41, sorted(PUBLISHED_CELLS).index(cell)])
    boxes = []
    edge = -np.inf
    for number, (name, width, length, height) in enumerate(BOX_SETS[set_name]):
        x = random.uniform(0.385, 0.395)
        low, high = max(-0.6 + 0.3 * number, edge + GRIPPER_GAP + length / 2), -0.6 + 0.3 * (number + 1)
        y = random.uniform(min(low, high), high)
        edge = y + length / 2
        boxes.append(BoxState(name, width, length, height, round(x, 6), round(y, 6), 0.0, False))
    return Instance(f"published/{cell}/{seed}", tuple(boxes), BASKETS[basket])
