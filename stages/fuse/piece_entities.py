"""Pieces of unnamed surface as entities of the map, beside what masks named and in places where they name nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scenewright.stages.fuse.extraction import ExtractedEntity, LabelledSurface
from scenewright.stages.fuse.pieces import Cloud, grown_things, pieces_beside
from scenewright.stages.fuse.surface import Surface
from scenewright.stages.fuse.unnamed_pieces import CEILING, FLOOR, topped_parts, unnamed_pieces
from scenewright.stages.fuse.walls import of_walls
from scenewright.stages.kit.formats.map_files import cut_mesh, face_labels
from scenewright.stages.kit.geometry.point_clouds import vertex_normals


@dataclass(frozen=True)
class Classes:
    """Ids of the classes that geometry can tell."""

    floor: int
    wall: int
    ceiling: int
    unnamed: int
    things: frozenset[int] = frozenset()
    tables: frozenset[int] = frozenset()
    """Of things that are a level top on legs."""


def with_pieces(surface, entities, labelled, classes, scene, layout, told, *, voxel, minimum_area):
    vertices = scene.vertices - [0.0, 0.0, layout.floor or 0.0]
    room = np.isin(labelled.class_id, (classes.floor, classes.wall, classes.ceiling)) | (layout.owner > 0) & (labelled.class_id == 0)
    thing = np.where(np.isin(labelled.class_id, sorted(classes.things)), labelled.instance, 0)
    room |= (labelled.instance > 0) & (thing == 0)
    cloud = Cloud(vertices, scene.normals, voxel)
    grown = grown_things(cloud, thing, room, minimum_area)
    told = np.where(grown != thing, 1.0, told)
    piece, thing_of = pieces_beside(cloud, grown, room, told, minimum_area)
    instance = np.where(room, labelled.instance, np.where(piece > 0, 0, thing_of))
    named, labelled = _cut_anew(surface, entities, labelled, instance.astype(np.int32))
    return _with_pieces(surface, named, labelled, piece, classes.unnamed)


def with_unnamed_pieces(
    surface: Surface,
    entities: Sequence[ExtractedEntity],
    labelled: LabelledSurface,
    classes: Classes,
    *,
    voxel: float,
    minimum_area: float,
    told: np.ndarray | None = None,
) -> tuple[list[ExtractedEntity], LabelledSurface]:
    """Return the entities and labels with the pieces of unnamed surface among them; as they are without a floor.

    `voxel` [m], `minimum_area` [m^2] of a piece, `told` (V,) as in `unnamed_pieces`. What masks took for a wall and is
    none is unnamed too. Nobody voted for a piece: it has no segments, and no confidence.
    """
    vertices = _over_floor(surface, labelled, classes)
    if vertices is None:
        return list(entities), labelled
    normals = vertex_normals(vertices, surface.faces)
    no_wall = np.zeros(len(vertices), bool)
    room = np.isin(labelled.class_id, (classes.floor, classes.wall, classes.ceiling))
    walls = room
    piece, instance = unnamed_pieces(
        vertices,
        normals,
        np.where(no_wall, 0, labelled.instance),
        room | walls,
        voxel=voxel,
        minimum_area=minimum_area,
        topped={e.instance for e in entities if e.class_id in classes.things},
        tables={e.instance for e in entities if e.class_id in classes.tables},
        told=told,
    )
    named_entities, labelled = _cut_anew(surface, entities, labelled, instance)
    return _with_pieces(surface, named_entities, labelled, piece, classes.unnamed)


def by_geometry(
    surface: Surface,
    entities: Sequence[ExtractedEntity],
    labelled: LabelledSurface,
    classes: Classes,
    *,
    voxel: float,
    minimum_area: float,
    sure: frozenset[int] = frozenset(),
) -> tuple[list[ExtractedEntity], LabelledSurface]:
    """Return entities and labels in a place where masks name nothing; as they are without a floor.

    Walls are what geometry says but for the instances that masks are `sure` to be things, and things (all of the class
    `unnamed` here) are but proposals to it. The largest piece of what was proposed as one thing has its segments,
    others have none.
    """
    vertices = _over_floor(surface, labelled, classes)
    if vertices is None:
        return list(entities), labelled
    normals = vertex_normals(vertices, surface.faces)
    class_id, instance = labelled.class_id.copy(), labelled.instance.copy()
    floor_or_ceiling = (class_id == classes.floor) | ((class_id == classes.ceiling) & (vertices[:, 2] > CEILING))
    walls = of_walls(vertices, normals, ~floor_or_ceiling & (vertices[:, 2] > FLOOR), voxel)
    proposed = np.where(class_id == classes.unnamed, instance, 0)
    walls &= ~np.isin(proposed, sorted(sure))
    piece, _ = unnamed_pieces(
        vertices,
        normals,
        np.zeros_like(instance),
        floor_or_ceiling | walls,
        voxel=voxel,
        minimum_area=minimum_area,
        proposed=proposed,
        sure=sure,
    )
    class_id[proposed > 0], instance[proposed > 0] = 0, 0
    wall = next((e.instance for e in entities if e.class_id == classes.wall), 1 + int(labelled.instance.max(initial=0)))
    class_id[walls], instance[walls] = classes.wall, wall
    class_id[piece > 0], instance[piece > 0] = 0, 0
    room = {e.instance: e for e in entities if e.class_id != classes.unnamed}
    if walls.any() and wall not in room:
        room[wall] = ExtractedEntity(wall, classes.wall, (), cut_mesh(surface, np.zeros(0, int)), 0.0, 0)
    of_face = face_labels(instance, surface.faces)
    cut = [replace(e, mesh=cut_mesh(surface, np.flatnonzero(of_face == number))) for number, e in sorted(room.items())]
    room_entities = [e for e in cut if len(e.mesh.faces)]
    lost = ~np.isin(instance, [e.instance for e in room_entities])
    class_id[lost], instance[lost] = 0, 0
    all_entities, result = _with_pieces(
        surface, room_entities, LabelledSurface(labelled.segment, class_id, instance), piece, classes.unnamed
    )
    unused = {e.instance: e for e in entities if e.class_id == classes.unnamed}
    for index in range(len(room_entities), len(all_entities)):  # the largest piece first
        most = int(np.bincount(proposed[result.instance == all_entities[index].instance]).argmax())
        if most in unused:
            all_entities[index] = replace(
                unused.pop(most), instance=all_entities[index].instance, mesh=all_entities[index].mesh
            )
    return all_entities, result


def _over_floor(surface: Surface, labelled: LabelledSurface, classes: Classes) -> np.ndarray | None:
    """Return the vertices (V, 3) [m] with the floor at 0, None where there is none."""
    level = surface.vertices[labelled.class_id == classes.floor, 2]
    return surface.vertices - [0.0, 0.0, float(np.median(level))] if len(level) else None


def _no_wall(vertices: np.ndarray, normals: np.ndarray, wall_mask: np.ndarray, voxel: float) -> np.ndarray:
    """Return which of the surface (V,) that masks called a wall (`wall_mask`) is none: what stands off every wall and
    has a level top, a desk that a mask mistook."""
    away = np.flatnonzero(wall_mask & (vertices[:, 2] > FLOOR) & ~of_walls(vertices, normals, wall_mask, voxel))
    result = np.zeros(len(vertices), bool)
    result[away[topped_parts(vertices[away], normals[away], voxel)]] = True
    return result


def _cut_anew(
    surface: Surface, entities: Sequence[ExtractedEntity], labelled: LabelledSurface, instance: np.ndarray
) -> tuple[list[ExtractedEntity], LabelledSurface]:
    """Return entities and labels where things have the surface that `instance` (V,) says, without those that have none
    left."""
    changed = instance != labelled.instance
    touched = set(np.union1d(instance[changed], labelled.instance[changed]).tolist())
    of_face, class_of = face_labels(instance, surface.faces), {e.instance: e.class_id for e in entities}
    nonempty = []
    for entity in entities:
        if entity.instance in touched:
            entity = replace(entity, mesh=cut_mesh(surface, np.flatnonzero(of_face == entity.instance)))
        if len(entity.mesh.faces):
            nonempty.append(entity)
    class_id = labelled.class_id.copy()
    class_id[changed] = [class_of.get(number, 0) for number in instance[changed].tolist()]
    lost = np.isin(instance, sorted(set(class_of) - {e.instance for e in nonempty}))
    return nonempty, LabelledSurface(labelled.segment, np.where(lost, 0, class_id), np.where(lost, 0, instance))


def _with_pieces(
    surface: Surface, entities: Sequence[ExtractedEntity], labelled: LabelledSurface, piece: np.ndarray, unnamed: int
) -> tuple[list[ExtractedEntity], LabelledSurface]:
    """Return entities and labels with those of every piece (V,) after them, by its number."""
    of_face, first = face_labels(piece, surface.faces), 1 + int(labelled.instance.max(initial=0))
    all_entities, number = list(entities), np.zeros(int(piece.max(initial=0)) + 1, np.int32)
    for label in range(1, len(number)):
        mesh = cut_mesh(surface, np.flatnonzero(of_face == label))
        if len(mesh.faces):
            number[label] = first + label
            all_entities.append(ExtractedEntity(first + label, unnamed, (), mesh, 0.0, 0))
    new = number[piece] > 0
    instance = np.where(new, number[piece], labelled.instance).astype(np.int32)
    class_id = np.where(new, np.int32(unnamed), labelled.class_id)
    return all_entities, LabelledSurface(labelled.segment, class_id, instance)
