"""Accuracy and completeness of a reconstructed surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class SurfaceAgreement:
    """Distances between a reconstruction and the truth [m], and shares within the threshold."""

    accuracy_mean: float
    accuracy_median: float
    accuracy_p95: float
    precision: float
    """Share of the reconstruction within the threshold of the true surface."""
    completeness_mean: float
    recall: float
    """Share of the true visible points within the threshold of the reconstruction."""
    fscore: float
    """Harmonic mean of precision and recall (Knapitsch 2017)."""


def distances_to_mesh(points: np.ndarray, vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return the unsigned distance (N,) of points (N, 3) to a triangle mesh (V, 3), (F, 3). Exact (Embree)."""
    import open3d as o3d

    if not len(points):
        return np.zeros(0)
    if not len(triangles):
        return np.full(len(points), np.inf)
    tensor: Any = o3d.core.Tensor  # its stub forgets that dtype and device have defaults
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        tensor(np.ascontiguousarray(vertices, dtype=np.float32)),
        tensor(np.ascontiguousarray(triangles, dtype=np.uint32)),
    )
    distances = scene.compute_distance(tensor(np.ascontiguousarray(points, dtype=np.float32)))
    return np.asarray(distances.numpy(), dtype=float)


def surface_agreement(
    to_truth: np.ndarray, to_reconstruction: np.ndarray, threshold: float, cap: float = 0.5
) -> SurfaceAgreement | None:
    """Summarise distances of reconstructed points to the true surface (N,), and of true points back (M,) [m].

    Completeness distances are capped at `cap` in the mean, so that an empty map has a finite figure. None when
    there is no reconstructed or no true point.
    """
    if not len(to_truth) or not len(to_reconstruction):
        return None
    precision = float(np.mean(to_truth <= threshold))
    recall = float(np.mean(to_reconstruction <= threshold))
    total = precision + recall
    return SurfaceAgreement(
        accuracy_mean=float(to_truth.mean()),
        accuracy_median=float(np.median(to_truth)),
        accuracy_p95=float(np.quantile(to_truth, 0.95)),
        precision=precision,
        completeness_mean=float(np.minimum(to_reconstruction, cap).mean()),
        recall=recall,
        fscore=2.0 * precision * recall / total if total else 0.0,
    )
