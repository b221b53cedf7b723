"""The look of a part: its triangles by colour, a few colours in all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scenewright.stages.library.importing.pictures import few_colors
from scenewright.stages.library.importing.source_model import Surface


@dataclass(frozen=True)
class Patch:
    """Triangles of one colour."""

    vertices: np.ndarray
    faces: np.ndarray


def painted(surfaces: Sequence[Surface], origin: np.ndarray) -> tuple[list[Patch], list[tuple[int, int, int]]]:
    """Return the surfaces of a part in its frame as patches, one a colour, a few colours in all."""
    starts = np.cumsum([0, *(len(surface.vertices) for surface in surfaces)])
    vertices = np.concatenate([surface.vertices for surface in surfaces]) - origin
    faces = np.concatenate([surface.faces + start for surface, start in zip(surfaces, starts, strict=False)])
    colors = np.concatenate([surface.colors for surface in surfaces])
    corners = vertices[faces]
    areas = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    solid = areas > 1e-14  # slivers have no normal, and engines stumble over them
    if solid.any():
        faces, colors, areas = faces[solid], colors[solid], areas[solid]
    colors = few_colors(colors, areas)
    patches, palette = [], []
    for color in np.unique(colors, axis=0):
        chosen = faces[(colors == color).all(axis=1)]
        used, inner = np.unique(chosen, return_inverse=True)
        patches.append(Patch(vertices[used], inner.reshape(-1, 3)))
        palette.append((int(color[0]), int(color[1]), int(color[2])))
    return patches, palette
