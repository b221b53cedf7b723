"""From the labelled surface to one mesh per panoptic entity (Han 2024, section 2.3.4, eq. 2.6)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from stages.fuse.counts import TripleCounts
from stages.fuse.surface import Surface
from stages.kit.formats.ply_files import ColoredMesh


@dataclass(frozen=True)
class ExtractedEntity:
    """One entity: its labels, its mesh, and how well the counts agree on it."""

    instance: int
    class_id: int
    segments: tuple[int, ...]
    mesh: ColoredMesh
    confidence: float
    observations: int


@dataclass(frozen=True)
class LabelledSurface:
    """Per vertex of the map's surface (V,) int32: merged segment label, class id, instance; 0 = unlabelled."""

    segment: np.ndarray
    class_id: np.ndarray
    instance: np.ndarray


def label_of_segments(counts: TripleCounts, largest_segment: int) -> tuple[np.ndarray, np.ndarray]:
    """Return class id and instance (L + 1,) int32 of every segment label 0 .. L (eq. 2.6); 0 where none was counted."""
    class_ids = np.zeros(largest_segment + 1, dtype=np.int32)
    instances = np.zeros(largest_segment + 1, dtype=np.int32)
    for segment in counts.by_segment:
        best = counts.best(segment)
        if best is not None:
            class_ids[segment], instances[segment] = best
    return class_ids, instances


def confidence_of(counts: TripleCounts, segments: tuple[int, ...], class_id: int, instance: int) -> float:
    """Return the share of the counts on an entity's segment labels that agrees with its class and instance."""
    rows = [counts.by_segment.get(segment, {}) for segment in segments]
    total = sum(sum(row.values()) for row in rows)
    return sum(row.get((class_id, instance), 0) for row in rows) / total if total else 0.0


def _edges(faces: np.ndarray) -> np.ndarray:
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    return np.unique(np.sort(edges, axis=1), axis=0)


def absorb_specks(
    labels: np.ndarray, faces: np.ndarray, *, whole: frozenset[int], minimum_size: int, minimum_share: float
) -> np.ndarray:
    """Return labels (V,) in which small connected parts have taken the label of most of their neighbours.

    A part is a set of vertices of one label > 0 that triangles (F, 3) connect. It is small under `minimum_size`
    vertices, or, unless its label is in `whole`, under `minimum_share` of the label's largest part. Parts without
    neighbours become 0. Ties go to the smaller label.
    """
    if len(faces) == 0:
        return np.zeros_like(labels)
    edges = _edges(faces)
    first, second = labels[edges[:, 0]], labels[edges[:, 1]]
    inside = edges[first == second]
    graph = coo_matrix((np.ones(len(inside), dtype=np.int8), (inside[:, 0], inside[:, 1])), shape=(len(labels),) * 2)
    count, part = connected_components(graph, directed=False)
    sizes = np.bincount(part, minlength=count)
    label_of_part = np.zeros(count, dtype=labels.dtype)
    label_of_part[part] = labels
    largest = np.zeros(int(labels.max()) + 1, dtype=np.int64)
    np.maximum.at(largest, label_of_part, sizes)
    divisible = ~np.isin(label_of_part, sorted(whole))
    small = (sizes < minimum_size) | (divisible & (sizes < minimum_share * largest[label_of_part]))
    small &= label_of_part > 0
    # Votes of the neighbours across the border, both ways.
    border = edges[first != second]
    border = np.concatenate([border, border[:, ::-1]])
    border = border[small[part[border[:, 0]]] & ~small[part[border[:, 1]]]]
    replacement = np.zeros(count, dtype=labels.dtype)
    if len(border):
        width = int(labels.max()) + 1
        keys, votes = np.unique(part[border[:, 0]].astype(np.int64) * width + labels[border[:, 1]], return_counts=True)
        order = np.lexsort((-keys, votes))
        replacement[keys[order] // width] = (keys % width)[order]
    result = labels.copy()
    result[small[part]] = replacement[part][small[part]]
    return result


def face_labels(labels: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the label (F,) of every face: that of two of its vertices, or of the first when all three differ."""
    corners = labels[faces]
    return np.where(corners[:, 1] == corners[:, 2], corners[:, 1], corners[:, 0])


def cut_mesh(surface: Surface, chosen: np.ndarray) -> ColoredMesh:
    """Return the chosen faces (F,) bool as a mesh of their own; vertices keep their order."""
    faces = surface.faces[chosen]
    used = np.unique(faces)
    return ColoredMesh(
        surface.vertices[used], np.searchsorted(used, faces).astype(np.int32).reshape(-1, 3), surface.colors[used]
    )


def extract_entities(
    surface: Surface,
    segment: np.ndarray,
    counts: TripleCounts,
    seen_in: dict[int, int],
    things: frozenset[int],
    *,
    minimum_voxels: int,
    minimum_observations: int,
    speck_share: float,
) -> tuple[list[ExtractedEntity], LabelledSurface]:
    """Return the entities, ascending by instance, and the labels of the whole surface.

    segment (V,) int32: merged segment label of every vertex. `seen_in`: frames that voted for an instance, as bits.
    A vertex stands for one surface voxel: entities under `minimum_voxels` vertices, or under `minimum_observations`
    frames, are dropped, and their vertices are unlabelled.
    """
    largest = max([0, *counts.by_segment, int(segment.max(initial=0))])
    class_of, instance_of = label_of_segments(counts, largest)
    class_of_instance = {int(p): int(c) for c, p in zip(class_of, instance_of, strict=True) if p > 0}
    stuff = frozenset(p for p, c in class_of_instance.items() if c not in things)
    instance = absorb_specks(
        instance_of[segment], surface.faces, whole=stuff, minimum_size=minimum_voxels, minimum_share=speck_share
    )
    of_face = face_labels(instance, surface.faces)
    entities = []
    kept = np.zeros_like(instance)
    for label in sorted(class_of_instance):
        observations = seen_in.get(label, 0).bit_count()
        mesh = cut_mesh(surface, of_face == label)
        if len(mesh.vertices) < minimum_voxels or observations < minimum_observations or len(mesh.faces) == 0:
            continue
        class_id = class_of_instance[label]
        segments = tuple(int(s) for s in np.flatnonzero(instance_of == label))
        confidence = confidence_of(counts, segments, class_id, label)
        entities.append(ExtractedEntity(label, class_id, segments, mesh, confidence, observations))
        kept[instance == label] = label
    class_table = np.zeros(int(instance_of.max()) + 1, dtype=np.int32)
    for entity in entities:
        class_table[entity.instance] = entity.class_id
    return entities, LabelledSurface(segment.astype(np.int32), class_table[kept], kept.astype(np.int32))
