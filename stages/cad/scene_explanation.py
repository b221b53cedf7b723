"""What the finished scene explains of its map: thing by thing, and what nothing explains."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scenewright.schemas.cad_scene import Explained
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.scene_parts import SurfacePlane
from scenewright.stages.cad.arranging import Arrangement
from scenewright.stages.cad.candidates import Shortlist
from scenewright.stages.cad.carcasses import Patches, patches_of
from scenewright.stages.cad.completion import STILL
from scenewright.stages.cad.explained import (
    NEAR,
    Triangles,
    depth_spread,
    explained_by_mesh,
    explained_by_model,
    placed_triangles,
    unexplained,
)
from scenewright.stages.cad.model_surfaces import ModelSurface
from scenewright.stages.cad.shapes import Placement
from scenewright.stages.kit.formats.entity_meshes import EntityMesh, load_entity_mesh
from scenewright.stages.kit.formats.mesh_files import read_mesh

RUNNERS_UP = 2
"""Models that were not chosen, of which is told what they explain."""


@dataclass(frozen=True)
class Explanation:
    """What a scene explains."""

    things: dict[str, Explained]
    """By node."""
    next_models: dict[str, dict[str, float]]
    """Node -> model that was not chosen -> share that it explains where it fits best, of the best `RUNNERS_UP`."""
    within: float
    """Surface so near is explained [m]."""
    rest: EntityMesh | None
    """The surface of the map that nothing explains."""


def explained_within(graph: ContactGraphFile, panoptic_map: PanopticMap) -> float:
    """Return how near surface of a map has to be to what explains it [m]: as near as it is known where depth spreads.
    Raises BadInput for meshes that cannot be read."""
    patches = {name: patches_of(mesh) for name, mesh in _meshes(graph, panoptic_map).items()}
    return NEAR + depth_spread(_planes(graph, patches))


def explanation_of(
    graph: ContactGraphFile,
    panoptic_map: PanopticMap,
    arranged: Arrangement,
    shortlists: Mapping[str, Shortlist],
    surfaces: dict[str, ModelSurface],
    output: Path,
    within: float,
) -> Explanation:
    """Return what a scene explains whose meshes, layout and surroundings lie in `output`: surface so near [m] as
    `within`. Raises BadInput for meshes that cannot be read."""
    meshes = _meshes(graph, panoptic_map)
    patches = {name: patches_of(mesh) for name, mesh in meshes.items()}
    things, others = {}, {}
    for node in graph.nodes:
        if node.id not in meshes or node.node_type == "layout":
            continue
        placement = arranged.placements.get(node.id)
        if placement is None:
            shift = arranged.shifts.get(node.id, STILL)
            things[node.id] = explained_by_mesh(patches[node.id], meshes[node.id], shift, within)
        else:
            model = surfaces[placement.shape.model.id]
            things[node.id] = explained_by_model(model, placement, patches[node.id], within)
            others[node.id] = {
                model_id: explained_by_model(surfaces[model_id], runner_up, patches[node.id], within).by_model
                for model_id, runner_up in next_models(shortlists[node.id].placements, placement).items()
            }
    path = panoptic_map.path("mesh.ply")
    stands = [*_written(output), *_models(arranged, surfaces)]
    rest = unexplained(load_entity_mesh(path), stands, within) if path.is_file() else None
    return Explanation(things, others, round(within, 4), rest)


def next_models(candidates: Sequence[Placement], chosen: Placement) -> dict[str, Placement]:
    """Return the best candidate of each of the first `RUNNERS_UP` models that were not chosen, by model."""
    best: dict[str, Placement] = {}
    for candidate in candidates:
        if candidate.shape.model.id != chosen.shape.model.id and len(best) < RUNNERS_UP:
            best.setdefault(candidate.shape.model.id, candidate)
    return best


def _meshes(graph: ContactGraphFile, panoptic_map: PanopticMap) -> dict[str, EntityMesh]:
    return {node.id: load_entity_mesh(panoptic_map.path(node.mesh)) for node in graph.nodes if node.mesh is not None}


def _planes(graph: ContactGraphFile, patches: dict[str, Patches]) -> Iterator[tuple[SurfacePlane, Patches]]:
    for node in graph.nodes:
        if node.id in patches:
            yield from ((plane, patches[node.id]) for plane in node.planes if not plane.hidden)


def _models(arranged: Arrangement, surfaces: dict[str, ModelSurface]) -> Iterator[Triangles]:
    for placement in arranged.placements.values():
        yield from placed_triangles(surfaces[placement.shape.model.id], placement)


def _written(output: Path) -> Iterator[Triangles]:
    """Yield the meshes that stand in the scene as they were mapped."""
    for folder in ("layout", "meshes"):
        for path in sorted((output / folder).glob("*.ply")):
            mesh = read_mesh(path, may_be_empty=True)
            yield np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces, dtype=np.int64)
