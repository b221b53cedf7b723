"""YOLO segmentation labels: a text a picture, a line `class x1 y1 x2 y2 ...` a mask, in shares of width and height.

Classes count from 0 in `names` of a YAML (`data.yaml`), or in the lines of `classes.txt`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from ruamel.yaml import YAML, YAMLError
from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import file_text
from scenewright.stages.segment.backends.masks.classes import categories_of, lines_of, read_classes
from scenewright.stages.segment.backends.masks.encoded import flatten_encoded
from scenewright.stages.segment.backends.masks.given import (
    Category,
    GivenFrame,
    GivenMask,
    MaskFormat,
    MaskSource,
    ReadSettings,
    picture_of_file,
)
from scenewright.stages.segment.backends.masks.listing import Listing

HINT = "a line is `class x1 y1 x2 y2 x3 y3 ...`, coordinates in 0..1"
LARGEST_YAML = 256_000
"""Most bytes of a YAML: its parser is slow."""
LOOKED_AT = 100
"""Texts among which one has to hold a label."""
BOX = 5
"""Numbers of a line that is a box; six with a score."""
SLACK = 0.01
"""How far a coordinate may be outside 0..1: rounding."""


def open_source(listing: Listing) -> MaskSource | None:
    """Return the masks of a folder of YOLO labels. Raises BadInput when a line is broken, or when all are boxes."""
    files = listing.ending(".txt")
    # Others lie beside them (Roboflow's README.dataset.txt).
    if not any(_is_row(lines[0]) for file in files[:LOOKED_AT] if (lines := lines_of(file))):
        return None
    rows_by_file = {file: [_row(line, file) for line in lines_of(file)] for file in files if _is_label(file)}
    rows = [row for rows in rows_by_file.values() for row in rows]
    if rows and all(polygon is None for _, polygon, _ in rows):
        raise BadInput(
            f"{listing.root}: its labels are boxes (class, x, y, width, height), none is an outline",
            hint="write outlines with a segmentation network (yolo segment predict ... save_txt=True)",
        )
    paths = list(rows_by_file)

    def read(place: int, shape: tuple[int, int], settings: ReadSettings) -> GivenFrame:
        rows = rows_by_file[paths[place]]
        told = [GivenMask(number, score) for number, _, score in rows]
        size = np.array([shape[1], shape[0]])
        areas = [None if polygon is None else [polygon * size] for _, polygon, _ in rows]
        return flatten_encoded(areas, told, settings, shape, str(paths[place]), (shape[1], shape[0]))

    pictures = tuple(picture_of_file(path, listing.root) for path in paths)
    lacks = () if any(score < 1 for _, _, score in rows) else ("scores",)
    return MaskSource(pictures, _categories(listing), read, lacks)


def _is_row(line: str) -> bool:
    words = line.split()
    try:
        return len(words) >= BOX and words[0].isdecimal() and all(abs(float(word)) < 1e9 for word in words)
    except ValueError:
        return False


def _is_label(path: Path) -> bool:
    lines = lines_of(path)
    return not lines or _is_row(lines[0])


def _row(line: str, path: Path) -> tuple[int, np.ndarray | None, float]:
    """Return class, polygon (K, 2) in shares of the picture (None: a box), and score."""
    if not _is_row(line):
        raise BadInput(f"{path}: {line!r:.60} is not a row of numbers", hint=HINT)
    words = line.split()
    values = np.array([float(word) for word in words[1:]])
    score = float(values[-1]) if len(values) % 2 else 1.0
    points = values[: len(values) // 2 * 2]
    if not ((points >= -SLACK) & (points <= 1 + SLACK)).all() or not 0 <= score <= 1:
        raise BadInput(f"{path}: {line!r:.60} has a number that is not in 0..1", hint=HINT)
    return int(words[0]), points.reshape(-1, 2) if len(points) >= BOX + 1 else None, score


def _categories(listing: Listing) -> dict[int, Category]:
    """Return what the numbers stand for, by a YAML's `names` or the class file. Raises BadInput when it is broken."""
    for path in (*listing.ending(".yaml"), *listing.ending(".yml")):
        names = _names(path)
        if names is not None:
            rows = dict(enumerate(names)) if isinstance(names, list) else names
            return categories_of({str(number): name for number, name in rows.items()}, str(path))
    listed = listing.named("classes.txt")
    lines = lines_of(listed) if listed else []
    if not all(line.split()[0].isdecimal() for line in lines):
        return categories_of({str(number): name for number, name in enumerate(lines)}, str(listed))
    return read_classes(listing)[0]


def _names(path: Path) -> Any:
    text = file_text(path, LARGEST_YAML, hint="names: [chair, table]")
    try:
        data = YAML(typ="safe", pure=True).load(text)
    except (YAMLError, ValueError, RecursionError, TypeError, AttributeError, KeyError, IndexError):
        raise BadInput(f"{path}: no YAML", hint="names: [chair, table]") from None
    names = data.get("names") if isinstance(data, dict) else None
    return names if isinstance(names, list | dict) else None


FORMAT = MaskFormat(
    "YOLO outlines", "a text a picture, `class x1 y1 x2 y2 ...` in shares of the picture", 40, open_source
)
