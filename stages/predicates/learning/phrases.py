"""Sentences as phrases: names of objects become <1>, <2>, and what is left says which perceptions are spoken of."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

CONCEPTS: dict[str, tuple[str, ...]] = {
    "size": ("large", "larger", "big", "small", "smaller"),
    "width": ("wide", "width", "narrow", "broad"),
    "height": ("height", "tall", "high", "thin", "flat"),
    "table": ("table",),
    "gripper": ("gripper", "hand", "hold", "holds", "held", "grasp", "grasped", "pick", "occupied"),
    "water": ("water",),
    "above": ("on", "top", "onto"),
    "inside": ("inside",),
    "other": ("another", "something", "other", "more"),
    "open": ("open", "opened", "shut", "closed"),
    "door": ("door", "doors"),
    "reach": ("reach", "reached"),
    "level": ("level",),
}
"""What words point at: the word list that stands in for a language model. It is written by hand."""
CATEGORIES = ("food", "can", "coaster", "shelf", "cup", "pot", "basket", "placemat", "plate")
"""The categories that perception knows."""
GREATER, SMALLER = ("wide", "large", "larger", "greater", "tall", "high"), ("small", "smaller", "less", "narrow")
_REASON = re.compile(r" so you| because |, thus| as it|, only| and can")
"""Words with which a reason or a consequence begins."""
_NUMBER = re.compile(r"\d+(?:\.\d+)?")


@dataclass(frozen=True)
class Phrase:
    """A sentence without its objects, e.g. `object <1> is not on object <2>`."""

    text: str
    arguments: int

    @property
    def words(self) -> frozenset[str]:
        """Its words."""
        plain = self.text.replace("can't", "can not").replace("n't", " not")
        return frozenset(re.findall(r"[a-z]+", plain))

    @property
    def concepts(self) -> frozenset[str]:
        """What its words point at; categories as `category:food`."""
        words = self.words
        concepts_named = {name for name, pointing in CONCEPTS.items() if words & set(pointing)}
        if concepts_named & {"width", "height"}:
            concepts_named.discard("size")
        return frozenset(concepts_named | {f"category:{word}" for word in CATEGORIES if word in words})

    @property
    def numbers(self) -> tuple[float, ...]:
        """Numbers that are said in it."""
        bare = re.sub(r"<\d>", "", self.text)
        return tuple(sorted({float(number) for number in _NUMBER.findall(bare)}))

    @property
    def denies(self) -> bool:
        """Whether it says that something is not so."""
        main = _REASON.split(self.text)[0]
        return bool(re.search(r"n't|\bnot\b", main))

    @property
    def direction(self) -> int:
        """1 when it complains of too much, -1 of too little, 0 when it says neither."""
        return bool(self.words & set(GREATER)) - bool(self.words & set(SMALLER))

    @property
    def name(self) -> str:
        """A name for what it finds lacking: its words, without the negation, or with one."""
        bare = re.sub(r"object <\d>|<\d>|,.*| as it.*| because.*| so you.*| thus.*", " ", self.text)
        words = [word for word in re.findall(r"[a-z]+", bare) if word not in ("the", "a", "an", "is", "does", "object")]
        if self.denies:
            name_words = [
                word for word in words if word not in ("not", "can", "you", "t", "haven", "has", "been", "yet")
            ]
            return "_".join(name_words) or "as_wanted"
        return "not_" + "_".join(words)


def phrase_of(sentence: str, names: Iterable[str]) -> tuple[Phrase, tuple[str, ...]]:
    """Return a correction's phrase and its objects, in the order in which they are named after the word `object`."""
    known_names = set(names)
    objects: list[str] = []

    def slot(match: re.Match[str]) -> str:
        name = match.group(1)
        if name not in known_names:
            return match.group(0)
        if name not in objects:
            objects.append(name)
        return f"object <{objects.index(name) + 1}>"

    text = re.sub(r"object (\w+)", slot, " ".join(sentence.lower().split()))
    return Phrase(text, len(objects)), tuple(objects)
