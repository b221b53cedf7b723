"""Apple's LZFSE, in which Record3D packs depth: the size that its blocks declare is looked at before they are unpacked.

Block headers are those of Apple's reference implementation (lzfse_internal.h, lzfse_encode_tables.h). Needs lzfse.
"""

from __future__ import annotations

import struct

from scenewright.stages.ingest.source import Unusable
from scenewright.stages.kit.needed import needed

PLAIN, FIRST, SECOND, FAST, END = b"bvx-", b"bvx1", b"bvx2", b"bvxn", b"bvx$"
FIRST_HEADER = 772
"""Bytes of the header of a block whose tables are not packed."""


def require_lzfse() -> None:
    """Raise MissingDependency when the library is not there."""
    needed("lzfse", "depth in .r3d files", extra="phone")


def unpacked(data: bytes, expected: int, what: str) -> bytes:
    """Return the `expected` bytes that LZFSE data unpacks to.

    Raises Unusable, naming `what` ("depth"), when the blocks declare another size, or are damaged, MissingDependency
    without the library.
    """
    library = needed("lzfse", "depth in .r3d files", extra="phone")
    declared = declared_size(data)
    if declared is not None and declared != expected:
        raise Unusable(f"undecodable_{what}", f"LZFSE data that unpacks to {declared} bytes, not {expected}")
    try:
        found = library.decompress(data) if declared is not None else b""
    except (library.error, MemoryError):
        found = b""
    if len(found) != expected:
        raise Unusable(f"undecodable_{what}", f"damaged LZFSE data of {len(data)} bytes")
    return found


def declared_size(data: bytes) -> int | None:
    """Return the bytes that the blocks say they unpack to, None where a block is cut off or of no known kind."""
    total, position = 0, 0
    try:
        while (kind := data[position : position + 4]) != END:
            size = struct.unpack_from("<I", data, position + 4)[0]
            if kind == PLAIN:
                length = 8 + size
            elif kind == FAST:
                length = 12 + struct.unpack_from("<I", data, position + 8)[0]
            elif kind == FIRST:
                length = FIRST_HEADER + struct.unpack_from("<I", data, position + 8)[0]
            elif kind == SECOND:
                literals, matches, states = struct.unpack_from("<QQQ", data, position + 8)
                length = (states & 0xFFFFFFFF) + (literals >> 20 & 0xFFFFF) + (matches >> 40 & 0xFFFFF)
            else:
                return None
            total, position = total + size, position + length
    except struct.error:
        return None
    return total
