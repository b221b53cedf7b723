"""Wiring of `cad`: contact graph, map and library in, functionally equivalent scene cg' out (Han 2024, section 2.4)."""

from __future__ import annotations

import math
import shutil
from collections.abc import Collection

import numpy as np

from schemas.base import as_transform
from schemas.cad_library import CadLibrary
from schemas.cad_scene import SURROUNDINGS, CadCandidate, CadScene, CadSceneFile, Replacement
from schemas.contact_graph import ContactGraph, ContactGraphFile, GraphNode
from schemas.errors import BadInput, UsageError
from schemas.panoptic_map import PanopticMap
from schemas.scene_parts import TREE_RELATIONS
from stages.cad.arranging import Arrangement, arrange
from stages.cad.candidates import Shortlist, models_for, object_points, shortlist
from stages.cad.coloring import part_colors
from stages.cad.conflicts import (
    Selection,
    Solid,
    convex_solid,
    min_conflicts,
    penetration,
    placed_pieces,
    placed_solid,
)
from stages.cad.free_space import NOTHING_KNOWN, load_free_space
from stages.cad.model_surfaces import ModelSurface, load_surface
from stages.cad.obstacles import floor_levels, obstacles_of
from stages.cad.parameters import CadParameters
from stages.cad.placing import placed_box, placed_planes
from stages.cad.scoring import Surroundings
from stages.cad.shapes import Placement
from stages.cad.surroundings import footing
from stages.cad.surroundings_files import area_of, surroundings_of, write_surroundings
from stages.kit.formats.cad_models import model_folder
from stages.kit.formats.entity_meshes import EntityMesh, load_entity_mesh
from stages.kit.geometry.point_clouds import sample_large_triangles, vertex_normals
from stages.kit.geometry.transforms import transform_from
from stages.kit.stage import Context

VERTICES, CONFLICTS, SAMPLES = 1, 2, 3
"""Random streams."""
COLOR_STEP = 4
"""Every so many vertices of a mesh say what colour it has."""


def run(
    contact_graph: ContactGraph,
    panoptic_map: PanopticMap,
    library: CadLibrary,
    *,
    parameters: CadParameters,
    context: Context,
) -> CadScene:
    """Replace every object by the CAD model that fits it best, such that the scene as a whole can exist."""
    if parameters.minimum_scale > parameters.maximum_scale:
        raise UsageError("minimum_scale is larger than maximum_scale")
    surfaces: dict[str, ModelSurface] = {}
    with context.progress.step("candidates"):
        shortlists = find_candidates(contact_graph.info, panoptic_map, library, surfaces, parameters, context)
    return choose_and_write(
        contact_graph.info, panoptic_map, library, shortlists, surfaces, parameters=parameters, context=context
    )


def choose_and_write(
    graph: ContactGraphFile,
    panoptic_map: PanopticMap,
    library: CadLibrary,
    shortlists: dict[str, Shortlist],
    surfaces: dict[str, ModelSurface],
    *,
    parameters: CadParameters,
    context: Context,
) -> CadScene:
    """Choose among the candidates of all objects, arrange the scene and write it (section 2.4.4)."""
    with context.progress.step("global check"):
        chosen, selection = select(graph, shortlists, surfaces, parameters, context)
        copy_meshes(graph, chosen, panoptic_map, context)
        layout = context.output / "layout"
        obstacles = obstacles_of(graph, layout, context.output / "meshes")
        solids = {name: convex_solid(pieces) for name, pieces in obstacles.items()}
        arranged, conflicts_after = adjust(
            graph, chosen, shortlists, surfaces, solids, floor_levels(graph, layout), parameters
        )
    nameless: EntityMesh | None = None
    if parameters.surroundings and parameters.method == "ours":
        with context.progress.step("surroundings"):
            pieces = [piece for some in obstacles.values() for piece in some]
            for placement in arranged.placements.values():
                placed = placed_pieces(placement, surfaces[placement.shape.model.id])
                pieces += [*placed, footing(placed)]
            nameless = surroundings_of(panoptic_map, pieces, parameters)
    with context.progress.step("writing"):
        if nameless is not None:
            write_surroundings(nameless, context.output / "meshes" / f"{SURROUNDINGS}.ply")
        colors = colors_of_parts(graph, arranged, surfaces, panoptic_map)
        scene = scene_file(graph, shortlists, arranged, colors, selection, conflicts_after)
        scene.write(context.output / "scene.json")
        cad_graph(graph, arranged, surfaces).write(context.output / "graph.json")
        copy_models(arranged, library, context)

    decisions = [replacement.decision for replacement in scene.replacements]
    errors = [placement.alignment_error for placement in arranged.placements.values()]
    summary = {
        "cad": decisions.count("cad"),
        "mesh": decisions.count("mesh"),
        "layout": decisions.count("layout"),
        "conflicts_before": scene.conflicts_before,
        "conflicts_after": scene.conflicts_after,
        "surroundings_m2": 0.0 if nameless is None else round(area_of(nameless), 2),
        "alignment_error_median": round(float(np.median(errors)), 4) if errors else None,
    }
    return CadScene(context.output, outcome="ok" if decisions else "empty", summary=summary)


def find_candidates(
    graph: ContactGraphFile,
    panoptic_map: PanopticMap,
    library: CadLibrary,
    surfaces: dict[str, ModelSurface],
    parameters: CadParameters,
    context: Context,
) -> dict[str, Shortlist]:
    """Return the shortlist of every object; surfaces of the models that were needed are added to `surfaces`."""
    models = library.info.models
    objects = [node for node in graph.nodes if node.node_type in ("rigid", "articulated")]
    free_space = load_free_space(panoptic_map) if parameters.method == "ours" else NOTHING_KNOWN
    found: dict[str, Shortlist] = {}
    for node in context.progress.track(objects, description="objects"):
        if node.mesh is None:
            found[node.id] = Shortlist(node, (), {}, "the map has no mesh of it")
            continue
        suitable = models_for(node.class_name, models)
        for model in suitable:
            if model.id not in surfaces:
                surfaces[model.id] = load_surface(model_folder(library, model.id), model)
        mesh = load_entity_mesh(panoptic_map.path(node.mesh))
        used = np.unique(mesh.faces)
        normals = vertex_normals(mesh.vertices, mesh.faces)
        extra, extra_normals = sample_large_triangles(
            mesh.vertices, mesh.faces, 0.01, context.random(SAMPLES, node.instance)
        )
        points, facing = object_points(
            node,
            np.concatenate([mesh.vertices[used], extra]),
            np.concatenate([normals[used], extra_normals]),
            parameters.vertices,
            context.random(VERTICES, node.instance),
        )
        found[node.id] = shortlist(
            points, facing, Surroundings(node, graph, free_space), suitable, surfaces, parameters
        )
    return found


def may_touch(graph: ContactGraphFile) -> set[frozenset[str]]:
    """Return pairs that are no collision: parent and child, and what else touches by nature."""
    return {frozenset((link.source, link.target)) for link in graph.links if link.relation != "proximal"}


def select(
    graph: ContactGraphFile,
    shortlists: dict[str, Shortlist],
    surfaces: dict[str, ModelSurface],
    parameters: CadParameters,
    context: Context,
) -> tuple[dict[str, Placement], Selection]:
    """Choose one candidate for each object that has any, by min-conflicts."""
    names = [name for name, entry in shortlists.items() if entry.placements]
    touching = may_touch(graph)
    solids: dict[tuple[int, int], Solid] = {}
    depths: dict[tuple[int, int, int, int], float] = {}

    def solid(i: int, a: int) -> Solid:
        if (i, a) not in solids:
            placement = shortlists[names[i]].placements[a]
            solids[i, a] = placed_solid(placement, surfaces[placement.shape.model.id])
        return solids[i, a]

    def depth(i: int, a: int, j: int, b: int) -> float:
        if frozenset((names[i], names[j])) in touching:
            return 0.0
        if i > j:
            i, a, j, b = j, b, i, a
        if (i, a, j, b) not in depths:
            depths[i, a, j, b] = penetration(solid(i, a), solid(j, b)).depth
        return depths[i, a, j, b]

    counts = []
    for name in names:
        scores = [placement.score for placement in shortlists[name].placements]
        limit = scores[0] + parameters.choice_margin if parameters.method == "ours" else math.inf
        counts.append(sum(score <= limit for score in scores))
    selection = min_conflicts(
        counts,
        depth,
        tolerance=parameters.collision_tolerance,
        iterations=parameters.conflict_iterations,
        random=context.random(CONFLICTS),
    )
    chosen = {name: shortlists[name].placements[k] for name, k in zip(names, selection.choice, strict=True)}
    return chosen, selection


def adjust(
    graph: ContactGraphFile,
    chosen: dict[str, Placement],
    shortlists: dict[str, Shortlist],
    surfaces: dict[str, ModelSurface],
    obstacles: dict[str, Solid],
    levels: dict[str, float],
    parameters: CadParameters,
) -> tuple[Arrangement, int]:
    """Put the chosen models on their supports and (ours) apart; returns the scene and the pairs still colliding."""
    margin = 2 * parameters.choice_margin
    alternatives = {
        name: [p for p in shortlists[name].placements if p.score <= shortlists[name].placements[0].score + margin]
        for name in chosen
    }
    arranged = arrange(
        graph,
        chosen,
        alternatives,
        surfaces,
        obstacles,
        levels=levels,
        area_threshold=parameters.area_threshold,
        tolerance=parameters.resting_tolerance,
        maximum_shift=parameters.maximum_shift if parameters.method == "ours" else 0.0,
    )
    touching = may_touch(graph)
    solids = {name: placed_solid(p, surfaces[p.shape.model.id]) for name, p in arranged.placements.items()}
    names = sorted(solids)
    pairs = [(a, b) for k, a in enumerate(names) for b in names[k + 1 :] if frozenset((a, b)) not in touching]
    return arranged, sum(penetration(solids[a], solids[b]).depth > parameters.collision_tolerance for a, b in pairs)


def candidate_record(placement: Placement) -> CadCandidate:
    """Return a placement as it is written."""
    return CadCandidate(
        model_id=placement.shape.model.id,
        joints=placement.shape.joints,
        scale=placement.scale,
        world_from_model=as_transform(transform_from(placement.rotation, placement.translation)),
        matching_error=placement.matching_error,
        alignment_error=placement.alignment_error,
    )


def scene_file(
    graph: ContactGraphFile,
    shortlists: dict[str, Shortlist],
    arranged: Arrangement,
    colors: dict[str, dict[str, tuple[int, int, int]]],
    selection: Selection,
    conflicts_after: int,
) -> CadSceneFile:
    """Return scene.json: the decision on every node. `colors`: node -> part -> colour in the map."""
    replacements = []
    for node in graph.nodes:
        if node.node_type == "layout":
            replacements.append(Replacement(node=node.id, decision="layout"))
        elif node.id in arranged.placements:
            entry, placement = shortlists[node.id], arranged.placements[node.id]
            chosen = candidate_record(placement)
            others = [candidate_record(p) for p in entry.placements if p.score != placement.score]
            first = candidate_record(entry.placements[0])
            replacements.append(
                Replacement(
                    node=node.id,
                    decision="cad",
                    reason=entry.reason,
                    chosen=chosen,
                    best_single=first,
                    part_colors=colors[node.id],
                    alternatives=tuple(others),
                    rejected=entry.rejected,
                )
            )
        elif node.id in shortlists:
            entry = shortlists[node.id]
            replacements.append(
                Replacement(node=node.id, decision="mesh", reason=entry.reason, rejected=entry.rejected)
            )
    return CadSceneFile(
        replacements=tuple(replacements),
        conflicts_before=selection.conflicts_before,
        conflicts_after=conflicts_after,
        iterations=selection.steps,
    )


def cad_graph(graph: ContactGraphFile, arranged: Arrangement, surfaces: dict[str, ModelSurface]) -> ContactGraphFile:
    """Return cg': the same nodes and relations, with model, pose, scale, joints, and the model's box and planes."""
    nodes: list[GraphNode] = []
    for node in graph.nodes:
        placement = arranged.placements.get(node.id)
        if placement is None:
            nodes.append(node)
            continue
        nodes.append(
            node.model_copy(
                update={
                    "box": placed_box(placement, surfaces[placement.shape.model.id]),
                    "planes": placed_planes(placement),
                    "model_id": placement.shape.model.id,
                    "world_from_model": as_transform(transform_from(placement.rotation, placement.translation)),
                    "scale": placement.scale,
                    "joints": dict(placement.shape.joints),
                }
            )
        )
    links = tuple(
        arranged.relations.get(link.target, link)
        if link.relation in TREE_RELATIONS
        else link.model_copy(update={"plane": None})  # it counted the planes that were seen, not the model's
        for link in graph.links
    )
    return graph.model_copy(update={"nodes": tuple(nodes), "links": links})


def copy_models(arranged: Arrangement, library: CadLibrary, context: Context) -> None:
    """Copy the folders of the chosen models, so that the scene needs no library."""
    for model_id in sorted({placement.shape.model.id for placement in arranged.placements.values()}):
        shutil.copytree(model_folder(library, model_id), context.output / "models" / model_id)


def copy_meshes(graph: ContactGraphFile, chosen: Collection[str], panoptic_map: PanopticMap, context: Context) -> None:
    """Copy the meshes of layout nodes and of objects that keep theirs: those that no model was `chosen` for."""
    for node in graph.nodes:
        if node.mesh is None or node.id in chosen:
            continue
        folder = context.output / ("layout" if node.node_type == "layout" else "meshes")
        folder.mkdir(exist_ok=True)
        source = panoptic_map.path(node.mesh)
        if not source.is_file():
            raise BadInput(f"{source}: mesh of node {node.id} is missing", hint="make the panoptic map again")
        shutil.copyfile(source, folder / f"{node.id}.ply")


def colors_of_parts(
    graph: ContactGraphFile, arranged: Arrangement, surfaces: dict[str, ModelSurface], panoptic_map: PanopticMap
) -> dict[str, dict[str, tuple[int, int, int]]]:
    """Return node -> part of its model -> colour that the map shows there."""
    found = {}
    for name, placement in arranged.placements.items():
        node = graph.node(name)
        if node.mesh is None:
            continue
        mesh = load_entity_mesh(panoptic_map.path(node.mesh))
        used = np.unique(mesh.faces)[::COLOR_STEP]
        normals = vertex_normals(mesh.vertices, mesh.faces)
        surface = surfaces[placement.shape.model.id]
        found[name] = part_colors(surface, placement, mesh.vertices[used], normals[used], mesh.colors[used])
    return found
