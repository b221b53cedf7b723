"""Figures and what they are allowed to be."""

from __future__ import annotations

from collections.abc import Mapping

Band = tuple[float, float]
"""The least and the largest value that passes."""


def outside(figures: Mapping[str, float], bands: Mapping[str, Band]) -> list[str]:
    """Return the figures that leave their bands, in words. Raises KeyError for a figure that was not measured."""
    return [
        f"{name} is {figures[name]:.4g}, not within {least:.4g} to {most:.4g}"
        for name, (least, most) in bands.items()
        if not least <= figures[name] <= most
    ]
