"""From a text to places: relevancy of every Gaussian at its own best size, of every region, and a probability.

No view is asked (the thesis takes one scale for all, the best in the view that is shown). Of regions that share most of
their Gaussians the likeliest alone is an answer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from schemas.language_map import LanguageMapFile
from stages.kit.open_words.relevancy import relevancy
from stages.kit.open_words.calibration import Calibration
from stages.kit.open_words.vectors import Vectors

MOST_ANSWERS = 20
SHARED = 0.3
"""Regions that share more than this of the smaller one's box or Gaussians are one place."""


@dataclass(frozen=True)
class Fits:
    """How well a text fits every region."""

    looks: np.ndarray
    """(R,) relevancy of what pictures show."""
    field: np.ndarray | None
    """(R,) mean relevancy of the Gaussians; None without any."""
    sizes: np.ndarray | None
    """(R,) index of the size that fits best."""
    probabilities: np.ndarray


@dataclass(frozen=True)
class RegionIndex:
    """Which Gaussians are in which region, made once for many queries."""

    gaussians: np.ndarray
    """(K,) Gaussians by region."""
    starts: np.ndarray
    """(R + 1,)"""

    def members(self, region: int) -> np.ndarray:
        """Return the Gaussians of a region."""
        return self.gaussians[self.starts[region] : self.starts[region + 1]]


def region_index(pieces: np.ndarray, count: int) -> RegionIndex:
    """Return the index of pieces (granularities, N) with `count` regions."""
    flat = pieces.reshape(-1)
    gaussian = np.tile(np.arange(pieces.shape[1] if pieces.ndim == 2 else 0), len(pieces))
    order = np.argsort(flat, kind="stable")
    order = order[flat[order] >= 0]
    starts = np.concatenate([[0], np.cumsum(np.bincount(flat[order], minlength=count))])
    return RegionIndex(gaussian[order], starts)


def fits(vectors: Vectors, info: LanguageMapFile, index: RegionIndex, rows: np.ndarray, calibration: Calibration) -> Fits:
    """Return how well the text rows[0] fits, against the canonical phrases rows[1:]."""
    seen = np.array([region.looks > 0 for region in info.regions], bool)
    of_looks = np.where(seen, relevancy(vectors.regions, rows), 0.0)
    field = sizes = None
    if len(vectors.means):
        found = relevancy(vectors.vectors, rows)
        best = found.argmax(axis=1)
        counts = np.maximum(np.diff(index.starts), 1)
        which = np.repeat(np.arange(len(seen)), np.diff(index.starts))
        weights = vectors.opacities[index.gaussians]
        total = np.maximum(np.bincount(which, weights, minlength=len(seen)), 1e-9)
        at_best = found[np.arange(len(found)), best]
        field = np.bincount(which, weights * at_best[index.gaussians], minlength=len(seen)) / total
        sizes = np.rint(np.bincount(which, best[index.gaussians], minlength=len(seen)) / counts).astype(int)
    return Fits(of_looks, field, sizes, calibration.probabilities(of_looks, field))


def ranked(info: LanguageMapFile, index: RegionIndex, probabilities: np.ndarray, most: int = MOST_ANSWERS) -> list[int]:
    """Return regions, the likeliest first, of which no two are one place."""
    kept: list[int] = []
    for region in np.argsort(-probabilities, kind="stable"):
        if len(kept) == most:
            break
        if all(not _one_place(info, index, int(region), other) for other in kept):
            kept.append(int(region))
    return kept


def _one_place(info: LanguageMapFile, index: RegionIndex, a: int, b: int) -> bool:
    if info.regions[a].instance or info.regions[b].instance:
        return False  # entities of a map are things of their own
    first, second = index.members(a), index.members(b)
    if len(first) and len(second):
        shared = len(np.intersect1d(first, second, assume_unique=True))
        if shared > SHARED * min(len(first), len(second)):
            return True
    boxes = [info.regions[k].box for k in (a, b)]
    low = np.max([np.array(box.center) - np.array(box.size) / 2 for box in boxes], axis=0)
    high = np.min([np.array(box.center) + np.array(box.size) / 2 for box in boxes], axis=0)
    volume = float(np.prod(np.maximum(high - low, 0)))
    return volume > SHARED * min(float(np.prod(np.maximum(box.size, 1e-3))) for box in boxes)
