"""The colours that the map shows on the parts of a placed model: what it looks like is a part of what it is like."""

from __future__ import annotations

import numpy as np

from stages.cad.model_surfaces import ModelSurface, to_model
from stages.cad.shapes import Placement

NEAR = 0.03
"""Vertices farther from the model than this say nothing of its colour [m]."""
LEAST_VERTICES = 10
"""Parts that fewer vertices show keep the colour of the library."""


def part_colors(
    surface: ModelSurface, placement: Placement, vertices: np.ndarray, normals: np.ndarray, colors: np.ndarray
) -> dict[str, tuple[int, int, int]]:
    """Return part -> median colour (sRGB, 0 to 255) of the map's vertices that are nearest to it.

    `vertices`, `normals` (N, 3) world frame, `colors` (N, 3) uint8. Parts that were not seen are left out.
    """
    nearest = surface.closest(to_model(placement, vertices), placement.shape.joints, normals @ placement.rotation)
    near = placement.scale * nearest.distance <= NEAR
    result = {}
    for k, part in enumerate(surface.model.parts):
        own = near & (nearest.part == k)
        if np.count_nonzero(own) >= LEAST_VERTICES:
            red, green, blue = (int(value) for value in np.round(np.median(colors[own], axis=0)))
            result[part] = (red, green, blue)
    return result
