"""Colours of triangles out of texture pictures."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from stages.kit.formats.image_headers import may_be_decoded
from stages.library.importing.source_folder import SourceFolder

LARGEST_PICTURE = 64 * 2**20
SAMPLES = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]], dtype=float)
"""Where a triangle's colour is looked up: its centre and three points towards its corners (barycentric)."""
PALETTE = 8
"""Colours of a part: the URDF names one mesh file for each."""


def read_picture(folder: SourceFolder, path: Path) -> np.ndarray | None:
    """Return a picture as (H, W, 3) uint8 RGB, or None when it is none or declares too much."""
    if path.stat().st_size > LARGEST_PICTURE:
        return None
    data = folder.read(path, LARGEST_PICTURE)
    if not may_be_decoded(data):
        return None
    picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    return None if picture is None else np.ascontiguousarray(picture[:, :, ::-1])


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
    kept = np.lexsort((np.arange(len(cells)), -weight))[:count]
    gaps = ((cells[:, None].astype(int) - cells[None, kept].astype(int)) ** 2).sum(axis=2)
    group = np.argmin(gaps, axis=1)[member]
    result = np.empty_like(colors)
    for number in range(len(kept)):
        inside = group == number
        if inside.any():
            mean = np.average(colors[inside].astype(float), axis=0, weights=areas[inside] + 1e-12)
            result[inside] = np.round(mean).astype(np.uint8)
    return result
