"""How well pairs of frames agree under one hypothesis about their poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Fit:
    """One number of each kind per pair."""

    residuals: np.ndarray
    """(P,) median residual: relative depth, at most 1; or pixels from the epipolar line."""
    costs: np.ndarray
    """(P,) mean truncated residual in [0, 1]."""
    overlaps: np.ndarray
    """(P,) share of the samples that could be compared."""

    @property
    def cost(self) -> float:
        """Mean over the pairs."""
        return float(self.costs.mean()) if len(self.costs) else 1.0

    @property
    def residual(self) -> float:
        """Median over the pairs."""
        return float(np.median(self.residuals)) if len(self.residuals) else 1.0

    @property
    def overlap(self) -> float:
        """Median over the pairs."""
        return float(np.median(self.overlaps)) if len(self.overlaps) else 0.0

    def wins(self, other: Fit) -> float:
        """Share of the pairs in which this costs less."""
        return float((self.costs < other.costs).mean()) if len(self.costs) else 0.0


def as_fit(rows: list[tuple[float, float, float]]) -> Fit:
    """Return the fit of one (residual, cost, overlap) a pair."""
    columns = np.array(rows, dtype=float).reshape(-1, 3)
    return Fit(columns[:, 0], columns[:, 1], columns[:, 2])


def relative_pose(target: np.ndarray, source: np.ndarray) -> np.ndarray:
    """Return target_from_source (4, 4) of two rigid poses world_from_target and world_from_source."""
    rotation = target[:3, :3].T
    result = np.eye(4)
    result[:3, :3] = rotation @ source[:3, :3]
    result[:3, 3] = rotation @ (source[:3, 3] - target[:3, 3])
    return result
