"""Colours of triangles out of texture pictures."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np
from scenewright.stages.kit.formats.image_headers import image_size, may_be_decoded
from scenewright.stages.library.importing.source_folder import SourceFolder

LARGEST_PICTURE = 64 * 2**20
"""Largest picture file [bytes]; a bound, by eye."""
MOST_PIXELS = 400_000_000
"""Most pixels of all pictures of a mesh file, those that are decoded again counted again: two dozen of 4096 x 4096."""
MOST_HELD = 400 * 2**20
"""Most bytes of decoded pictures that are held."""
SAMPLES = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]], dtype=float)
"""Places in a triangle where its colour is looked up (barycentric): its centre and three points towards its corners."""
PALETTE = 8
"""Colours of a part: the URDF names one mesh file for each."""


class Pictures:
    """The pictures that a mesh file names, decoded when they are asked for; few are held at a time."""

    def __init__(self, folder: SourceFolder, path: Path, findings: list[str]) -> None:
        self._folder, self._path, self._findings = folder, path, findings
        self._decoded: dict[str, np.ndarray | None] = {}
        self._remaining_pixels = MOST_PIXELS

    def picture(self, name: str) -> np.ndarray | None:
        """Return a picture (H, W, 3) uint8 RGB, or None when it is not there, or none, or there are too many."""
        if name not in self._decoded:
            picture = self._read(name)
            while picture is not None and self._decoded and picture.size + self._decoded_bytes() > MOST_HELD:
                del self._decoded[next(iter(self._decoded))]
            self._decoded[name] = picture
        return self._decoded[name]

    def _decoded_bytes(self) -> int:
        return sum(picture.size for picture in self._decoded.values() if picture is not None)

    def _read(self, name: str) -> np.ndarray | None:
        label = f"{self._path.name}: image {Path(name.replace(chr(92), '/')).name!r:.60}"
        file = self._folder.find(name, self._path.parent)
        picture = None
        if file is not None and file.stat().st_size <= LARGEST_PICTURE:
            data = self._folder.read(file, LARGEST_PICTURE)
            size = image_size(data)
            if size is not None and may_be_decoded(data):
                self._remaining_pixels -= size[0] * size[1]
                if self._remaining_pixels < 0:
                    self._findings.append(f"{label} is left out: more than {MOST_PIXELS} pixels in all")
                    return None
                with suppress(cv2.error):  # a decoder that gives up
                    picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
        if picture is None:
            self._findings.append(f"{label} is not there")
            return None
        return np.ascontiguousarray(picture[:, :, ::-1])


def face_colors(picture: np.ndarray, texture_points: np.ndarray) -> np.ndarray:
    """Return (F, 3) uint8: the picture (H, W, 3) at texture points (F, 3, 2), v up, repeated beyond 0..1."""
    weights = SAMPLES / SAMPLES.sum(axis=1, keepdims=True)
    points = np.einsum("sc,fcd->fsd", weights, np.nan_to_num(texture_points)) % 1.0
    height, width = picture.shape[:2]
    column = np.minimum((points[..., 0] * width).astype(int), width - 1)
    row = np.minimum(((1.0 - points[..., 1]) * height).astype(int), height - 1)
    return np.round(picture[row, column].astype(float).mean(axis=1)).astype(np.uint8)


def few_colors(colors: np.ndarray, areas: np.ndarray, count: int = PALETTE) -> np.ndarray:
    """Return colours (F, 3) uint8 with at most `count` different ones, by area (F,).

    The commonest cells of a 5-bit grid are kept, every face takes the nearest of them, and each group its mean.
    """
    distinct = np.unique(colors, axis=0)
    if len(distinct) <= count:
        return colors
    cells, member = np.unique(colors >> 3, axis=0, return_inverse=True)
    member = member.reshape(-1)
    weight = np.bincount(member, weights=areas + 1e-12, minlength=len(cells))
    chosen = np.lexsort((np.arange(len(cells)), -weight))[:count]
    gaps = ((cells[:, None].astype(int) - cells[None, chosen].astype(int)) ** 2).sum(axis=2)
    group = np.argmin(gaps, axis=1)[member]
    result = np.empty_like(colors)
    for number in range(len(chosen)):
        inside = group == number
        if inside.any():
            mean = np.average(colors[inside].astype(float), axis=0, weights=areas[inside] + 1e-12)
            result[inside] = np.round(mean).astype(np.uint8)
    return result
