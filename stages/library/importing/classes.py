"""Which class of the vocabulary a model is of, by its names, and how large such things are."""

from __future__ import annotations

import re
import tomllib
from functools import cache

import numpy as np
from pydantic import Field
from scenewright.schemas.base import Model
from scenewright.schemas.places import data_file
from scenewright.schemas.vocabulary import load_vocabulary

TABLE_FILE, WORDS_FILE = "imported_models.toml", "labels/words.toml"
LONGEST_PHRASE = 4
"""Most words of a phrase that names a class."""
LONGEST_NAME = 400
"""Characters of a name that are looked at: its end, where English puts the thing."""
SHORTEST_ENDING = 3
"""Fewest letters of a class name that is recognised as the ending of a word; by eye."""
FILLERS = re.compile(r"(?:root|body|link|main|model|mesh|base)$")
SPLIT = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")


class UsualSize(Model):
    """Bounds [m] within which nearly all things of a class are."""

    across: tuple[float, float]
    """Of the larger horizontal extent."""
    height: tuple[float, float]

    def fits(self, size: np.ndarray, slack: float = 1.0) -> bool:
        """Whether a size (3,) [m], z up, is usual, with all bounds wider by the factor `slack`."""
        across, height = float(max(size[0], size[1])), float(size[2])
        return bool(
            self.across[0] / slack <= across <= self.across[1] * slack
            and self.height[0] / slack <= height <= self.height[1] * slack
        )


class ImportTable(Model):
    """data/imported_models.toml."""

    words: dict[str, tuple[str, ...]] = Field(default_factory=dict)
    sizes: dict[str, UsualSize] = Field(default_factory=dict)


@cache
def import_table() -> ImportTable:
    """Read data/imported_models.toml once."""
    return ImportTable.model_validate(tomllib.loads(data_file(TABLE_FILE).read_text(encoding="utf-8")), strict=False)


@cache
def phrases() -> dict[str, str]:
    """Return phrase (lower case, blanks between words) -> class of the vocabulary; things only."""
    thing_classes = [entry for entry in load_vocabulary().classes if entry.kind == "thing"]
    names = {entry.name for entry in thing_classes}
    class_of_phrase: dict[str, str] = {}
    for row in tomllib.loads(data_file(WORDS_FILE).read_text(encoding="utf-8"))["labels"]:
        if row["class"] in names:
            class_of_phrase.update(dict.fromkeys((row["name"], *row.get("also", ())), row["class"]))
    for source in ("ade20k", "coco", "nyu40", "scannet"):
        for entry in thing_classes:
            class_of_phrase.update(dict.fromkeys(getattr(entry, source), entry.name))
    for class_name, words in import_table().words.items():
        class_of_phrase.update(dict.fromkeys(words, class_name))
    class_of_phrase.update(
        {entry.name.replace("_", " "): entry.name for entry in thing_classes if entry.name != "object"}
    )
    class_of_phrase.pop("object", None)
    return {
        " ".join(words_of(phrase)): class_name for phrase, class_name in class_of_phrase.items() if words_of(phrase)
    }


def words_of(name: str) -> list[str]:
    """Return the words of a name in lower case: `KitchenTable_01` -> kitchen, table; `TVCabinet` -> tv, cabinet."""
    return [word.lower() for word in SPLIT.findall(name)]


def class_of(names: tuple[str, ...]) -> str | None:
    """Return the class that the first telling name stands for, or None.

    The longest known phrase wins, then the later one, as English puts the thing last (a TV cabinet is a cabinet). When
    no word is known, the ending of one counts (`hingecabinet`).
    """
    class_of_phrase = phrases()
    names = tuple(name[-LONGEST_NAME:] for name in names)
    for name in names:
        words = words_of(name)
        for length in range(min(LONGEST_PHRASE, len(words)), 0, -1):
            for start in range(len(words) - length, -1, -1):
                phrase = " ".join(words[start : start + length])
                class_name = class_of_phrase.get(phrase) or class_of_phrase.get(phrase.removesuffix("s"))
                if class_name:
                    return class_name
    endings = sorted(
        (p for p in class_of_phrase if " " not in p and len(p) >= SHORTEST_ENDING), key=lambda p: (-len(p), p)
    )
    for name in names:
        for word in reversed(words_of(name)):
            bare = FILLERS.sub("", word)
            for ending in endings:
                if bare.endswith(ending):
                    return class_of_phrase[ending]
    return None


def usual_size(class_name: str) -> UsualSize | None:
    """Return the bounds of a class, None when none are known."""
    return import_table().sizes.get(class_name)
