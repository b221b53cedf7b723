"""Words, what they are true of, and which are kept from training (lexicon.toml).

A thing is described by attributes: each noun, colour, material, size or group is true, false or unknown of it. A phrase
is up to three attributes in words; it is true of a thing of which all are, false where one is false.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from scenewright.stages.kit.open_words.reading.colors import COLORS
from scenewright.stages.kit.open_words.two_towers import words_of

FILE = Path(__file__).with_name("lexicon.toml")
DOMINANT, TRACE = 0.5, 0.12
"""Shares of its surface from which on a thing is of a colour, and below which it is not."""
TRUE, FALSE, UNKNOWN = 1, 0, -1


@dataclass(frozen=True)
class Thing:
    """What is known of a thing that is seen."""

    class_name: str
    style: str = ""
    colors: tuple[tuple[str, float], ...] = ()
    """(name, share of the surface); none where it is not known."""
    extent: float = 0.0
    """Greatest edge of its box [m]; 0 unknown."""


@dataclass(frozen=True)
class Phrase:
    """A text and the attributes that it says."""

    text: str
    attributes: tuple[int, ...]


class Lexicon:
    """The words and attributes of lexicon.toml."""

    def __init__(self) -> None:
        self.table = tomllib.loads(FILE.read_text(encoding="utf-8"))
        held = self.table["held_out"]
        self.held_words = frozenset(held["words"])
        self.held_combinations = frozenset((color, name) for color, name in held["combinations"])
        self.held_styles = frozenset((name, style) for name, style in held["styles"])
        self.classes = tuple(self.table["nouns"])
        self.attributes: list[tuple[str, str]] = [("class", name) for name in self.classes]
        self.attributes += [("style", f"{c}.{s}") for c, styles in self.table["styles"].items() for s in styles]
        self.attributes += [("group", name) for name in self.table["groups"]]
        self.attributes += [("color", name) for name in COLORS]
        self.attributes += [("material", name) for name in self.table["materials"]]
        self.attributes += [("size", name) for name in self.table["sizes"]]
        self.number = {attribute: k for k, attribute in enumerate(self.attributes)}

    def nouns(self, attribute: int) -> list[str]:
        """Return the words of a class, style or group."""
        kind, name = self.attributes[attribute]
        if kind == "class":
            return list(self.table["nouns"][name])
        if kind == "style":
            class_name, style = name.split(".")
            return list(self.table["styles"][class_name][style])
        return [name]

    def adjectives(self, attribute: int) -> list[str]:
        """Return the words of a colour, material or size."""
        kind, name = self.attributes[attribute]
        return [name, *self.table["color_words"].get(name, ())] if kind == "color" else [name]

    def row(self, thing: Thing) -> np.ndarray:
        """Return (A,) int8: what is true of a thing."""
        found = np.full(len(self.attributes), FALSE, np.int8)
        shares, wood = dict(thing.colors), {"brown", "beige"}
        for k, (kind, name) in enumerate(self.attributes):
            if kind == "class":
                found[k] = name == thing.class_name
            elif kind == "style":
                found[k] = name == f"{thing.class_name}.{thing.style}"
            elif kind == "group":
                found[k] = thing.class_name in self.table["groups"][name]
            elif kind == "color":
                share = shares.get(name, 0.0)
                found[k] = UNKNOWN if not shares or TRACE <= share < DOMINANT else share >= DOMINANT
            elif kind == "material":
                found[k] = thing.class_name in self.table["materials"][name]
                if name == "wooden" and found[k]:
                    brown = sum(share for color, share in shares.items() if color in wood)
                    found[k] = UNKNOWN if not shares or 0.2 <= brown < 0.6 else brown >= 0.6
            else:
                low, high = self.table["sizes"][name]
                edge = 0.4 if name == "large" else -0.25
                near = thing.extent == 0 or low - edge < thing.extent < low or high < thing.extent < high - edge
                found[k] = UNKNOWN if near else low <= thing.extent <= high
        # a desk may be called a table, a wall cabinet a cabinet
        for name, others in {"desk": ("table",), "table": ("desk",), "wall_cabinet": ("cabinet",)}.items():
            if thing.class_name == name:
                for other in others:
                    found[self.number["class", other]] = UNKNOWN
        return found

    def is_held_out(self, thing: Thing) -> bool:
        """Whether no picture of the thing may be trained on."""
        if (thing.class_name, thing.style) in self.held_styles:
            return True
        return any(
            (color, thing.class_name) in self.held_combinations and share >= TRACE for color, share in thing.colors
        )

    def is_held_phrase(self, phrase: Phrase) -> bool:
        """Whether no training text may be this."""
        words = set(words_of(phrase.text))
        if any(set(words_of(held)) <= words for held in self.held_words):
            return True
        names = [self.attributes[k] for k in phrase.attributes]
        colors = [name for kind, name in names if kind == "color"]
        classes = [name.split(".")[0] for kind, name in names if kind in ("class", "style")]
        return any((color, name) in self.held_combinations for color in colors for name in classes)

    def phrase(self, row: np.ndarray, random: np.random.Generator) -> Phrase:
        """Return a phrase that is true of a thing: a noun, mostly with a word or two before it, or a colour alone."""
        true = {
            kind: [k for k, (each, _) in enumerate(self.attributes) if each == kind and row[k] == TRUE]
            for kind in ("class", "style", "group", "color", "material", "size")
        }
        nouns = true["class"] * 6 + true["style"] * 3 + true["group"]
        chosen: list[int] = []
        for kind, chance in (("size", 0.15), ("color", 0.55), ("material", 0.15)):
            if true[kind] and random.random() < chance:
                chosen.append(int(random.choice(true[kind])))
        words = [str(random.choice(self.adjectives(k))) for k in chosen]
        if chosen and random.random() < 0.12:
            return Phrase(" ".join([*words, "thing"]), tuple(chosen))
        noun = int(random.choice(nouns))
        words.append(str(random.choice(self.nouns(noun))))
        if random.random() < 0.08:
            words.insert(0, "the" if random.random() < 0.5 else "a")
        return Phrase(" ".join(words), (*chosen, noun))

    def training_phrase(self, row: np.ndarray, random: np.random.Generator) -> Phrase:
        """Return a phrase that is true of a thing and not held out."""
        for _ in range(40):
            found = self.phrase(row, random)
            if not self.is_held_phrase(found):
                return found
        raise ValueError("every phrase of a thing is held out")


@cache
def lexicon() -> Lexicon:
    """Read lexicon.toml once."""
    return Lexicon()


def truth_of(rows: np.ndarray, phrases: list[Phrase]) -> np.ndarray:
    """Return (N, M) int8 for rows (N, A): TRUE where all attributes of a phrase are, FALSE where one is false."""
    result = np.full((len(rows), len(phrases)), TRUE, np.int8)
    for m, phrase in enumerate(phrases):
        values = rows[:, list(phrase.attributes)]
        result[:, m] = np.where((values == FALSE).any(1), FALSE, np.where((values == UNKNOWN).any(1), UNKNOWN, TRUE))
    return result
