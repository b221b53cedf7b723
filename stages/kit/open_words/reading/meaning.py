"""How likely a thing with a name is what a noun means, by two layers: our vocabulary, and WordNet.

Each layer is asked of what the one before leaves open, and has probabilities of its own, fitted on the nouns of our
lexicon (data/words/meanings.toml; `python -m benchmarks.words.meanings`). No layer was fitted on what is reported on.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Literal

from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import file_toml
from scenewright.schemas.places import REINSTALL, data_file
from scenewright.schemas.vocabulary import UNNAMED, load_vocabulary
from scenewright.stages.kit.open_words.reading.names import class_named, senses_named
from scenewright.stages.kit.open_words.reading.nouns import Nouns, anchors, nouns

FILE = "words/meanings.toml"
"""File below data/."""
Relation = Literal["same", "kind", "broader", "sister", "cousin", "none"]
"""Of a noun to a name: the same sense, a kind of it, what it is a kind of, of one parent, of one grandparent."""


@dataclass(frozen=True)
class Calibration:
    """data/words/meanings.toml."""

    named: float
    """Probability that a thing of the class that a noun names is what the noun means ..."""
    synonym: float
    """... where the noun is a synonym of the class by our tables."""
    relations: Mapping[str, float]
    """Relation by WordNet -> that probability."""


@dataclass(frozen=True)
class Meaning:
    """How likely a name is what nouns mean."""

    probability: float
    layer: str
    """`vocabulary`, `wordnet`; "" where no layer says anything."""
    how: str
    """Relation of noun and name, in a word."""


NOTHING = Meaning(0.0, "", "")


@cache
def calibration(path: Path | None = None) -> Calibration:
    """Return the fitted probabilities. Raises BadInput for a damaged file."""
    file = path or data_file(FILE)
    try:
        row = file_toml(file, hint=REINSTALL)
        return Calibration(
            float(row["vocabulary"]["named"]),
            float(row["vocabulary"]["synonym"]),
            {name: float(value) for name, value in row["wordnet"].items()},
        )
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise BadInput(f"{file}: no calibration of meanings ({error})", hint=REINSTALL) from None


class Meanings:
    """The layers that are there; `with_nouns` False leaves WordNet out."""

    def __init__(self, with_nouns: bool = True) -> None:
        self._table = nouns() if with_nouns else None
        self._fit = calibration()

    def layers(self) -> tuple[str, ...]:
        """Return the names of the layers that are there."""
        return ("vocabulary", "WordNet") if self._table else ("vocabulary",)

    def of(self, asked: Iterable[str], names: Sequence[str]) -> list[Meaning]:
        """Return per name (a class, or a label of a network) how likely it is what one of the nouns `asked` means."""
        best = [NOTHING] * len(names)
        for noun in asked:
            found = [self._of(noun, name) for name in names]
            best = [max(pair, key=lambda m: m.probability) for pair in zip(best, found, strict=True)]
        return best

    def knows(self, noun: str) -> bool:
        """Whether any layer has something to say about a noun."""
        return bool(class_named(noun) or (self._table and senses_named(noun)))

    def _of(self, noun: str, name: str) -> Meaning:
        fit, own = self._fit, class_named(noun)
        written = name.replace("_", " ")
        if name == UNNAMED:
            return NOTHING
        if noun == written:
            return Meaning(fit.named, "vocabulary", "named so")
        if own and noun == own.replace("_", " ") and class_named(written) == own:
            return Meaning(fit.named, "vocabulary", "a kind of it")  # the label of a network, by its class
        relation = relation_of(self._table, noun, name) if self._table is not None else "none"
        if own == name:
            at_least = fit.relations["kind"] if relation == "kind" else fit.synonym
            return Meaning(at_least, "vocabulary", "a kind of it" if relation == "kind" else "a synonym")
        by_nouns = fit.relations[relation] if self._table is not None and relation != "none" else 0.0
        return Meaning(by_nouns, "wordnet" if by_nouns else "", _HOW[relation])


_HOW = {
    "same": "a synonym", "kind": "a kind of it", "broader": "one of these", "sister": "of the same kind",
    "cousin": "of a like kind", "none": "",
}  # fmt: skip


@cache
def senses_of(name: str) -> frozenset[int]:
    """Return the senses of a name: of a class those of data/words/anchors.toml, of another label all."""
    if name in {entry.name for entry in load_vocabulary().classes}:
        return anchors().get(name, frozenset())
    return senses_named(name.replace("_", " "))


@cache
def relation_of(table: Nouns, noun: str, name: str) -> Relation:
    """Return the nearest relation between senses of a noun and those of a name."""
    asked, there = senses_named(noun), senses_of(name)
    if asked & there:
        return "same"
    above_there = {sense: steps for s in there for sense, steps in table.above(s).items()}
    above_asked = {sense: steps for s in asked for sense, steps in table.above(s).items()}
    if any(s in above_asked for s in there):
        return "kind"
    if any(s in above_there for s in asked):
        return "broader"
    shared = [s for s in set(above_asked) & set(above_there) if not table.is_general(s)]
    nearest = min((max(_steps(table, asked, s), _steps(table, there, s)) for s in shared), default=99)
    return "sister" if nearest == 1 else "cousin" if nearest == 2 else "none"


def _steps(table: Nouns, senses: frozenset[int], above: int) -> int:
    return min(table.above(s).get(above, 99) for s in senses)
