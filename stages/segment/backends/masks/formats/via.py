"""VGG Image Annotator: one JSON of pictures with `regions`, a project or an export of annotations."""

from __future__ import annotations

from typing import Any

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.segment.backends.masks.drawn import Shape, points_of, source_of_shapes
from scenewright.stages.segment.backends.masks.given import MaskFormat, MaskSource, Picture, entry, stem_of
from scenewright.stages.segment.backends.masks.listing import Listing
from scenewright.stages.segment.backends.masks.polygons import ellipse, rectangle

PROJECT = "_via_img_metadata"
WORDS = ("class", "label", "name", "category", "type", "object")
"""Attributes of a region that say what it is, the first that is there."""
HINT = "export the annotations as JSON again"
LOOKED_AT = 3
"""JSON files among which one has to be of this format."""


def open_source(listing: Listing) -> MaskSource | None:
    """Return the masks of a folder with a JSON of VIA. Raises BadInput when it is broken."""
    found = [(file, _pictures(listing.json(file))) for file in listing.ending(".json")[:LOOKED_AT]]
    path, rows = next(((file, rows) for file, rows in found if rows is not None), (None, None))
    if path is None or rows is None:
        return None
    pictures = [Picture(stem_of(row["filename"]), seen=row["filename"]) for row in rows]
    wheres = [f"{path}: {row['filename']:.80}" for row in rows]
    shapes = [
        [_shape(region, f"{where}: region {number}") for number, region in enumerate(_regions(row), start=1)]
        for row, where in zip(rows, wheres, strict=True)
    ]
    return source_of_shapes(pictures, shapes, wheres)


def _pictures(data: Any) -> list[Any] | None:
    """Return the pictures that a JSON of VIA lists; None when it is none."""
    listed = data.get(PROJECT, data) if isinstance(data, dict) else None
    rows = list(listed.values()) if isinstance(listed, dict) else []
    ours = rows and all(isinstance(row, dict) and isinstance(row.get("filename"), str) for row in rows)
    return rows if ours and all("regions" in row for row in rows) else None


def _regions(row: Any) -> list[Any]:
    """A list, or in files of VIA 1 an object by number."""
    regions = row["regions"]
    return list(regions.values()) if isinstance(regions, dict) else regions if isinstance(regions, list) else []


def _shape(region: Any, where: str) -> Shape:
    drawn, said = entry(region, "shape_attributes", dict), entry(region, "region_attributes", dict) or {}
    kind = entry(drawn, "name", str)
    if drawn is None or kind is None:
        raise BadInput(f"{where}: says no shape", hint=HINT)
    words = {key.lower(): _word(value) for key, value in said.items()}
    word = next((words[key] for key in WORDS if words.get(key)), next(filter(None, words.values()), ""))
    if kind in ("point", "polyline"):
        return Shape(word, None)
    if kind == "polygon":
        columns = entry(drawn, "all_points_x", list), entry(drawn, "all_points_y", list)
        pairs = [list(pair) for pair in zip(*columns, strict=False)] if columns[0] and columns[1] else None
        points = points_of(pairs)
        if points is None or len(columns[0] or []) != len(columns[1] or []):
            raise BadInput(f"{where}: its polygon has no points, or not as many x as y", hint=HINT)
        return Shape(word, [points] if len(points) > 2 else None)
    numbers = {key: float(value) for key, value in drawn.items() if entry(drawn, key, (int, float)) is not None}
    try:
        return Shape(word, [_polygon(kind, numbers)])
    except KeyError as missing:
        raise BadInput(f"{where}: a {kind:.30} without {missing}, or of no known kind", hint=HINT) from None


def _polygon(kind: str, numbers: dict[str, float]) -> np.ndarray:
    if kind == "rect":
        return rectangle((numbers["x"], numbers["y"]), (numbers["width"], numbers["height"]))
    center = numbers["cx"], numbers["cy"]
    if kind == "circle":
        return ellipse(center, (numbers["r"], numbers["r"]))
    return ellipse(center, (numbers["rx"], numbers["ry"]), numbers.get("theta", 0.0))


def _word(value: Any) -> str:
    """The text of an attribute; of boxes to tick the first that is ticked."""
    if isinstance(value, dict):
        return next((key for key, ticked in value.items() if ticked), "")
    return value.strip() if isinstance(value, str) else ""


FORMAT = MaskFormat("VIA", "VGG Image Annotator's JSON", 36, open_source)
