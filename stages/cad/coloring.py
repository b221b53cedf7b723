"""The colours that the map shows on the parts of a placed model: what it looks like is a part of what it is like.

A camera sees the cover of a book and hardly its pages, the seat of a chair and not its underside. So what is taken from
the map is by how much the surface that was seen differs from the model's own there, and the part's mean is shifted by
that. It is taken where the part is lit, as the walls are whose brightness tells the light (room_light.py), and half of
it from what faces up, half from what stands upright: lamps hang over tops. Parts that nobody saw follow a seen part of
the same colour (legs are alike), and else stay as they are.
"""

from __future__ import annotations

import numpy as np
from scenewright.stages.cad.model_surfaces import ModelSurface, to_model
from scenewright.stages.cad.room_light import LIT
from scenewright.stages.cad.shapes import Placement
from scipy.stats import trim_mean

NEAR = 0.03
"""Vertices farther from the model than this say nothing of its colour [m]."""
LEAST_VERTICES = 10
"""Parts that fewer vertices show were not seen."""
STRAY = 0.1
"""Share of the vertices of a small part left out at both ends: labels leak."""
AROUND = 15
"""Percent of vertices, brighter and darker than LIT, that are taken for lit too."""
MOSTLY_RIM = 256
"""A part that fewer of the given vertices show is mostly rim, where labels leak: what is bright there is of something
else. Of every fourth vertex of a map with voxels of 2 cm they stand for 0.4 m²."""
UP, UPRIGHT = 0.7, 0.5
"""Cosines to the vertical: over the first surface faces up, under the second it stands upright."""
SAME_COLOR = 12.0
"""Parts of a model whose own mean colours differ by less are of one material (sRGB, 0 to 255)."""


def part_colors(
    surface: ModelSurface, placement: Placement, vertices: np.ndarray, normals: np.ndarray, colors: np.ndarray
) -> dict[str, tuple[int, int, int]]:
    """Return part -> mean colour (sRGB, 0 to 255) that it is to have, for every part when any was seen.

    `vertices`, `normals` (N, 3) world frame, `colors` (N, 3) uint8.
    """
    at, facing = to_model(placement, vertices), normals @ placement.rotation
    nearest = surface.closest(at, placement.shape.joints, facing)
    close = placement.scale * nearest.distance <= NEAR
    shifts: dict[str, np.ndarray] = {}
    for k, part in enumerate(surface.model.parts):
        of_part = close & (nearest.part == k)
        if np.count_nonzero(of_part) >= LEAST_VERTICES:
            own_look = surface.looks[part].colors[nearest.triangle[of_part]]
            shifts[part] = _of_lit(colors[of_part].astype(float) - own_look, normals[of_part, 2])
    if not shifts:
        return {}
    means = {part: surface.looks[part].mean for part in surface.model.parts}
    result = {}
    for part, mean in means.items():
        shift = shifts.get(part)
        if shift is None:
            alike = min(shifts, key=lambda other: float(np.linalg.norm(means[other] - mean)))
            shift = shifts[alike] if np.linalg.norm(means[alike] - mean) < SAME_COLOR else np.zeros(3)
        red, green, blue = (int(value) for value in np.round(np.clip(mean + shift, 0, 255)))
        result[part] = (red, green, blue)
    return result


def _of_lit(shifts: np.ndarray, cosine: np.ndarray) -> np.ndarray:
    """Return the mean (3,) of the shifts (N, 3) of lit vertices; of what is mostly rim that of all vertices but strays.

    `cosine` (N,): of their normals to the vertical.
    """
    if len(shifts) < MOSTLY_RIM:
        return np.asarray(trim_mean(shifts, STRAY, axis=0))
    facing = [shifts[own] for own in (cosine > UP, np.abs(cosine) < UPRIGHT) if np.count_nonzero(own) >= LEAST_VERTICES]
    means = []
    for each in facing or [shifts]:
        brightness = each.sum(axis=1)
        low, high = np.percentile(brightness, [LIT - AROUND, LIT + AROUND])
        means.append(each[(brightness >= low) & (brightness <= high)].mean(axis=0))
    return np.asarray(np.mean(means, axis=0))
