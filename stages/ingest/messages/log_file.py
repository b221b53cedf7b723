"""A file that is read at given places, whatever its state."""

from __future__ import annotations

import os
import zlib
from pathlib import Path

from scenewright.schemas.errors import BadInput

PIECE = 1 << 20
"""Bytes that are read at a time for a checksum; by eye."""


class Damaged(Exception):
    """Something in a file that is not what it says. The text follows the words "the record" or "the chunk"."""


class LogFile:
    """A file open for reading. It has no position, so that readers in several threads do not disturb each other."""

    def __init__(self, path: Path, kind: str) -> None:
        """Open a file. Raises BadInput when it is missing or no plain file, with `kind` as what was expected."""
        try:
            if not path.is_file():
                fault = "is a folder" if path.is_dir() else "is not a file" if path.exists() else "file is missing"
                raise BadInput(f"{path}: {fault}, expected {kind}")
            self._descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        except OSError as error:
            raise BadInput(f"{path}: cannot be opened: {error.strerror}") from None
        self.size = os.fstat(self._descriptor).st_size

    def close(self) -> None:
        """Close the file; harmless when it is closed."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1

    def read(self, offset: int, length: int) -> bytes:
        """Return up to `length` bytes, fewer only at the end of the file. Raises Damaged when the disk fails."""
        length = min(length, self.size - offset)  # a claim alone allocates nothing
        if length <= 0:
            return b""
        try:
            data = os.pread(self._descriptor, length, offset)
            while 0 < len(data) < length and (
                chunk := os.pread(self._descriptor, length - len(data), offset + len(data))
            ):
                data += chunk
        except OSError as error:
            raise Damaged(f"cannot be read from the disk ({error.strerror})") from None
        return data

    def exactly(self, offset: int, length: int) -> bytes:
        """Return `length` bytes. Raises Damaged when the file has fewer."""
        data = self.read(offset, length)
        if len(data) != length:
            raise Damaged(f"ends {length - len(data)} bytes early")
        return data

    def checksum(self, start: int, end: int) -> int:
        """Return the CRC-32 of the bytes from start to end, read piece by piece. Raises Damaged."""
        checksum = 0
        for start_of_piece in range(start, end, PIECE):
            checksum = zlib.crc32(self.exactly(start_of_piece, min(PIECE, end - start_of_piece)), checksum)
        return checksum
