"""COCO panoptic: one JSON with `annotations[].segments_info`, and a PNG for each with ids R + 256 G + 65536 B."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.segment.backends.masks.classes import categories_of, read_classes, score_of
from scenewright.stages.segment.backends.masks.coco_images import picture_of, pictures_by_id
from scenewright.stages.segment.backends.masks.given import (
    GivenFrame,
    GivenMask,
    MaskFormat,
    MaskSource,
    ReadSettings,
    entry,
)
from scenewright.stages.segment.backends.masks.images import read_panoptic
from scenewright.stages.segment.backends.masks.listing import Listing

HINT = "panopticapi describes the format"


def open_source(listing: Listing) -> MaskSource | None:
    """Return the masks of a folder whose JSON has `segments_info`. Raises BadInput when it is broken."""
    path = next((file for file in listing.ending(".json")[:3] if _is_panoptic(listing.json(file))), None)
    if path is None:
        return None
    data: dict[str, Any] = listing.json(path)
    rows = data["annotations"]
    pictures, where = pictures_by_id(data, str(path)), str(path)
    files: dict[str, list[Path]] = {}
    for file in listing.ending(".png"):
        files.setdefault(file.name, []).append(file)
    picture_list = [
        picture_of(entry(row, "file_name", str) or "", entry(row, "image_id", int), row, pictures) for row in rows
    ]
    images: list[Path] = []
    for row in rows:
        name = (entry(row, "file_name", str) or "").replace("\\", "/")
        same = files.get(Path(name).name, [])
        exact = [file for file in same if file.as_posix().endswith("/" + name)] or same
        if not exact:
            raise BadInput(f"{where}: its image {name!r:.80} is not in {listing.root}", hint="put the PNGs beside it")
        images.append(exact[0])
    own = categories_of(data["categories"], where) if "categories" in data else {}
    categories = read_classes(listing)[0] | own

    def read(place: int, shape: tuple[int, int], settings: ReadSettings) -> GivenFrame:
        ids = read_panoptic(images[place], shape)
        masks = _masks(rows[place], f"{where}: {images[place].name}")
        missing = sorted(set(np.unique(ids).tolist()) - {0} - masks.keys())
        if missing:
            raise BadInput(
                f"{images[place]}: id {missing[0]} is not in segments_info of {path.name} ({len(missing)} such ids)",
                hint=HINT,
            )
        return GivenFrame(ids, masks)

    scored = any("score" in segment for row in rows for segment in row["segments_info"] if isinstance(segment, dict))
    return MaskSource(tuple(picture_list), categories, read, ("overlaps",) if scored else ("scores", "overlaps"))


def _is_panoptic(data: Any) -> bool:
    rows = entry(data, "annotations", list)
    return bool(rows) and all(entry(row, "segments_info", list) is not None for row in rows)


def _masks(row: dict[str, Any], where: str) -> dict[int, GivenMask]:
    masks: dict[int, GivenMask] = {}
    for segment in row["segments_info"]:
        number = entry(segment, "id", int)
        if number is None or number <= 0 or number in masks:
            raise BadInput(f"{where}: segment id {str(segment):.60} is missing, no number over 0, or twice", hint=HINT)
        masks[number] = GivenMask(entry(segment, "category_id", int), score_of(segment.get("score"), where))
    return masks


FORMAT = MaskFormat("COCO panoptic", "JSON with segments_info and panoptic PNGs", 10, open_source)
