"""Id images out of PNG files that nobody vouches for."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import file_content
from scenewright.stages.kit.formats.image_headers import image_size, may_be_decoded
from scenewright.stages.kit.formats.masks import decode_panoptic_png

LARGEST_PNG = 512 * 2**20
"""Most bytes of a PNG file."""


def read_panoptic(path: Path, shape: tuple[int, int]) -> np.ndarray:
    """Return the ids (H, W) int32 of a COCO panoptic PNG for a frame of `shape`. Raises BadInput."""
    data = _checked_content(path, shape)
    try:
        return decode_panoptic_png(data)
    except BadInput as error:
        raise BadInput(f"{path}: {error.message}", hint=error.hint) from None


def read_instances(path: Path, shape: tuple[int, int]) -> np.ndarray:
    """Return the values (H, W) int32 of a PNG of one channel, 8 or 16 bits, for a frame of `shape`. Raises BadInput."""
    data = _checked_content(path, shape)
    try:
        image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        raise BadInput(f"{path}: cannot be decoded ({error.err})", hint="write it again") from None
    if image is None or image.ndim != 2 or image.dtype not in (np.uint8, np.uint16):
        raise BadInput(
            f"{path}: an instance PNG has one channel of 8 or 16 bits",
            hint="a COCO panoptic PNG (three channels) needs its JSON beside it; palettes are not read",
        )
    return image.astype(np.int32)


def _checked_content(path: Path, shape: tuple[int, int]) -> bytes:
    try:
        if path.stat().st_size > LARGEST_PNG:
            raise BadInput(f"{path}: larger than {LARGEST_PNG} bytes", hint="write it again")
        data = file_content(path, LARGEST_PNG, hint="check the file")
    except OSError as error:
        raise BadInput(f"{path}: {error.strerror or error}", hint="check the file") from None
    size = image_size(data)
    if size is None:
        raise BadInput(f"{path}: no PNG", hint="write it again")
    if size != (shape[1], shape[0]):
        raise BadInput(
            f"{path}: masks of {size[0]}x{size[1]}, the frame has {shape[1]}x{shape[0]} pixels",
            hint="scale the network's masks to the pictures of the sequence (nearest neighbour)",
        )
    if not may_be_decoded(data):
        raise BadInput(f"{path}: declares {size[0]}x{size[1]} pixels, which {len(data)} bytes cannot hold")
    return data
