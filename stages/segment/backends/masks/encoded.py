"""Encoded masks of one frame: run lengths, polygons, or nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.run_lengths import decode_rle
from scenewright.stages.kit.geometry.outlines import fill
from scenewright.stages.segment.backends.masks.given import MOST_PIXELS, GivenFrame, GivenMask, ReadSettings
from scenewright.stages.segment.backends.masks.overlapping import flatten
from scenewright.stages.segment.backends.masks.polygons import check_size, polygons_of


@dataclass(frozen=True)
class Crop:
    """A mask (h, w) bool whose first pixel is that of column `left` and row `top` of the picture."""

    mask: np.ndarray
    left: int = 0
    top: int = 0

    def pasted(self, shape: tuple[int, int]) -> np.ndarray:
        """Return the mask (H, W) of the picture; what reaches over it is cut off."""
        mask = np.zeros(shape, dtype=bool)
        inner = self.mask[max(0, -self.top) :, max(0, -self.left) :]
        top, left = max(0, self.top), max(0, self.left)
        inner = inner[: max(0, shape[0] - top), : max(0, shape[1] - left)]
        mask[top : top + inner.shape[0], left : left + inner.shape[1]] = inner
        return mask


def cropped(mask: np.ndarray) -> Crop:
    """Return the part of a mask (H, W) bool that has pixels."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return Crop(mask[:0, :0])
    left, top = int(columns[0]), int(rows[0])
    return Crop(mask[top : rows[-1] + 1, left : columns[-1] + 1].copy(), left, top)


def flatten_encoded(
    encodings: Sequence[Any],
    told: Sequence[GivenMask],
    settings: ReadSettings,
    shape: tuple[int, int],
    where: str,
    size: tuple[int, int] | None = None,
) -> GivenFrame:
    """Return the frame of encoded masks: RLE, COCO's lists of polygons, polygons (K, 2), masks (H, W), crops, or None.
    What has no pixel is left out and counted. `size` (width, height) of the picture in which polygons were drawn, if it
    is known.

    Raises BadInput, beginning with `where`, when an encoding is broken or lies, and when there are more masks than are
    held at a time.
    """
    check_amount(len(encodings), shape, where)
    masks, kept = [], []
    for number, encoding in enumerate(encodings, start=1):
        try:
            mask = decode(encoding, shape, size)
        except BadInput as error:
            raise BadInput(f"{where}: mask {number}: {error.message}", hint=error.hint) from None
        if mask.any():
            masks.append(mask)
            kept.append(told[number - 1])
    return replace(flatten(masks, kept, settings, shape), empty=len(encodings) - len(masks))


def decode(encoding: Any, shape: tuple[int, int], size: tuple[int, int] | None) -> np.ndarray:
    """Return one mask (H, W) bool. Raises BadInput, in words that follow the name of the mask."""
    if encoding is None:
        return np.zeros(shape, dtype=bool)
    if isinstance(encoding, np.ndarray):
        return encoding
    if isinstance(encoding, Crop):
        check_size(size, [], shape)
        return encoding.pasted(shape)
    if not isinstance(encoding, list):
        return decode_rle(encoding, shape)
    drawn = all(isinstance(part, np.ndarray) for part in encoding)
    polygons = encoding if drawn else polygons_of(encoding)
    check_size(size, polygons, shape)
    return fill(polygons, shape)


def check_amount(count: int, shape: tuple[int, int], where: str) -> None:
    """Raise BadInput, beginning with `where`, when so many masks of `shape` are more than are held at a time."""
    if count * shape[0] * shape[1] > MOST_PIXELS:
        most = MOST_PIXELS // max(shape[0] * shape[1], 1)
        raise BadInput(
            f"{where}: {count} masks in one frame, at most {most} of this size are read",
            hint="leave out what overlaps or is doubtful",
        )
