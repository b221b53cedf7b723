"""Masks out of an image whose values are classes: which values are listed, which mean "ignore"."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.segment.backends.masks.given import Category, GivenFrame, GivenMask

IGNORED = (255, 65535)
"""Values that mean "ignore" wherever no class file lists them (PASCAL VOC, Cityscapes, mmsegmentation)."""


def named_by_value(
    values: np.ndarray, classes: Mapping[int, Category], divisor: int, path: Path, source: str, hint: str
) -> GivenFrame:
    """Return the frame of an image (H, W) of integers whose values are classes, or class times `divisor` plus instance.

    Where `classes` list 0, it is a class; else 0 is no mask. An unlisted value of IGNORED is no mask and counted.
    Raises BadInput, beginning with `path`, for another value that `source` does not list.
    """
    present = np.unique(values).tolist()
    class_of = {value: value // divisor if divisor and value >= divisor else value for value in present}
    unlisted = [value for value in present if class_of[value] not in classes]
    ignored = [value for value in unlisted if value in IGNORED]
    missing = [value for value in unlisted if value and value not in IGNORED]
    check_listed(missing, classes, path, source, hint)
    masks = {value: GivenMask(class_of[value]) for value in present if value not in unlisted}
    return numbered(values, masks, ignored)


def check_listed(missing: list[int], listed: Mapping[int, object], path: Path, source: str, hint: str) -> None:
    """Raise BadInput, beginning with `path`, when values are missing among those that `source` lists."""
    if missing:
        span = f"{min(listed)}..{max(listed)}" if listed else "none"
        raise BadInput(
            f"{path}: id {missing[0]} is beyond {source}, which lists {span} ({len(missing)} such ids)", hint=hint
        )


def numbered(values: np.ndarray, masks: Mapping[int, GivenMask], ignored: list[int]) -> GivenFrame:
    """Return the frame of an image (H, W) of values and what they are: 0 may be a mask, values without one are none."""
    listed = np.array(sorted(masks), dtype=np.int64)
    place = np.searchsorted(listed, values)
    known = place < len(listed)
    known[known] = listed[place[known]] == values[known]
    ids = np.where(known, place + 1, 0).astype(np.int32)
    count = int(np.isin(values, ignored).sum()) if ignored else 0
    return GivenFrame(ids, {k: masks[value] for k, value in enumerate(listed.tolist(), start=1)}, ignored=count)
