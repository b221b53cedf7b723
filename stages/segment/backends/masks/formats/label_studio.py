"""Label Studio: one JSON of tasks, each a picture with `annotations[].result`; polygons, rectangles, ellipses, brushes.

JSON-MIN, in which a task is `{"image": ..., "label": [shapes]}`, is brought to that form. Lengths are percents of the
picture. A brush is a run-length code of Label Studio's own, over R, G, B, A of each pixel.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.image_headers import LARGEST_IMAGE
from scenewright.stages.segment.backends.masks.drawn import Shape, points_of, source_of_shapes
from scenewright.stages.segment.backends.masks.encoded import cropped
from scenewright.stages.segment.backends.masks.given import MaskFormat, MaskSource, Picture, entry, stem_of
from scenewright.stages.segment.backends.masks.listing import Listing
from scenewright.stages.segment.backends.masks.polygons import ellipse, rectangle

HINT = "export the project as JSON, or as COCO with polygons"
LOOKED_AT = 3
"""JSON files among which one has to be of this format."""
CHANNELS = 4


def open_source(listing: Listing) -> MaskSource | None:
    """Return the masks of a folder with a JSON of Label Studio. Raises BadInput when it is broken."""
    found = [(file, _tasks(listing.json(file))) for file in listing.ending(".json")[:LOOKED_AT]]
    path, tasks = next(((file, rows) for file, rows in found if rows), (None, []))
    if path is None:
        return None
    pictures: list[Picture] = []
    shapes: list[list[Shape]] = []
    wheres: list[str] = []
    for number, task in enumerate(tasks, start=1):
        where = f"{path}: task {task.get('id', number)}"
        results = _results(task)
        sizes = {size for row in results if (size := _size(row)) is not None}
        if len(sizes) > 1:
            raise BadInput(f"{where}: its results are of images of several sizes", hint=HINT)
        name = _picture_name(task)
        pictures.append(Picture(stem_of(name), size=next(iter(sizes), None), seen=name))
        shapes.append([_shape(row, f"{where}: result {k}") for k, row in enumerate(results, start=1) if _is_area(row)])
        wheres.append(where)
    return source_of_shapes(pictures, shapes, wheres)


def _tasks(data: Any) -> list[Any]:
    """Return the tasks that a JSON lists; nothing: it is none of Label Studio's."""
    rows = data if isinstance(data, list) else []
    if all(entry(row, "data", dict) is not None and entry(row, "annotations", list) is not None for row in rows):
        return rows
    tasks = [_whole_task(row) for row in rows]
    return tasks if all(tasks) and any(task["annotations"][0]["result"] for task in tasks) else []


def _whole_task(row: Any) -> dict[str, Any]:
    """Return a task of JSON-MIN in the form of the whole export; nothing: it is none."""
    if not isinstance(row, dict) or not isinstance(row.get("image"), str):
        return {}
    shapes = [shape for value in row.values() if isinstance(value, list) for shape in value if _size(shape)]
    result = [{**shape, "value": shape} for shape in shapes]
    return {"id": row.get("id"), "data": {"image": row["image"]}, "annotations": [{"result": result}]}


def _picture_name(task: Any) -> str:
    names = [value for value in task["data"].values() if isinstance(value, str)]
    return entry(task["data"], "image", str) or (names[0] if names else "")


def _results(task: Any) -> list[Any]:
    """What was drawn: of several annotations of a picture the first that was not cancelled."""
    done = [row for row in task["annotations"] if isinstance(row, dict) and not row.get("was_cancelled")]
    return (entry(done[0], "result", list) or []) if done else []


def _is_area(row: Any) -> bool:
    """Whether a result is a region (others are relations, choices, texts)."""
    value = entry(row, "value", dict) or {}
    return any(key in value for key in ("points", "rle", "height", "radiusX"))


def _size(row: Any) -> tuple[int, int] | None:
    width, height = entry(row, "original_width", int), entry(row, "original_height", int)
    return (width, height) if width and height else None


def _shape(row: Any, where: str) -> Shape:
    value, size = row["value"], _size(row)
    word = next((v[0] for k, v in value.items() if k.endswith("labels") and isinstance(v, list) and v), "")
    if size is None or not isinstance(word, str):
        raise BadInput(f"{where}: has no original_width and original_height, or no label", hint=HINT)
    if "rle" in value:
        return Shape(word, cropped(brush_mask(value["rle"], size, where)))
    percent = np.array(size) / 100
    if "points" in value:
        points = points_of(value["points"])
        if points is None:
            raise BadInput(f"{where}: its points are no list of pairs", hint=HINT)
        return Shape(word, [points * percent] if len(points) > 2 else None)
    numbers = {key: float(value[key]) for key in value if entry(value, key, (int, float)) is not None}
    turn = math.radians(numbers.get("rotation", 0.0))
    try:
        corner = numbers["x"] * percent[0], numbers["y"] * percent[1]
        if "radiusX" in numbers:
            radii = numbers["radiusX"] * percent[0], numbers["radiusY"] * percent[1]
            return Shape(word, [ellipse(corner, radii, turn)])
        return Shape(word, [rectangle(corner, (numbers["width"] * percent[0], numbers["height"] * percent[1]), turn)])
    except KeyError as missing:
        raise BadInput(f"{where}: has no number {missing}", hint=HINT) from None


def brush_mask(code: Any, size: tuple[int, int], where: str) -> np.ndarray:
    """Return the mask (H, W) bool of a brush in a picture of `size` (width, height): where alpha is over 0.

    32 bits say how many values there are, 5 bits how long a value is, 4 times 4 bits how long a count may be. Then
    runs: a bit (1: one value for all), 2 bits (which of the four lengths), the count less one, and the value or values
    (all lengths less one). Source: label_studio_sdk, converter/brush.py. Raises BadInput, beginning with `where`.
    """
    damaged = BadInput(f"{where}: its brush is damaged, or of another size than the image", hint=HINT)
    if not isinstance(code, list) or not all(type(byte) is int and 0 <= byte < 256 for byte in code):
        raise damaged
    bits = "".join(f"{byte:08b}" for byte in code)
    position = 0

    def take(count: int) -> int:
        nonlocal position
        position += count
        if position > len(bits):
            raise damaged
        return int(bits[position - count : position], 2)

    amount = take(32)
    length = take(5) + 1
    if amount != CHANNELS * size[0] * size[1] or amount > CHANNELS * LARGEST_IMAGE or length > 8:
        raise damaged
    counts = [take(4) + 1 for _ in range(4)]
    values = np.zeros(amount, dtype=np.uint8)
    place = 0
    while place < amount:
        is_run = take(1)
        end = place + 1 + take(counts[take(2)])
        if end > amount:
            raise damaged
        values[place:end] = take(length) if is_run else [take(length) for _ in range(end - place)]
        place = end
    return values.reshape(size[1], size[0], CHANNELS)[..., 3] > 0


FORMAT = MaskFormat("Label Studio", "its JSON export of polygons, rectangles, ellipses and brushes", 34, open_source)
