"""COCO instances: a dataset (`images`, `annotations`, `categories`) or a list of results, with masks as RLE."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

from scenewright.schemas.errors import BadInput
from scenewright.stages.segment.backends.masks.classes import categories_of, read_classes, score_of
from scenewright.stages.segment.backends.masks.coco_images import picture_of, pictures_by_id
from scenewright.stages.segment.backends.masks.encoded import flatten_encoded
from scenewright.stages.segment.backends.masks.given import (
    GivenFrame,
    GivenMask,
    MaskFormat,
    MaskSource,
    ReadSettings,
    entry,
)
from scenewright.stages.segment.backends.masks.listing import Listing


def open_source(listing: Listing) -> MaskSource | None:
    """Return the masks of a folder with a JSON of annotations of images. Raises BadInput when it is broken."""
    path = next((file for file in listing.ending(".json")[:3] if _rows(listing.json(file)) is not None), None)
    if path is None:
        return None
    data, where = listing.json(path), str(path)
    pictures = pictures_by_id(data, where)
    by_image: dict[int, list[Any]] = defaultdict(list)
    for number in pictures:
        by_image[number] = []
    for row in _rows(data) or ():
        image = entry(row, "image_id", int)
        if image is None or (pictures and image not in pictures):
            raise BadInput(f"{where}: annotation of image {row.get('image_id')!r:.40}, which it does not list")
        by_image[image].append(row)
    images = list(by_image)
    listed = categories_of(data["categories"], where) if isinstance(data, dict) and data.get("categories") else {}
    categories = listed or read_classes(listing)[0]

    def read(place: int, shape: tuple[int, int], settings: ReadSettings) -> GivenFrame:
        rows = by_image[images[place]]
        masks = [
            GivenMask(entry(row, "category_id", int), score_of(row.get("score"), f"{where}: image {images[place]}"))
            for row in rows
        ]
        return flatten_encoded(
            [row.get("segmentation") for row in rows], masks, settings, shape, f"{where}: image {images[place]}"
        )

    scored = any("score" in row for rows in by_image.values() for row in rows)
    picture_list = tuple(picture_of("", number, {}, pictures) for number in images)
    return MaskSource(picture_list, categories, read, () if scored else ("scores",))


def _rows(data: Any) -> list[Any] | None:
    rows = data if isinstance(data, list) else entry(data, "annotations", list)
    if not rows:
        return rows if isinstance(data, dict) and entry(data, "images", list) else None
    return rows if all(isinstance(row, dict) and "image_id" in row and "segmentation" in row for row in rows) else None


FORMAT = MaskFormat("COCO instances", "JSON with RLE masks, a dataset or a list of results", 20, open_source)
