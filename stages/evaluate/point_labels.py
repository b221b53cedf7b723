"""Moving labels between point sets by nearest neighbour."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree


def nearest_labels(
    points: np.ndarray, labelled_points: np.ndarray, labels: np.ndarray, maximum_distance: float = np.inf
) -> np.ndarray:
    """Give each point (N, 3) the label of the nearest labelled point (V, 3), (V,) within a distance [m], else 0.

    A neighbour whose own label is 0 (unlabelled) passes 0 on: what covers a point decides.
    """
    if not len(points) or not len(labelled_points):
        return np.zeros(len(points), dtype=np.int64)
    tree = cKDTree(labelled_points, balanced_tree=False, compact_nodes=False)
    distance, index = tree.query(points, distance_upper_bound=maximum_distance, workers=1)
    within = np.isfinite(distance)
    result = np.zeros(len(points), dtype=np.int64)
    result[within] = labels[index[within]]
    return result
