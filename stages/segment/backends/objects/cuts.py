"""Cuts through smooth patches: where flush boxes and coaxial cans may meet, which no depth shows.

Such a border runs straight across a whole face (or once around a jacket), at right angles to an edge of the box or to
the axis of the can. So a patch is unrolled along a few directions, and every line across it is judged by the share of
its width over which the colour steps or a thin line runs. A print rarely has a line from border to border; where it
has, the grouping joins the pieces again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.segment.backends.objects.regions import color_difference


@dataclass(frozen=True)
class CutSettings:
    """Constants of the cuts; pixel counts hold for 640x480."""

    minimum_pixels: int = 500
    """Smaller patches are not cut."""
    cell: float = 1.7
    """Cells of the unrolled patch [pixels]."""
    step: float = 4.5
    """A colour step in a cell over this counts (CIE 1976, lightness counts half)."""
    support: float = 0.72
    """Share of the width that must step."""
    margin: float = 0.018
    """Nearest that a cut may come to the end of a patch or to another cut [m]."""
    most: int = 3
    """Cuts per direction."""


@compiled
def _unroll_patch(
    rows: np.ndarray,
    columns: np.ndarray,
    points: np.ndarray,
    lab: np.ndarray,
    along: np.ndarray,
    across: np.ndarray,
    cell: float,
) -> tuple[np.ndarray, np.ndarray, float]:
    """Mean colour (S, T, 3) and pixels (S, T) of the cells of a patch, and the first coordinate along [m]."""
    count = len(rows)
    s = np.empty(count)
    t = np.empty(count)
    for k in range(count):
        p = points[rows[k], columns[k]]
        s[k] = p[0] * along[0] + p[1] * along[1] + p[2] * along[2]
        t[k] = p[0] * across[0] + p[1] * across[1] + p[2] * across[2]
    s_low, t_low = s.min(), t.min()
    height = min(400, int((s.max() - s_low) / cell) + 1)
    width = min(400, int((t.max() - t_low) / cell) + 1)
    color = np.zeros((height, width, 3))
    pixels = np.zeros((height, width))
    for k in range(count):
        i = min(height - 1, int((s[k] - s_low) / cell))
        j = min(width - 1, int((t[k] - t_low) / cell))
        pixels[i, j] += 1.0
        for c in range(3):
            color[i, j, c] += lab[rows[k], columns[k], c]
    for i in range(height):
        for j in range(width):
            if pixels[i, j] > 0:
                for c in range(3):
                    color[i, j, c] /= pixels[i, j]
    return color, pixels, s_low


@compiled
def _line_support(color: np.ndarray, pixels: np.ndarray, step: float) -> np.ndarray:
    """Of every line of cells (S,) the share of its width with a colour step or a thin line there."""
    height, width = pixels.shape
    support = np.zeros(height)
    widest = 0.0
    for i in range(height):
        filled = 0.0
        for j in range(width):
            if pixels[i, j] > 0:
                filled += 1.0
        widest = max(widest, filled)
    for i in range(3, height - 3):
        measured = stepping = 0.0
        for j in range(width):
            best = 0.0
            has_pixels = False
            # The border may lie a cell higher or lower in a column.
            for k in range(i - 1, i + 2):
                if pixels[k - 1, j] > 0 and pixels[k + 1, j] > 0:
                    has_pixels = True
                    best = max(best, color_difference(color[k - 1, j], color[k + 1, j]))
                    if pixels[k, j] > 0 and pixels[k - 2, j] > 0 and pixels[k + 2, j] > 0:
                        # A shadow in the gap: darker than both sides.
                        darker = 0.5 * (min(color[k - 2, j, 0], color[k + 2, j, 0]) - color[k, j, 0])
                        best = max(best, darker)
            if has_pixels:
                measured += 1.0
                if best > step:
                    stepping += 1.0
        if measured >= 4 and measured >= 0.25 * widest:
            support[i] = stepping / measured
    return support


def _directions(points: np.ndarray, normals: np.ndarray, up: np.ndarray) -> list[np.ndarray]:
    """Unit vectors along which a patch with these points and normals (N, 3) may be cut."""
    mean = normals.mean(axis=0)
    mean /= max(1e-6, float(np.linalg.norm(mean)))
    values, vectors = np.linalg.eigh(normals.T @ normals / len(normals))
    if values[1] > 0.04:
        # Curved: a jacket is cut around its axis; what curves both ways (a sphere) is not cut.
        return [vectors[:, 0]] if values[0] < 0.25 * values[1] else []
    first = up - mean * float(up @ mean)
    if np.linalg.norm(first) < 0.35:
        first = np.cross(mean, [1.0, 0.0, 0.0])
    first /= np.linalg.norm(first)
    second = np.cross(mean, first)
    flat = np.stack([points @ first, points @ second], axis=1).astype(np.float32)
    angle = math.radians(cv2.minAreaRect(flat)[2])
    result = []
    if abs(float(up @ mean)) < 0.9:
        result += [first, second]
    for turn in (angle, angle + math.pi / 2):
        direction = math.cos(turn) * first + math.sin(turn) * second
        if all(abs(float(direction @ chosen)) < math.cos(math.radians(7)) for chosen in result):
            result.append(direction)
    return result


def _peaks(score: np.ndarray, least: float, apart: int, most: int) -> list[int]:
    """Positions of the highest values over `least`, at least `apart` from one another and from both ends."""
    positions: list[int] = []
    for i in np.argsort(-score, kind="stable"):
        if score[i] < least or len(positions) == most:
            break
        if apart <= i < len(score) - apart and all(abs(int(i) - other) >= apart for other in positions):
            positions.append(int(i))
    return positions


@compiled
def pixels_by_label(labels: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return rows and columns (K,) of all pixels with a label in `labels` (H, W), label by label and row by row, and
    where every label 0..count begins (count + 2,); label 0 has none."""
    height, width = labels.shape
    starts = np.zeros(count + 2, dtype=np.int64)
    for v in range(height):
        for u in range(width):
            if labels[v, u] > 0:
                starts[labels[v, u] + 1] += 1
    starts = np.cumsum(starts)
    following = starts.copy()
    rows, columns = np.empty(starts[-1], dtype=np.int32), np.empty(starts[-1], dtype=np.int32)
    for v in range(height):
        for u in range(width):
            k = labels[v, u]
            if k > 0:
                rows[following[k]], columns[following[k]] = v, u
                following[k] += 1
    return rows, columns, starts


def cut_patches(
    labels: np.ndarray,
    points: np.ndarray,
    normals: np.ndarray,
    lab: np.ndarray,
    up: np.ndarray,
    focal: float,
    settings: CutSettings,
) -> tuple[np.ndarray, np.ndarray]:
    """Return (labels (H, W) int32 1..m of the pieces, patch (m + 1,) that each is of).

    `labels` (H, W) int32 patches 1..n; `points`, `normals` (H, W, 3) [m, camera frame]; `lab` (H, W, 3) of lab_image;
    `up` (3,) normal of the support surface; `focal` length [pixels].
    """
    count = int(labels.max(initial=0))
    all_rows, all_columns, starts = pixels_by_label(labels, count)
    pixels_of = np.diff(starts)
    result = labels.copy()
    patch_of = list(range(count + 1))
    for k in range(1, count + 1):
        if pixels_of[k] < settings.minimum_pixels:
            continue
        rows, columns = all_rows[starts[k] : starts[k + 1]], all_columns[starts[k] : starts[k + 1]]
        thin = slice(None, None, max(1, len(rows) // 1500))
        some_points = points[rows[thin], columns[thin]].astype(np.float64)
        some_normals = normals[rows[thin], columns[thin]].astype(np.float64)
        mean = some_normals.mean(axis=0)
        cell = settings.cell * float(some_points[:, 2].mean()) / focal
        code = np.zeros(len(rows), dtype=np.int64)
        for direction in _directions(some_points, some_normals, up):
            across = np.cross(mean, direction)
            if np.linalg.norm(across) < 0.2:
                continue
            across /= np.linalg.norm(across)
            # A slanted face has fewer pixels to the metre: its cells are longer.
            view = some_points.mean(axis=0)
            seen_share = float(np.linalg.norm(np.cross(direction, view / np.linalg.norm(view))))
            size = cell / max(0.4, seen_share)
            color, filled, low = _unroll_patch(rows, columns, points, lab, direction, across, size)
            support = _line_support(color, filled, settings.step)
            places = _peaks(support, settings.support, max(3, round(settings.margin / size)), settings.most)
            if not places:
                continue
            along = points[rows, columns].astype(np.float64) @ direction
            bounds = np.sort(low + (np.array(places) + 0.5) * size)
            code = code * (settings.most + 1) + np.searchsorted(bounds, along)
        pixels = np.bincount(code)
        largest = int(pixels.argmax())
        # A piece too small to be judged stays with the largest one.
        for piece in np.nonzero(pixels >= max(1, settings.minimum_pixels // 4))[0]:
            if piece == largest:
                continue
            of_piece = code == piece
            patch_of.append(k)
            result[rows[of_piece], columns[of_piece]] = len(patch_of) - 1
    return result, np.array(patch_of)
