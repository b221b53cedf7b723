"""Recognising places: which earlier key frames may show what this one shows.

With colour: a bag of binary words. A word is a fixed choice of bits of a descriptor (locality-sensitive hashing, Indyk
and Motwani 1998), so that no vocabulary has to be trained or shipped; words are weighted by their rarity (tf-idf, Sivic
and Zisserman 2003). A descriptor of real numbers has a bit for each of some random planes: on which side it lies
(Charikar 2002). Without colour: random ferns on the depth image (Glocker, Shotton, Criminisi and Izadi, Real-time RGB-D
camera relocalization via randomized ferns, 2015).
"""

from __future__ import annotations

import math
from collections import defaultdict

import numpy as np

BITS = 256
"""Of a descriptor."""
TABLES, WORD_BITS = 12, 16
"""Words of a descriptor, and bits of a word; by eye."""
FERNS = 400
"""Ferns of a depth image, each of three tests of one pixel; by eye."""
FERN_SIZE = (30, 40)
"""Rows and columns to which the depth image is thinned out for the ferns."""


class PlaceIndex:
    """Scores of a frame's descriptors against those of the frames that were added before."""

    def __init__(self, random: np.random.Generator) -> None:
        self._bits = np.stack([random.choice(BITS, WORD_BITS, replace=False) for _ in range(TABLES)])
        self._random = random
        self._planes = np.zeros((0, BITS))
        self._places: dict[int, list[int]] = defaultdict(list)
        self._words: list[np.ndarray] = []
        self._norms: np.ndarray | None = None

    def words(self, descriptors: np.ndarray) -> np.ndarray:
        """Return the sorted distinct words (K,) int64 of descriptors (N, 32) uint8, or (N, C) of real numbers."""
        if not len(descriptors):
            return np.zeros(0, dtype=np.int64)
        if descriptors.dtype != np.uint8:
            if len(self._planes) != descriptors.shape[1]:
                self._planes = self._random.normal(size=(descriptors.shape[1], BITS))
            descriptors = np.packbits(descriptors @ self._planes > 0, axis=1)
        bits = np.unpackbits(descriptors, axis=1)[:, self._bits].astype(np.int64)
        codes = bits @ (1 << np.arange(WORD_BITS, dtype=np.int64))
        return np.unique(codes + (np.arange(TABLES, dtype=np.int64) << WORD_BITS))

    def add(self, descriptors: np.ndarray) -> None:
        """Add the next frame; frames are numbered in the order they are added."""
        self._norms = None
        number, words = len(self._words), self.words(descriptors)
        self._words.append(words)
        for word in words.tolist():
            self._places[word].append(number)

    def scores(self, number: int) -> np.ndarray:
        """Return the likeness (N,) in [0, 1] of an added frame with every added frame; its own is 1."""
        total = len(self._words)
        if self._norms is None:
            rarity = {word: math.log(total / len(places)) ** 2 for word, places in self._places.items()}
            self._norms = np.array([math.sqrt(sum(rarity[word] for word in words.tolist())) for words in self._words])
        shared = np.zeros(total)
        for word in self._words[number].tolist():
            places = self._places[word]
            if len(places) > 1:
                shared[places] += math.log(total / len(places)) ** 2
        shared[number] = self._norms[number] ** 2
        scale = self._norms * self._norms[number]
        return np.divide(shared, scale, out=np.zeros(total), where=scale > 0)


class Ferns:
    """Codes of depth images, and how alike they are."""

    def __init__(self, random: np.random.Generator) -> None:
        self._rows = random.integers(0, FERN_SIZE[0], FERNS)
        self._columns = random.integers(0, FERN_SIZE[1], FERNS)
        self._thresholds = random.uniform(0.5, 4.0, (FERNS, 3))

    def code(self, depth: np.ndarray) -> np.ndarray:
        """Return the code (FERNS,) int8 of a z-depth image (H, W) [m]; -1 where there is no depth."""
        rows = np.minimum((self._rows + 0.5) / FERN_SIZE[0] * depth.shape[0], depth.shape[0] - 1).astype(int)
        columns = np.minimum((self._columns + 0.5) / FERN_SIZE[1] * depth.shape[1], depth.shape[1] - 1).astype(int)
        z = depth[rows, columns]
        code = (z[:, None] > self._thresholds).sum(axis=1)
        return np.where(z > 0, code, -1).astype(np.int8)


def fern_likeness(code: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return the share (N,) of ferns that agree between `code` (F,) and others (N, F), where both have depth."""
    both_have_depth = (code >= 0) & (others >= 0)
    return ((code == others) & both_have_depth).sum(axis=1) / np.maximum(both_have_depth.sum(axis=1), 0.25 * len(code))
