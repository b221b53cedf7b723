"""PNGs of one channel or with a palette, one a picture: the value (the index) of a pixel is the instance it is of.

What a value is, says the class file of the folder (`classes.json`, `classes.txt`) or, for one picture and before it,
a JSON of the picture's name: `{"7": "chair", "9": {"class": "wall", "score": 0.8}}`. 0 is no mask where neither
lists it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.segment.backends.masks.classes import read_classes, score_of, words_numbered
from scenewright.stages.segment.backends.masks.given import (
    Category,
    GivenFrame,
    GivenMask,
    MaskFormat,
    MaskSource,
    ReadSettings,
    picture_of_file,
)
from scenewright.stages.segment.backends.masks.images import read_instances
from scenewright.stages.segment.backends.masks.listing import Listing
from scenewright.stages.segment.backends.masks.values import IGNORED, check_listed, named_by_value, numbered

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
    class_file = listing.class_source()
    numbers = words_numbered(
        (word for entries in entries_by_file for word, _ in (entries or {}).values() if word), classes
    )
    categories = {**classes, **{number: Category(word) for word, number in numbers.items()}}

    def read(place: int, shape: tuple[int, int], settings: ReadSettings) -> GivenFrame:
        values, has_palette = read_instances(files[place], shape)
        entries = entries_by_file[place]
        if entries is None and classes:
            return named_by_value(values, classes, divisor, files[place], class_file, HINT)
        present = np.unique(values).tolist()
        if entries is None:
            # PASCAL VOC and its kin draw a rim of 255 around the instances of a palette.
            ignored = [v for v in present if v in IGNORED and has_palette and len(set(present) - {0, v})]
            return numbered(values, {v: GivenMask(None) for v in present if v and v not in ignored}, ignored)
        unlisted = [value for value in present if value not in entries]
        missing = [value for value in unlisted if value and value not in IGNORED]
        check_listed(missing, entries, files[place], beside[files[place].with_suffix("")].name, HINT)
        masks = {v: GivenMask(numbers.get(entries[v][0]), entries[v][1]) for v in present if v in entries}
        return numbered(values, masks, [value for value in unlisted if value in IGNORED])

    scored = any(entries is not None for entries in entries_by_file)
    return MaskSource(
        tuple(picture_of_file(file, listing.root) for file in files),
        categories,
        read,
        ("overlaps",) if scored else ("scores", "overlaps"),
    )


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
    "instance PNG", "8 or 16 bits or a palette, with classes.json, classes.txt or a JSON beside each", 50, open_source
)
