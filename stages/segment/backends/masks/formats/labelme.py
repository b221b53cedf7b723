"""LabelMe: a JSON a picture, with `shapes` of `label`, `points` and `shape_type`."""

from __future__ import annotations

import base64
import binascii
from pathlib import Path
from typing import Any

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.segment.backends.masks.drawn import Shape, points_of, source_of_shapes
from scenewright.stages.segment.backends.masks.encoded import Crop
from scenewright.stages.segment.backends.masks.given import MaskFormat, MaskSource, Picture, entry, picture_of_file
from scenewright.stages.segment.backends.masks.images import decode_mask
from scenewright.stages.segment.backends.masks.listing import Listing, read_json
from scenewright.stages.segment.backends.masks.polygons import ellipse

HINT = "save it again with LabelMe"
LOOKED_AT = 3
"""JSON files among which one has to be of this format."""
FLAT = ("point", "points", "line", "linestrip")
"""Shapes that enclose nothing."""


def open_source(listing: Listing) -> MaskSource | None:
    """Return the masks of a folder of LabelMe's files. Raises BadInput when one is broken."""
    files = listing.ending(".json")
    if not any(_is_labelme(listing.json(file)) for file in files[:LOOKED_AT]):
        return None
    pictures: list[Picture] = []
    shapes: list[list[Shape]] = []
    wheres: list[str] = []
    for file in files:
        data = read_json(file)
        if not _is_labelme(data):
            continue
        size = entry(data, "imageWidth", int), entry(data, "imageHeight", int)
        known_size = (size[0], size[1]) if size[0] and size[1] else None
        pictures.append(picture_of_file(file, listing.root, size=known_size))
        shapes.append(_shapes(data["shapes"], file))
        wheres.append(str(file))
    return source_of_shapes(pictures, shapes, wheres)


def _is_labelme(data: Any) -> bool:
    return entry(data, "shapes", list) is not None and ("imagePath" in data or "imageData" in data)


def _shapes(rows: list[Any], path: Path) -> list[Shape]:
    """Return the shapes; those of one label and group are one. Raises BadInput."""
    shapes: list[Shape] = []
    groups: dict[tuple[str, Any], int] = {}
    for number, row in enumerate(rows, start=1):
        where = f"{path}: shape {number}"
        label, points = entry(row, "label", str), points_of(row.get("points") if isinstance(row, dict) else None)
        if label is None or points is None:
            raise BadInput(f"{where}: has no label or no points", hint=HINT)
        area = _area(row, points, where)
        group = (label, entry(row, "group_id", (int, str)))
        first = groups.get(group) if group[1] is not None else None
        earlier = shapes[first].area if first is not None else None
        if first is not None and isinstance(earlier, list) and isinstance(area, list):
            shapes[first] = Shape(label, earlier + area)
            continue
        groups[group] = len(shapes)
        shapes.append(Shape(label, area))
    return shapes


def _area(row: Any, points: np.ndarray, where: str) -> list[np.ndarray] | Crop | None:
    kind = row.get("shape_type") or "polygon"
    if kind in FLAT:
        return None
    if kind == "polygon":
        return [points] if len(points) > 2 else None
    if kind in ("rectangle", "circle", "mask") and len(points) != 2:
        raise BadInput(f"{where}: a {kind} has two points, this one {len(points)}", hint=HINT)
    if kind == "circle":
        radius = float(np.hypot(*(points[1] - points[0])))
        return [ellipse((points[0, 0], points[0, 1]), (radius, radius))]
    (left, top), (right, bottom) = points.min(axis=0), points.max(axis=0)
    if kind == "rectangle":
        return [np.array([[left, top], [right, top], [right, bottom], [left, bottom]])]
    if kind == "mask":
        try:
            data = base64.b64decode(row.get("mask") or "", validate=True)
        except (binascii.Error, ValueError, TypeError):
            raise BadInput(f"{where}: its mask is not base64", hint=HINT) from None
        return Crop(decode_mask(data, where), int(round(left)), int(round(top)))
    raise BadInput(f"{where}: a shape of the unknown kind {kind!r:.30}", hint="draw it as a polygon")


FORMAT = MaskFormat("LabelMe", "a JSON a picture with `shapes`", 32, open_source)
