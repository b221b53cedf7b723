"""Ask a language map: opened once, asked many times."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.language_map import LanguageMap, LanguageMapFile
from scenewright.schemas.vocabulary import UNNAMED
from scenewright.stages.kit.open_words.answering import MOST_ANSWERS, Fits, fits, ranked, region_index
from scenewright.stages.kit.open_words.calibration import NAMED_SPLAT, Calibration, calibration_of, recognised
from scenewright.stages.kit.open_words.encoder import Encoder
from scenewright.stages.kit.open_words.relations import related
from scenewright.stages.kit.open_words.relevancy import query_rows
from scenewright.stages.kit.open_words.vectors import read_vectors


def source_of(info: LanguageMapFile) -> str:
    """Return which fit a language map needs: a splat whose pieces a panoptic map names has one of its own."""
    return NAMED_SPLAT if info.source == "splat" and any(region.class_name for region in info.regions) else info.source


def class_vectors(info: LanguageMapFile, encoder: Encoder) -> np.ndarray:
    """Return (R, width) vectors of the names of regions' classes; NaN where a region has none, or is but an object."""
    names = sorted({region.class_name for region in info.regions} - {"", UNNAMED})
    result = np.full((len(info.regions), encoder.width), np.nan, np.float32)
    if names:
        vectors = dict(zip(names, encoder.texts([name.replace("_", " ") for name in names]), strict=True))
        for row, region in zip(result, info.regions, strict=True):
            row[:] = vectors.get(region.class_name, np.nan)
    return result


@dataclass(frozen=True)
class Found:
    """One place."""

    region: int
    probability: float
    relevancy: float
    field_relevancy: float | None
    size: float | None
    other: int = 0
    """Instance of what it stands on, in or beside."""


class Finder:
    """A language map with its encoder. Raises BadInput for damaged vectors.

    `recognised`: how much of it the encoder knows, None where nothing was fitted for that encoder; `is_strange`: too
    little, so that hardly anything is believed.
    """

    def __init__(self, language: LanguageMap, encoder: Encoder, calibration: Calibration | None = None) -> None:
        self.info, self.encoder = language.info, encoder
        self.vectors = read_vectors(language)
        self.index = region_index(self.vectors.pieces, self.info)
        self.calibration = calibration or calibration_of(source_of(self.info), self.info.encoder)
        self.classes = class_vectors(self.info, encoder) if self.calibration.class_name else None
        self.recognised: float | None = None
        if self.calibration.fitted:
            self.recognised = recognised(self.vectors.regions, self.index.extents, encoder)
        self.is_strange = self.recognised is not None and self.recognised < self.calibration.least_recognised

    def fits(self, text: str) -> Fits:
        """Return how well a text fits every region."""
        fits_of_text = fits(
            self.vectors, self.info, self.index, query_rows(self.encoder, text), self.calibration, self.classes
        )
        believed = self.calibration.strange if self.is_strange else 1.0
        return replace(fits_of_text, probabilities=believed * fits_of_text.probabilities)

    def find(self, text: str) -> list[Found]:
        """Return places, the likeliest first, of which no two are one."""
        fits_of_text = self.fits(text)
        return [
            self._result_of(fits_of_text, region)
            for region in ranked(self.info, self.index, fits_of_text.probabilities)
        ]

    def find_related(self, relation: tuple[str, str, str], graph: ContactGraphFile) -> list[Found]:
        """Return places of the first thing of a relation; the probability of both is the product, and of several others
        the likeliest counts."""
        first_words, word, of_what = relation
        first, second = self.fits(first_words), self.fits(of_what)
        number = {region.instance: k for k, region in enumerate(self.info.regions)}
        best: dict[int, tuple[float, int]] = {}
        for a, b in sorted(related(graph, word)):
            if a in number and b in number:
                chance = float(first.probabilities[number[a]] * second.probabilities[number[b]])
                if chance > best.get(number[a], (0.0, 0))[0]:
                    best[number[a]] = (chance, b)
        order = sorted(best, key=lambda region: (-best[region][0], region))[:MOST_ANSWERS]
        return [replace(self._result_of(first, k), probability=best[k][0], other=best[k][1]) for k in order]

    def cannot_tell(self, *texts: str) -> bool:
        """Whether the encoder cannot say that a room lacks what texts name: one has a word that it never read and that
        is in no class of the map, or it has learned no pictures like these."""
        in_classes = {word for region in self.info.regions for word in region.class_name.split("_")}
        return self.is_strange or any(set(self.encoder.unread(text)) - in_classes for text in texts)

    def place(self, region: int) -> np.ndarray:
        """Return (3,) where an answer points [m]: of the Gaussians of a piece the one nearest their median, as the
        middle of a box about a corner of walls lies in the air; of an entity the middle of its box."""
        points = self.vectors.means[self.index.members(region)].astype(float)
        if not len(points):
            return np.array(self.info.regions[region].box.center)
        return points[int(np.linalg.norm(points - np.median(points, axis=0), axis=1).argmin())]

    def _result_of(self, fits_of_text: Fits, region: int) -> Found:
        field, size = None, None
        if fits_of_text.field is not None and fits_of_text.sizes is not None:
            field = float(np.clip(fits_of_text.field[region], 0, 1))
            size = self.info.sizes[int(np.clip(fits_of_text.sizes[region], 0, len(self.info.sizes) - 1))]
        return Found(region, float(fits_of_text.probabilities[region]), float(fits_of_text.looks[region]), field, size)
