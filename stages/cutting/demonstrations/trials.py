"""Trials of the cells of table 6.1 from seeds, and which of them train."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scenewright.stages.cutting.demonstrations.cutter import Demonstration, Scatter, follow
from scenewright.stages.cutting.demonstrations.recipes import CELLS, TRAINING_SHARE, recipes_of
from scenewright.stages.cutting.world.foods import FAMILIES, make_food
from scenewright.stages.kit.geometry.transforms import transform_from_yaw

SPACING = 0.3
"""Distance between objects on the board [m]; by eye."""


def make_trial(cell: str, seed: Sequence[int], scatter: Scatter | None = None) -> Demonstration:
    """Return the trial of a cell and a seed: foods, recipes, and how the scripted cutter carried them out."""
    random = np.random.default_rng([list(CELLS).index(cell), *seed])
    names = tuple(random.choice(sorted(FAMILIES), size=CELLS[cell].objects).tolist())
    objects = []
    for number, name in enumerate(names):
        pose = transform_from_yaw(float(random.uniform(-np.pi, np.pi)), np.array([SPACING * number, 0.0, 0.0]))
        objects.append(make_food(name, random).moved(pose))
    return follow(cell, names, objects, tuple(recipes_of(CELLS[cell], random)), random, scatter=scatter)


def make_trials(seed: int, scatter: Scatter | None = None, share: float = 1.0) -> list[Demonstration]:
    """Return the trials of every cell, 110 with `share` 1."""
    return [
        make_trial(cell.name, (seed, number), scatter)
        for cell in CELLS.values()
        for number in range(max(1, round(share * cell.trials)))
    ]


def is_for_training(cell: str, number: int, trials: int) -> bool:
    """Whether the trial of this number within its cell is one that methods learn from: the first 40 % of n1m1."""
    return cell == "n1m1" and number < TRAINING_SHARE * trials
