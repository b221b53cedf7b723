"""How far a traced thread lies from the true one, and how much of it was found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

STEP = 0.0003
"""Spacing at which both curves are compared [m]."""
NEAR = 0.002
"""True thread within this distance of the curve counts as found [m]."""


@dataclass(frozen=True)
class ThreadError:
    """Of one frame [m]: median and 95 % distance of the curve to the true one, lengths, and the share (0 to 1) of the
    true thread that lies within NEAR of the curve. Distances are NaN where there is no curve."""

    median: float
    p95: float
    length: float
    true_length: float
    covered: float


def resampled(points: np.ndarray, step: float = STEP) -> np.ndarray:
    """Return points (M, 3) about `step` apart along the polyline (N, 3), its ends included."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    at = np.linspace(0.0, along[-1], max(2, int(along[-1] / step) + 1))
    return np.stack([np.interp(at, along, points[:, axis]) for axis in range(3)], axis=1)


def thread_error(points: np.ndarray, length: float, true: np.ndarray) -> ThreadError:
    """Return the error of a curve (N, 3) against the true polyline (M, 3)."""
    dense = resampled(true)
    true_length = float(np.linalg.norm(np.diff(true, axis=0), axis=1).sum())
    if len(points) < 2:
        return ThreadError(float("nan"), float("nan"), length, true_length, 0.0)
    curve = resampled(points)
    distances, _ = cKDTree(dense).query(curve)
    back, _ = cKDTree(curve).query(dense)
    return ThreadError(
        float(np.median(distances)),
        float(np.quantile(distances, 0.95)),
        length,
        true_length,
        float((back < NEAR).mean()),
    )


def thread_metrics(errors: Sequence[ThreadError]) -> dict[str, float]:
    """Return `ours/thread/<measure>` -> number: medians over the frames with a curve; shares over all."""
    traced = [error for error in errors if np.isfinite(error.median)]
    figures = {
        "ours/thread/frames": float(len(errors)),
        "ours/thread/traced": len(traced) / max(1, len(errors)),
        "ours/thread/found_share": float(np.mean([error.covered for error in errors])) if errors else 0.0,
    }
    if traced:
        figures["ours/thread/distance_mm"] = 1000 * float(np.median([error.median for error in traced]))
        figures["ours/thread/distance_mm_p95"] = 1000 * float(np.median([error.p95 for error in traced]))
        figures["ours/thread/length_error_share"] = float(
            np.median([abs(error.length - error.true_length) / error.true_length for error in traced])
        )
    return {name: round(value, 4) for name, value in figures.items()}


def thread_rows(errors: Sequence[ThreadError]) -> list[str]:
    """Return the lines of a table, one row a frame."""
    lines = [
        "| frame | distance mm median / p95 | length mm | true length mm | found of the true % |",
        "|---|---|---|---|---|",
    ]
    for index, error in enumerate(errors):
        lines.append(
            f"| {index} | {1000 * error.median:.2f} / {1000 * error.p95:.2f} | {1000 * error.length:.0f} "
            f"| {1000 * error.true_length:.0f} | {100 * error.covered:.0f} |"
        )
    return lines
