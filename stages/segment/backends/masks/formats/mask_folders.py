"""One PNG a mask, in a folder a picture (Segment Anything's `amg.py`) or in a folder a class or thing.

`x/0.png`, `x/1.png`, ... are the masks of picture x, and `x/metadata.csv`, where it is there, judges them as `sam.py`
has it. Without that table the names decide which of the two it is: `chair/000012.png` is a chair in frame 12.
"""

from __future__ import annotations

import re
from collections import defaultdict
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.labels import ANYTHING, class_of_word
from scenewright.stages.segment.backends.masks.classes import lines_of, words_numbered
from scenewright.stages.segment.backends.masks.encoded import flatten_encoded
from scenewright.stages.segment.backends.masks.given import (
    Category,
    GivenFrame,
    GivenMask,
    MaskFormat,
    MaskSource,
    Picture,
    ReadSettings,
    stem_of,
)
from scenewright.stages.segment.backends.masks.images import read_instances
from scenewright.stages.segment.backends.masks.listing import Listing
from scenewright.stages.segment.backends.masks.matching import says_a_frame
from scenewright.stages.segment.backends.masks.names import own_name

TABLE = "metadata.csv"
JUDGEMENTS = ("predicted_iou", "stability_score")
OF_A_MASK = re.compile(r"mask|obj|inst|seg", re.IGNORECASE)
"""What the name of one mask, or of the folder of one thing, is called after."""
HINT = "each PNG is one mask: 0 outside, another value inside"


def open_source(listing: Listing) -> MaskSource | None:
    """Return the masks of folders of PNGs. Raises BadInput when nothing says whether a folder is a picture."""
    tables = {file.parent: file for file in listing.files if file.name == TABLE and _judges_masks(file)}
    files = [file for file in listing.ending(".png") if file.parent != listing.root or listing.root in tables]
    folders = sorted({file.parent for file in files} | tables.keys())
    stems = [stem_of(file.name) for file in files]
    if not tables and (len(files) < len(listing.ending(".png")) or len(set(stems)) == len(stems)):
        return None
    of_pictures = bool(tables) or _are_pictures([folder.name for folder in folders], stems, listing.root)
    if of_pictures is None:
        return None
    members: dict[str, list[Path]] = {folder.name: [] for folder in folders} if of_pictures else defaultdict(list)
    for file in files:
        members[file.parent.name if of_pictures else stem_of(file.name)].append(file)
    things = [] if of_pictures else [folder.name for folder in folders]
    words = [name for name in things if not any(letter.isdecimal() for letter in name)]
    numbers = words_numbered(words, {})
    scores = {folder: _scores(table) for folder, table in tables.items()}
    names = list(members)

    def read(place: int, shape: tuple[int, int], settings: ReadSettings) -> GivenFrame:
        masks, told = [], []
        for file in members[names[place]]:
            mask = _mask(file, shape)
            if not mask.any():
                continue  # a thing that this picture does not show
            masks.append(mask)
            score = scores.get(file.parent, {}).get(file.stem, 1.0)
            told.append(GivenMask(None if of_pictures else numbers.get(file.parent.name), score))
        return flatten_encoded(masks, told, settings, shape, str(listing.root / names[place]))

    categories = {number: Category(word) for word, number in numbers.items()}
    pictures = tuple(Picture(own_name(name), seen=f"{name}/" if of_pictures else name) for name in names)
    return MaskSource(pictures, categories, read, () if tables else ("scores",))


def _are_pictures(folders: list[str], stems: list[str], root: Path) -> bool | None:
    """Return whether folders are pictures (else classes or things); None: they are of another kind (`images`). Raises
    BadInput when the names do not say it."""
    if not any(letter.isdecimal() for name in folders for letter in name):
        return False if any(class_of_word(name) != ANYTHING for name in folders) else None
    if all(map(says_a_frame, folders)) != all(map(says_a_frame, stems)):
        return all(map(says_a_frame, folders))
    if all(map(OF_A_MASK.search, folders)) != all(map(OF_A_MASK.search, stems)):
        return all(map(OF_A_MASK.search, stems))
    raise BadInput(
        f"{root}: nothing says whether {folders[0]!r} or {stems[0]!r} is a picture",
        hint="name what is a picture by its frame: 000012/3.png is mask 3 of frame 12, chair/000012.png a chair there",
    )


def _judges_masks(table: Path) -> bool:
    """Whether a table is that of `amg.py`; other data sets have one of this name too."""
    head = (lines_of(table) or [""])[0].split(",")
    return "id" in head and any(name in head for name in JUDGEMENTS)


def _scores(table: Path) -> dict[str, float]:
    """Return mask -> score, the lower of the two judgements. Raises BadInput."""
    head, *rows = [line.split(",") for line in lines_of(table)]
    columns = [head.index(name) for name in ("id", *JUDGEMENTS) if name in head]
    scores = {}
    for row in rows:
        try:
            scores[row[columns[0]]] = min(1.0, *(float(row[column]) for column in columns[1:]))
        except (ValueError, IndexError):
            raise BadInput(f"{table}: {','.join(row)!r:.60} is not a row of numbers", hint="write it again") from None
    return {name: score if score >= 0 else 0.0 for name, score in scores.items()}


def _mask(path: Path, shape: tuple[int, int]) -> np.ndarray:
    values, _ = read_instances(path, shape)
    if len(np.unique(values[values != 0])) > 1:
        raise BadInput(f"{path}: holds several values, so it is more than one mask", hint=HINT)
    return values != 0


FORMAT = MaskFormat("mask PNGs", "a PNG a mask, in a folder a picture (amg.py) or a folder a class", 47, open_source)
