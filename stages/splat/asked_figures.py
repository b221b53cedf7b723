"""How well queries are answered: from the first place found for each, its probability, and whether it is right."""

from __future__ import annotations

import numpy as np

REJECTED = 0.9
"""Share of absent texts that are rejected at the threshold where recall is looked at."""
BINS = 10
"""Bins of the calibration error."""


def recall_at_rejection(present: np.ndarray, right: np.ndarray, absent: np.ndarray) -> float | None:
    """Return the share of things found at the one threshold that rejects REJECTED of the absent texts; None without
    texts of both kinds. `present` (N,), `absent` (M,): probabilities of first places; `right` (N,) bool."""
    if not len(present) or not len(absent):
        return None
    return float((right & (present > np.quantile(absent, REJECTED))).mean())


def calibration_error(chances: np.ndarray, hits: np.ndarray) -> float | None:
    """Return the expected calibration error of probabilities (N,) over BINS bins (Guo et al. 2017, equation 3); `hits`
    (N,): whether each came true. None without any."""
    if not len(chances):
        return None
    bins = np.minimum((BINS * chances).astype(int), BINS - 1)
    gaps = [abs(chances[bins == b].mean() - hits[bins == b].mean()) * (bins == b).mean() for b in np.unique(bins)]
    return float(sum(gaps))
