"""What a thing is called: by what all looks at it said, and by their silence.

Ours. Each look (looks.py) either names the thing, names it wrongly, or says nothing. How often the masks of this log
name things says how much their silence means. Rooms hold some things more often than others, and each within a range of
sizes: that is the prior. The name with the largest posterior is taken if it is likelier than not; else it is an
`object`.
A mask that calls a thing a wall, floor or window is silent about which thing it is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scenewright.schemas.class_counts import class_counts
from scenewright.schemas.vocabulary import Vocabulary
from scenewright.stages.kit.class_extents import LARGEST_EXTENT, SMALLEST_EXTENT, is_plausible

WRONG = 0.05
"""Least share of looks at a thing that give it a wrong name."""
BACKGROUND = 0.15
"""Least share of looks at what has no name in the vocabulary that give it one."""
DOUBT = float(np.log(3.0))
"""Log odds against any name by a look that finds a thing and does not recognise it."""
CLASSES = 10
"""Names between which wrong looks choose."""
SPREAD = float(np.log(4.0 / 0.05))
"""Things without a name have any extent from 0.05 to 4 m: width of its logarithm."""
USUAL_SPREAD = float(np.log(4.0))
"""Width of the logarithm of the extent of a class of which no range of extents is known."""
SILENT = 0.1
"""Least share of looks at a thing that say nothing."""
SELDOM = 0.2
"""Least share of looks that name a thing."""
LOOKS = 8.0
"""Looks are alike: however many there are, they count for fewer than so many."""
LIKELY = 0.5
"""Posterior from which on a name is given."""
RUNNERS_UP = 5
"""Names that come next and are kept, for words that ask for one of them; by eye."""
UNUSUAL = 1.5
"""A thing may be this much larger than usual where masks are as sure of its name as they usually are."""


@dataclass(frozen=True)
class Said:
    """What was said of one thing."""

    looks: float
    """In how many of them it was seen."""
    scores: Mapping[int, float]
    """Class -> mean score, 0..1 a look."""


@dataclass(frozen=True)
class Rates:
    """What looks do, in shares."""

    right: float
    """They name a thing rightly."""
    wrong: float
    """They name it wrongly."""
    background: float
    """They name what has no name."""


@dataclass(frozen=True)
class Naming:
    """A name with its reasons."""

    class_id: int
    posterior: float
    runners_up: tuple[tuple[int, float], ...]
    """The next classes with their posteriors."""
    rule: str


def rates_of(things: Sequence[Said], classes: frozenset[int]) -> Rates:
    """Return what looks at these things do, by what they said: the leading class is taken for right.

    Of masks without errors silence and other names would mean too much, so there are least shares.
    """
    leading, firsts, rest = [], 0.0, 0.0
    for said in things:
        scores = sorted((s for c, s in said.scores.items() if c in classes), reverse=True)
        leading.append(scores[0] if scores else 0.0)
        firsts += min(said.looks, LOOKS) * sum(scores[:1])
        rest += min(said.looks, LOOKS) * sum(scores[1:])
    right = float(np.clip(np.median(leading), SELDOM, 1.0 - SILENT)) if leading else 0.5
    confused = rest / (firsts + rest) if firsts else 0.0
    return Rates(right, max(WRONG, confused * right), max(BACKGROUND, confused))


def name_of(said: Said, rates: Rates, extent: float, vocabulary: Vocabulary, unnamed: int) -> Naming:
    """Return the name of a thing with a diagonal of `extent` [m]; `unnamed` is the class of those without."""
    names = {c: s for c, s in said.scores.items() if c != unnamed and vocabulary.by_id(c).kind == "thing"}
    possible = {c: s for c, s in names.items() if _can_be(vocabulary.by_id(c).name, extent, s >= rates.right)}
    doubt = said.scores.get(unnamed, 0.0)
    spoken = sum(names.values())
    silent = max(0.0, 1.0 - spoken - doubt)
    none = np.log(1.0 - rates.background) * silent + np.log(rates.background / CLASSES) * spoken
    silence = np.log(max(1.0 - rates.right - rates.wrong, SILENT)) * silent
    effective = LOOKS * said.looks / (said.looks + LOOKS)
    odds = {
        c: np.log(prior_odds(vocabulary.by_id(c).name))
        + effective
        * (s * np.log(rates.right) + (spoken - s) * np.log(rates.wrong / CLASSES) + silence - doubt * DOUBT - none)
        for c, s in possible.items()
    }
    order = sorted(odds, key=lambda c: (-odds[c], c))
    weights = np.exp(np.minimum([odds[c] for c in order], 50.0))
    rows = [(c, round(float(w / (1.0 + weights.sum())), 3)) for c, w in zip(order, weights, strict=True)]
    if rows and rows[0][1] >= LIKELY:
        return Naming(*rows[0], tuple(rows[1 : 1 + RUNNERS_UP]), "the likeliest of the names that masks gave it")
    left = round(1.0 - sum(p for _, p in rows), 3)
    rule = "no name is likely enough" if rows else "no thing of its size has its name" if names else "nobody named it"
    return Naming(unnamed, left, tuple(rows[:RUNNERS_UP]), rule)


def prior_odds(class_name: str) -> float:
    """Return how much likelier a thing of a possible extent has the name than none, before anybody said anything.

    Ours: the ratio of annotated counts, times that of the widths over which extents of either are spread evenly.
    """
    counts, largest = class_counts(), LARGEST_EXTENT.get(class_name)
    smallest = SMALLEST_EXTENT.get(class_name)
    spread = USUAL_SPREAD if largest is None or smallest is None else float(np.log(largest / smallest))
    return counts.of(class_name) / counts.nameless * SPREAD / spread


def _can_be(name: str, extent: float, sure: bool) -> bool:
    return is_plausible(name, extent / (UNUSUAL if sure else 1.0), cut_off=sure)
