"""From panoptic entities to graph nodes: load meshes, filter, boxes, planes; suppose a floor that was not labelled."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.panoptic_map import Entity as MapEntity
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.graph.method import GraphMethod
from scenewright.stages.graph.nodes import THINNEST_DISTANCE, Entity, PlaneSearch, patch_from_fit, surface_planes
from scenewright.stages.graph.parameters import GraphParameters
from scenewright.stages.kit.digests import sha256_of_file
from scenewright.stages.kit.formats.entity_meshes import load_entity_mesh
from scenewright.stages.kit.geometry.boxes import convex_hull, minimum_box
from scenewright.stages.kit.geometry.planes import PlaneFit
from scenewright.stages.kit.geometry.point_clouds import sample_large_triangles, thin_to_grid, vertex_normals
from scenewright.stages.kit.stage import Context

SAMPLES, PLANES = 1, 2
"""Random streams."""

Kept = dict[str, Entity | str]
"""What entities came to, by a digest of all that decides it."""


def load_entities(
    panoptic_map: PanopticMap,
    method: GraphMethod,
    parameters: GraphParameters,
    context: Context,
    kept: Kept | None = None,
) -> tuple[list[Entity], dict[str, str]]:
    """Return the nodes in the order of their instance labels, and why entities were dropped (name -> reason).

    What `kept` holds of an earlier map is not looked at again, and what is new goes into it: most of a map stays as it
    is while the camera is elsewhere. Raises BadInput for an entity whose class is not in the vocabulary or whose mesh
    cannot be read.
    """
    entries = sorted(panoptic_map.info.entities, key=lambda entry: entry.instance)
    if len({entry.instance for entry in entries}) != len(entries):
        raise BadInput(f"{panoptic_map.root}: an instance label is used twice", hint="make the panoptic map again")
    entities: list[Entity] = []
    dropped: dict[str, str] = {}
    for entry in context.progress.track(entries, description="entities"):
        entity = _load_once(panoptic_map, entry, method, parameters, context, kept)
        if isinstance(entity, str):
            dropped[f"{entry.class_name}_{entry.instance}"] = entity
        else:
            entities.append(entity)
    for name, whole_name in method.fragments(entities).items():
        dropped[name] = f"a piece of {whole_name}"
    return [entity for entity in entities if entity.name not in dropped], dropped


def _load_once(
    panoptic_map: PanopticMap,
    entry: MapEntity,
    method: GraphMethod,
    parameters: GraphParameters,
    context: Context,
    kept: Kept | None,
) -> Entity | str:
    path = panoptic_map.path(entry.mesh)
    if kept is None or not path.is_file():
        return load_entity(panoptic_map, entry, method, parameters, context)
    key = f"{entry.class_name}_{entry.instance} {sha256_of_file(path)}"
    if key not in kept:
        kept[key] = load_entity(panoptic_map, entry, method, parameters, context)
    entity = kept[key]
    return entity if isinstance(entity, str) else replace(entity, confidence=entry.confidence, mesh=entry.mesh)


def load_entity(
    panoptic_map: PanopticMap, entry: MapEntity, method: GraphMethod, parameters: GraphParameters, context: Context
) -> Entity | str:
    """Return one node <o, c, M, B, Pi>, or the reason why it is dropped."""
    load_vocabulary().by_name(entry.class_name)  # of a class that is not in it nothing is dropped in silence
    if entry.class_name in parameters.dropped_classes:
        return f"class {entry.class_name} is dropped"
    if entry.triangles == 0:
        return "no triangles"
    points, normals = oriented_points(panoptic_map, entry.mesh, entry.instance, parameters, context)
    if len(points) < parameters.minimum_points:
        return f"{len(points)} points on the grid, fewer than {parameters.minimum_points}"
    return entity_of(entry, points, normals, method, parameters, context.random(PLANES, entry.instance))


def entity_of(
    entry: MapEntity,
    points: np.ndarray,
    normals: np.ndarray,
    method: GraphMethod,
    parameters: GraphParameters,
    random: np.random.Generator,
) -> Entity | str:
    """Return the node of an entity's points (N, 3) [m] and unit normals (N, 3) on the grid, or why it is dropped."""
    semantic = load_vocabulary().by_name(entry.class_name)
    distance = parameters.plane_distance
    if semantic.is_layout:
        # Walls and floors come in pieces by nature.
        box, in_box = minimum_box(points), np.ones(len(points), dtype=bool)
    else:
        box, in_box = method.box(points, normals, entry.class_name)
        distance = max(min(distance, min(box.size) / 4), THINNEST_DISTANCE)
    diagonal = float(np.linalg.norm(box.size))
    if diagonal < parameters.minimum_diagonal:
        return f"diagonal {diagonal:.3f} m is below {parameters.minimum_diagonal} m"
    search = PlaneSearch(
        distance=distance,
        iterations=parameters.plane_iterations,
        normal_weight=parameters.normal_weight,
        plane_share=parameters.plane_share,
        horizontal_threshold=parameters.horizontal_threshold,
        spacing=parameters.point_spacing,
        small=method.small_supports(semantic),
    )
    return Entity(
        name=f"{entry.class_name}_{entry.instance}",
        instance=entry.instance,
        class_name=entry.class_name,
        node_type=semantic.node,
        movable=semantic.movable,
        mesh=entry.mesh,
        confidence=entry.confidence,
        points=points[in_box],
        box=box,
        patches=surface_planes(points[in_box], normals[in_box], search, random),
    )


def oriented_points(
    panoptic_map: PanopticMap, mesh: str, stream: int, parameters: GraphParameters, context: Context
) -> tuple[np.ndarray, np.ndarray]:
    """Return points (N, 3) and unit normals (N, 3) of a mesh file of the map, thinned to the grid."""
    loaded = load_entity_mesh(panoptic_map.path(mesh))
    used = np.unique(loaded.faces)
    normals = vertex_normals(loaded.vertices, loaded.faces)
    extra, extra_normals = sample_large_triangles(
        loaded.vertices, loaded.faces, parameters.point_spacing, context.random(SAMPLES, stream)
    )
    points = np.concatenate([loaded.vertices[used], extra])
    return thin_to_grid(points, np.concatenate([normals[used], extra_normals]), parameters.point_spacing)


def suppose_floor(
    panoptic_map: PanopticMap, entities: list[Entity], parameters: GraphParameters, context: Context
) -> Entity | None:
    """Return a floor node made from surface at z = 0 that belongs to no node, or None when the map shows too little.

    Ingest puts the floor at z = 0 (Gravity). A floor that the segmentation missed is still there in the whole mesh.
    """
    path = panoptic_map.path("mesh.ply")
    if not path.is_file():
        return None
    try:
        points, normals = oriented_points(panoptic_map, "mesh.ply", 0, parameters, context)
    except BadInput:  # a map of nothing has no triangles
        return None
    level = (np.abs(points[:, 2]) <= parameters.plane_distance) & (normals[:, 2] >= -parameters.horizontal_threshold)
    for entity in entities:
        if entity.node_type != "layout" and len(entity.points) and entity.bottom < parameters.plane_distance:
            low, high = entity.points.min(axis=0) - 0.02, entity.points.max(axis=0) + 0.02
            level &= ~np.all((points >= low) & (points <= high), axis=1)
    if np.count_nonzero(level) * parameters.point_spacing**2 < parameters.minimum_floor_area:
        return None
    floor = points[level]
    fit = PlaneFit(np.array([0.0, 0.0, 1.0]), -float(np.median(floor[:, 2])), np.arange(len(floor)))
    instance = max((entry.instance for entry in panoptic_map.info.entities), default=0) + 1
    if len(convex_hull(floor[:, :2])) < 3:
        return None
    patch = patch_from_fit(floor, fit, parameters.horizontal_threshold)
    return Entity(
        name=f"floor_{instance}",
        instance=instance,
        class_name="floor",
        node_type="layout",
        movable=False,
        mesh=None,
        confidence=0.5,
        points=floor,
        box=minimum_box(floor),
        patches=(patch,),
    )
