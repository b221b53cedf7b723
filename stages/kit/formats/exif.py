"""The EXIF orientation of a picture: what it says, taking it off without touching a pixel, and turning pixels by it.

JPEG keeps EXIF in an APP1 segment, PNG in an eXIf chunk: a TIFF header with directories of 12-byte entries. Viewers,
browsers and OpenCV turn a picture by its orientation; intrinsics are then those of another picture. Format: EXIF 2.32
(CIPA DC-008), 4.6.
"""

from __future__ import annotations

import struct
import zlib

import numpy as np
from scenewright.stages.kit.formats.foxglove import JPEG_START, PNG_START

ORIENTATION = 0x0112
ENTRY = 12
"""Bytes of an entry of a directory."""
TRANSPOSED = (5, 6, 7, 8)
"""Orientations under which width and height change places."""
EXIF_HEAD = b"Exif\0\0"


def orientation_of(data: bytes) -> int:
    """Return the orientation that a JPEG or PNG states, 1 (upright) to 8; 1 where it states none."""
    found = _entry(data)
    if found is None:
        return 1
    start, order = found[0] + found[2], found[1]
    value = struct.unpack_from(order + "H", data, start + 8)[0]
    return value if 1 <= value <= 8 else 1


def without_orientation(data: bytes) -> bytes:
    """Return the picture without its entry of orientation; every other byte of pixels and EXIF stays."""
    while (found := _entry(data)) is not None:
        block, order, entry, directory = found
        count = struct.unpack_from(order + "H", data, block + directory)[0]
        end = block + directory + 2 + ENTRY * count + 4  # behind the entries lies the place of the next directory
        changed = bytearray(data)
        changed[block + entry : end] = data[block + entry + ENTRY : end] + bytes(ENTRY)
        struct.pack_into(order + "H", changed, block + directory, count - 1)
        data = _with_checksum(changed, block) if data.startswith(PNG_START) else bytes(changed)
    return data


def turned(image: np.ndarray, orientation: int) -> np.ndarray:
    """Return an image (H, W, ...) as it is meant to be looked at; (W, H, ...) for orientations 5 to 8."""
    if orientation in TRANSPOSED:
        image = image.swapaxes(0, 1)
    rows, columns = {2: (1, -1), 3: (-1, -1), 4: (-1, 1), 6: (1, -1), 7: (-1, -1), 8: (-1, 1)}.get(orientation, (1, 1))
    return np.ascontiguousarray(image[::rows, ::columns])


def _entry(data: bytes) -> tuple[int, str, int, int] | None:
    """Return of the orientation: where the TIFF header is in `data`, its byte order, and the places of the entry and of
    its directory from there. None without any, and for EXIF that is broken."""
    block = _exif_block(data)
    if block is None:
        return None
    order = {b"II*\0": "<", b"MM\0*": ">"}.get(data[block : block + 4])
    if order is None:
        return None
    try:
        (directory,) = struct.unpack_from(order + "I", data, block + 4)
        (count,) = struct.unpack_from(order + "H", data, block + directory)
        for entry in range(directory + 2, directory + 2 + ENTRY * count, ENTRY):
            tag, kind, number = struct.unpack_from(order + "HHI", data, block + entry)
            if tag == ORIENTATION and kind == 3 and number == 1 and len(data) >= block + directory + 6 + ENTRY * count:
                return block, order, entry, directory
    except struct.error:
        return None
    return None


def _exif_block(data: bytes) -> int | None:
    """Return where the TIFF header of the EXIF data begins."""
    if data.startswith(JPEG_START):
        place = 2
        while place + 4 <= len(data) and data[place] == 0xFF and data[place + 1] not in (0xDA, 0xD9):
            if data[place + 1] == 0xE1 and data[place + 4 : place + 10] == EXIF_HEAD:
                return place + 10
            place += 2 + int.from_bytes(data[place + 2 : place + 4], "big")
    elif data.startswith(PNG_START):
        place = len(PNG_START)
        while place + 8 <= len(data):
            if data[place + 4 : place + 8] == b"eXIf":
                return place + 8
            place += 12 + int.from_bytes(data[place : place + 4], "big")
    return None


def _with_checksum(data: bytearray, block: int) -> bytes:
    """Return a PNG whose eXIf chunk, which begins at `block`, has the checksum of what it holds now."""
    size = int.from_bytes(data[block - 8 : block - 4], "big")
    data[block + size : block + size + 4] = zlib.crc32(data[block - 4 : block + size]).to_bytes(4, "big")
    return bytes(data)
