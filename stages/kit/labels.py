"""The labels that networks use and the class of data/vocabulary.toml that each stands for (data/labels/*.toml).

Labels are found by their name. A position says nothing: of two published checkpoints of one network, one counts the 133
COCO labels without gaps and the other keeps COCO's ids, with gaps.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Literal

from pydantic import ValidationError
from scenewright.schemas.base import Model
from scenewright.schemas.errors import BadInput, first_problem
from scenewright.schemas.outside import file_text, file_toml
from scenewright.schemas.places import data_file
from scenewright.schemas.vocabulary import Vocabulary, load_vocabulary

LABELS_FOLDER = data_file("labels")
LABEL_FILES = {
    "coco-panoptic": "labels/coco_panoptic.toml",
    "ade20k": "labels/ade20k.toml",
    "words": "labels/words.toml",
    "pascal-voc": "labels/pascal_voc.toml",
}
"""Label set -> file of data/."""
LABEL_TABLES = tuple(LABEL_FILES.values())
FIRST_OF_ADE20K = 31
"""Labels of mlcommons' reduced set: the first of ADE20K's 150, which are its most frequent."""
OWN = "scenewright"
"""The label set that is the vocabulary itself."""
MATCHED = (OWN, "coco-panoptic", "ade20k", "words")
"""Label tables in which the labels of a network are sought."""
VOCABULARIES = ("coco", "nyu40", "scannet", "ade20k")
ANYTHING = "object"
LARGEST_FILE = 2**20
"""Largest label file [bytes]."""
LONGEST_WORD = 100
"""Longest word [characters]."""


class Label(Model):
    """One label of a network."""

    name: str
    id: int | None = None
    """Number of the label in its set."""
    kind: Literal["thing", "stuff"] = "thing"
    """`stuff`: the network gives one mask for all of it."""
    class_name: str = ""
    """Class of data/vocabulary.toml; empty: the label says nothing, its pixels stay void."""
    also: tuple[str, ...] = ()
    """Other spellings."""


@dataclass(frozen=True)
class LabelSet:
    """Labels that belong together."""

    name: str
    labels: tuple[Label, ...]

    def find(self, name: str) -> Label | None:
        """Return the label called `name`, in any spelling, or by the first of several names between commas."""
        by_name = self._by_name()
        return by_name.get(plain(name)) or by_name.get(plain(name.split(",")[0]))

    def by_id(self, number: int) -> Label | None:
        """Return the label with this number."""
        return next((label for label in self.labels if label.id == number), None)

    def _by_name(self) -> dict[str, Label]:
        """Spelling -> label; a label's own name comes before what others are also called."""
        labels: dict[str, Label] = {}
        for spelled in ([(label.name,) for label in self.labels], [label.also for label in self.labels]):
            for label, spellings in zip(self.labels, spelled, strict=True):
                for spelling in spellings:
                    labels.setdefault(plain(spelling), label)
        return labels


@dataclass(frozen=True)
class LabelMap:
    """What the numbers that a network gives out stand for."""

    set_name: str
    labels: Mapping[int, Label]
    """Number -> label; numbers that stand for nothing are left out."""
    unknown: tuple[str, ...]
    """Names that are in no table."""

    def stuff(self) -> set[int]:
        """Numbers of the labels of which a network gives one mask for all."""
        return {number for number, label in self.labels.items() if label.kind == "stuff"}


def plain(name: str) -> str:
    """Return a name in small letters, with single spaces instead of underscores and hyphens."""
    return " ".join(name.replace("_", " ").replace("-", " ").lower().split())


@cache
def load_label_set(name: str) -> LabelSet:
    """Return a label set: `coco-panoptic`, `coco-80` (its things), `ade20k`, `ade20k-31` (its first 31, mlcommons'
    reduced set), `pascal-voc`, or `scenewright` (the vocabulary).

    Raises BadInput for another name.
    """
    if name == OWN:
        return _own_labels(load_vocabulary())
    if name == "coco-80":
        thing_labels = [label for label in load_label_set("coco-panoptic").labels if label.kind == "thing"]
        return LabelSet(name, tuple(thing_labels))
    if name == "ade20k-31":
        return LabelSet(name, load_label_set("ade20k").labels[:FIRST_OF_ADE20K])
    if name not in LABEL_FILES:
        names = ", ".join((*LABEL_FILES, "coco-80", "ade20k-31", OWN))
        raise BadInput(f"no label set {name!r}", hint=f"label sets: {names}")
    return read_label_table(LABELS_FOLDER.parent / LABEL_FILES[name])


def _own_labels(vocabulary: Vocabulary) -> LabelSet:
    labels = []
    for entry in vocabulary.classes:
        also = dict.fromkeys(alias for source in VOCABULARIES for alias in getattr(entry, source))
        labels.append(Label(name=entry.name, id=entry.id, kind=entry.kind, class_name=entry.name, also=tuple(also)))
    return LabelSet(OWN, tuple(labels))


def read_label_file(path: Path) -> LabelSet:
    """Read a user's own labels: a TOML table as in data/labels, or plain text with one word a line.

    A line is `word` or `word = class`; `#` begins a comment. Raises BadInput.
    """
    if Path(path).suffix == ".toml":
        return read_label_table(path)
    return LabelSet(Path(path).name, parse_words(_text(path).splitlines(), str(path)))


def read_label_table(path: Path) -> LabelSet:
    """Read a TOML table: `name`, and `labels` with `name`, `class` and, if wanted, `id`, `kind`, `also`.

    Raises BadInput when it is no such table, names a class that does not exist, or a label or id twice.
    """
    hint = "write it as data/labels/coco_panoptic.toml is written"
    try:
        rows = file_toml(path, LARGEST_FILE, hint=hint)
        labels = tuple(
            Label(**{("class_name" if k == "class" else k): v for k, v in r.items()}) for r in rows["labels"]
        )
        name = str(rows.get("name", Path(path).stem))
    except (KeyError, AttributeError, TypeError, RecursionError) as error:
        raise BadInput(f"{path}: no table of labels ({type(error).__name__}: {error})", hint=hint) from None
    except ValidationError as error:
        raise BadInput(f"{path}: {first_problem(error)}", hint=hint) from None
    except tomllib.TOMLDecodeError as error:
        raise BadInput(f"{path}: {error}", hint=hint) from None
    _check(labels, str(path))
    return LabelSet(name, labels)


def parse_words(words: Iterable[str], where: str) -> tuple[Label, ...]:
    """Return the label of every word (`word` or `word = class`). Raises BadInput for a class that does not exist.

    A word without a class gets the one that has this name or synonym in the vocabulary or a label set, else `object`:
    whoever asks for an abacus wants to find it, under whatever class.
    """
    labels = []
    for line in words:
        word, is_assigned, class_name = (part.strip() for part in line.split("#")[0].partition("="))
        if not word:
            continue
        if len(word) > LONGEST_WORD:
            raise BadInput(f"{where}: a word of {len(word)} letters", hint=f"at most {LONGEST_WORD}")
        labels.append(Label(name=word, class_name=class_name if is_assigned else class_of_word(word)))
    if not labels:
        raise BadInput(f"{where}: no words", hint="for example: cup, table, kettle")
    _check(tuple(labels), where)
    return tuple(labels)


def class_of_word(word: str) -> str:
    """Return the class of a word by name or synonym (vocabulary first, then label sets); `object` when none has it."""
    for name in (OWN, *LABEL_FILES):
        label = load_label_set(name).find(word)
        if label is not None and label.class_name:
            return label.class_name
    return ANYTHING


def match_labels(names: Mapping[int, str], *given: LabelSet | None, where: str) -> LabelMap:
    """Return what the numbers of a network stand for, from the names that it gives them.

    The `given` sets go first, in their order. What they lack is looked for in the tables of data/labels: first in the
    one that knows most of the names, of equals the vocabulary. Raises BadInput when not one name is known.
    Placeholders (`N/A`, empty) are passed over.
    """
    real = {number: name for number, name in names.items() if plain(name) not in ("", "n/a", "none", "background")}
    tables = [load_label_set(name) for name in MATCHED]
    best = max(tables, key=lambda labels: sum(labels.find(name) is not None for name in real.values()))
    # Masks of several networks may lie in one folder.
    sets = [*(labels for labels in given if labels), best, *(labels for labels in tables if labels is not best)]
    found = {
        number: next((label for each in sets if (label := each.find(name)) is not None), None)
        for number, name in real.items()
    }
    matched = {number: label for number, label in found.items() if label is not None}
    unknown = tuple(sorted({real[number] for number, label in found.items() if label is None}))
    if not matched:
        examples = ", ".join(list(real.values())[:5])
        raise BadInput(
            f"{where}: its labels ({examples}, ...) are in no table", hint="give a table of them: --labels FILE.toml"
        )
    return LabelMap(sets[0].name, matched, unknown)


def _text(path: Path) -> str:
    return file_text(path, LARGEST_FILE, hint="write one word a line, or a TOML table")


def _check(labels: tuple[Label, ...], where: str) -> None:
    classes = {entry.name for entry in load_vocabulary().classes}
    names, numbers = set(), set()
    for label in labels:
        if label.class_name and label.class_name not in classes:
            raise BadInput(
                f"{where}: label {label.name!r} has class {label.class_name!r}, which is not in the vocabulary",
                hint="classes: data/vocabulary.toml",
            )
        for spelling in (label.name, *label.also):
            if plain(spelling) in names:
                raise BadInput(f"{where}: {spelling!r} comes twice", hint="keep one of them")
            names.add(plain(spelling))
        if label.id is not None and label.id in numbers:
            raise BadInput(f"{where}: id {label.id} comes twice", hint="keep one of them")
        numbers.add(label.id)
