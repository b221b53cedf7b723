"""What Segment Anything's automatic mask generator gives, one JSON a picture: RLE masks without classes.

A list of `{"segmentation": RLE, "predicted_iou": ..., "stability_score": ...}` (`output_mode="coco_rle"`), or the form
of the data set SA-1B, `{"image": {...}, "annotations": [...]}`. The score of a mask is the lower of the two judgements.
"""

from __future__ import annotations

from typing import Any

from scenewright.schemas.errors import BadInput
from scenewright.stages.segment.backends.masks.encoded import flatten_encoded
from scenewright.stages.segment.backends.masks.given import (
    GivenFrame,
    GivenMask,
    MaskFormat,
    MaskSource,
    ReadSettings,
    entry,
    picture_of_file,
)
from scenewright.stages.segment.backends.masks.listing import Listing, read_json

HINT = 'write SamAutomaticMaskGenerator(output_mode="coco_rle").generate(image) as JSON, a file a picture'


def open_source(listing: Listing) -> MaskSource | None:
    """Return the masks of a folder of one JSON a picture. Raises BadInput when they cannot be matched to pictures."""
    files = listing.ending(".json")
    # A picture in which nothing was found is an empty list: the first that holds something decides.
    first = next((rows for file in files[:100] if (rows := _rows(read_json(file))) != []), None)
    if not first or not all(_is_sam(row) for row in first):
        return None

    def read(place: int, shape: tuple[int, int], settings: ReadSettings) -> GivenFrame:
        where = str(files[place])
        rows = _rows(read_json(files[place]))
        if rows is None or not all(isinstance(row, dict) for row in rows):
            raise BadInput(f"{where}: no list of masks", hint=HINT)
        masks = [GivenMask(None, _score(row, where)) for row in rows]
        return flatten_encoded([row.get("segmentation") for row in rows], masks, settings, shape, where)

    return MaskSource(tuple(picture_of_file(file, listing.root) for file in files), {}, read)


def _rows(data: Any) -> list[Any] | None:
    return data if isinstance(data, list) else entry(data, "annotations", list)


def _is_sam(row: Any) -> bool:
    return isinstance(row, dict) and "segmentation" in row and ("predicted_iou" in row or "stability_score" in row)


def _score(row: dict[str, Any], where: str) -> float:
    scores = [row[key] for key in ("predicted_iou", "stability_score") if row.get(key) is not None]
    if not all(isinstance(value, int | float) and not isinstance(value, bool) and value >= 0 for value in scores):
        raise BadInput(f"{where}: predicted_iou or stability_score is not a number of 0 or more", hint=HINT)
    # The network's judgement of its own mask may pass 1 a little.
    return float(min([1.0, *scores]))


FORMAT = MaskFormat("SAM", "Segment Anything's automatic masks, a JSON a picture", 30, open_source)
