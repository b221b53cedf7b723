"""From the map while it is being built to what it comes to: surface, labels, entities (Han 2024, section 2.3.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from schemas.base import as_vector
from schemas.panoptic_map import EntitiesFile, Entity
from schemas.vocabulary import UNNAMED, Vocabulary
from stages.fuse.counts import TripleCounts
from stages.fuse.extraction import ExtractedEntity, ExtractionSettings, LabelledSurface, extract_entities
from stages.fuse.mapping import PanopticMapper
from stages.fuse.parameters import FuseParameters
from stages.fuse.smoothing import smoothed_tsdf
from stages.fuse.strange_places import without_doubtful
from stages.fuse.surface import Surface, extract_surface
from stages.fuse.unnamed_pieces import unnamed_pieces
from stages.kit.formats.map_files import cut_mesh, face_labels, mesh_name
from stages.kit.stage import Progress

LAYOUT = ("floor", "wall", "ceiling")


@dataclass(frozen=True)
class MaskSource:
    """Whose masks a map is made of."""

    label: str
    recognised: float | None = None
    """As in segments.json."""


@dataclass(frozen=True)
class ClosedMap:
    """What a map comes to: its entities, surface and labels."""

    file: EntitiesFile
    entities: list[ExtractedEntity]
    surface: Surface
    labelled: LabelledSurface
    counts: TripleCounts
    merged: np.ndarray
    """Merged segment label of every segment label."""


def describe(entity: ExtractedEntity, vocabulary: Vocabulary) -> Entity:
    """Return an entity's row of entities.json."""
    return Entity(
        instance=entity.instance,
        class_name=vocabulary.by_id(entity.class_id).name,
        mesh=mesh_name(entity.instance),
        vertices=len(entity.mesh.vertices),
        triangles=len(entity.mesh.faces),
        box_minimum=as_vector(entity.mesh.vertices.min(axis=0)),
        box_maximum=as_vector(entity.mesh.vertices.max(axis=0)),
        confidence=round(entity.confidence, 6),
        observations=entity.observations,
        segments=entity.segments,
    )


def with_unnamed_pieces(
    surface: Surface,
    entities: list[ExtractedEntity],
    labelled: LabelledSurface,
    layout: frozenset[int],
    floor: int,
    unnamed: int,
    parameters: FuseParameters,
) -> tuple[list[ExtractedEntity], LabelledSurface]:
    """Return the entities and labels with the pieces of unnamed surface among them; as they are without a floor.

    `layout`, `floor`, `unnamed`: class ids. Nobody voted for a piece: it has no segments, and no confidence.
    """
    level = surface.vertices[labelled.class_id == floor, 2]
    if not len(level):
        return entities, labelled
    piece = unnamed_pieces(
        surface.vertices - [0.0, 0.0, float(np.median(level))],
        surface.faces,
        labelled.instance,
        np.isin(labelled.class_id, sorted(layout)),
        voxel=parameters.voxel_size,
        minimum_area=parameters.unnamed_area,
    )
    of_face, first = face_labels(piece, surface.faces), 1 + int(labelled.instance.max(initial=0))
    found, number = list(entities), np.zeros(int(piece.max(initial=0)) + 1, np.int32)
    for label in range(1, len(number)):
        mesh = cut_mesh(surface, np.flatnonzero(of_face == label))
        if len(mesh.faces):
            number[label] = first + label
            found.append(ExtractedEntity(first + label, unnamed, (), mesh, 0.0, 0))
    new = number[piece] > 0
    instance = np.where(new, number[piece], labelled.instance).astype(np.int32)
    class_id = np.where(new, np.int32(unnamed), labelled.class_id)
    return found, LabelledSurface(labelled.segment, class_id, instance)


def is_strange(source: MaskSource, parameters: FuseParameters) -> bool:
    """Whether the segmenter recognised so little of this place that only what most views agree on is to be believed."""
    return source.recognised is not None and source.recognised < parameters.least_recognised


def close_map(mapper: PanopticMapper, vocabulary: Vocabulary, source: MaskSource, progress: Progress) -> ClosedMap:
    """Merge what is one instance, draw the surface and cut it into entities.

    Labels of the mapper are merged by it.
    """
    parameters = mapper.parameters
    with progress.step("merge instances"):
        mapper.regularize()
    with progress.step("extract surface"):
        tsdf = smoothed_tsdf(mapper.blocks, parameters.smoothing)
        surface = extract_surface(mapper.blocks, minimum_weight=parameters.minimum_weight, tsdf=tsdf)
    with progress.step("extract entities"):
        merged = mapper.labels.table()
        unnamed = vocabulary.by_name(UNNAMED).id
        fewest = min(parameters.minimum_observations, max(1, mapper.labelled_frames // 10))
        grouping = mapper.merging.grouping(mapper.seen_in, fewest, unnamed)
        settings = ExtractionSettings(
            minimum_share=parameters.minimum_prediction_share,
            minimum_voxels=parameters.minimum_entity_voxels,
            minimum_observations=fewest,
            speck_share=parameters.speck_share,
            part_distance=parameters.part_distance,
            spread_steps=parameters.spread_steps,
            piece_share=parameters.piece_share,
            unnamed=unnamed,
        )
        entities, labelled = extract_entities(
            surface, merged[surface.segment], grouping, mapper.sightings, mapper.merging.things, settings
        )
        if parameters.merging == "ours" and is_strange(source, parameters):
            scores, things = grouping.class_scores, mapper.merging.things
            entities, labelled = without_doubtful(entities, labelled, scores, mapper.sightings, things, unnamed)
        if parameters.unnamed_area > 0 and parameters.merging == "ours":
            layout = frozenset(entry.id for entry in vocabulary.classes if entry.name in LAYOUT)
            floor = vocabulary.by_name("floor").id
            entities, labelled = with_unnamed_pieces(surface, entities, labelled, layout, floor, unnamed, parameters)
    file = EntitiesFile(
        voxel_size=parameters.voxel_size,
        truncation_distance=mapper.truncation_distance,
        frames_integrated=mapper.frames_integrated,
        segmentation=source.label,
        entities=tuple(describe(entity, vocabulary) for entity in entities),
    )
    return ClosedMap(file, entities, surface, labelled, grouping.counts, merged)
