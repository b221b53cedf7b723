"""Ours: a model that the arrangement moved off the surface that it stands for gives the thing its mesh back.

What is moved aside out of its neighbours is judged again where it came to stand, by the same error as a candidate. A
mesh is never moved so far, so it explains what was seen where the model no longer does.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.cad.arranging import Arrangement
from scenewright.stages.cad.candidates import Shortlist
from scenewright.stages.cad.model_surfaces import ModelSurface, alignment_error
from scenewright.stages.cad.shapes import Placement
from scenewright.stages.kit.formats.entity_meshes import load_entity_mesh


def moved_off(
    graph: ContactGraphFile,
    panoptic_map: PanopticMap,
    arranged: Arrangement,
    chosen: Mapping[str, Placement],
    surfaces: Mapping[str, ModelSurface],
    largest_error: float,
) -> dict[str, str]:
    """Return node -> why its model is none any more, for models that the arrangement moved aside until they lie farther
    than `largest_error` [m] from what was seen of their thing, root mean square, and farther than before.

    The way along with what carries it, and up or down onto it, does not count: the graph asks for these.
    """
    why = {}
    for name, placement in arranged.placements.items():
        link, mesh = graph.parent_link(name), graph.node(name).mesh
        along, way = went(arranged, chosen, "" if link is None else link.source), went(arranged, chosen, name)
        along = np.array([*along[:2], way[2]])
        own = way - along
        if mesh is None or not own.any():
            continue
        points = load_entity_mesh(panoptic_map.path(mesh)).vertices
        error = alignment_error(surfaces[placement.shape.model.id], placement, points + along)
        before = alignment_error(surfaces[chosen[name].shape.model.id], chosen[name], points)
        if error > max(largest_error, before):
            moved, off = 1000 * np.linalg.norm(own), 1000 * error
            why[name] = f"{placement.shape.model.id} would have to stand {moved:.0f} mm aside, {off:.0f} mm off"
    return why


def went(arranged: Arrangement, chosen: Mapping[str, Placement], name: str) -> np.ndarray:
    """Return how far (3,) [m] the arrangement moved a thing, model or mesh, from where it was seen."""
    if name in arranged.placements:
        return np.asarray(arranged.placements[name].translation - chosen[name].translation)
    return arranged.shifts.get(name, np.zeros(3))


def given_back(entry: Shortlist, why: str) -> Shortlist:
    """Return the shortlist of a thing that keeps its mesh after all."""
    return replace(entry, placements=(), reason=f"no model: {why}")
