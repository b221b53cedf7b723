"""Parts by cells are those of all pairs of a search tree, in the order in which they first appear."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.fuse.connecting import connected
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

REACH = 0.08


def by_pairs(points: np.ndarray) -> np.ndarray:
    pairs = cKDTree(points).query_pairs(REACH, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs), bool), (pairs[:, 0], pairs[:, 1])), shape=(len(points),) * 2)
    return connected_components(graph, directed=False)[1]


@pytest.mark.parametrize("count", [0, 1, 5, 300, 2000])
@pytest.mark.parametrize("rounded", [False, True])
def test_as_by_all_pairs(count: int, rounded: bool) -> None:
    random = np.random.default_rng(count)
    points = random.uniform(-0.6, 0.6, (count, 3))
    points = np.round(points, 2) if rounded else points  # many exactly as far apart as the reach
    expected = by_pairs(points) if count else np.zeros(0, int)
    assert np.array_equal(connected(points, REACH), expected)


def test_groups_stay_apart() -> None:
    random = np.random.default_rng(3)
    points, groups = random.uniform(0, 0.7, (800, 3)), random.integers(0, 3, 800)
    apart = np.column_stack([points, 1000.0 * groups])
    assert np.array_equal(connected(points, REACH, groups), by_pairs(apart))
