"""Relevancies as probabilities: a logistic function fitted to right and wrong answers in tuning rooms.

data/words/calibration.toml holds one for each source and encoder; benchmarks/words/calibrate.py fits it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from schemas.errors import BadInput
from schemas.outside import file_toml

FILE = "words/calibration.toml"
"""Below data/."""
BUNDLED = Path(__file__).resolve().parents[3] / "data" / FILE
CLOSEST = 1e-4
SHORTEST = 0.01
"""Edge of a region, at least [m]."""


@dataclass(frozen=True)
class Calibration:
    """probability = logistic(bias + looks x log odds of the looks + field x log odds of the field + extent x e +
    extent_squared x e^2), where e is the logarithm of the greatest edge of a region [m]."""

    bias: float
    looks: float
    field: float
    extent: float
    extent_squared: float
    fitted: bool = True

    def probabilities(self, looks: np.ndarray, field: np.ndarray | None, extents: np.ndarray) -> np.ndarray:
        """Return (R,) of relevancies (R,) and edges (R,); those of regions that no picture shows are 0."""
        e = np.log(np.maximum(extents, SHORTEST))
        odds = self.bias + self.looks * log_odds(looks) + self.extent * e + self.extent_squared * e**2
        if field is not None:
            odds = odds + self.field * log_odds(field)
        return np.where(looks > 0, 1.0 / (1.0 + np.exp(-odds)), 0.0)


UNFITTED = Calibration(0.0, 1.0, 0.0, 0.0, 0.0, fitted=False)
"""Of an encoder that nothing was fitted for: the relevancy of the looks."""
WEIGHTS = ("bias", "looks", "field", "extent", "extent_squared")


def log_odds(shares: np.ndarray) -> np.ndarray:
    """Return log(p / (1 - p)) of shares kept off 0 and 1."""
    kept = np.clip(shares, CLOSEST, 1 - CLOSEST)
    return np.log(kept / (1 - kept))


def fitted(weights: Sequence[float]) -> Calibration:
    """Return the calibration with weights in the order of WEIGHTS. Raises ValueError for another number of them."""
    bias, looks, field, extent, extent_squared = weights
    return Calibration(bias, looks, field, extent, extent_squared)


def calibration_of(source: str, encoder: str, path: Path = BUNDLED) -> Calibration:
    """Return what was fitted for a source (`splat`, `panoptic_map`) and the label of an encoder; UNFITTED where nothing
    was. Raises BadInput for a damaged file."""
    for entry in file_toml(path).get("fit", ()):
        try:
            if (entry["source"], entry["encoder"]) == (source, encoder):
                return fitted([float(entry[name]) for name in WEIGHTS])
        except (KeyError, TypeError, ValueError):
            raise BadInput(f"{path}: an entry lacks source, encoder or {', '.join(WEIGHTS)}") from None
    return UNFITTED
