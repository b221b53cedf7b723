"""What a folder of masks holds, whatever its format."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scenewright.stages.segment.backends.masks.listing import Listing
from scenewright.stages.segment.backends.masks.names import own_name

MOST_PIXELS = 2**30
"""Pixels of all masks of one frame together: 3495 masks of 640x480."""


@dataclass(frozen=True)
class Category:
    """What a number stands for."""

    name: str
    is_thing: bool | None = None
    """None: the format does not say, the label does."""


@dataclass(frozen=True)
class Picture:
    """The masks of one picture, and by what its frame may be found."""

    name: str
    """File name without folder and ending, as far as it is known."""
    number: int | None = None
    time: float | None = None
    """[s]"""
    size: tuple[int, int] | None = None
    """Width and height [pixels], where outlines are given."""
    seen: str = ""
    """What the folder calls it, where that is not the name."""


@dataclass(frozen=True)
class GivenMask:
    """What is said of one mask."""

    category: int | None
    """Number of its category; None: it has no class."""
    score: float = 1.0


@dataclass(frozen=True)
class GivenFrame:
    """The masks of one frame. `ids` (H, W) int32, 0 = no mask; `masks` says what the others are."""

    ids: np.ndarray
    masks: Mapping[int, GivenMask]
    overlapping: int = 0
    """Masks that lost pixels to others, or all of them."""
    faint: int = 0
    """Masks under the score threshold."""
    empty: int = 0
    """Annotations without a mask, or with one that has no pixel."""
    ignored: int = 0
    """Pixels of the value that means "ignore" by habit."""


@dataclass(frozen=True)
class ReadSettings:
    """How masks that overlap or are uncertain are judged."""

    score_threshold: float
    minimum_pixels: int
    """At the size of the picture."""
    behind: frozenset[int] = frozenset()
    """Categories of walls, floors and the like: their masks lie under those of things, whatever their size."""


@dataclass(frozen=True)
class MaskSource:
    """A folder that was recognised."""

    pictures: tuple[Picture, ...]
    categories: Mapping[int, Category]
    """Empty: nothing has a class, or nothing says what its number means."""
    read: Callable[[int, tuple[int, int], ReadSettings], GivenFrame]
    """(place in `pictures`, (H, W) of the frame, settings) -> its masks. Raises BadInput."""
    lacks: tuple[str, ...] = ()
    """What the format, or this folder, has no place for: `scores`, `overlaps`."""


@dataclass(frozen=True)
class MaskFormat:
    """A format, as its file in `formats/` declares it under the name FORMAT."""

    name: str
    summary: str
    """For the line that lists what is read."""
    order: int
    """Its place among those that are tried."""
    open: Callable[[Listing], MaskSource | None]
    """None: the folder is of another format. Raises BadInput when it is of this one and broken."""


def entry(row: Any, key: str, kind: type | tuple[type, ...]) -> Any:
    """Return row[key] when the row is an object that has it in this kind, else None. True and False are no numbers."""
    value = row.get(key) if isinstance(row, dict) else None
    return value if isinstance(value, kind) and not isinstance(value, bool) else None


def stem_of(name: str) -> str:
    """Return the last part of a path without its ending, and without what a labelling service put behind it."""
    return own_name(Path(name.replace("\\", "/")).stem)


def picture_of_file(file: Path, root: Path, **more: Any) -> Picture:
    """Return the picture that a file of the folder `root` is named after."""
    seen = file.relative_to(root).as_posix() if file.is_relative_to(root) and file != root else file.name
    return Picture(stem_of(file.name), seen=seen, **more)
