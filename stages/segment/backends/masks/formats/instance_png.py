"""PNGs of one channel, 8 or 16 bits, one a picture: the value of a pixel is the instance it is of, 0 none.

What a value is, says the class file of the folder (`classes.json`, `classes.txt`) or, for one picture and before it,
a JSON of the picture's name: `{"7": "chair", "9": {"class": "wall", "score": 0.8}}`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.segment.backends.masks.classes import read_classes, score_of
from scenewright.stages.segment.backends.masks.given import (
    Category,
    GivenFrame,
    GivenMask,
    MaskFormat,
    MaskSource,
    Picture,
    ReadSettings,
)
from scenewright.stages.segment.backends.masks.images import read_instances
from scenewright.stages.segment.backends.masks.listing import Listing

HINT = 'classes.json: {"1": "chair"}, or beside 000012.png a 000012.json: {"7": {"class": "chair", "score": 0.8}}'


def open_source(listing: Listing) -> MaskSource | None:
    """Return the masks of a folder of PNGs. Raises BadInput when a class file is broken."""
    files = listing.ending(".png")
    if not files:
        return None
    beside = {file.with_suffix(""): file for file in listing.ending(".json")}
    entries_by_file = [
        _read_entries(listing, beside[file.with_suffix("")]) if file.with_suffix("") in beside else None
        for file in files
    ]
    classes, divisor = read_classes(listing)
    words = sorted({word for entries in entries_by_file for word, _ in (entries or {}).values() if word})
    numbers = {word: number for number, word in enumerate(words, start=1 + max(classes, default=0))}
    categories = {**classes, **{number: Category(word) for word, number in numbers.items()}}

    def read(place: int, shape: tuple[int, int], settings: ReadSettings) -> GivenFrame:
        ids = read_instances(files[place], shape)
        values = [value for value in np.unique(ids).tolist() if value]
        entries = entries_by_file[place]
        if entries is not None:
            missing = [value for value in values if value not in entries]
            source = beside[files[place].with_suffix("")].name
            masks = {v: GivenMask(numbers.get(entries[v][0]), entries[v][1]) for v in values if v in entries}
        else:
            of = {value: value // divisor if divisor and value >= divisor else value for value in values}
            missing = [value for value in values if classes and of[value] not in classes]
            source = getattr(listing.class_file(), "name", "")
            masks = {value: GivenMask(of[value] if classes else None) for value in values if value not in missing}
        if missing:
            raise BadInput(
                f"{files[place]}: id {missing[0]} is beyond {source}, which lists {_range(entries or classes)} "
                f"({len(missing)} such ids)",
                hint=HINT,
            )
        return GivenFrame(ids, masks)

    scored = any(entries is not None for entries in entries_by_file)
    return MaskSource(
        tuple(Picture(file.stem) for file in files),
        categories,
        read,
        ("overlaps",) if scored else ("scores", "overlaps"),
    )


def _range(listed: Any) -> str:
    return f"{min(listed)}..{max(listed)}" if listed else "none"


def _read_entries(listing: Listing, path: Path) -> dict[int, tuple[str, float]]:
    """Return value -> (class name, empty: none; score) of one picture."""
    data = listing.json(path)
    if not isinstance(data, dict):
        raise BadInput(f"{path}: no object of values", hint=HINT)
    entries = {}
    for key, row in data.items():
        name = row if isinstance(row, str) else row.get("class", "") if isinstance(row, dict) else None
        if not (key.isascii() and key.isdigit() and len(key) < 6) or not isinstance(name, str):
            raise BadInput(f"{path}: {key[:20]!r}: {str(row):.40} says no class of a value", hint=HINT)
        entries[int(key)] = (name, score_of(row.get("score") if isinstance(row, dict) else None, f"{path}: {key}"))
    return entries


FORMAT = MaskFormat(
    "instance PNG", "8 or 16 bits, with classes.json, classes.txt or a JSON beside each", 50, open_source
)
