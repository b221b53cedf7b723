"""Gradient-boosted trees for a yes-or-no question: scoring in numba, the arrays kept as safetensors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.kit.formats.safetensors_file import read_safetensors, write_safetensors

Trees = tuple[np.ndarray, np.ndarray, np.ndarray, float]
"""Feature of every inner node (T, 2^d - 1) int32, its threshold (T, 2^d - 1) float32 (above goes right), value of every
leaf (T, 2^d) float32, and the score of no tree at all."""
FORMAT = "scenewright boosted trees"
_OTHER = "put the file of the project back, or write it anew: scenewright train tabletop-pairs with --ship"


@compiled
def score_rows(row: np.ndarray, trees: tuple[np.ndarray, np.ndarray, np.ndarray, float]) -> float:
    """Return the log-odds of one row of features (F,) float32."""
    features, thresholds, values, base = trees
    inner = features.shape[1]
    total = base
    for tree in range(features.shape[0]):
        node = 0
        while node < inner:
            node = 2 * node + (2 if row[features[tree, node]] > thresholds[tree, node] else 1)
        total += values[tree, node - inner]
    return total


def write_trees(path: Path, trees: Trees, features: tuple[str, ...], description: str) -> None:
    """Write trees with the names of their features."""
    tensors = {"features": trees[0], "thresholds": trees[1], "values": trees[2], "base": np.array([trees[3]])}
    write_safetensors(path, tensors, {"format": FORMAT, "names": ",".join(features), "description": description})


def read_trees(path: Path, features: tuple[str, ...]) -> Trees:
    """Return the trees of a file. Raises BadInput when it is damaged, something else, or for other features."""
    tensors, metadata = read_safetensors(path)
    if metadata.get("format") != FORMAT or set(tensors) != {"features", "thresholds", "values", "base"}:
        raise BadInput(f"{path}: holds no boosted trees", hint=_OTHER)
    if metadata.get("names") != ",".join(features):
        raise BadInput(f"{path}: these trees were grown on other features", hint=_OTHER)
    nodes, thresholds, values, base = (tensors[name] for name in ("features", "thresholds", "values", "base"))
    inner = nodes.shape[1] if nodes.ndim == 2 else 0
    shapes = nodes.ndim == 2 and thresholds.shape == nodes.shape and values.shape == (len(nodes), inner + 1)
    types = nodes.dtype == np.int32 and thresholds.dtype == values.dtype == np.float32
    complete = inner > 0 and (inner + 1) & inner == 0 and base.shape == (1,)
    if not (shapes and types and complete) or nodes.min(initial=0) < 0 or nodes.max(initial=0) >= len(features):
        raise BadInput(f"{path}: the arrays are not those of balanced trees over {len(features)} features", hint=_OTHER)
    if np.isnan(thresholds).any() or not np.isfinite(values).all() or not np.isfinite(base).all():
        raise BadInput(f"{path}: the trees hold numbers that are none", hint=_OTHER)
    return nodes, thresholds, values, float(base[0])
