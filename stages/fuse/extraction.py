"""From the labelled surface to one mesh per panoptic entity (Han 2024, section 2.3.4, eq. 2.6)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scenewright.stages.fuse.counts import TripleCounts
from scenewright.stages.fuse.merging import Grouping
from scenewright.stages.fuse.parts import absorb_pieces, absorb_specks, drop_far_parts, spread_labels
from scenewright.stages.fuse.surface import Surface
from scenewright.stages.kit.formats.map_files import cut_mesh, face_labels
from scenewright.stages.kit.formats.ply_files import ColoredMesh

SPREAD_COSINE = 0.7
"""Labels spread to unlabelled vertices over surface that bends by less than 45 degrees from vertex to vertex."""


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


def label_of_segments(
    grouping: Grouping, sightings: Mapping[int, int], largest_segment: int, minimum_share: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return class id and instance (L + 1,) int32 of every segment label 0 .. L (eq. 2.6); 0 where none was counted.

    A label whose predictions are fewer than `minimum_share` of its sightings (frame segments that were matched to it,
    background included) stays unlabelled: a detector that takes a cupboard for a fridge in one frame out of thirty is
    outvoted by the frames in which it sees nothing there. Equation 2.6 itself never weighs the background; 0 is that.
    """
    counts = grouping.counts
    class_ids = np.zeros(largest_segment + 1, dtype=np.int32)
    instances = np.zeros(largest_segment + 1, dtype=np.int32)
    for segment, row in counts.by_segment.items():
        best = grouping.best.get(segment) or counts.best(segment)
        if best is not None and sum(row.values()) >= minimum_share * sightings.get(segment, 0):
            class_ids[segment], instances[segment] = best
    return class_ids, instances


def class_of_instances(counts: TripleCounts, class_of: np.ndarray, instance_of: np.ndarray) -> dict[int, int]:
    """Return {instance: class} from class and instance (L + 1,) of the segment labels.

    The labels of an instance agree on the class where both were counted together (eq. 2.4). Counted apart they need
    not: then the class of the labels with most predictions in all counts, ties to the smaller number.
    """
    votes: dict[int, dict[int, int]] = {}
    for segment in np.flatnonzero(instance_of):
        per_class = votes.setdefault(int(instance_of[segment]), {})
        class_id = int(class_of[segment])
        per_class[class_id] = per_class.get(class_id, 0) + sum(counts.by_segment[int(segment)].values())
    return {p: min(per_class, key=lambda c: (-per_class[c], c)) for p, per_class in votes.items()}


def confidence_of(counts: TripleCounts, segments: tuple[int, ...], class_id: int, instance: int) -> float:
    """Return the share of the counts on an entity's segment labels that agrees with its class and instance."""
    rows = [counts.by_segment.get(segment, {}) for segment in segments]
    total = sum(sum(row.values()) for row in rows)
    return sum(row.get((class_id, instance), 0) for row in rows) / total if total else 0.0


@dataclass(frozen=True)
class ExtractionSettings:
    """What becomes an entity."""

    minimum_share: float
    """See `label_of_segments`."""
    minimum_voxels: int
    """A vertex stands for one surface voxel."""
    minimum_observations: int
    """Frames that voted for an entity, or votes on the segments it ended up with, whichever are fewer."""
    speck_share: float
    part_distance: float
    """[m]"""
    spread_steps: int = 0
    piece_share: float = 0.0
    unnamed: int | None = None
    """Class of things that masks found and did not recognise."""


def extract_entities(
    surface: Surface,
    segment: np.ndarray,
    grouping: Grouping,
    sightings: Mapping[int, int],
    things: frozenset[int],
    settings: ExtractionSettings,
) -> tuple[list[ExtractedEntity], LabelledSurface]:
    """Return the entities, ascending by instance, and the labels of the whole surface.

    segment (V,) int32: merged segment label of every vertex. Entities that fall short of the `settings` are dropped,
    and their vertices are unlabelled.
    """
    counts, unnamed = grouping.counts, settings.unnamed
    largest = max([0, *counts.by_segment, int(segment.max(initial=0))])
    class_of, instance_of = label_of_segments(grouping, sightings, largest, settings.minimum_share)
    class_of_instance = class_of_instances(counts, class_of, instance_of)
    stuff = frozenset(p for p, c in class_of_instance.items() if c not in things)
    spread_instance = spread_labels(
        instance_of[segment], surface.vertices, surface.faces, steps=settings.spread_steps, minimum_cosine=SPREAD_COSINE
    )
    instance = absorb_specks(
        spread_instance,
        surface.faces,
        whole=stuff,
        minimum_size=settings.minimum_voxels,
        minimum_share=settings.speck_share,
    )
    # Things without a name are not of one class: a cup is no piece of the table that nobody recognised either.
    countable = {p: c for p, c in class_of_instance.items() if c in things and c != unnamed}
    instance = absorb_pieces(instance, surface.faces, countable, share=settings.piece_share)
    instance = drop_far_parts(instance, surface.vertices, surface.faces, whole=stuff, distance=settings.part_distance)
    of_face = face_labels(instance, surface.faces)
    by_label = np.argsort(of_face, kind="stable")
    sorted_labels = of_face[by_label]
    entities = []
    instance_of_vertex = np.zeros_like(instance)
    for label in sorted(class_of_instance):
        class_id = class_of_instance[label]
        segments = tuple(int(s) for s in np.flatnonzero(instance_of == label))
        votes = sum(
            count for segment in segments for (_, voted), count in counts.by_segment[segment].items() if voted == label
        )
        # A stuff class is one instance all over the room: frames that voted for it elsewhere say nothing here.
        observations = min(grouping.seen_in.get(label, 0).bit_count(), votes)
        start, end = np.searchsorted(sorted_labels, (label, label + 1))
        mesh = cut_mesh(surface, by_label[start:end])
        if (
            len(mesh.vertices) < settings.minimum_voxels
            or observations < settings.minimum_observations
            or not len(mesh.faces)
        ):
            continue
        confidence = confidence_of(counts, segments, class_id, label)
        entities.append(ExtractedEntity(label, class_id, segments, mesh, confidence, observations))
        instance_of_vertex[instance == label] = label
    class_table = np.zeros(int(instance_of.max()) + 1, dtype=np.int32)
    for entity in entities:
        class_table[entity.instance] = entity.class_id
    return entities, LabelledSurface(
        segment.astype(np.int32), class_table[instance_of_vertex], instance_of_vertex.astype(np.int32)
    )
