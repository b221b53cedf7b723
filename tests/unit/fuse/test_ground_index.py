"""A rectangle of the ground has all of its points, groups have all of their members."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scenewright.stages.fuse.ground_index import CELL, GroundIndex
from scenewright.stages.fuse.pieces import members_of


@given(st.integers(0, 2**31))
def test_all_within_and_none_far_away(seed: int) -> None:
    random = np.random.default_rng(seed)
    points = random.uniform(-4, 4, (random.integers(0, 300), 3))
    low = random.uniform(-5, 5, 2)
    high = low + random.uniform(0, 4, 2)
    found = GroundIndex(points).around(low, high)
    assert len(np.unique(found)) == len(found)
    within = np.flatnonzero(((points[:, :2] >= low) & (points[:, :2] <= high)).all(axis=1))
    assert set(within) <= set(found)
    beside = points[found, :2]
    assert ((beside >= low - CELL) & (beside <= high + CELL)).all()


def test_members() -> None:
    found = members_of(np.array([3, 0, 1, 3, -1, 1]), 1)
    assert {name: own.tolist() for name, own in found.items()} == {1: [2, 5], 3: [0, 3]}
    assert members_of(np.zeros(0, int), 0) == {}
