"""PNGs whose colours are classes: with a label map beside them (CVAT's "Segmentation mask"), or in folders as VOC's.

`labelmap.txt` has a line `label:R,G,B:parts:actions` for each class. `SegmentationClass/x.png` says what a pixel is,
`SegmentationObject/x.png`, where it is there, of which instance; without a label map the colours, or the indices of the
palette, are PASCAL VOC's.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.labels import load_label_set
from scenewright.stages.segment.backends.masks.classes import lines_of, read_classes
from scenewright.stages.segment.backends.masks.given import (
    Category,
    GivenFrame,
    MaskFormat,
    MaskSource,
    ReadSettings,
    picture_of_file,
    stem_of,
)
from scenewright.stages.segment.backends.masks.images import read_colors, read_instances
from scenewright.stages.segment.backends.masks.listing import Listing
from scenewright.stages.segment.backends.masks.values import named_by_value, numbered

LABEL_MAP = "labelmap.txt"
HINT = f"{LABEL_MAP}: a line `chair:128,0,0` for each class"
CLASS_FOLDERS = ("SegmentationClass", "SegmentationClassPNG")
OBJECT_FOLDERS = ("SegmentationObject", "SegmentationObjectPNG")
RIM = 255
"""The index of the rim around VOC's objects, and of what is to be ignored."""


def open_source(listing: Listing) -> MaskSource | None:
    """Return the masks of a folder with a label map, or of VOC's folders. Raises BadInput when the map is broken."""
    label_map = listing.named(LABEL_MAP)
    pictures = listing.ending(".png")
    in_class_folder = [file for file in pictures if file.parent.name in CLASS_FOLDERS]
    files = in_class_folder or [file for file in pictures if file.parent.name not in OBJECT_FOLDERS]
    if not files or not (label_map or in_class_folder):
        return None
    objects = {stem_of(file.name): file for file in pictures if file.parent.name in OBJECT_FOLDERS}
    if label_map:
        colors, categories = read_label_map(label_map)
    else:
        given, divisor = read_classes(listing)
        colors = {color: index for index, color in enumerate(voc_colors(RIM + 1))}
        categories = given or {0: Category("background"), **voc_categories()}
    source = label_map.name if label_map else listing.class_source() if given else "PASCAL VOC's classes"

    def read(place: int, shape: tuple[int, int], settings: ReadSettings) -> GivenFrame:
        path = files[place]
        image = read_colors(path, shape) if label_map or not _is_indexed(path, shape) else None
        values = read_instances(path, shape)[0] if image is None else _numbers_of_colors(image, colors, path, source)
        frame = named_by_value(values, categories, 0 if label_map else divisor, path, source, HINT)
        instances = objects.get(stem_of(path.name))
        return frame if instances is None else _split(frame, instances, shape)

    lacks = ("scores", "overlaps")
    return MaskSource(tuple(picture_of_file(file, listing.root) for file in files), categories, read, lacks)


def voc_categories() -> dict[int, Category]:
    """Return number -> class of PASCAL VOC."""
    return {label.id: Category(label.name) for label in load_label_set("pascal-voc").labels if label.id is not None}


def read_label_map(path: Path) -> tuple[dict[int, int], dict[int, Category]]:
    """Return colour (R + 256 G + 65536 B) -> number of its class from 1, and number -> class. Black that no label has
    is no mask. Raises BadInput."""
    colors: dict[int, int] = {}
    categories: dict[int, Category] = {}
    for line in lines_of(path):
        name, _, rest = line.partition(":")
        parts = [part.strip() for part in rest.split(":")[0].split(",")]
        if not name.strip() or len(parts) != 3 or not all(p.isdecimal() and int(p) < 256 for p in parts):
            raise BadInput(f"{path}: {line!r:.60} says no colour of a label", hint=HINT)
        red, green, blue = (int(part) for part in parts)
        color = red + 256 * green + 65536 * blue
        if color in colors:
            other = categories[colors[color]].name
            raise BadInput(
                f"{path}: {name!r} and {other!r} have one colour", hint="give each label a colour of its own"
            )
        colors[color] = len(categories) + 1
        categories[colors[color]] = Category(name.strip())
    if not categories:
        raise BadInput(f"{path}: lists no labels", hint=HINT)
    return {0: 0, **colors}, categories


def voc_colors(count: int) -> list[int]:
    """Return the first colours of PASCAL VOC's palette, R + 256 G + 65536 B: bit k of an index by threes makes bit
    7 - k of red, green and blue."""
    colors = []
    for index in range(count):
        channels = [sum((index >> (3 * k + c) & 1) << (7 - k) for k in range(8)) for c in range(3)]
        colors.append(channels[0] + 256 * channels[1] + 65536 * channels[2])
    return colors


def _is_indexed(path: Path, shape: tuple[int, int]) -> bool:
    try:
        read_instances(path, shape)
    except BadInput:
        return False
    return True


def _numbers_of_colors(image: np.ndarray, colors: Mapping[int, int], path: Path, source: str) -> np.ndarray:
    present = np.unique(image)
    unknown = [color for color in present.tolist() if color not in colors]
    if unknown:
        red, green, blue = unknown[0] & 255, unknown[0] >> 8 & 255, unknown[0] >> 16
        raise BadInput(
            f"{path}: the colour {red},{green},{blue} is not among those of {source} ({len(unknown)} such colours)",
            hint=HINT,
        )
    numbers = np.array([colors[color] for color in present.tolist()], dtype=np.int32)
    return numbers[np.searchsorted(present, image)]


def _split(frame: GivenFrame, path: Path, shape: tuple[int, int]) -> GivenFrame:
    """Return the frame whose classes are cut into the instances of another image; what has none stays whole."""
    colors = read_colors(path, shape)
    instances = read_instances(path, shape)[0] if colors is None else colors
    pairs = frame.ids.astype(np.int64) * (1 << 24) + instances
    masks = {pair: frame.masks[pair >> 24] for pair in np.unique(pairs).tolist() if pair >> 24}
    cut = numbered(pairs, masks, [])
    return GivenFrame(cut.ids, cut.masks, ignored=frame.ignored)


FORMAT = MaskFormat(
    "coloured PNG", "a labelmap.txt, or the folders of PASCAL VOC, CVAT and labelme2voc", 45, open_source
)
