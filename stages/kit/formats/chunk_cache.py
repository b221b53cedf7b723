"""The last few unpacked chunks of a log, within a bound of memory."""

from __future__ import annotations

from collections.abc import Callable

MOST_CHUNKS = 4
"""Most chunks that are kept unpacked; by eye."""
MOST_BYTES = 64 << 20
"""Most bytes of all kept chunks together; the latest is kept whatever its size."""


class ChunkCache:
    """Keeps unpacked chunks by number; the least recently used one leaves first."""

    def __init__(self) -> None:
        self._chunks: dict[int, bytes] = {}

    def get(self, index: int, unpack: Callable[[int], bytes]) -> bytes:
        """Return the chunk with this number, unpacked by `unpack` when it is not kept."""
        data = self._chunks.pop(index, None)
        if data is None:
            data = unpack(index)
            cached_bytes = sum(map(len, self._chunks.values()))
            while self._chunks and (len(self._chunks) >= MOST_CHUNKS or cached_bytes + len(data) > MOST_BYTES):
                cached_bytes -= len(self._chunks.pop(next(iter(self._chunks))))
        self._chunks[index] = data
        return data

    def clear(self) -> None:
        """Forget all chunks."""
        self._chunks.clear()

    def __len__(self) -> int:
        return len(self._chunks)
