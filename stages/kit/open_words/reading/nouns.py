"""Nouns of English for things that one can touch, and what each is a kind of (Open English WordNet).

data/words/nouns.txt.gz is derived from it (`python -m benchmarks.words.nouns`); data/words/nouns.LICENSE.md names its
authors. An installation may lack it: then nothing is known of nouns beyond our own vocabulary.
"""

from __future__ import annotations

import gzip
import zlib
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cache

from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import file_toml
from scenewright.schemas.places import REINSTALL, data_file

FILE = "words/nouns.txt.gz"
"""File below data/: a line a sense, `noun;noun TAB line line`: its nouns, and the lines (from 0) of its hypernyms."""
ANCHORS_FILE = "words/anchors.toml"
"""File below data/: class of the vocabulary -> senses, each written `noun < hypernym`."""
MOST_BYTES = 2**24
"""Largest table that is unpacked [bytes]."""
GENERAL = ("physical entity", "object", "whole", "artifact", "matter", "thing", "instrumentality", "causal agent")
"""Hypernyms of nearly everything: what shares no more than these is not akin."""


@dataclass(frozen=True, eq=False)
class Nouns:
    """Senses by number, with their nouns and hypernyms."""

    members: tuple[tuple[str, ...], ...]
    hypernyms: tuple[tuple[int, ...], ...]
    by_noun: dict[str, tuple[int, ...]]
    """Noun in small letters -> senses."""
    _above: dict[int, dict[int, int]] = field(default_factory=dict)

    def senses(self, noun: str) -> tuple[int, ...]:
        """Return the senses of a noun, () of one that the table lacks."""
        return self.by_noun.get(noun.lower(), ())

    def above(self, sense: int) -> dict[int, int]:
        """Return hypernym -> steps up to it, the sense itself with 0."""
        if sense not in self._above:
            steps, edge = {sense: 0}, [sense]
            while edge:
                edge = [h for s in edge for h in self.hypernyms[s] if steps.setdefault(h, steps[s] + 1) == steps[s] + 1]
                if len(steps) > len(self.members):
                    break
            self._above[sense] = steps
        return self._above[sense]

    def anchored(self, written: str) -> frozenset[int]:
        """Return the senses of `noun < hypernym`: those of the noun that are a kind of the hypernym; all of a noun
        alone."""
        noun, _, above = (part.strip() for part in written.partition("<"))
        kinds = set(self.senses(above)) if above else set()
        return frozenset(s for s in self.senses(noun) if not above or kinds & set(self.above(s)))

    def is_general(self, sense: int) -> bool:
        """Whether nearly everything is a kind of a sense."""
        return any(noun in GENERAL for noun in self.members[sense])

    def kinds_of(self, senses: Iterable[int]) -> dict[int, list[int]]:
        """Return sense -> its direct hyponyms, of senses that have any."""
        wanted, found = set(senses), defaultdict(list)
        for number, above in enumerate(self.hypernyms):
            for sense in wanted.intersection(above):
                found[sense].append(number)
        return dict(found)


@cache
def nouns() -> Nouns | None:
    """Return the table, None where the installation has none. Raises BadInput for a damaged one."""
    path = data_file(FILE)
    if not path.is_file():
        return None
    try:
        with gzip.open(path) as stream:
            text = stream.read(MOST_BYTES + 1)
        return parsed(text.decode("utf-8"))
    except (OSError, EOFError, ValueError, IndexError, zlib.error) as error:
        raise BadInput(f"{path}: no table of nouns ({type(error).__name__})", hint=REINSTALL) from None


def parsed(text: str) -> Nouns:
    """Return the table of a text as `FILE` has it. Raises ValueError or IndexError for another."""
    members, hypernyms = [], []
    by_noun: dict[str, list[int]] = defaultdict(list)
    for number, line in enumerate(text.splitlines()):
        names, _, above = line.partition("\t")
        members.append(tuple(names.split(";")))
        hypernyms.append(tuple(map(int, above.split())))
        for name in members[-1]:
            by_noun[name.lower()].append(number)
    if any(not 0 <= h < len(members) for above in hypernyms for h in above):
        raise ValueError("a hypernym that is not there")
    return Nouns(tuple(members), tuple(hypernyms), {name: tuple(senses) for name, senses in by_noun.items()})


@cache
def anchors() -> dict[str, frozenset[int]]:
    """Return class of the vocabulary -> its senses; nothing without the table."""
    table = nouns()
    if table is None:
        return {}
    written = file_toml(data_file(ANCHORS_FILE), hint=REINSTALL)["senses"]
    return {name: frozenset().union(*map(table.anchored, each)) for name, each in written.items()}
