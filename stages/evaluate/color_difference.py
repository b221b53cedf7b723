"""How different two colours look: CIE L*a*b* (CIE 15:2004) and the distance in it (CIE 1976)."""

from __future__ import annotations

import numpy as np

XYZ_FROM_LINEAR = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)
"""sRGB primaries, white D65 (IEC 61966-2-1)."""


def linear_from_srgb(colors: np.ndarray) -> np.ndarray:
    """Return linear light (..., 3) in [0, 1] of sRGB colours (..., 3) in [0, 255]."""
    values = np.asarray(colors, dtype=float) / 255.0
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def lab_from_linear(colors: np.ndarray) -> np.ndarray:
    """Return L*, a*, b* (..., 3) of linear sRGB light (..., 3)."""
    relative = np.asarray(colors, dtype=float) @ XYZ_FROM_LINEAR.T / XYZ_FROM_LINEAR.sum(axis=1)
    f = np.where(relative > (6 / 29) ** 3, np.cbrt(relative), relative / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.stack([116 * f[..., 1] - 16, 500 * (f[..., 0] - f[..., 1]), 200 * (f[..., 1] - f[..., 2])], axis=-1)


def mean_lab(colors: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return L*, a*, b* (3,) of the light that sRGB colours (N, 3) in [0, 255] give together, weighted by area (N,).

    Light adds up linearly, so the mean is taken before the conversion. Raises ValueError without any weight.
    """
    weights = np.asarray(weights, dtype=float)
    if not weights.sum() > 0:
        raise ValueError("no area to take a mean colour over")
    linear = linear_from_srgb(np.asarray(colors, dtype=float).reshape(-1, 3))
    return lab_from_linear((weights[:, None] * linear).sum(axis=0) / weights.sum())


def color_difference(first: np.ndarray, second: np.ndarray) -> float:
    """Return the CIE 1976 difference of two L*a*b* colours (3,): 2.3 is just noticeable, black and white are 100."""
    return float(np.linalg.norm(np.asarray(first, dtype=float) - np.asarray(second, dtype=float)))
