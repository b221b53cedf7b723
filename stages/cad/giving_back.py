"""Ours: a model that does not explain what was seen of its thing gives way to the next, and at last to the mesh.

Models err in shape, and what is moved aside out of its neighbours ends beside its surface. Both are judged where a
model came to stand, by the share of the surface that it explains. A mesh explains all of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.cad.arranging import Arrangement
from scenewright.stages.cad.candidates import Shortlist
from scenewright.stages.cad.carcasses import patches_of
from scenewright.stages.cad.explained import explained_by_model
from scenewright.stages.cad.model_surfaces import ModelSurface
from scenewright.stages.cad.shapes import Placement
from scenewright.stages.kit.formats.entity_meshes import load_entity_mesh


def unexplaining(
    graph: ContactGraphFile,
    panoptic_map: PanopticMap,
    arranged: Arrangement,
    chosen: Mapping[str, Placement],
    surfaces: Mapping[str, ModelSurface],
    least: float,
    within: float,
) -> dict[str, str]:
    """Return node -> why its model is none any more, for models that explain less than a share `least` of what was
    seen of their thing, where the arrangement put them.

    The way along with what carries it, and up or down onto it, does not count: the graph asks for these. Surface is
    explained that is as near as `within` [m]. Raises BadInput for meshes that cannot be read.
    """
    why = {}
    for name, placement in arranged.placements.items():
        link, mesh = graph.parent_link(name), graph.node(name).mesh
        if mesh is None or least <= 0.0:
            continue
        way = went(arranged, chosen, name)
        along = np.array([*went(arranged, chosen, "" if link is None else link.source)[:2], way[2]])
        patches = patches_of(load_entity_mesh(panoptic_map.path(mesh)))
        patches = replace(patches, points=patches.points + along)
        share = explained_by_model(surfaces[placement.shape.model.id], placement, patches, within).by_model
        if share < least:
            aside = 1000 * np.linalg.norm(way - along)
            why[name] = f"{placement.shape.model.id} would explain {share:.0%}, {aside:.0f} mm aside"
    return why


def went(arranged: Arrangement, chosen: Mapping[str, Placement], name: str) -> np.ndarray:
    """Return how far (3,) [m] the arrangement moved a thing, model or mesh, from where it was seen."""
    if name in arranged.placements:
        return np.asarray(arranged.placements[name].translation - chosen[name].translation)
    return arranged.shifts.get(name, np.zeros(3))


def given_back(entry: Shortlist, model_id: str, why: str) -> Shortlist:
    """Return the shortlist of a thing without a model: it keeps its mesh after all where no other is left."""
    left = tuple(placement for placement in entry.placements if placement.shape.model.id != model_id)
    return replace(entry, placements=left, reason=f"{'the next, as' if left else 'no model:'} {why}")
