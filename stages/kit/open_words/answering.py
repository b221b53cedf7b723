"""From a text to places: relevancy of every Gaussian at its own best size, of every region, and a probability.

No view is asked (the thesis takes one scale for all, the best in the view that is shown). Of regions that share most of
their Gaussians the likeliest alone is an answer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.schemas.language_map import LanguageMapFile
from scenewright.stages.kit.open_words.calibration import Calibration
from scenewright.stages.kit.open_words.relevancy import TEMPERATURE, margins, relevancy
from scenewright.stages.kit.open_words.vectors import Vectors

MOST_ANSWERS = 20
"""Most answers to a text unless more are asked for."""
SHARED = 0.3
"""Regions that share more than this of the smaller one's box or Gaussians are one place."""

TOUCHING, LARGER, AS_WELL = 0.05, 1.2, 0.6
"""A larger thing (times the edge) within this distance [m] explains what a smaller one looks like if it is at least so
many times as likely. Set on two tuning rooms (`room` 7 and 9417)."""


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
    gaussians: np.ndarray | None
    """(N,) relevancy of every Gaussian at its best size; None without any."""


@dataclass(frozen=True)
class RegionIndex:
    """Which Gaussians are in which region, made once for many queries."""

    gaussians: np.ndarray
    """(K,) Gaussians by region."""
    starts: np.ndarray
    """(R + 1,)"""

    owners: np.ndarray
    """(K,) region of each of `gaussians`."""
    extents: np.ndarray
    """(R,) greatest edge of each region's box [m]."""
    lows: np.ndarray
    highs: np.ndarray
    """(R, 3) least and greatest corners of the boxes as if they stood along the axes [m]."""

    def sums(self, values: np.ndarray) -> np.ndarray:
        """Return (R,) sums of values (N,) of Gaussians over the regions."""
        return np.bincount(self.owners, values[self.gaussians], minlength=len(self.extents))

    def members(self, region: int) -> np.ndarray:
        """Return the Gaussians of a region."""
        return self.gaussians[self.starts[region] : self.starts[region + 1]]


def region_index(pieces: np.ndarray, info: LanguageMapFile) -> RegionIndex:
    """Return the index of pieces (granularities, N) of a language map."""
    count = len(info.regions)
    gaussians, starts = members_of(pieces, count)
    owners = np.repeat(np.arange(count), np.diff(starts))
    centers = np.array([region.box.center for region in info.regions], float).reshape(-1, 3)
    sizes = np.array([region.box.size for region in info.regions], float).reshape(-1, 3)
    extents = sizes.max(axis=1, initial=0.0)
    return RegionIndex(gaussians, starts, owners, extents, centers - sizes / 2, centers + sizes / 2)


def members_of(pieces: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the Gaussians (K,) by region and where each of `count` regions starts (count + 1,)."""
    flat = pieces.reshape(-1)
    gaussian = np.tile(np.arange(pieces.shape[1]), len(pieces))
    order = np.argsort(flat, kind="stable")
    order = order[flat[order] >= 0]
    return gaussian[order], np.concatenate([[0], np.cumsum(np.bincount(flat[order], minlength=count))])


def fits(
    vectors: Vectors,
    info: LanguageMapFile,
    index: RegionIndex,
    rows: np.ndarray,
    calibration: Calibration,
    classes: np.ndarray | None = None,
) -> Fits:
    """Return how well the text rows[0] fits, against the canonical phrases rows[1:]; `classes` (R, width): vectors of
    the names of the regions' classes, NaN where they have none."""
    was_looked_at = np.array([region.looks > 0 for region in info.regions], bool)
    of_looks = np.where(was_looked_at, relevancy(margins(vectors.regions, rows)), 0.0)
    field = sizes = at_best = None
    if len(vectors.means):
        apart = margins(vectors.vectors, rows)
        best = apart.argmax(axis=1)
        at_best = relevancy(apart[np.arange(len(apart)), best])
        weights = vectors.opacities
        field = index.sums(weights * at_best) / np.maximum(index.sums(weights), 1e-9)
        sizes = np.rint(index.sums(best.astype(float)) / np.maximum(np.diff(index.starts), 1)).astype(int)
    alike = None if classes is None else TEMPERATURE * (classes @ rows[0])
    probabilities = calibration.probabilities(of_looks, field, index.extents, alike)
    if info.source == "panoptic_map":
        probabilities = explained(probabilities, index)
    return Fits(of_looks, field, sizes, probabilities, at_best)


def explained(probabilities: np.ndarray, index: RegionIndex) -> np.ndarray:
    """Return the probabilities (R,) of entities when larger things that they touch explain what they look like.

    A square about a bottle shows mostly the table that it stands on. Where the table fits nearly as well, the bottle is
    as likely as before only if the table is not what was asked for.
    """
    gaps = np.maximum(index.lows[:, None] - index.highs[None], index.lows[None] - index.highs[:, None]).max(axis=2)
    larger = index.extents[None] >= LARGER * index.extents[:, None]
    as_well = probabilities[None] >= AS_WELL * probabilities[:, None]
    explains = np.where((gaps <= TOUCHING) & larger & as_well, probabilities[None], 0.0)
    return probabilities * (1.0 - explains.max(axis=1, initial=0.0))


def ranked(info: LanguageMapFile, index: RegionIndex, probabilities: np.ndarray, most: int = MOST_ANSWERS) -> list[int]:
    """Return regions, the likeliest first, of which no two are one place."""
    answers: list[int] = []
    for region in np.argsort(-probabilities, kind="stable"):
        if len(answers) == most:
            break
        if not _is_known_place(info, index, int(region), answers):
            answers.append(int(region))
    return answers


def _is_known_place(info: LanguageMapFile, index: RegionIndex, region: int, answers: list[int]) -> bool:
    """Whether a region shares its box or its Gaussians with one of those kept; entities of a map are things of their
    own."""
    if not answers or info.source == "panoptic_map":
        return False
    edges = np.minimum(index.highs[region], index.highs[answers]) - np.maximum(index.lows[region], index.lows[answers])
    shared = np.prod(np.maximum(edges, 0), axis=1)
    volumes = np.prod(np.maximum(index.highs - index.lows, 1e-3)[[region, *answers]], axis=1)
    if (shared > SHARED * np.minimum(volumes[0], volumes[1:])).any():
        return True
    own_members = index.members(region)
    for answer in (answers[k] for k in np.flatnonzero((edges > 0).all(axis=1))):
        theirs = index.members(answer)
        common = len(np.intersect1d(own_members, theirs, assume_unique=True))
        if common > SHARED * min(len(own_members), len(theirs)):
            return True
    return False
