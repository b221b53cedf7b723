"""The size that an image file declares, read from its header, so that a lying one is refused before it is decoded."""

from __future__ import annotations

import re
import struct

LARGEST_IMAGE = 100_000_000
"""Pixels that an image may declare: a decoder takes 3 to 8 bytes for each, whatever the file holds."""
JPEG_SIZE_MARKERS = frozenset({*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC})
"""Start of frame; the three left out are tables and an extension."""
JPEG_BARE_MARKERS = frozenset({0x01, *range(0xD0, 0xD9)})
"""JPEG markers without a length."""
PNG_START = b"\x89PNG\r\n\x1a\n"
PNG_CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}
"""Samples a pixel by colour type (PNG specification, 11.2.2)."""
DEFLATE_LIMIT = 1032
"""Deflate never packs more than this many bytes into one."""
TIFF_WIDTH, TIFF_HEIGHT = 256, 257
"""Tags of an image's size (TIFF 6.0)."""
PNM = re.compile(rb"P[1-6]((?:\s|#[^\n]*\n)+(\d{1,9}))((?:\s|#[^\n]*\n)+(\d{1,9}))(?=[\s#])")


def image_size(data: bytes) -> tuple[int, int] | None:
    """Return (width, height) that the header of a PNG, JPEG, PNM (PBM, PGM, PPM), TIFF, BMP or WebP declares.

    None when the bytes are none of these or the header is cut short. Only headers are looked at; nothing is decoded.
    """
    data = bytes(data)
    try:
        if data.startswith(b"\x89PNG\r\n\x1a\n"):
            return _png(data)
        if data.startswith(b"\xff\xd8"):
            return _jpeg(data)
        if data[:4] in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"):
            return _tiff(data)
        if data.startswith(b"BM"):
            return _bmp(data)
        if data.startswith(b"RIFF") and data[8:12] == b"WEBP":
            return _webp(data)
    except struct.error:
        return None
    match = PNM.match(data[:4096])
    return (int(match[2]), int(match[4])) if match else None


def may_be_decoded(data: bytes) -> bool:
    """Whether the header is that of an image of a known kind, with pixels, at most LARGEST_IMAGE of them.

    The chunks of a PNG have to lie in the data and be able to unpack to its pixels: decoders reserve what they claim.
    """
    size = image_size(data)
    if size is None or not 0 < size[0] * size[1] <= LARGEST_IMAGE:
        return False
    return not bytes(data).startswith(PNG_START) or _png_holds_its_pixels(bytes(data), *size)


def _png_holds_its_pixels(data: bytes, width: int, height: int) -> bool:
    packed, position = 0, 8
    while position + 12 <= len(data):
        length, kind = struct.unpack_from(">I4s", data, position)
        if position + 12 + length > len(data):
            return False
        packed += length if kind in (b"IDAT", b"fdAT") else 0
        position += 12 + length
        if kind == b"IEND":
            break
    bits, color = struct.unpack_from("BB", data, 24)
    row = (width * bits * PNG_CHANNELS.get(color, 4) + 7) // 8
    return row * height <= DEFLATE_LIMIT * packed


def _png(data: bytes) -> tuple[int, int] | None:
    kind, width, height = struct.unpack_from(">4sII", data, 12)
    return (width, height) if kind == b"IHDR" else None


def _jpeg(data: bytes) -> tuple[int, int] | None:
    position = 2
    while True:
        start, marker = struct.unpack_from("BB", data, position)
        if start != 0xFF:
            return None
        if marker == 0xFF:  # fill bytes
            position += 1
        elif marker in JPEG_BARE_MARKERS:
            position += 2
        elif marker in JPEG_SIZE_MARKERS:
            height, width = struct.unpack_from(">HH", data, position + 5)
            return width, height
        else:
            length = struct.unpack_from(">H", data, position + 2)[0]
            if length < 2:
                return None
            position += 2 + length


def _tiff(data: bytes) -> tuple[int, int] | None:
    order = "<" if data.startswith(b"II") else ">"
    if data[2:4].strip(b"\0") == b"+":  # BigTIFF
        first, count_format, entry_format, inline = struct.unpack_from(order + "Q", data, 8)[0], "Q", "HHQ", 12
    else:
        first, count_format, entry_format, inline = struct.unpack_from(order + "I", data, 4)[0], "H", "HHI", 8
    count = struct.unpack_from(order + count_format, data, first)[0]
    position = first + struct.calcsize("=" + count_format)
    length = inline + (8 if inline == 12 else 4)
    sizes: dict[int, int] = {}
    for _ in range(min(count, 4096)):
        tag, kind, _ = struct.unpack_from(order + entry_format, data, position)
        value_format = {3: "H", 4: "I", 16: "Q"}.get(kind)
        if tag in (TIFF_WIDTH, TIFF_HEIGHT) and value_format:
            sizes.setdefault(tag, struct.unpack_from(order + value_format, data, position + inline)[0])
        position += length
    return (sizes[TIFF_WIDTH], sizes[TIFF_HEIGHT]) if len(sizes) == 2 else None


def _bmp(data: bytes) -> tuple[int, int]:
    if struct.unpack_from("<I", data, 14)[0] == 12:
        width, height = struct.unpack_from("<HH", data, 18)
    else:
        width, height = struct.unpack_from("<ii", data, 18)
    return abs(width), abs(height)  # a negative height means rows from the top


def _webp(data: bytes) -> tuple[int, int] | None:
    kind = data[12:16]
    if kind == b"VP8 ":
        width, height = struct.unpack_from("<HH", data, 26)
        return width & 0x3FFF, height & 0x3FFF
    if kind == b"VP8L":
        bits = struct.unpack_from("<I", data, 21)[0]
        return (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1
    if kind == b"VP8X":
        width, height = (int.from_bytes(data[position : position + 3], "little") + 1 for position in (24, 27))
        return (width, height) if len(data) >= 30 else None
    return None
