"""The class file of a folder of masks, and what else says which number is which class."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import LARGEST_SETTINGS, file_text
from scenewright.stages.segment.backends.masks.given import Category, entry
from scenewright.stages.segment.backends.masks.listing import Listing

LONGEST_NAME = 200
"""Most letters of a class's name; a guard, by eye."""
HINT = 'classes.json: {"1": "chair", "2": "wall"}, or classes.txt with a line `1 chair` for each'
LARGEST_NUMBER = 2**31 - 1
"""Largest number of a class: what fits into 32 bits."""


def read_classes(listing: Listing) -> tuple[dict[int, Category], int]:
    """Return the categories of the folder's class file, and the divisor of its numbers (0: none).

    `classes.json` is an object number -> name, a list of COCO categories, or `{"divisor": 1000, "classes": ...}`: then
    number 17003 is the fourth instance of class 17, as networks trained on Cityscapes write it. `classes.txt` has a
    number and a name in each line, Roboflow's `_classes.csv` with a comma between them, labelme2voc's `class_names.txt`
    the names alone, from 0. Raises BadInput for a broken one; without a file the table of `--labels` counts.
    """
    path = listing.class_file()
    if path is None:
        return {number: Category(name) for number, name in listing.numbered.items()}, 0
    where = str(path)
    if path.suffix == ".csv":
        lines = [line.replace(",", " ", 1) for line in lines_of(path)[1:]]
        return categories_of(dict(_pair(line) for line in lines), where), 0
    if path.suffix == ".txt":
        lines = lines_of(path)
        if path.name == "class_names.txt":
            return categories_of({str(number): name for number, name in enumerate(lines)}, where), 0
        return categories_of(dict(_pair(line) for line in lines), where), 0
    data = listing.json(path)
    divisor = 0
    if isinstance(data, dict) and "classes" in data:
        divisor = entry(data, "divisor", int) or 0
        if not 0 <= divisor <= LARGEST_NUMBER:
            raise BadInput(f"{path}: divisor {divisor} is not a number of 0 or more", hint=HINT)
        data = data["classes"]
    return categories_of(data, where), divisor


def lines_of(path: Path) -> list[str]:
    """Return the lines of a text that say something; `#` begins a comment. Raises BadInput when it is no text."""
    lines = [line.split("#")[0].strip() for line in file_text(path, LARGEST_SETTINGS, hint=HINT).splitlines()]
    return [line for line in lines if line]


def words_numbered(words: Iterable[str], taken: Mapping[int, Category]) -> dict[str, int]:
    """Return word -> number, in the order of the words and after those that are `taken`."""
    return {word: number for number, word in enumerate(sorted(set(words)), start=1 + max(taken, default=0))}


def categories_of(data: Any, where: str) -> dict[int, Category]:
    """Return the categories of COCO's list or of an object number -> name. Raises BadInput, beginning with `where`."""
    if isinstance(data, dict):
        rows = [
            {"id": int(key) if key.isascii() and key.isdigit() and len(key) < 11 else None, "name": data[key]}
            for key in data
        ]
    elif isinstance(data, list):
        rows = data
    else:
        raise BadInput(f"{where}: lists no categories", hint=HINT)
    categories: dict[int, Category] = {}
    for row in rows:
        number, name = entry(row, "id", int), entry(row, "name", str)
        if number is None or not 0 <= number <= LARGEST_NUMBER:
            raise BadInput(f"{where}: a category has no number: {str(row):.60}", hint=HINT)
        if not name or len(name) > LONGEST_NAME or not name.isprintable():
            raise BadInput(f"{where}: category {number} has no name", hint=HINT)
        if number in categories:
            raise BadInput(f"{where}: category {number} comes twice", hint=HINT)
        thing = row.get("isthing")
        categories[number] = Category(name, bool(thing) if thing in (0, 1) else None)
    return categories


def _pair(line: str) -> tuple[str, str]:
    number, _, name = line.partition(" ")
    return number, name.strip()


def score_of(value: Any, where: str) -> float:
    """Return a score in 0..1; None is 1. Raises BadInput, beginning with `where`."""
    if value is None:
        return 1.0
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value <= 1:
        raise BadInput(f"{where}: score {value!r:.30} is not in 0..1", hint="write probabilities")
    return float(value)
