"""What a thing is called: by what all looks at it said, and by their silence.

Ours. Each look either names the thing, names it wrongly, or says nothing. How often the masks of this log name a thing
that stands free says how much their silence means. The name with the largest posterior is taken, if it is likely enough
and a thing of that size can have it; else the thing is an `object`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scenewright.schemas.vocabulary import Vocabulary
from scenewright.stages.kit.class_extents import is_plausible

WRONG = 0.05
"""Share of looks at a thing that give it a wrong name."""
BACKGROUND = 0.15
"""Share of looks at what is no thing of any class that give it a name."""
DOUBT = float(np.log(3.0))
"""A look that finds a thing and does not recognise it is so much less likely at one with a name: log odds."""
CLASSES = 10
"""Names between which wrong looks choose."""
NAMELESS = 0.4
"""Prior of having no name in the vocabulary."""
SILENT = 0.1
"""Least share of looks at a thing that say nothing."""
LOOKS = 8.0
"""Looks are alike: however many there are, they count for fewer than so many."""
LIKELY = 0.6
"""Posterior from which on a name is given."""
UNUSUAL = 1.5
"""A thing may be this much larger than usual where most looks agree on its name."""


@dataclass(frozen=True)
class Said:
    """What was said of one thing."""

    looks: float
    """How many frames looked at a spot of it, in the mean."""
    scores: Mapping[int, float]
    """Class -> mean score, 0..1 a look."""


@dataclass(frozen=True)
class Naming:
    """A name with its reasons."""

    class_id: int
    posterior: float
    runners_up: tuple[tuple[int, float], ...]
    """Further classes, the likelier first, with their posteriors."""
    rule: str


def said_of(
    segments: np.ndarray, scores: Mapping[int, Mapping[int, float]], sightings: Mapping[int, int], claimed: frozenset[int] = frozenset()
) -> Said:
    """Return what was said of surface of these segment labels (N,), those that are `claimed` by other things left out.

    `scores`: by segment label and class the sum of the scores of all masks; `sightings`: frame segments matched to each
    label.
    """
    labels, counts = np.unique(segments, return_counts=True)
    looks, of_class = 0.0, dict[int, float]()
    for label, share in zip(labels.tolist(), (counts / counts.sum()).tolist(), strict=True):
        seen = sightings.get(label, 0)
        looks += share * seen
        if label in claimed:
            continue
        for c, score in scores.get(label, {}).items():
            of_class[c] = of_class.get(c, 0.0) + share * min(score / max(seen, 1), 1.0)
    return Said(looks, of_class)


def usual_score(things: Sequence[Said], classes: frozenset[int]) -> float:
    """Return how often looks name a thing: the median of the leading scores of these things, 0..1."""
    leading = [max((s for c, s in said.scores.items() if c in classes), default=0.0) for said in things]
    return float(np.clip(np.median(leading), 0.2, 1.0 - SILENT)) if leading else 0.5


@dataclass(frozen=True)
class Rates:
    """How often looks of this log's masks do what."""

    right: float
    """Name a thing rightly."""
    wrong: float
    """Name it wrongly."""
    background: float
    """Name what is no thing of any class."""


def rates_of(things: Sequence[Said], classes: frozenset[int]) -> Rates:
    """Return how often looks name things, from what was said of these."""
    leading, other = 0.0, 0.0
    for said in things:
        of_things = sorted((s for c, s in said.scores.items() if c in classes), reverse=True)
        leading += min(said.looks, LOOKS) * sum(of_things[:1])
        other += min(said.looks, LOOKS) * sum(of_things[1:])
    confused = other / (leading + other) if leading else 0.0
    right = usual_score(things, classes)
    return Rates(right, max(WRONG, confused * right), max(BACKGROUND, confused))


def name_of(said: Said, rates: Rates, extent: float, vocabulary: Vocabulary, unnamed: int) -> Naming:
    """Return the name of a thing with a diagonal of `extent` [m]; `usual` as `usual_score` returns it."""
    names = {c: s for c, s in said.scores.items() if c != unnamed and vocabulary.by_id(c).kind == "thing"}
    possible = {c: s for c, s in names.items() if _can_be(vocabulary.by_id(c).name, extent, s >= rates.right)}
    doubt = said.scores.get(unnamed, 0.0)
    all_said = sum(s for c, s in said.scores.items() if c != unnamed)
    silent = max(0.0, 1.0 - all_said - doubt)
    effective = LOOKS * said.looks / (said.looks + LOOKS)
    wrong = np.log(rates.wrong / CLASSES)
    none = np.log(1.0 - rates.background) * silent + np.log(rates.background / CLASSES) * all_said
    log_odds = {
        c: np.log((1 - NAMELESS) / len(possible) / NAMELESS)
        + effective
        * (s * np.log(rates.right) + silent * np.log(max(1.0 - rates.right - rates.wrong, SILENT)) + (all_said - s) * wrong - doubt * DOUBT - none)
        for c, s in possible.items()
    }
    order = sorted(log_odds, key=lambda c: (-log_odds[c], c))
    weight = np.exp(np.minimum([log_odds[c] for c in order], 50.0))
    posterior = weight / (1.0 + weight.sum())
    rows = [(c, round(float(p), 3)) for c, p in zip(order, posterior, strict=True)]
    if rows and rows[0][1] >= LIKELY:
        return Naming(rows[0][0], rows[0][1], tuple(rows[1:3]), "the likeliest name")
    if rows:
        return Naming(unnamed, 1.0 - rows[0][1], tuple(rows[:2]), "no name is likely enough")
    return Naming(unnamed, 1.0, (), "no thing of its size has the names that were said" if names else "nobody named it")


def _can_be(name: str, extent: float, agreed: bool) -> bool:
    return is_plausible(name, extent / (UNUSUAL if agreed else 1.0), cut_off=agreed)
