"""Which family explains a thing, if one does, and how well."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scenewright.stages.cad.built_ins import EXPLAINED
from scenewright.stages.cad.carcasses import Patches, patches_of
from scenewright.stages.cad.families import cabinets, chairs, lamps, screens, shelves, sofas, tables
from scenewright.stages.cad.families.forms import Form, Reading
from scenewright.stages.cad.families.reading import further_pieces
from scenewright.stages.cad.target import Surroundings
from scenewright.stages.kit.formats.entity_meshes import EntityMesh
from scenewright.stages.kit.formats.mobility import BUILT_IN, STANDS
from scenewright.stages.kit.geometry.boxes import bottom, points_in_box
from scenewright.stages.kit.geometry.steadiness import stands_steadily
from scipy.spatial import cKDTree

FAMILIES: Mapping[str, tuple[tuple[str, ...], Callable[[Reading], Form | str]]] = {
    "cabinet": (("cabinet", "wall_cabinet", "drawer_unit", "wardrobe", "fridge"), cabinets.read),
    "chair": (("chair",), chairs.read),
    "lamp": (("lamp",), lamps.read),
    "screen": (("monitor",), screens.read),
    "shelf": (("shelf", "wall_shelf"), shelves.read),
    "sofa": (("sofa", "bed"), sofas.read),
    "table": (("table", "desk", "bench", "stool"), tables.read),
}
"""Family -> classes whose things may be of it, and what reads it off a surface."""
FEWEST = 50
"""Patches of surface without which nothing can be said."""
INDEPENDENT = 0.1
"""Surface so far apart [m] is seen, bent and hidden apart: errors of depth and of masks are as wide."""
CLEAR = 2.0
"""Standard deviations that a difference is clear from."""
STRAY = 0.01
"""Surface outside the observed box by more than this was stray to the graph [m]."""


@dataclass(frozen=True)
class Fitted:
    """A form that explains a thing."""

    form: Form
    near: np.ndarray
    """(N,) bool: the patches of the thing that it explains."""
    explained: float


def surface_to_read(around: Surroundings, mesh: EntityMesh) -> Reading:
    """Return the surface of a thing for families, world frame."""
    patches, box = patches_of(mesh), around.node.box_observed
    if box is not None:
        patches = patches.chosen(points_in_box(box, patches.points, margin=STRAY))
    links = [link for link in around.graph.links if link.source == around.node.id and link.relation in STANDS]
    boxes = [around.graph.node(link.target).box for link in links]
    carrying = tuple(bottom(child) for child in boxes if child is not None)
    height, own = around.stands_at, cKDTree(mesh.vertices)
    walls = tuple(plane for wall in around.walls for plane in wall.planes if not plane.horizontal)
    name = around.node.class_name
    return Reading(
        patches, height, np.eye(3), around.free_space, own, carrying, around.hangs, walls, name, around.within
    )


def fit(family: str, reading: Reading) -> Fitted | str:
    """Return the form of a family that explains a surface, world frame, or why there is none."""
    if len(reading.patches.areas) < FEWEST:
        return "hardly any surface"
    form = FAMILIES[family][1](reading)
    if isinstance(form, str):
        return form
    own = reading.turned(form.turn)
    if not form.leaves:  # what is beside or on a closed carcass is another thing
        more = further_pieces(list(form.pieces), own, form.distance(own.patches))
        form = replace(form, pieces=(*form.pieces, *more))
    free = form.classes[0] not in BUILT_IN
    if free and not stands_steadily([piece.corners for piece in form.pieces], reading.base):
        return "it would not stand"
    near = form.distance(own.patches) < reading.within
    explained = share(near, own.patches)
    return Fitted(form, near, explained) if explained >= EXPLAINED else f"it explains {explained:.0%}"


def share(near: np.ndarray, patches: Patches) -> float:
    """Return the share of a surface, by area, of patches (N,) bool."""
    return float(patches.areas[near].sum() / max(patches.areas.sum(), 1e-12))


def explains_clearly_more(near: np.ndarray, other: np.ndarray, patches: Patches) -> bool:
    """Whether one stand-in explains more of a surface than another, beyond what chance would give.

    `near`, `other` (N,) bool: the patches that either explains. Patches beside each other are explained or not
    together, so differences are summed over cells of `INDEPENDENT`; the sum has to be clear of zero, where every cell
    might have gone either way.
    """
    cells = np.unique(np.floor(patches.points / INDEPENDENT).astype(int), axis=0, return_inverse=True)[1].ravel()
    differences = np.bincount(cells, weights=patches.areas * (near.astype(float) - other))
    return bool(differences.sum() > CLEAR * np.sqrt(np.sum(differences**2)))
