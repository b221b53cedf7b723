"""Id images out of PNG files that nobody vouches for."""

from __future__ import annotations

import io
from pathlib import Path

import cv2
import numpy as np
from PIL import Image
from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import file_content
from scenewright.stages.kit.formats.image_headers import image_size, may_be_decoded
from scenewright.stages.kit.formats.masks import decode_panoptic_png

LARGEST_PNG = 512 * 2**20
"""Most bytes of a PNG file."""
BITS_AT, COLOR_TYPE_AT = 24, 25
"""Where the header of a PNG says how many bits a sample has, and its colour type (PNG specification, 11.2.2)."""
PALETTE = 3
"""The colour type of a PNG with a palette."""


def read_panoptic(path: Path, shape: tuple[int, int]) -> np.ndarray:
    """Return the ids (H, W) int32 of a COCO panoptic PNG for a frame of `shape`. Raises BadInput."""
    data = _checked_content(path, shape)
    try:
        return decode_panoptic_png(data)
    except BadInput as error:
        raise BadInput(f"{path}: {error.message}", hint=error.hint) from None


def read_instances(path: Path, shape: tuple[int, int]) -> tuple[np.ndarray, bool]:
    """Return the values (H, W) int32 of a PNG for a frame of `shape`, and whether they are the indices of a palette.

    One channel of 1 to 16 bits is read, a palette, and three channels that are the same. Raises BadInput.
    """
    data = _checked_content(path, shape)
    if data[COLOR_TYPE_AT] == PALETTE:
        return _palette_indices(path, data), True
    image = _decoded(path, data)
    if image.ndim == 3 and (image[..., :1] == image[..., :3]).all() and len(np.unique(image[..., 3:])) < 2:
        image = image[..., 0]  # grey, stored as colour
    if image.ndim != 2 or image.dtype not in (np.uint8, np.uint16):
        raise BadInput(
            f"{path}: is a colour image without a table of its classes",
            hint="put a labelmap.txt beside it (a line `chair:128,0,0` for each class), COCO's JSON where it is a "
            "panoptic PNG, or write one channel whose values are the instances",
        )
    # Samples of less than 8 bits are stretched to 0..255 when they are decoded.
    bits = data[BITS_AT]
    return image.astype(np.int32) // (255 // (2**bits - 1) if bits < 8 else 1), False


def read_colors(path: Path, shape: tuple[int, int]) -> np.ndarray | None:
    """Return the colours (H, W) int32, R + 256 G + 65536 B, of a PNG for a frame of `shape`, of one with a palette too;
    None when it has one channel. Raises BadInput."""
    image = _decoded(path, _checked_content(path, shape))
    if image.ndim != 3 or image.dtype != np.uint8:
        return None
    blue, green, red = (image[..., k].astype(np.int32) for k in range(3))
    return red + 256 * green + 65536 * blue


def _palette_indices(path: Path, data: bytes) -> np.ndarray:
    try:
        with Image.open(io.BytesIO(data), formats=("PNG",)) as image:
            return np.asarray(image, dtype=np.int32)
    except (OSError, SyntaxError, ValueError, EOFError):
        raise BadInput(f"{path}: a PNG that is damaged", hint="write it again") from None


def _decoded(path: Path, data: bytes) -> np.ndarray:
    try:
        image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        image = None
    if image is None:
        raise BadInput(f"{path}: a PNG that is damaged", hint="write it again")
    return image


def _checked_content(path: Path, shape: tuple[int, int]) -> bytes:
    try:
        if path.stat().st_size > LARGEST_PNG:
            raise BadInput(f"{path}: larger than {LARGEST_PNG} bytes", hint="write it again")
        data = file_content(path, LARGEST_PNG, hint="check the file")
    except OSError as error:
        raise BadInput(f"{path}: {error.strerror or error}", hint="check the file") from None
    size = image_size(data)
    if size is None or data[:4] != b"\x89PNG":
        raise BadInput(f"{path}: no PNG", hint="write it as PNG")
    if size != (shape[1], shape[0]):
        raise BadInput(
            f"{path}: masks of {size[0]}x{size[1]}, the frame has {shape[1]}x{shape[0]} pixels",
            hint="scale the network's masks to the pictures of the sequence (nearest neighbour)",
        )
    if not may_be_decoded(data):
        raise BadInput(f"{path}: declares {size[0]}x{size[1]} pixels, which {len(data)} bytes cannot hold")
    return data


def decode_mask(data: bytes, where: str) -> np.ndarray:
    """Return the mask (h, w) bool of a small PNG: where it is not 0. Raises BadInput, beginning with `where`."""
    if not may_be_decoded(data):
        raise BadInput(f"{where}: its mask is not a sound PNG", hint="write it again")
    image = _decoded(Path(where), data)
    return (image if image.ndim == 2 else image.max(axis=2)) != 0
