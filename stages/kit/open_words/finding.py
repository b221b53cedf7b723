"""Ask a language map: opened once, asked many times."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.errors import UsageError
from scenewright.schemas.language_map import LanguageMap, LanguageMapFile, LanguageRegion
from scenewright.schemas.vocabulary import UNNAMED
from scenewright.stages.kit.geometry.point_clouds import middle_of
from scenewright.stages.kit.open_words.answering import MOST_ANSWERS, Fits, fits, ranked, region_index
from scenewright.stages.kit.open_words.calibration import NAMED_SPLAT, Calibration, calibration_of, log_odds, recognised
from scenewright.stages.kit.open_words.encoder import Encoder
from scenewright.stages.kit.open_words.reading.evidence import Names
from scenewright.stages.kit.open_words.reading.matching import Thing, is_layout, matches
from scenewright.stages.kit.open_words.reading.meaning import Meanings
from scenewright.stages.kit.open_words.reading.phrase import Phrase, read_phrase
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


def thing_of(region: LanguageRegion) -> Thing:
    """Return a region as a thing that may be asked for by its names."""
    return Thing(
        region.instance,
        Names(region.names, region.seen, region.said),
        region.colors,
        max(region.box.size),
        bool(region.class_name) and is_layout(region.class_name),
    )


def things_of(info: LanguageMapFile) -> tuple[list[Thing], np.ndarray]:
    """Return the distinct things of a language map, and (R,) which of them each region is a piece of; regions of no
    entity are one thing without names."""
    first: dict[int, int] = {}
    for number, region in enumerate(info.regions):
        first.setdefault(region.instance, number)
    place = {instance: k for k, instance in enumerate(first)}
    things = [thing_of(info.regions[number]) for number in first.values()]
    return things, np.array([place[region.instance] for region in info.regions], int)


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
    doubtful: bool = False
    """Whether it rests on one doubtful name."""


class Finder:
    """A language map with its encoder. Raises BadInput for damaged vectors.

    `recognised`: how much of it the encoder knows, None where nothing was fitted for that encoder; `is_strange`: too
    little, so that it is not heard where networks named the regions, and hardly believed where none did.
    """

    def __init__(
        self,
        language: LanguageMap,
        encoder: Encoder,
        calibration: Calibration | None = None,
        meanings: Meanings | None = None,
    ) -> None:
        self.info, self.encoder = language.info, encoder
        self.vectors = read_vectors(language)
        self.index = region_index(self.vectors.pieces, self.info)
        self.calibration = calibration or calibration_of(source_of(self.info), self.info.encoder)
        self.classes = class_vectors(self.info, encoder) if self.calibration.class_name else None
        self.recognised: float | None = None
        if self.calibration.fitted:
            self.recognised = recognised(self.vectors.regions, self.index.extents, encoder)
        self.is_strange = self.recognised is not None and self.recognised < self.calibration.least_recognised
        self.has_names = any(region.names for region in self.info.regions)
        self.meanings = meanings or Meanings()
        self._things, self._thing = things_of(self.info)

    @property
    def by_names(self) -> bool:
        """Whether names by networks answer: the encoder knows no such pictures, or nobody fitted it."""
        return self.has_names and (self.is_strange or not self.calibration.fitted)

    def fits(self, text: str, phrase: Phrase | None = None) -> Fits:
        """Return how well a text fits every region; `phrase`: what it was read as, read here where it is not given."""
        phrase = (phrase or heard(text)) if self.by_names else None
        named = None if phrase is None else self._named(phrase)
        if named is not None and self.is_strange:
            return Fits(np.zeros(len(named)), None, None, named, self._lit(named))
        fits_of_text = fits(
            self.vectors, self.info, self.index, query_rows(self.encoder, text), self.calibration, self.classes
        )
        if named is not None:
            return replace(fits_of_text, probabilities=with_witness(named, fits_of_text.looks))
        believed = self.calibration.strange if self.is_strange else 1.0
        return replace(fits_of_text, probabilities=believed * fits_of_text.probabilities)

    def find(self, text: str, phrase: Phrase | None = None) -> list[Found]:
        """Return places, the likeliest first, of which no two are one."""
        fits_of_text = self.fits(text, phrase)
        chances = fits_of_text.probabilities
        order = self._one_an_entity(chances) if self.by_names else ranked(self.info, self.index, chances)
        return [self._result_of(fits_of_text, region) for region in order]

    def find_related(self, phrase: Phrase, graph: ContactGraphFile) -> list[Found]:
        """Return places of the first thing of a relation; the probability of both is the product, and of several others
        the likeliest counts."""
        assert phrase.other is not None
        first = self.fits(phrase.thing(), replace(phrase, relation="", other=None))
        second = self.fits(phrase.other.thing(), phrase.other)
        number = {region.instance: k for k, region in enumerate(self.info.regions)}
        best: dict[int, tuple[float, int]] = {}
        for a, b in sorted(related(graph, phrase.relation)):
            if a in number and b in number:
                chance = float(first.probabilities[number[a]] * second.probabilities[number[b]])
                if chance > best.get(number[a], (0.0, 0))[0]:
                    best[number[a]] = (chance, b)
        order = sorted(best, key=lambda region: (-best[region][0], region))[:MOST_ANSWERS]
        return [replace(self._result_of(first, k), probability=best[k][0], other=best[k][1]) for k in order]

    def cannot_tell(self, *texts: str) -> bool:
        """Whether nobody can say that a room lacks what texts name: the encoder has learned no pictures like these, or
        never read a word that is in no class of the map; where names answer, no layer knows a noun."""
        if self.by_names:
            phrases = [heard(text) for text in texts]
            return any(
                phrase is None or not all(map(self.meanings.knows, phrase.nouns)) or phrase.all_unread()
                for phrase in phrases
            )
        in_classes = {word for region in self.info.regions for word in region.class_name.split("_")}
        return self.is_strange or any(set(self.encoder.unread(text)) - in_classes for text in texts)

    def place(self, region: int) -> np.ndarray:
        """Return (3,) where an answer points [m]: on the surface, in the middle of what was seen of it; of an entity of
        an older map the middle of its box."""
        points = self.vectors.means[self.index.members(region)].astype(float)
        if len(points):
            return middle_of(points)
        known = self.info.regions[region]
        return np.array(known.box.center if known.point is None else known.point)

    def _named(self, phrase: Phrase) -> np.ndarray:
        """Return (R,) how likely each region is what a phrase asks for; pieces of an entity are as likely as it is."""
        found = matches(phrase, self._things, self.meanings)
        return np.array([match.probability for match in found])[self._thing]

    def _lit(self, probabilities: np.ndarray) -> np.ndarray | None:
        """Return (N,) per Gaussian the probability of its likeliest piece; None without any."""
        pieces = self.vectors.pieces
        if not len(self.vectors.means):
            return None
        return np.where(pieces >= 0, probabilities[pieces], 0.0).max(axis=0, initial=0.0)

    def _one_an_entity(self, probabilities: np.ndarray) -> list[int]:
        """Return the likeliest regions of which any is likely at all, none two pieces of one entity: all have its
        name."""
        order: list[int] = []
        told: set[int] = set()
        for region in np.argsort(-probabilities, kind="stable"):
            if len(order) == MOST_ANSWERS or probabilities[region] <= 0:
                break
            instance = self.info.regions[region].instance
            if not instance or instance not in told:
                order.append(int(region))
                told.add(instance)
        return order

    def _result_of(self, fits_of_text: Fits, region: int) -> Found:
        field, size = None, None
        if fits_of_text.field is not None and fits_of_text.sizes is not None:
            field = float(np.clip(fits_of_text.field[region], 0, 1))
            size = self.info.sizes[int(np.clip(fits_of_text.sizes[region], 0, len(self.info.sizes) - 1))]
        return Found(
            region,
            float(fits_of_text.probabilities[region]),
            float(fits_of_text.looks[region]),
            field,
            size,
            doubtful=self.by_names and self._things[self._thing[region]].names.is_doubtful(),
        )


def heard(text: str) -> Phrase | None:
    """Return what a text is read as, None where it is not understood."""
    try:
        return read_phrase(text)
    except UsageError:
        return None


def with_witness(named: np.ndarray, looks: np.ndarray) -> np.ndarray:
    """Return probabilities (R,) by names (R,) with an encoder that nobody fitted as one more witness: its relevancies
    (R,) are odds, and one witness changes odds at most as much as it says."""
    odds = log_odds(named) + np.where(looks > 0, log_odds(looks), 0.0)
    return 1.0 / (1.0 + np.exp(-odds))
