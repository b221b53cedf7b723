"""Models that are made for one thing: what their parts are written with, and how one knows them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh
from scenewright.schemas.base import as_vector
from scenewright.schemas.cad_library import CadModel
from scenewright.schemas.scene_parts import SurfacePlane
from scenewright.stages.kit.formats.model_writer import Faceted, PartGeometry
from scenewright.stages.kit.geometry.solids import Solid, box, mass_properties

BODY, GREY = "body", (150, 150, 150)
"""Name of the part that does not move, and its colour (sRGB) where none was seen."""
BUILT_IN, FAMILY = "built_in", "family"
"""Entries of a recipe: the node that boxes were made for, and the family that a model was made of."""


def is_built_in(model: CadModel) -> bool:
    """Whether a model is a run of boxes that stands where it was built."""
    return BUILT_IN in model.recipe


def is_of_family(model: CadModel) -> bool:
    """Whether a model was made of the parts of a family."""
    return FAMILY in model.recipe


def solid_box(low: np.ndarray, high: np.ndarray) -> Solid:
    """Return the box between two corners (3,) [m]."""
    return box((low[0], high[0]), (low[1], high[1]), (low[2], high[2]))


def part_of(name: str, solids: Sequence[Solid], density: float, shown: Sequence[Faceted] = ()) -> PartGeometry:
    """Return a part of convex solids of a density [kg/m³]; `shown`: its look, where that is not the solids."""
    properties = mass_properties(solids, [density] * len(solids))
    return PartGeometry(name, solids, [GREY] * len(solids), properties, shown, [GREY] * len(shown))


def _corners(axis: int, up: bool, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return the corners (4, 3) of a rectangle across an axis, counter-clockwise as seen from where it looks."""
    first, second = [a for a in range(3) if a != axis]
    corners = np.tile(low, (4, 1))
    corners[[1, 2], first] = high[first]
    corners[[2, 3], second] = high[second]
    return corners if up == (axis != 1) else corners[::-1]


def quad(axis: int, up: bool, low: np.ndarray, high: np.ndarray) -> trimesh.Trimesh:
    """Return the rectangle between two corners (3,) across an axis, looking along it (`up`) or against it."""
    return trimesh.Trimesh(_corners(axis, up, low, high), [[0, 1, 2], [0, 2, 3]], process=False)


def plane_of(axis: int, up: bool, low: np.ndarray, high: np.ndarray) -> SurfacePlane:
    """Return that rectangle as a surface plane."""
    normal = np.eye(3)[axis] * (1.0 if up else -1.0)
    middle = 0.5 * (low + high)
    return SurfacePlane(
        normal=as_vector(normal),
        offset=-float(normal @ middle),
        area=rectangle_area(low, high),
        center=as_vector(middle),
        corners=tuple(as_vector(corner) for corner in _corners(axis, up, low, high)),
        horizontal=axis == 2 and up,
    )


def rectangle_area(low: np.ndarray, high: np.ndarray) -> float:
    """Return the area of the rectangle between two corners (3,) [m²]."""
    edges = high - low
    return float(np.prod(edges[edges > 0]))
