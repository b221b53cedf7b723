"""Relevancies as probabilities: a logistic function fitted to right and wrong answers in tuning rooms.

data/words/calibration.toml holds one for each source and encoder; `scenewright train word-probabilities` fits it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import file_toml
from scenewright.schemas.places import REINSTALL, data_file
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.open_words.encoder import Encoder

FILE = "words/calibration.toml"
"""File below data/."""
BUNDLED = data_file(FILE)
NAMED_SPLAT = "named splat"
"""Source of fits for splats whose pieces have classes of a panoptic map."""
CLOSEST = 1e-4
"""Closest to 0 and 1 that a share may come, so that its log odds are finite."""
SHORTEST = 0.01
"""Shortest edge that a region counts with [m]."""


@dataclass(frozen=True)
class Calibration:
    """probability = logistic(bias + looks x log odds of the looks + field x log odds of the field + extent x e +
    extent_squared x e^2 + class), where e is the logarithm of the greatest edge of a region [m]. Where a map names the
    region's class, class = class_bias + class_name x (how alike text and name are); 0 elsewhere."""

    bias: float
    looks: float
    field: float
    extent: float
    extent_squared: float
    fitted: bool = True
    least_recognised: float = -1.0
    """A place of which the encoder recognises less (`recognised`) is strange to it ..."""
    strange: float = 1.0
    """... and a probability there is this share of what was fitted elsewhere."""
    class_bias: float = 0.0
    class_name: float = 0.0

    def probabilities(
        self, looks: np.ndarray, field: np.ndarray | None, extents: np.ndarray, alike: np.ndarray | None = None
    ) -> np.ndarray:
        """Return (R,) of relevancies (R,), edges (R,) and how alike text and class are (R,), NaN where a region has no
        class; those of regions that no picture shows are 0."""
        e = np.log(np.maximum(extents, SHORTEST))
        odds = self.bias + self.looks * log_odds(looks) + self.extent * e + self.extent_squared * e**2
        if field is not None:
            odds = odds + self.field * log_odds(field)
        if alike is not None:
            odds = odds + np.where(np.isnan(alike), 0.0, self.class_bias + self.class_name * np.nan_to_num(alike))
        return np.where(looks > 0, 1.0 / (1.0 + np.exp(-odds)), 0.0)


def recognised(regions: np.ndarray, extents: np.ndarray, encoder: Encoder) -> float:
    """Return how alike regions (R, width), rows of zeros where no picture shows one, and the nearest name of the
    vocabulary are, on the mean (cosine), by their greatest edges (R,) [m]; 0 where none is seen.

    Pictures of another kind than the encoder learned from are near no name, however well they fit one rather than
    another.
    """
    has_vector = (regions != 0).any(axis=1)
    names = [entry.name.replace("_", " ") for entry in load_vocabulary().classes]
    read_names = [name for name in names if not encoder.unread(name)]
    if not has_vector.any() or not read_names:
        return 0.0
    nearest = (regions[has_vector].astype(np.float32) @ encoder.texts(read_names).T).max(axis=1)
    return float(np.average(nearest, weights=np.maximum(extents[has_vector], SHORTEST)))


UNFITTED = Calibration(0.0, 1.0, 0.0, 0.0, 0.0, fitted=False)
"""Calibration of an encoder that nothing was fitted for: the relevancy of the looks."""
WEIGHTS = ("bias", "looks", "field", "extent", "extent_squared", "class_bias", "class_name")
OF_PLACES = ("least_recognised", "strange")


def log_odds(shares: np.ndarray) -> np.ndarray:
    """Return log(p / (1 - p)) of shares kept off 0 and 1."""
    clipped = np.clip(shares, CLOSEST, 1 - CLOSEST)
    return np.log(clipped / (1 - clipped))


def fitted(weights: Sequence[float], least_recognised: float = -1.0, strange: float = 1.0) -> Calibration:
    """Return the calibration with weights in the order of WEIGHTS. Raises ValueError for another number of them."""
    bias, looks, field, extent, extent_squared, class_bias, class_name = weights
    return Calibration(
        bias, looks, field, extent, extent_squared, True, least_recognised, strange, class_bias, class_name
    )


def calibration_of(source: str, encoder: str, path: Path = BUNDLED) -> Calibration:
    """Return what was fitted for a source (`splat`, NAMED_SPLAT, `panoptic_map`) and the label of an encoder; UNFITTED
    where nothing was. Raises BadInput for a damaged file."""
    for entry in file_toml(path, hint=REINSTALL).get("fit", ()):
        try:
            if (entry["source"], entry["encoder"]) == (source, encoder):
                weights = [float(entry[name]) for name in WEIGHTS]
                return fitted(weights, float(entry["least_recognised"]), float(entry["strange"]))
        except (KeyError, TypeError, ValueError):
            raise BadInput(
                f"{path}: an entry lacks source, encoder or {', '.join((*WEIGHTS, *OF_PLACES))}", hint=REINSTALL
            ) from None
    return UNFITTED
