"""What a thing is called: by what all looks at it said, and by their silence.

Ours. Each look (looks.py) either names the thing, names it wrongly, or says nothing. How often the masks of this log
name things says how much their silence means. Of several networks each is heard by itself, on the names that it knows:
one that has no backpacks calls them chairs, and that is nothing against a backpack. Rooms hold some things more often
than others, and each within a range of sizes: that is the prior. The name with the largest posterior is taken if it is
likelier than not; else it is an `object`.
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
    networks: tuple[Mapping[int, float], ...] = ()
    """Of several networks what each of them said; empty: there was one."""

    def by_network(self) -> tuple[Mapping[int, float], ...]:
        """Return the scores of each network."""
        return self.networks or (self.scores,)


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
class Network:
    """One of the networks of a log."""

    rates: Rates
    knows: frozenset[int]
    """Classes of things that it named anything in the log."""


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


def networks_of(things: Sequence[Said], classes: frozenset[int]) -> tuple[Network, ...]:
    """Return the networks that looked at these things; `classes`: of things that have a name."""
    count = max((len(said.by_network()) for said in things), default=1)
    heard = [[Said(t.looks, t.by_network()[n]) for t in things if n < len(t.by_network())] for n in range(count)]
    naming = [[said for said in of_one if classes & set(said.scores)] for of_one in heard]
    return tuple(
        Network(rates_of(of_one, classes), classes & frozenset(c for said in of_one for c in said.scores))
        for of_one in naming
    )


def name_of(
    said: Said, usual: float, networks: Sequence[Network], extent: float, vocabulary: Vocabulary, unnamed: int
) -> Naming:
    """Return the name of a thing with a diagonal of `extent` [m].

    `usual`: share of looks in which things are named by any network; `networks`: as in `networks_of`; `unnamed`: class
    of things without a name.
    """
    names = {c: s for c, s in said.scores.items() if c != unnamed and vocabulary.by_id(c).kind == "thing"}
    names |= {c: 0.0 for own in said.networks for c in own if c not in names and vocabulary.by_id(c).kind == "thing"}
    names.pop(unnamed, None)
    possible = [c for c, s in names.items() if _can_be(vocabulary.by_id(c).name, extent, s >= usual)]
    effective = LOOKS * said.looks / (said.looks + LOOKS)
    odds = {c: np.log(prior_odds(vocabulary.by_id(c).name)) for c in possible}
    for network, scores in zip(networks, said.by_network(), strict=False):
        own = {c: s for c, s in scores.items() if c in network.knows}
        doubt = scores.get(unnamed, 0.0)
        for c in network.knows & set(possible):
            odds[c] += effective * _look_odds(own.get(c, 0.0), sum(own.values()), doubt, network.rates)
    order = sorted(odds, key=lambda c: (-odds[c], c))
    weights = np.exp(np.minimum([odds[c] for c in order], 50.0))
    rows = [(c, round(float(w / (1.0 + weights.sum())), 3)) for c, w in zip(order, weights, strict=True)]
    if rows and rows[0][1] >= LIKELY:
        return Naming(*rows[0], tuple(rows[1 : 1 + RUNNERS_UP]), "the likeliest of the names that masks gave it")
    left = round(1.0 - sum(p for _, p in rows), 3)
    rule = "no name is likely enough" if rows else "no thing of its size has its name" if names else "nobody named it"
    return Naming(unnamed, left, tuple(rows[:RUNNERS_UP]), rule)


def _look_odds(score: float, spoken: float, doubt: float, rates: Rates) -> float:
    """Return the log odds by one look of a network that a thing has a name and not none. `score`: of that name,
    `spoken`: of all names, `doubt`: of none, each a look."""
    silent = max(0.0, 1.0 - spoken - doubt)
    none = np.log(1.0 - rates.background) * silent + np.log(rates.background / CLASSES) * spoken
    silence = np.log(max(1.0 - rates.right - rates.wrong, SILENT)) * silent
    given = score * np.log(rates.right) + (spoken - score) * np.log(rates.wrong / CLASSES)
    return float(given + silence - doubt * DOUBT - none)


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
