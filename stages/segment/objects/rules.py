"""The hand-set answer to whether two groups of patches are one object. Constants were set on mOSD's `learn` frames."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from stages.segment.objects.pairs import FEATURES

_AT = {name: k for k, name in enumerate(FEATURES)}
SMALLER, TOUCHING = _AT["smaller_pixels"], _AT["touching"]
CONNECTED, JUMP, CONCAVE, CONVEX = _AT["connected"], _AT["jump"], _AT["concave"], _AT["convex"]
BORDER_COLOR, HISTOGRAM, CHROMA = _AT["border_color"], _AT["histogram"], _AT["chroma"]
BEHIND_GAIN, HIDDEN = _AT["behind_gain"], _AT["hidden"]
NORMAL_ANGLE, RESIDUAL_GAIN = _AT["normal_angle"], _AT["residual_gain"]
TOP, GAP = _AT["top_difference"], _AT["gap"]
CUT, FINE_STEPS = _AT["cut"], _AT["fine_steps"]
CRUMB = math.log(400.0)
"""Patches with fewer pixels than this have no shape of their own: colour and border decide."""


@njit(cache=True)
def rule_score(f: np.ndarray) -> float:
    """Return a score of the features (pairs.FEATURES) of two groups: over 0 they are one object.

    Pieces that a cut made are one unless the colours of both as wholes are others. Touching groups: convex borders
    join, concave ones part; a union that fills its hull better than its parts is likely one solid (bowls and mugs:
    inside and outside); a colour step and a depth jump speak against. Groups apart are one only when something nearer
    hides what lies between, and they agree in colour, height and slope.
    """
    if f[CUT] > 0.5:
        other = 4.0 * (0.3 - f[HISTOGRAM]) + 2.0 * (f[FINE_STEPS] - 0.75) + 0.05 * (f[CHROMA] - 15.0)
        return 2.4 - other - 6.0 * max(0.0, f[BEHIND_GAIN])
    if f[TOUCHING] > 0.0:
        score = 3.0 + f[CONNECTED] * (3.0 * f[CONVEX] - 2.3 * f[CONCAVE])
        score -= 10.0 * f[BEHIND_GAIN]
        score -= 0.12 * f[BORDER_COLOR] + 0.08 * f[CHROMA]
        score -= 5.0 * (1.0 - f[CONNECTED]) * f[JUMP] + 8.0 * f[TOP]
        if f[SMALLER] < CRUMB:
            score += 1.5 * (CRUMB - f[SMALLER])
        return score
    score = -1.4 + 12.0 * min(f[HIDDEN], 0.25)
    score -= 6.0 * max(0.0, f[BEHIND_GAIN])
    score -= 0.04 * (f[CHROMA] - 12.0) - 1.5 * (f[HISTOGRAM] - 0.2)
    score += 1.0 * (f[NORMAL_ANGLE] - 0.9) - 0.4 * f[RESIDUAL_GAIN]
    score -= 5.0 * f[TOP]
    score -= 0.2 * f[GAP]
    return score
