"""Wiring of `cad`: contact graph, map and library in, functionally equivalent scene cg' out (Han 2024, section 2.4)."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scenewright.schemas.articulations import Articulation, Articulations
from scenewright.schemas.cad_library import CadLibrary
from scenewright.schemas.cad_scene import SURROUNDINGS, UNEXPLAINED, CadScene, JointEvidence, ShellFile
from scenewright.schemas.contact_graph import ContactGraph, ContactGraphFile
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.cad.arranging import Arrangement
from scenewright.stages.cad.building_in import colliding_built_ins, yielded
from scenewright.stages.cad.candidates import Shortlist, models_for, object_points
from scenewright.stages.cad.choosing import adjust, select
from scenewright.stages.cad.coloring import part_colors
from scenewright.stages.cad.completing import completed, hulls_of
from scenewright.stages.cad.conflicts import placed_pieces
from scenewright.stages.cad.explained import shares_of
from scenewright.stages.cad.families.stand_in import inferred_of
from scenewright.stages.cad.free_space import FreeSpace
from scenewright.stages.cad.giving_back import given_back, unexplaining
from scenewright.stages.cad.joint_evidence import Looked, joint_evidence
from scenewright.stages.cad.made_models import is_built_in, is_of_family
from scenewright.stages.cad.method import CadMethod
from scenewright.stages.cad.model_surfaces import ModelSurface
from scenewright.stages.cad.obstacles import floor_levels, obstacles_of
from scenewright.stages.cad.ours import Ours
from scenewright.stages.cad.parameters import CadParameters
from scenewright.stages.cad.recognition import named_by_people, renamed, with_carriers
from scenewright.stages.cad.records import cad_graph, scene_file
from scenewright.stages.cad.room_light import gain_by_walls, relight, relit
from scenewright.stages.cad.scene_explanation import explained_within, explanation_of
from scenewright.stages.cad.shapes import Placement
from scenewright.stages.cad.shell import drawn, shell_file, shell_of
from scenewright.stages.cad.stretching import source_of, write_stretched
from scenewright.stages.cad.surroundings import Piece, footing
from scenewright.stages.cad.surroundings_files import rounded_area, surroundings_of, write_surface
from scenewright.stages.cad.target import Surroundings, Target
from scenewright.stages.cad.thesis import Thesis
from scenewright.stages.cad.tries import Thing, load_surfaces, sought
from scenewright.stages.kit.formats.cad_models import model_folder
from scenewright.stages.kit.formats.entity_meshes import EntityMesh, load_entity_mesh
from scenewright.stages.kit.geometry.convex_solids import Solid, convex_solid
from scenewright.stages.kit.geometry.point_clouds import sample_large_triangles, vertex_normals
from scenewright.stages.kit.stage import Context

VERTICES, CONFLICTS, SAMPLES = 1, 2, 3
"""Random streams."""
COLOR_STEP = 4
"""Every so many vertices of a mesh say what colour it has."""
METHODS: dict[str, Callable[[CadParameters], CadMethod]] = {"ours": Ours, "thesis": Thesis}


def run(
    contact_graph: ContactGraph,
    panoptic_map: PanopticMap,
    library: CadLibrary,
    articulations: Articulations | None = None,
    *,
    parameters: CadParameters,
    context: Context,
) -> CadScene:
    """Replace every object by the CAD model that fits it best, such that the scene as a whole can exist.

    `articulations`: what the log shows in two states, the strongest ground of a joint."""
    if parameters.minimum_scale > parameters.maximum_scale:
        raise UsageError("minimum_scale is larger than maximum_scale", hint="lower the one or raise the other")
    method = METHODS[parameters.method](parameters)
    surfaces: dict[str, ModelSurface] = {}
    with context.progress.step("candidates"):
        moved = () if articulations is None else articulations.info.articulations
        graph, within = contact_graph.info, explained_within(contact_graph.info, panoptic_map)
        shortlists = find_candidates(graph, panoptic_map, library, surfaces, method, context, within, moved)
    return choose_and_write(graph, panoptic_map, library, shortlists, surfaces, method, context, within, moved)


def choose_and_write(
    graph: ContactGraphFile,
    panoptic_map: PanopticMap,
    library: CadLibrary,
    shortlists: dict[str, Shortlist],
    surfaces: dict[str, ModelSurface],
    method: CadMethod,
    context: Context,
    within: float,
    moved: Sequence[Articulation] = (),
) -> CadScene:
    """Choose among the candidates of all objects, arrange the scene and write it (section 2.4.4). `within`: surface so
    near is explained [m]; `moved`: what the log shows in two states."""
    as_seen = renamed(graph, shortlists)
    first = {name: entry.placements[0] for name, entry in shortlists.items() if entry.placements}
    graph = with_carriers(as_seen, shortlists, first)
    free_space, corrects = method.free_space(panoptic_map), method.corrects
    with context.progress.step("shell"):
        shell = write_shell(graph, panoptic_map, free_space, context) if corrects and method.parameters.shell else None
    with context.progress.step("global check"):
        chosen, selection = select(graph, shortlists, surfaces, method, context.random(CONFLICTS))
        obstacles, solids = meshes_that_stand(graph, chosen, shell, panoptic_map, context)
        if yielding := colliding_built_ins(graph, chosen, surfaces, solids, method.parameters):
            chosen = {name: placement for name, placement in chosen.items() if name not in yielding}
            shortlists = {name: yielded(entry) if name in yielding else entry for name, entry in shortlists.items()}
            obstacles, solids = meshes_that_stand(graph, chosen, shell, panoptic_map, context)
        graph = with_carriers(as_seen, shortlists, chosen)
        levels = floor_levels(graph, context.output / "layout")
        arranged, conflicts_after = adjust(graph, chosen, shortlists, surfaces, solids, levels, method)
        while off := unexplaining(graph, panoptic_map, arranged, chosen, surfaces, method.least_explained, within):
            shortlists |= {
                name: given_back(shortlists[name], chosen[name].shape.model.id, why) for name, why in off.items()
            }
            chosen |= {name: shortlists[name].placements[0] for name in off if shortlists[name].placements}
            chosen = {name: placement for name, placement in chosen.items() if shortlists[name].placements}
            graph = with_carriers(as_seen, shortlists, chosen)
            obstacles, solids = meshes_that_stand(graph, chosen, shell, panoptic_map, context)
            arranged, conflicts_after = adjust(graph, chosen, shortlists, surfaces, solids, levels, method)
        move_meshes(arranged, context.output / "meshes")
    built = [name for name, placement in arranged.placements.items() if is_built_in(placement.shape.model)]
    nameless: EntityMesh | None = None
    still, final = np.zeros(3), cad_graph(graph, arranged, surfaces)
    standing = {
        name: [(vertices + arranged.shifts.get(name, still), faces) for vertices, faces in some]
        for name, some in obstacles.items()
    }
    standing |= {name: placed_pieces(p, surfaces[p.shape.model.id]) for name, p in arranged.placements.items()}
    with context.progress.step("complete what would not stand"):
        inferred = completed(final, context.output / "meshes", standing, levels, arranged.shifts, free_space)
    if corrects and method.parameters.surroundings:
        with context.progress.step("surroundings"):
            pieces = [piece for some in standing.values() for piece in some]
            pieces += [footing(standing[name]) for name in arranged.placements]
            pieces += [pair for added in inferred.values() for pair in hulls_of(added)]
            unmoving = [graph.node(name).instance for name in built if not arranged.placements[name].shape.model.joints]
            nameless = surroundings_of(panoptic_map, pieces, unmoving, method.parameters)
    with context.progress.step("writing"):
        if nameless is not None:
            write_surface(nameless, context.output / "meshes" / f"{SURROUNDINGS}.ply")
        gain = gain_of_light(graph, panoptic_map) if corrects else 1.0
        colors = colors_of_parts(graph, arranged, surfaces, panoptic_map, gain)
        evidence = grounds_of_joints(graph, arranged, shortlists, surfaces, panoptic_map, moved, method)
        explanation = explanation_of(graph, panoptic_map, arranged, shortlists, surfaces, context.output, within)
        if explanation.rest is not None:
            write_surface(explanation.rest, context.output / UNEXPLAINED)
        placed = ((name, p, surfaces[p.shape.model.id]) for name, p in arranged.placements.items())
        unseen = {name: added for name, p, surface in placed if (added := inferred_of(p, surface)) is not None}
        scene = scene_file(
            graph,
            final,
            shortlists,
            arranged,
            colors,
            evidence,
            inferred | unseen,
            explanation,
            selection,
            conflicts_after,
            gain,
        )
        scene.write(context.output / "scene.json")
        final.write(context.output / "graph.json")
        copy_models(arranged, library, context)
        if gain != 1.0:
            folders = ("meshes", "layout", "shell")
            files = [file for folder in folders for file in sorted((context.output / folder).glob("*.ply"))]
            relight([*files, *context.output.glob(UNEXPLAINED)], gain)

    of_families = sum(is_of_family(placement.shape.model) for placement in arranged.placements.values())
    decisions = [replacement.decision for replacement in scene.replacements]
    errors = [placement.alignment_error for placement in arranged.placements.values()]
    summary = {
        "cad": decisions.count("cad") - len(built) - of_families,
        "of_families": of_families,
        "built_in": len(built),
        "mesh": decisions.count("mesh"),
        "layout": decisions.count("layout"),
        "completed": sum(bool(added.pieces) for added in inferred.values()),
        "conflicts_before": scene.conflicts_before,
        "conflicts_after": scene.conflicts_after,
        "surroundings_m2": rounded_area(nameless),
        **shares_of(explanation.things),
        "unexplained_m2": rounded_area(explanation.rest),
        "joints": sum(len(joint_grounds) for joint_grounds in evidence.values()),
        "joints_moved": sum(
            "moved" in entry.grounds for joint_grounds in evidence.values() for entry in joint_grounds.values()
        ),
        "joints_held": sum(
            not entry.grounds for joint_grounds in evidence.values() for entry in joint_grounds.values()
        ),
        "alignment_error_median": round(float(np.median(errors)), 4) if errors else None,
    }
    return CadScene(context.output, outcome="ok" if decisions else "empty", summary=summary)


def find_candidates(
    graph: ContactGraphFile,
    panoptic_map: PanopticMap,
    library: CadLibrary,
    surfaces: dict[str, ModelSurface],
    method: CadMethod,
    context: Context,
    within: float,
    moved: Sequence[Articulation] = (),
) -> dict[str, Shortlist]:
    """Return the shortlist of every object; surfaces of the models that were needed are added to `surfaces`. Models of
    built-ins are written into the output. `within`: surface so near is explained [m]; `moved`: what the log shows in
    two states."""
    objects = [node for node in graph.nodes if node.node_type in ("rigid", "articulated")]
    free_space, named_by_hand = method.free_space(panoptic_map), named_by_people(panoptic_map)
    because = panoptic_map.because
    said = {} if because is None else {entity.instance: entity.said for entity in because.entities}
    shortlists: dict[str, Shortlist] = {}
    for node in context.progress.track(objects, description="objects"):
        if node.mesh is None:
            shortlists[node.id] = Shortlist(node, (), {}, "the map has no mesh of it")
            continue
        suitable = models_for(node.class_name, library.info.models)
        load_surfaces(library, suitable, surfaces)
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
            method.parameters.vertices,
            context.random(VERTICES, node.instance),
        )
        target = Target(points, facing, Surroundings(node, graph, free_space, within), suitable, surfaces)
        words, by_hand = said.get(node.instance, {}), node.id in named_by_hand
        thing = Thing(target, mesh, library, moved, words, by_hand, context.output / "models")
        shortlists[node.id] = sought(thing, method)
    return shortlists


def copy_models(arranged: Arrangement, library: CadLibrary, context: Context) -> None:
    """Copy the folders of the chosen models, so that the scene needs no library; built-ins that lost their place go."""
    models = {placement.shape.model.id: placement.shape.model for placement in arranged.placements.values()}
    folder = context.output / "models"
    for written in sorted(folder.iterdir()) if folder.is_dir() else ():
        if written.name not in models:
            shutil.rmtree(written)
    for model_id, model in sorted(models.items()):
        source = source_of(model)
        if source is not None:
            write_stretched(model, model_folder(library, source), folder / model_id)
        elif not is_built_in(model) and not is_of_family(model):
            shutil.copytree(model_folder(library, model_id), folder / model_id)


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


def write_shell(
    graph: ContactGraphFile, panoptic_map: PanopticMap, free_space: FreeSpace, context: Context
) -> ShellFile | None:
    """Write the plates that close the room (shell.json, shell/<node>.ply) and return them; None without a layout."""
    if panoptic_map.layout is None:
        return None
    bounds = [node for node in graph.nodes if node.node_type == "layout" and node.mesh is not None]
    meshes = {node.id: load_entity_mesh(panoptic_map.path(str(node.mesh))) for node in bounds}
    panels = shell_of(graph, panoptic_map.layout, meshes, free_space)
    for name, mesh in meshes.items():
        own = [panel for panel in panels if panel.node == name]
        if own:
            write_surface(drawn(own, mesh), context.output / "shell" / f"{name}.ply")
    shell = shell_file(panels, meshes)
    shell.write(context.output / "shell.json")
    return shell


def meshes_that_stand(
    graph: ContactGraphFile,
    chosen: Collection[str],
    shell: ShellFile | None,
    panoptic_map: PanopticMap,
    context: Context,
) -> tuple[dict[str, list[Piece]], dict[str, Solid]]:
    """Copy layout and the meshes of what no model was `chosen` for; return their convex pieces, those of the `shell`
    where there is one, and these as solids."""
    copy_meshes(graph, chosen, panoptic_map, context)
    pieces = obstacles_of(graph, context.output / "layout", context.output / "meshes", shell)
    return pieces, {name: convex_solid(some) for name, some in pieces.items()}


def move_meshes(arranged: Arrangement, folder: Path) -> None:
    """Put the meshes (`<node>.ply`) of things that keep theirs where they went."""
    for name, shift in arranged.shifts.items():
        if shift.any():
            mesh = load_entity_mesh(folder / f"{name}.ply")
            write_surface(replace(mesh, vertices=mesh.vertices + shift), folder / f"{name}.ply")


def gain_of_light(graph: ContactGraphFile, panoptic_map: PanopticMap) -> float:
    """Return by how much linear light is multiplied so that walls reflect what walls do."""
    none = np.zeros((0, 3), np.uint8)
    seen = [(node, load_entity_mesh(panoptic_map.path(node.mesh)).colors) for node in graph.nodes if node.mesh]
    walls = [colors for node, colors in seen if node.class_name == "wall"]
    return gain_by_walls(np.concatenate([none, *walls]), np.concatenate([none, *(colors for _, colors in seen)]))


def colors_of_parts(
    graph: ContactGraphFile,
    arranged: Arrangement,
    surfaces: dict[str, ModelSurface],
    panoptic_map: PanopticMap,
    gain: float,
) -> dict[str, dict[str, tuple[int, int, int]]]:
    """Return node -> part of its model -> colour that the map shows there, under `gain` times the light."""
    colors = {}
    for name, placement in arranged.placements.items():
        node = graph.node(name)
        if node.mesh is None:
            continue
        mesh = load_entity_mesh(panoptic_map.path(node.mesh))
        used = np.unique(mesh.faces)[::COLOR_STEP]
        normals = vertex_normals(mesh.vertices, mesh.faces)
        surface = surfaces[placement.shape.model.id]
        seen = relit(mesh.colors[used], gain)
        colors[name] = part_colors(surface, placement, mesh.vertices[used], normals[used], seen)
    return colors


def grounds_of_joints(
    graph: ContactGraphFile,
    arranged: Arrangement,
    shortlists: dict[str, Shortlist],
    surfaces: dict[str, ModelSurface],
    panoptic_map: PanopticMap,
    moved: Sequence[Articulation],
    method: CadMethod,
) -> dict[str, dict[str, JointEvidence]]:
    """Return node -> joint -> why it is believed, for every placed model with joints; nothing where the method does
    not ask. What the map shows is compared with the model where it fits the map, not where the arrangement moved it.
    Raises UsageError for a vouched name that is neither a node nor a class."""
    vouched = set(method.parameters.vouched)
    names = {node.id for node in graph.nodes} | {entry.name for entry in load_vocabulary().classes}
    if unknown := sorted(vouched - names):
        raise UsageError(f"--vouched {unknown[0]}: no thing of the contact graph, and no class", hint="see graph.json")
    evidence = {}
    for name, placement in arranged.placements.items():
        node = graph.node(name)
        if node.mesh is None or not placement.shape.model.joints or not method.corrects:
            continue
        mesh = load_entity_mesh(panoptic_map.path(node.mesh))
        looked = Looked(mesh.vertices, vertex_normals(mesh.vertices, mesh.faces), mesh.colors)
        known_to_move = bool(vouched & {name, node.class_name})
        surface = surfaces[placement.shape.model.id]
        fitted = as_fitted(placement, shortlists[name].placements)
        evidence[name] = joint_evidence(surface, fitted, looked, vouched=known_to_move, articulations=moved)
    return evidence


def as_fitted(placement: Placement, candidates: Sequence[Placement]) -> Placement:
    """Return an arranged placement where it was before it was moved: at the candidate whose model, turn and size it
    has. As it is where there is none (it was made smaller to have room)."""
    for candidate in candidates:
        same = candidate.shape.model.id == placement.shape.model.id and candidate.scale == placement.scale
        if same and np.array_equal(candidate.rotation, placement.rotation):
            return replace(placement, translation=candidate.translation)
    return placement
