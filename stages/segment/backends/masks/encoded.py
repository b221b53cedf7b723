"""Run-length encoded masks of one frame."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.run_lengths import decode_rle
from scenewright.stages.segment.backends.masks.given import MOST_PIXELS, GivenFrame, GivenMask, ReadSettings
from scenewright.stages.segment.backends.masks.overlapping import flatten


def flatten_encoded(
    encodings: Sequence[Any], told: Sequence[GivenMask], settings: ReadSettings, shape: tuple[int, int], where: str
) -> GivenFrame:
    """Return the frame of encoded masks. Raises BadInput, beginning with `where`, when an encoding is broken or lies,
    and when there are more masks than are held at a time."""
    check_amount(len(encodings), shape, where)
    masks = []
    for number, encoding in enumerate(encodings, start=1):
        try:
            masks.append(decode_rle(encoding, shape))
        except BadInput as error:
            raise BadInput(f"{where}: mask {number}: {error.message}", hint=error.hint) from None
    return flatten(masks, told, settings, shape)


def check_amount(count: int, shape: tuple[int, int], where: str) -> None:
    """Raise BadInput, beginning with `where`, when so many masks of `shape` are more than are held at a time."""
    if count * shape[0] * shape[1] > MOST_PIXELS:
        most = MOST_PIXELS // max(shape[0] * shape[1], 1)
        raise BadInput(f"{where}: {count} masks in one frame, at most {most} of this size are read")
