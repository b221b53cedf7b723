"""Unpacking that never holds more than was claimed, whatever the packed bytes expand to."""

from __future__ import annotations

import bz2
from collections.abc import Callable
from typing import Any, BinaryIO

import lz4.frame
import zstandard

PIECE = 16 << 20
"""Bytes that are unpacked at a time: a claim alone allocates no more than this."""
_OPENERS: dict[str, Callable[[], Any]] = {"lz4": lz4.frame.LZ4FrameDecompressor, "bz2": bz2.BZ2Decompressor}


def unpacked(packed: bytes, compression: str, size: int) -> bytes:
    """Return the `size` bytes that `packed` holds. `compression` is `zstd`, `lz4` (frames), `bz2`, or empty or `none`.

    Raises ValueError, in words that follow "the chunk", when it cannot be unpacked or holds another number of bytes;
    a bomb is stopped one byte after the claim.
    """
    if compression in ("", "none"):
        data = packed
    elif compression == "zstd":
        data = _unpacked_zstd(packed, size)
    elif compression in _OPENERS:
        data = _unpacked_stream(_OPENERS[compression](), packed, size)
    else:
        raise ValueError(f"uses unknown compression {compression!r:.40}")
    if len(data) != size:
        unpacked_size = f"more than {size}" if len(data) > size else str(len(data))
        raise ValueError(f"lies about its size: it holds {unpacked_size} bytes and claims {size}")
    return data


def _unpacked_zstd(packed: bytes, size: int) -> bytes:
    pieces, total = [], 0
    try:
        reader = zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=True)
        while total <= size and (piece := reader.read(min(PIECE, size + 1 - total))):
            pieces.append(piece)
            total += len(piece)
    except (zstandard.ZstdError, MemoryError) as error:
        raise ValueError(f"cannot be unpacked: {error}") from None
    return b"".join(pieces)


def _unpacked_stream(decompressor: Any, packed: bytes, size: int) -> bytes:
    pieces, total, unread = [], 0, packed
    try:
        while total <= size and not decompressor.eof:
            piece = decompressor.decompress(unread, min(PIECE, size + 1 - total))
            unread = b""
            pieces.append(piece)
            total += len(piece)
            if not piece and decompressor.needs_input:
                break
    except (RuntimeError, OSError, EOFError, ValueError, MemoryError) as error:
        raise ValueError(f"cannot be unpacked: {error}") from None
    return b"".join(pieces)


def unpacked_within(packed: bytes, limit: int) -> bytes:
    """Return what zstd frames of unstated size hold. Raises ValueError, also when that is more than `limit` bytes."""
    data = _unpacked_zstd(packed, limit)
    if len(data) > limit:
        raise ValueError(f"holds more than {limit} bytes")
    return data


def unpack_file(packed: BinaryIO, target: BinaryIO, limit: int) -> None:
    """Write what a zstd file holds into `target`, piece by piece.

    Raises ValueError when it is damaged or holds more than `limit` bytes; what came before is written then.
    """
    total = 0
    try:
        reader = zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=True)
        while piece := reader.read(min(PIECE, limit + 1 - total)):
            total += len(piece)
            if total > limit:
                raise ValueError(f"holds more than {limit} bytes")
            target.write(piece)
    except zstandard.ZstdError as error:
        raise ValueError(f"cannot be unpacked after its first {total} bytes: {error}") from None


def stated_size(head: bytes) -> int | None:
    """Return the size that the head of a zstd file states, or None."""
    try:
        size = zstandard.frame_content_size(head)
    except zstandard.ZstdError:
        return None
    return size if size >= 0 else None
