"""Growing gradient-boosted trees for a yes-or-no question (Friedman 2001; second-order leaves as in Chen and
Guestrin 2016): features in bins, balanced trees of a fixed depth, every tree on a random part of rows and features."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.segment.backends.objects.boosting import Trees

BINS = 64
"""Bins into which a feature is sorted before splits are sought."""


def bin_edges(features: np.ndarray) -> np.ndarray:
    """Return (F, BINS - 1) float32 thresholds between bins that hold about as many rows (N, F) each."""
    shares = np.linspace(0, 1, BINS + 1)[1:-1]
    return np.quantile(features.astype(np.float64), shares, axis=0).T.astype(np.float32)


def binned(features: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Return (N, F) uint8: how many thresholds of its feature every value exceeds."""
    columns = [np.searchsorted(edges[k], features[:, k], side="left") for k in range(features.shape[1])]
    return np.stack(columns, axis=1).astype(np.uint8)


@compiled
def _grow_tree(
    bins: np.ndarray,
    gradient: np.ndarray,
    curvature: np.ndarray,
    rows: np.ndarray,
    allowed: np.ndarray,
    depth: int,
    ridge: float,
    least: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Feature and bin of every inner node (bin BINS: all go left), and the leaves' values."""
    inner = 2**depth - 1
    feature = np.zeros(inner, dtype=np.int32)
    cut = np.full(inner, BINS, dtype=np.int32)
    node_of = np.zeros(len(rows), dtype=np.int32)
    for level in range(depth):
        start, width = 2**level - 1, 2**level
        sums = np.zeros((width, bins.shape[1], BINS, 2))
        for k in range(len(rows)):
            node = node_of[k] - start
            for f in allowed:
                b = bins[rows[k], f]
                sums[node, f, b, 0] += gradient[rows[k]]
                sums[node, f, b, 1] += curvature[rows[k]]
        for node in range(width):
            total_g, total_h = sums[node, allowed[0], :, 0].sum(), sums[node, allowed[0], :, 1].sum()
            best = 1e-6
            for f in allowed:
                g = h = 0.0
                for b in range(BINS - 1):
                    g += sums[node, f, b, 0]
                    h += sums[node, f, b, 1]
                    if h < least or total_h - h < least:
                        continue
                    gain = g * g / (h + ridge) + (total_g - g) ** 2 / (total_h - h + ridge)
                    gain -= total_g**2 / (total_h + ridge)
                    if gain > best:
                        best, feature[start + node], cut[start + node] = gain, f, b
        for k in range(len(rows)):
            node = node_of[k]
            node_of[k] = 2 * node + (2 if bins[rows[k], feature[node]] > cut[node] else 1)
    leaf_gradient, leaf_curvature = np.zeros(2**depth), np.zeros(2**depth)
    for k in range(len(rows)):
        leaf_gradient[node_of[k] - inner] += gradient[rows[k]]
        leaf_curvature[node_of[k] - inner] += curvature[rows[k]]
    return feature, cut, -leaf_gradient / (leaf_curvature + ridge)


@compiled
def _add_tree(
    total: np.ndarray, bins: np.ndarray, feature: np.ndarray, cut: np.ndarray, values: np.ndarray, rate: float
) -> None:
    inner = len(feature)
    for k in range(len(bins)):
        node = 0
        while node < inner:
            node = 2 * node + (2 if bins[k, feature[node]] > cut[node] else 1)
        total[k] += rate * values[node - inner]


def grow_trees(
    features: np.ndarray,
    answers: np.ndarray,
    weights: np.ndarray,
    random: np.random.Generator,
    *,
    trees: int = 200,
    depth: int = 4,
    rate: float = 0.06,
    row_share: float = 0.6,
    feature_share: float = 0.5,
    ridge: float = 4.0,
    least: float = 6.0,
) -> Trees:
    """Return trees whose sum is the log-odds of `answers` (N,) 0/1 given `features` (N, F), rows weighted (N,).

    `rate` shrinks every tree; `ridge` and `least` are the penalty and the smallest sum of second derivatives of a leaf.
    """
    edges = bin_edges(features)
    bins = binned(features, edges)
    mean = float(np.average(answers, weights=weights))
    base = float(np.log(mean / (1 - mean)))
    total = np.full(len(answers), base)
    inner = 2**depth - 1
    node_features = np.zeros((trees, inner), np.int32)
    thresholds = np.full((trees, inner), np.inf, np.float32)
    values = np.zeros((trees, inner + 1), np.float32)
    for k in range(trees):
        probability = 1 / (1 + np.exp(-total))
        rows = np.flatnonzero(random.random(len(answers)) < row_share)
        allowed = np.flatnonzero(random.random(features.shape[1]) < feature_share)
        allowed = allowed if len(allowed) else np.array([0])
        feature, cut, value = _grow_tree(
            bins,
            weights * (probability - answers),
            weights * np.maximum(probability * (1 - probability), 1e-4),
            rows,
            allowed,
            depth,
            ridge,
            least,
        )
        _add_tree(total, bins, feature, cut, value, rate)
        node_features[k] = feature
        split = cut < BINS - 1
        thresholds[k][split] = edges[feature[split], cut[split]]
        values[k] = rate * value
    return node_features, thresholds, values, base
