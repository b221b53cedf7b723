"""The wound pad: a height field with one raised wound along the world's x axis (world z up, metres)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scenewright.stages.kit.compiled import compiled

RIDGE_HEIGHT = 0.0055
"""Height of the wound over the pad [m]; by eye."""
RIDGE_HALF_WIDTH = 0.0065
"""Half the width of the wound [m]; by eye."""


class Ridge(NamedTuple):
    """The raised wound: its height and half its width [m]; `elliptic`: half an ellipse on a flat pad, as trials have it
    (stages/suture/trials/wound.py), else rounded, with a slit along its crest and slight waves."""

    height: float = RIDGE_HEIGHT
    half_width: float = RIDGE_HALF_WIDTH
    elliptic: bool = False


ROUNDED = Ridge()
SLIT_HALF_WIDTH = 0.0006
"""Half the width of the slit along the wound's crest [m]; by eye."""
FLAT_FROM = 0.0135
"""Distance from the wound [m] beyond which the pad is flat but for its waves."""


@compiled(fastmath=True)
def height(x: float, y: float, ridge: Ridge) -> float:
    """Return the pad's height [m] at (x, y)."""
    if ridge.elliptic:
        return ridge.height * np.sqrt(max(1.0 - (y / ridge.half_width) ** 2, 0.0))
    waves = 0.0004 * np.sin(90.0 * x + 1.3) * np.cos(70.0 * y)
    if abs(y) > FLAT_FROM:
        return waves
    across = y / ridge.half_width
    crest = ridge.height * np.exp(-across * across * across * across * 0.7)
    slit = 0.0018 * np.exp(-(y / SLIT_HALF_WIDTH) * (y / SLIT_HALF_WIDTH))
    return crest - slit + waves


@compiled
def _hash(column: int, row: int, salt: int) -> float:
    value = (column * 374761393 + row * 668265263 + salt * 1274126177) & 0xFFFFFFFF
    value = ((value ^ (value >> 13)) * 1103515245) & 0xFFFFFFFF
    return float((value ^ (value >> 16)) & 0xFFFF) / 65535.0


@compiled
def texture(x: float, y: float, salt: int) -> float:
    """Return a smooth mottle between -1 and 1 with grains of 6, 1.5 and 0.5 mm at (x, y) [m]."""
    total = 0.0
    for octave in range(3):
        scale = (166.0, 660.0, 2000.0)[octave]
        weight = (0.45, 0.30, 0.25)[octave]
        u, v = x * scale + 1000.0, y * scale + 1000.0
        column, row = int(np.floor(u)), int(np.floor(v))
        a, b = u - column, v - row
        a, b = a * a * (3 - 2 * a), b * b * (3 - 2 * b)
        low = _hash(column, row, salt + octave) * (1 - a) + _hash(column + 1, row, salt + octave) * a
        high = _hash(column, row + 1, salt + octave) * (1 - a) + _hash(column + 1, row + 1, salt + octave) * a
        total += weight * (2.0 * (low * (1 - b) + high * b) - 1.0)
    return total
