"""Whether a utensil's head shows tines: how far an image is brighter (or higher) on a fork's tines than in its gaps."""

from __future__ import annotations

from functools import cache

import numpy as np
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.tableware.world.dish_shapes import GAP_SHARE, HEAD_SHARE, TINES
from scenewright.stages.tableware.world.items import Measures


@cache
def _comb(fork: Measures) -> tuple[np.ndarray, np.ndarray]:
    """Return points (N, 2) [m] on the middle lines of a fork's tines, and (M, 2) of its gaps; the head is at +x."""
    root = (0.5 - 0.5 * HEAD_SHARE) * fork.length
    along = np.arange(root, 0.5 * fork.length - 0.001, 0.0012)
    tine = fork.width * (1.0 - GAP_SHARE) / TINES
    pitch = (fork.width - tine) / (TINES - 1)
    middles = -0.5 * fork.width + 0.5 * tine + pitch * np.arange(TINES)
    gaps = middles[:-1] + 0.5 * pitch

    def points(lines: np.ndarray) -> np.ndarray:
        x, y = np.meshgrid(along, lines)
        return np.stack([x.ravel(), y.ravel()], axis=1)

    return points(middles), points(gaps)


@compiled
def _mean(image: np.ndarray, points: np.ndarray, u: float, v: float, cos: float, sin: float) -> float:
    """Return the mean of an image (h, w) at points [m], bilinear; negative values of the image are not known."""
    total, weight = 0.0, 0.0
    for i in range(len(points)):
        x = u + points[i, 0] * cos + points[i, 1] * sin
        y = v + points[i, 0] * sin - points[i, 1] * cos
        column, row = int(x), int(y)
        if 0 <= column < image.shape[1] - 1 and 0 <= row < image.shape[0] - 1:
            a, b = x - column, y - row
            for q in range(4):
                value = image[row + q // 2, column + q % 2]
                if value >= 0.0:
                    part = (a if q % 2 else 1.0 - a) * (b if q // 2 else 1.0 - b)
                    total += part * value
                    weight += part
    return total / weight if weight > 0.25 * len(points) else np.nan


@compiled
def _difference(
    image: np.ndarray, tines: np.ndarray, gaps: np.ndarray, u: float, v: float, angle: float, scale: float, sign: float
) -> float:
    best = np.nan
    for turn in range(-1, 2):
        cos, sin = scale * np.cos(angle + 0.02 * turn), scale * np.sin(angle + 0.02 * turn)
        for shift in range(-3, 4):
            du, dv = -0.5 * shift * sin / scale, 0.5 * shift * cos / scale
            x, y = u + du, v + dv
            value = sign * (_mean(image, tines, x, y, cos, sin) - _mean(image, gaps, x, y, cos, sin))
            if not np.isnan(value) and (np.isnan(best) or value > best):
                best = value
    return best


def tine_difference(
    image: np.ndarray, pose: tuple[float, float, float], scale: float, fork: Measures, sign: float = 1.0
) -> float:
    """Return how much more `image` (h, w) holds on the tines than in the gaps of a fork at `pose` (u, v [px], angle
    [rad]), largest over 21 poses nearby; less where `sign` is negative. NaN where too little is known. Negative values
    of the image are unknown."""
    return float(_difference(image, *_comb(fork), *pose, scale, sign))
