"""Where a known shape stands, by points of one side of it."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.geometry.transforms import apply
from scipy.spatial import cKDTree

ROUNDS = 25
"""Steps of one fit; by eye."""
KEPT = 0.8
"""Share of the seen points, the nearest, that a round goes by: the rest may be of something else."""
FAR = 0.05
"""A point farther from the shape tells no more than one this far [m]."""
SURE = 0.002
"""About the noise of a depth camera near by [m]."""


def fit_upright(seen: np.ndarray, shape: np.ndarray, *, as_believed: bool = False) -> np.ndarray:
    """Return the motion (4, 4), a turn about the vertical and a shift, that brings a shape onto points of it.

    `seen` (N, 3): points of the side that cameras saw; `shape` (M, 3): all around it, where it is believed. Trimmed
    iterated closest points from the seen points to the shape, so that its hidden side pulls at nothing. It starts with
    the boxes' middles one over the other, tops level: a top is in sight more often than a foot; `as_believed`, where
    it is believed: of what is large one side is in sight.
    """
    low, high = np.percentile(seen, 2, axis=0), np.percentile(seen, 98, axis=0)
    own_low, own_high = shape.min(axis=0), shape.max(axis=0)
    motion = np.eye(4)
    if not as_believed:
        motion[:2, 3] = (low + high - own_low - own_high)[:2] / 2
        motion[2, 3] = high[2] - own_high[2]
    tree = cKDTree(shape)
    for _ in range(ROUNDS):
        back = (seen - motion[:3, 3]) @ motion[:3, :3]
        away, nearest = tree.query(back)
        nearest_rows = np.argsort(away, kind="stable")[: max(3, int(KEPT * len(seen)))]
        step = align_upright(apply(motion, shape[nearest[nearest_rows]]), seen[nearest_rows])
        motion = step @ motion
        if np.abs(step - np.eye(4)).max() < 1e-5:
            break
    return motion


def align_upright(source: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Return the turn about the vertical and shift (4, 4) that bring points (N, 3) closest to others (N, 3)."""
    middle, goal = source.mean(axis=0), target.mean(axis=0)
    a, b = (source - middle)[:, :2], (target - goal)[:, :2]
    angle = np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum())
    step = np.eye(4)
    step[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    step[:3, 3] = goal - step[:3, :3] @ middle
    return step
