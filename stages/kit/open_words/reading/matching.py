"""How likely each thing is what a phrase asks for: its names, colours, size, and how it stands to others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.class_extents import LARGEST_EXTENT, SMALLEST_EXTENT
from scenewright.stages.kit.open_words.reading.evidence import Names
from scenewright.stages.kit.open_words.reading.meaning import NOTHING, Meaning, Meanings
from scenewright.stages.kit.open_words.reading.phrase import Phrase
from scenewright.stages.kit.open_words.relations import related

DOMINANT, TRACE = 0.5, 0.12
"""Shares of its surface from which on a thing is of a colour, and below which it is not (the lexicon's)."""
LEAST, MOST = 0.05, 0.95
"""A thing is of a colour or size with a probability between these: light and shade change both."""
MIDDLE, STEEPNESS = 0.5, 3.0
"""Greatest edge of a thing that is neither small nor large [m], and slope over its logarithm; by eye."""
ANYTHING = 0.9
"""Probability that any thing of no certain name is "anything"."""


@dataclass(frozen=True)
class Thing:
    """A thing that may be asked for."""

    instance: int
    names: Names
    colors: Mapping[str, float]
    """Colour -> share of its surface; empty where nobody knows."""
    extent: float
    """Greatest edge of its box [m]."""
    is_layout: bool = False
    """Floor, wall or ceiling, which is no "thing"."""


@dataclass(frozen=True)
class Match:
    """How well a thing answers a phrase."""

    probability: float
    name: str
    """The name of the thing that speaks most for it; "" for none."""
    meaning: Meaning
    other: int = 0
    """Instance of the thing that it is on, in, under or beside."""


def matches(
    phrase: Phrase, things: Sequence[Thing], meanings: Meanings, graph: ContactGraphFile | None = None
) -> list[Match]:
    """Return per thing how likely it is what a phrase asks for. Without a graph relations are not judged."""
    alone = [_match(phrase, thing, meanings) for thing in things]
    if phrase.other is None or graph is None:
        return alone
    return in_relation(alone, matches(phrase.other, things, meanings, graph), things, phrase.relation, graph)


def in_relation(
    first: Sequence[Match], second: Sequence[Match], things: Sequence[Thing], relation: str, graph: ContactGraphFile
) -> list[Match]:
    """Return the matches of things that stand in a relation to something of the `second` matches: the product of both,
    of several others the likeliest counting."""
    number = {thing.instance: k for k, thing in enumerate(things)}
    best = [Match(0.0, match.name, match.meaning) for match in first]
    for a, b in sorted(related(graph, relation)):
        if a not in number or b not in number:
            continue
        k, chance = number[a], first[number[a]].probability * second[number[b]].probability
        if chance > best[k].probability:
            best[k] = Match(chance, first[k].name, first[k].meaning, b)
    return best


def _match(phrase: Phrase, thing: Thing, meanings: Meanings) -> Match:
    name, meaning, probability = "", NOTHING, 0.0 if thing.is_layout else ANYTHING
    if phrase.nouns:
        names = tuple(thing.names.shares)
        told = meanings.of(phrase.nouns, names)
        parts = [thing.names.shares[each] * m.probability for each, m in zip(names, told, strict=True)]
        probability = min(1.0, sum(parts))
        if parts:
            best = int(np.argmax(parts))
            name, meaning = names[best], told[best]
    for color in phrase.colors:
        probability *= color_probability(thing.colors, color, len(phrase.colors))
    for size in phrase.sizes:
        probability *= size_probability(thing, name, size)
    return Match(probability, name, meaning)


def color_probability(shares: Mapping[str, float], color: str, colors: int = 1) -> float:
    """Return how likely a thing with these shares of colours is called so, as one of several `colors`; 0.5 where
    nobody knows its colours."""
    if not shares:
        return 0.5
    dominant = DOMINANT / colors
    share = (shares.get(color, 0.0) - TRACE) / (dominant - TRACE) if dominant > TRACE else shares.get(color, 0.0)
    return float(np.clip(share, LEAST, MOST))


def size_probability(thing: Thing, name: str, size: str) -> float:
    """Return how likely a thing is called `small` or `large`: for one of its name where sizes of that are known."""
    low, high = SMALLEST_EXTENT.get(name), LARGEST_EXTENT.get(name)
    middle = float(np.sqrt(low * high)) if low is not None and high is not None else MIDDLE
    odds = STEEPNESS * np.log(max(thing.extent, 1e-3) / middle)
    large = float(np.clip(1.0 / (1.0 + np.exp(-odds)), LEAST, MOST))
    return large if size == "large" else 1.0 - large


def is_layout(class_name: str) -> bool:
    """Whether a class bounds the room."""
    return any(entry.is_layout for entry in load_vocabulary().classes if entry.name == class_name)
