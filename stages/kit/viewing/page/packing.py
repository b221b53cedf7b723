"""Arrays as the page reads them: one block of bytes, compressed, and where each array lies in it."""

from __future__ import annotations

import base64
import gzip
import hashlib
from dataclasses import dataclass, field

import numpy as np
from scenewright.stages.kit.geometry.cells import cell_keys

STEPS = 65_535
"""Steps of a coordinate between the least and the largest of its mesh: 0.15 mm over 10 m."""


@dataclass
class Block:
    """Bytes of arrays, each at a multiple of 4. Equal arrays are held once."""

    _chunks: list[bytes] = field(default_factory=list)
    _size: int = 0
    _places: dict[bytes, list[int]] = field(default_factory=dict)

    def put(self, array: np.ndarray) -> list[int]:
        """Return [first byte, number of values] of an array that was put there."""
        data = np.ascontiguousarray(array).tobytes()
        key = hashlib.sha256(array.dtype.str.encode() + data).digest()
        if key not in self._places:
            self._places[key] = [self._size, array.size]
            padding = bytes(-len(data) % 4)
            self._chunks += [data, padding]
            self._size += len(data) + len(padding)
        return self._places[key]

    def positions(self, points: np.ndarray) -> dict[str, list[float] | list[int]]:
        """Return where points (N, 3) [m] lie: `at`, three uint16 each, and what they are: `low` + `step` * value."""
        points = np.asarray(points, dtype=float).reshape(-1, 3)
        low = points.min(axis=0) if len(points) else np.zeros(3)
        step = (points.max(axis=0) - low) / STEPS if len(points) else np.zeros(3)
        steps = np.rint((points - low) / np.where(step > 0, step, 1.0)).astype("<u2")
        return {"at": self.put(steps), "low": low.tolist(), "step": step.tolist()}

    def text(self) -> str:
        """Return everything, compressed, in base 64; the same arrays give the same text."""
        return base64.b64encode(gzip.compress(b"".join(self._chunks), 6, mtime=0)).decode("ascii")


def thinned_mesh(vertices: np.ndarray, faces: np.ndarray, edge: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return vertices (K, 3), faces (G, 3) and which old vertex gives each its colour (K,): one vertex, the mean, in
    each cube of `edge` [m]; faces that collapse or come twice are gone."""
    _, first, inverse = np.unique(cell_keys(vertices, edge), return_index=True, return_inverse=True)
    count = np.bincount(inverse)
    means = np.stack([np.bincount(inverse, weights=vertices[:, k]) / count for k in range(3)], axis=1)
    corners = inverse[faces]
    corners = corners[(corners != np.roll(corners, 1, axis=1)).all(axis=1)]
    turn = corners.argmin(axis=1)[:, None] if len(corners) else np.zeros((0, 1), np.int64)
    return means, np.unique(np.take_along_axis(corners, (turn + np.arange(3)) % 3, axis=1), axis=0), first
