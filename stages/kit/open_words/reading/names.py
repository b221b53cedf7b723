"""Nouns as people write them: plural or not, in two words or one, by our vocabulary or by the table of nouns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

from scenewright.schemas.outside import file_toml
from scenewright.schemas.places import REINSTALL, data_file
from scenewright.stages.kit.labels import ANYTHING, class_of_word
from scenewright.stages.kit.open_words.reading.nouns import nouns

ATTRIBUTES_FILE = "words/attributes.toml"
WANTS_FILE = "words/wants.toml"
IRREGULAR = {
    "shelves": "shelf", "knives": "knife", "leaves": "leaf", "mice": "mouse", "people": "person", "men": "man",
    "women": "woman", "children": "child", "dishes": "dish", "boxes": "box", "glasses": "glass", "couches": "couch",
    "switches": "switch", "loaves": "loaf", "feet": "foot", "teeth": "tooth",
}  # fmt: skip
"""Plurals whose ending says nothing."""
ALWAYS_PLURAL = ("scissors", "trousers", "clothes", "headphones", "jeans", "glasses")
"""Plurals that are names themselves."""


def singulars(word: str) -> tuple[str, ...]:
    """Return a noun in small letters, then what it may be the plural of."""
    *before, last = word.split(" ")
    ends = [last]
    if last in IRREGULAR:
        ends.append(IRREGULAR[last])
    elif last.endswith("ies") and len(last) > 4:
        ends.append(f"{last[:-3]}y")
    elif last.endswith("s") and not last.endswith("ss") and len(last) > 3:
        ends += [last[:-1], last[:-2]] if last.endswith("es") else [last[:-1]]
    return tuple(" ".join((*before, end)) for end in ends)


@cache
def class_named(noun: str) -> str:
    """Return the class of the vocabulary that a noun names, by itself or as a synonym; "" of none."""
    for spelled in singulars(noun):
        name = class_of_word(spelled)
        if name != ANYTHING or spelled == ANYTHING:
            return name
    return ""


@cache
def senses_named(noun: str) -> frozenset[int]:
    """Return the senses of a noun in the table of nouns; none without it."""
    table = nouns()
    for spelled in singulars(noun) if table is not None else ():
        for form in (spelled, spelled.replace(" ", "-"), spelled.replace(" ", "")):
            if table is not None and (senses := table.senses(form)):
                return frozenset(senses)
    return frozenset()


def is_noun(words: str) -> bool:
    """Whether the vocabulary or the table of nouns has it."""
    return bool(class_named(words)) or bool(senses_named(words))


@cache
def adjectives() -> dict[str, tuple[str, str]]:
    """Return adjective -> its kind (`color`, `size`, `material`) and what it says."""
    table = file_toml(data_file(ATTRIBUTES_FILE), hint=REINSTALL)
    return {word: (kind, name) for kind, names in table.items() for name, words in names.items() for word in words}


@dataclass(frozen=True)
class Want:
    """Something to do, and what serves it."""

    name: str
    nouns: tuple[str, ...]


@cache
def wants() -> dict[str, Want]:
    """Return what people say -> what they want."""
    rows: Sequence[dict[str, object]] = file_toml(data_file(WANTS_FILE), hint=REINSTALL)["want"]
    found = {}
    for row in rows:
        said, serving = row["said"], row["nouns"]
        assert isinstance(said, list) and isinstance(serving, list)
        found.update(dict.fromkeys(said, Want(str(row["name"]), tuple(serving))))
    return found
