"""COCO instances: datasets (`images`, `annotations`, `categories`) or lists of results; masks are RLE or polygons."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

from scenewright.schemas.errors import BadInput
from scenewright.stages.segment.backends.masks.classes import categories_of, read_classes, score_of
from scenewright.stages.segment.backends.masks.coco_images import picture_of, pictures_by_id
from scenewright.stages.segment.backends.masks.encoded import flatten_encoded
from scenewright.stages.segment.backends.masks.given import (
    Category,
    GivenFrame,
    GivenMask,
    MaskFormat,
    MaskSource,
    Picture,
    ReadSettings,
    entry,
)
from scenewright.stages.segment.backends.masks.listing import Listing

LOOKED_AT = 3
"""JSON files among which one has to be of this format."""


def open_source(listing: Listing) -> MaskSource | None:
    """Return the masks of a folder with JSONs of annotations of images, one or several (a file a part, as Roboflow
    writes `train`, `valid`, `test`). Raises BadInput when one is broken, or when not one annotation has a mask."""
    files = listing.ending(".json")
    if all(_rows(listing.json(file)) is None for file in files[:LOOKED_AT]):
        return None
    kinds = {type(listing.json(file)): file for file in files if _rows(listing.json(file)) is not None}
    if len(kinds) > 1:
        raise BadInput(
            f"{listing.root}: {kinds[dict].name} is a dataset, {kinds[list].name} a list of results",
            hint="give one of the two: --masks FILE",
        )
    categories: dict[int, Category] = {}
    pictures: list[Picture] = []
    rows_of: list[tuple[str, list[Any]]] = []
    for file in files:
        data, where = listing.json(file), str(file)
        rows = _rows(data)
        if rows is None:
            continue
        listed = categories_of(data["categories"], where) if isinstance(data, dict) and data.get("categories") else {}
        for number, category in listed.items():
            if categories.setdefault(number, category).name != category.name:
                raise BadInput(
                    f"{where}: category {number} is {category.name!r}, in a file before it {categories[number].name!r}",
                    hint="give one of the files alone: --masks FILE",
                )
        by_id = pictures_by_id(data, where)
        by_image = _by_image(rows, by_id, where)
        pictures += [picture_of("", number, {}, by_id) for number in by_image]
        rows_of += [(f"{where}: image {number}", of_image) for number, of_image in by_image.items()]
    every_row = [row for _, rows in rows_of for row in rows]
    if every_row and not any(row.get("segmentation") for row in every_row):
        raise BadInput(
            f"{rows_of[0][0]}: its annotations are boxes, none has a mask",
            hint="annotate with polygons or masks; Segment Anything makes masks of boxes",
        )

    def read(place: int, shape: tuple[int, int], settings: ReadSettings) -> GivenFrame:
        where, rows = rows_of[place]
        masks = [GivenMask(entry(row, "category_id", int), score_of(row.get("score"), where)) for row in rows]
        encodings = [row.get("segmentation") for row in rows]
        return flatten_encoded(encodings, masks, settings, shape, where, pictures[place].size)

    scored = any("score" in row for row in every_row)
    return MaskSource(tuple(pictures), read_classes(listing)[0] | categories, read, () if scored else ("scores",))


def _by_image(rows: list[Any], pictures: dict[int, Picture], where: str) -> dict[int, list[Any]]:
    """Return image id -> its annotations. Raises BadInput for one of an image that is not listed."""
    by_image: dict[int, list[Any]] = defaultdict(list)
    for number in pictures:
        by_image[number] = []
    for row in rows:
        image = entry(row, "image_id", int)
        if image is None or (pictures and image not in pictures):
            raise BadInput(
                f"{where}: annotation of image {row.get('image_id')!r:.40}, which it does not list",
                hint="`image_id` is the `id` of one of `images`",
            )
        by_image[image].append(row)
    return by_image


def _rows(data: Any) -> list[Any] | None:
    rows = data if isinstance(data, list) else entry(data, "annotations", list)
    if not rows:
        return rows if isinstance(data, dict) and entry(data, "images", list) else None
    are_annotations = all(
        isinstance(row, dict) and "image_id" in row and ("segmentation" in row or "bbox" in row) for row in rows
    )
    return rows if are_annotations else None


FORMAT = MaskFormat("COCO instances", "JSON with RLE masks or polygons, datasets or a list of results", 20, open_source)
