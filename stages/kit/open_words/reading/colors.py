"""What a colour is called."""

from __future__ import annotations

import colorsys

import numpy as np

COLORS = ("white", "grey", "black", "red", "orange", "yellow", "green", "blue", "brown", "beige", "pink", "purple")


def color_name(color: np.ndarray) -> str:
    """Return the name of an sRGB colour (3,) in 0..1."""
    hue, saturation, value = colorsys.rgb_to_hsv(*(float(v) for v in color))
    degrees = 360.0 * hue
    if value < 0.27:
        return "black"
    if saturation < 0.14:
        return "white" if value > 0.80 else "grey"
    if 18 <= degrees < 62 and saturation < 0.36 and value > 0.6:
        return "beige"
    if degrees < 12 or degrees >= 345:
        return "pink" if saturation < 0.45 and value > 0.75 else "red"
    if degrees < 40:
        return "orange" if saturation > 0.70 and value > 0.72 else "brown"
    if degrees < 66:
        return "yellow" if value > 0.55 else "brown"
    if degrees < 168:
        return "green" if saturation >= 0.2 else "grey"
    if degrees < 258:
        return "blue" if saturation >= 0.2 else "grey"
    return "purple" if degrees < 300 else "pink"


def color_shares(colors: np.ndarray, weights: np.ndarray) -> dict[str, float]:
    """Return name -> share of the weights (N,) of colours (N, 3), sRGB in 0..1."""
    distinct, member = np.unique(np.round(colors, 2), axis=0, return_inverse=True)
    sums = np.bincount(member.reshape(-1), weights)
    shares: dict[str, float] = {}
    for color, amount in zip(distinct, sums / max(float(sums.sum()), 1e-12), strict=True):
        name = color_name(color)
        shares[name] = shares.get(name, 0.0) + float(amount)
    return shares
