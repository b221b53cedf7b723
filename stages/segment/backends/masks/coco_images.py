"""The table `images` that COCO's formats have."""

from __future__ import annotations

from typing import Any

from scenewright.schemas.errors import BadInput
from scenewright.stages.segment.backends.masks.given import Picture, entry, stem_of


def pictures_by_id(data: Any, where: str) -> dict[int, Picture]:
    """Return the pictures of the table `images`, if there is one. Raises BadInput, beginning with `where`."""
    pictures: dict[int, Picture] = {}
    for row in entry(data, "images", list) or ():
        number = entry(row, "id", int)
        if number is None or number in pictures:
            raise BadInput(f"{where}: an image has no id, or one that comes twice: {str(row):.60}", hint="number them")
        pictures[number] = picture_of(entry(row, "file_name", str) or "", number, row, {})
    return pictures


def picture_of(file_name: str, number: int | None, row: Any, pictures: dict[int, Picture]) -> Picture:
    """Return the picture of an annotation: as the table has it, else by its own file name, time and number."""
    if number is not None and number in pictures and (pictures[number].name or not file_name):
        return pictures[number]
    time = entry(row, "timestamp", (int, float))
    size = entry(row, "width", int), entry(row, "height", int)
    return Picture(
        stem_of(file_name),
        number,
        None if time is None else float(time),
        (size[0], size[1]) if size[0] and size[1] else None,
        file_name,
    )
