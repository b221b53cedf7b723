"""Sums over the pixels of patches and over their common borders. Sums add up when patches are joined."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.segment.backends.objects.hulls import convex_hull

LIGHTNESS_BINS, CHROMA_BINS = 5, 6
"""Bins of a patch's colours: of L, and of a and b each; by eye."""
COLOR_BINS = LIGHTNESS_BINS * CHROMA_BINS * CHROMA_BINS
"""Bins of a patch's colours in all."""
HEIGHT_BINS = 80
"""Bins of a patch's heights over its support surface; by eye."""
HEIGHT_BIN = 0.005
"""Heights are counted in bins of this size [m]."""

POINT_SUMS = 1 + 3 + 6 + 3 + 9 + 3
"""Columns of `Regions.sums`: pixels; x y z; xx xy xz yy yz zz; normal; u v uu uv vv w uw vw ww (column, row, inverse
depth); L a b."""
BORDER_SUMS = 17
"""Layers of `Regions.borders`, see `_border_sums`."""
REACH = 4
"""Normals and colours beside a border are taken this many pixels inside, where no window reaches over it."""
CONCAVE, CONVEX = -0.12, 0.15
"""Bounds of (p - q) . (n_p - n_q) / |p - q|."""
COLOR_STEP = 14.0
"""A colour difference (CIE 1976, lightness counts half) across a border over this is a step."""
FINE_REACH, FINE_STEP = 2, 5.0
"""The same close to the border: what a thin line or a faint step shows."""


@dataclass
class Regions:
    """Patches as sums. Row 0 of everything is unused."""

    sums: np.ndarray
    """(N + 1, POINT_SUMS)."""
    colors: np.ndarray
    """(N + 1, COLOR_BINS) pixels per colour."""
    heights: np.ndarray
    """(N + 1, HEIGHT_BINS) pixels per height."""
    perimeters: np.ndarray
    """(N + 1,) sides of pixels that face another label."""
    borders: np.ndarray
    """(N + 1, N + 1, BORDER_SUMS): [a, b] as seen from a."""
    corners: np.ndarray
    """(K, 2) corners (column, row) of all hulls, one after another."""
    corner_starts: np.ndarray
    """(N + 2,) where the hull of every patch begins."""


def lab_image(color: np.ndarray, window: tuple[slice, slice]) -> np.ndarray:
    """Return (h, w, 3) float32 CIE Lab of a window of RGB (H, W, 3) uint8, slightly smoothed: L 0..100, a and b about
    -100..100."""
    # Two pixels more on every side: the filter reaches so far.
    top, left = (max(0, side.start - 2) for side in window)
    smooth = cv2.GaussianBlur(color[top : window[0].stop + 2, left : window[1].stop + 2], (5, 5), 1.0)
    inner = smooth[window[0].start - top : window[0].stop - top, window[1].start - left : window[1].stop - left]
    return cv2.cvtColor(np.divide(inner, np.float32(255), dtype=np.float32), cv2.COLOR_RGB2LAB)


@compiled
def color_difference(a: np.ndarray, b: np.ndarray) -> float:
    """Return the difference of two Lab colours (3,), lightness at half weight: it changes with the light on a face."""
    return np.sqrt(0.25 * (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


@compiled
def _point_sums(
    labels: np.ndarray,
    points: np.ndarray,
    normals: np.ndarray,
    inverse: np.ndarray,
    height: np.ndarray,
    lab: np.ndarray,
    count: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    sums = np.zeros((count + 1, POINT_SUMS), dtype=np.float64)
    colors = np.zeros((count + 1, COLOR_BINS), dtype=np.float64)
    heights = np.zeros((count + 1, HEIGHT_BINS), dtype=np.float64)
    rows, columns = labels.shape
    for v in range(rows):
        for u in range(columns):
            k = labels[v, u]
            if k == 0:
                continue
            s = sums[k]
            x, y, z = points[v, u, 0], points[v, u, 1], points[v, u, 2]
            s[0] += 1.0
            s[1] += x
            s[2] += y
            s[3] += z
            s[4] += x * x
            s[5] += x * y
            s[6] += x * z
            s[7] += y * y
            s[8] += y * z
            s[9] += z * z
            s[10] += normals[v, u, 0]
            s[11] += normals[v, u, 1]
            s[12] += normals[v, u, 2]
            w = inverse[v, u]
            s[13] += u
            s[14] += v
            s[15] += u * u
            s[16] += u * v
            s[17] += v * v
            s[18] += w
            s[19] += u * w
            s[20] += v * w
            s[21] += w * w
            lightness, a, b = lab[v, u, 0], lab[v, u, 1], lab[v, u, 2]
            s[22] += lightness
            s[23] += a
            s[24] += b
            bin_l = min(LIGHTNESS_BINS - 1, max(0, int(lightness * LIGHTNESS_BINS / 100.0)))
            bin_a = min(CHROMA_BINS - 1, max(0, int((a + 45.0) * CHROMA_BINS / 90.0)))
            bin_b = min(CHROMA_BINS - 1, max(0, int((b + 45.0) * CHROMA_BINS / 90.0)))
            colors[k, (bin_l * CHROMA_BINS + bin_a) * CHROMA_BINS + bin_b] += 1.0
            heights[k, min(HEIGHT_BINS - 1, max(0, int(height[v, u] / HEIGHT_BIN)))] += 1.0
    return sums, colors, heights


@compiled
def _border_sums(
    labels: np.ndarray,
    patch_of: np.ndarray,
    points: np.ndarray,
    normals: np.ndarray,
    inverse: np.ndarray,
    height: np.ndarray,
    lab: np.ndarray,
    up: np.ndarray,
    count: int,
    jump: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Layers: 0 sides; 1 connected sides; 2 sides where a is nearer minus those where b is; 3 sides sampled inside;
    4 sum of the convexity; 5 concave; 6 convex; 7 sum of the normals' cosine; 8 sum of the colour difference;
    9 colour steps; 10 height of a minus height of b [m]; 11 upward share of a's normals; 12 of b's; 13 sum of the
    difference of the inverse depth where not connected; 14 colour samples; 15 sides along a cut through one patch;
    16 fine colour steps."""
    borders = np.zeros((count + 1, count + 1, BORDER_SUMS), dtype=np.float32)
    perimeters = np.zeros(count + 1, dtype=np.float64)
    rows, columns = labels.shape
    for v in range(rows):
        for u in range(columns):
            a = labels[v, u]
            for side in range(2):
                row, column = v + side, u + 1 - side
                if row >= rows or column >= columns:
                    continue
                b = labels[row, column]
                if a == b:
                    continue
                if a > 0:
                    perimeters[a] += 1.0
                if b > 0:
                    perimeters[b] += 1.0
                if a == 0 or b == 0:
                    continue
                e = borders[a, b]
                o = borders[b, a]
                e[0] += 1
                o[0] += 1
                difference = inverse[v, u] - inverse[row, column]
                gap = points[row, column] - points[v, u]
                over_a = abs(gap[0] * normals[v, u, 0] + gap[1] * normals[v, u, 1] + gap[2] * normals[v, u, 2])
                over_b = abs(
                    gap[0] * normals[row, column, 0]
                    + gap[1] * normals[row, column, 1]
                    + gap[2] * normals[row, column, 2]
                )
                z = points[v, u, 2]
                connected = abs(gap[2]) <= jump * z or over_a <= 0.5 * jump * z or over_b <= 0.5 * jump * z
                if connected:
                    e[1] += 1
                    o[1] += 1
                else:
                    sign = 1.0 if difference > 0 else -1.0
                    e[2] += sign
                    o[2] -= sign
                    e[13] += abs(difference)
                    o[13] += abs(difference)
                if patch_of[a] == patch_of[b]:
                    e[15] += 1
                    o[15] += 1
                # Step inside, as far as the patches reach.
                pv, pu, qv, qu = v, u, row, column
                for k in range(1, REACH + 1):
                    nv, nu = v - side * k, u - (1 - side) * k
                    if nv >= 0 and nu >= 0 and labels[nv, nu] == a:
                        pv, pu = nv, nu
                    nv, nu = row + side * k, column + (1 - side) * k
                    if nv < rows and nu < columns and labels[nv, nu] == b:
                        qv, qu = nv, nu
                    if k == FINE_REACH and color_difference(lab[pv, pu], lab[qv, qu]) > FINE_STEP:
                        e[16] += 1
                        o[16] += 1
                step = color_difference(lab[pv, pu], lab[qv, qu])
                e[14] += 1
                o[14] += 1
                e[8] += step
                o[8] += step
                if step > COLOR_STEP:
                    e[9] += 1
                    o[9] += 1
                if not connected:
                    continue
                np_, nq = normals[pv, pu], normals[qv, qu]
                if (np_[2] == 0.0 and np_[0] == 0.0) or (nq[2] == 0.0 and nq[0] == 0.0):
                    continue
                line = points[pv, pu] - points[qv, qu]
                length = np.sqrt(line[0] ** 2 + line[1] ** 2 + line[2] ** 2)
                if length <= 0.0:
                    continue
                convexity = (
                    line[0] * (np_[0] - nq[0]) + line[1] * (np_[1] - nq[1]) + line[2] * (np_[2] - nq[2])
                ) / length
                cosine = np_[0] * nq[0] + np_[1] * nq[1] + np_[2] * nq[2]
                rise = height[pv, pu] - height[qv, qu]
                up_a = np_[0] * up[0] + np_[1] * up[1] + np_[2] * up[2]
                up_b = nq[0] * up[0] + nq[1] * up[1] + nq[2] * up[2]
                e[3] += 1
                o[3] += 1
                e[4] += convexity
                o[4] += convexity
                if convexity < CONCAVE:
                    e[5] += 1
                    o[5] += 1
                elif convexity > CONVEX:
                    e[6] += 1
                    o[6] += 1
                e[7] += cosine
                o[7] += cosine
                e[10] += rise
                o[10] -= rise
                e[11] += up_a
                o[11] += up_b
                e[12] += up_b
                o[12] += up_a
    return borders, perimeters


@compiled
def _hulls(labels: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Hulls of all labels from the first and last pixel of every row."""
    rows, columns = labels.shape
    first = np.full((count + 1, rows), columns, dtype=np.int32)
    last = np.full((count + 1, rows), -1, dtype=np.int32)
    for v in range(rows):
        for u in range(columns):
            k = labels[v, u]
            if k > 0:
                first[k, v] = min(first[k, v], u)
                last[k, v] = max(last[k, v], u)
    corners = np.empty((2 * rows * 8 + 16, 2), dtype=np.float64)
    starts = np.zeros(count + 2, dtype=np.int64)
    size = 0
    scratch = np.empty((2 * rows, 2), dtype=np.float64)
    for k in range(1, count + 1):
        starts[k] = size
        used = 0
        for v in range(rows):
            if last[k, v] < 0:
                continue
            scratch[used, 0], scratch[used, 1] = first[k, v], v
            scratch[used + 1, 0], scratch[used + 1, 1] = last[k, v], v
            used += 2
        hull = convex_hull(scratch[:used])
        while size + len(hull) > len(corners):
            larger = np.empty((2 * len(corners), 2), dtype=np.float64)
            larger[:size] = corners[:size]
            corners = larger
        corners[size : size + len(hull)] = hull
        size += len(hull)
    starts[count + 1] = size
    return corners[:size].copy(), starts


def measure_regions(
    labels: np.ndarray,
    patch_of: np.ndarray,
    points: np.ndarray,
    normals: np.ndarray,
    inverse: np.ndarray,
    height: np.ndarray,
    lab: np.ndarray,
    up: np.ndarray,
    *,
    jump: float,
) -> Regions:
    """Return the sums of patches `labels` (H, W) int32 1..n; pieces of one patch have the same `patch_of` (n + 1,).

    `points`, `normals` (H, W, 3) [m, camera frame], `inverse` (H, W) [1/m], `height` (H, W) [m] over the support
    surface, `lab` (H, W, 3) of lab_image, `up` (3,) the surface's normal; `jump` as PatchSettings.jump.
    """
    count = int(labels.max(initial=0))
    sums, colors, heights = _point_sums(labels, points, normals, inverse, height, lab, count)
    borders, perimeters = _border_sums(
        labels, patch_of, points, normals, inverse, height, lab, np.asarray(up, dtype=np.float32), count, jump
    )
    corners, starts = _hulls(labels, count)
    return Regions(sums, colors, heights, perimeters, borders, corners, starts)
