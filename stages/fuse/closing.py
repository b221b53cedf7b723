"""From the map while it is being built to what it comes to: surface, labels, entities (Han 2024, section 2.3.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.schemas.base import as_vector
from scenewright.schemas.panoptic_map import EntitiesFile, Entity
from scenewright.schemas.vocabulary import UNNAMED, Vocabulary
from scenewright.stages.fuse.agreed_names import with_agreed_names, without_claimed
from scenewright.stages.fuse.counts import TripleCounts
from scenewright.stages.fuse.extraction import ExtractedEntity, ExtractionSettings, LabelledSurface, extract_entities
from scenewright.stages.fuse.impossible_names import without_impossible_names
from scenewright.stages.fuse.mapping import PanopticMapper
from scenewright.stages.fuse.parameters import FuseParameters
from scenewright.stages.fuse.piece_entities import Classes, by_geometry, with_unnamed_pieces
from scenewright.stages.fuse.smoothing import smoothed_tsdf
from scenewright.stages.fuse.strange_places import share_told, sure_things, thing_score, without_names
from scenewright.stages.fuse.surface import Surface, extract_surface
from scenewright.stages.kit.formats.map_files import mesh_name
from scenewright.stages.kit.stage import Progress

FLAT_TOPPED = ("table", "desk")
"""Classes of things that are a level top on legs."""


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


def is_strange(source: MaskSource, parameters: FuseParameters) -> bool:
    """Whether the segmenter recognised so little of this place that its masks are not to be believed."""
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
        ours = parameters.merging == "ours"
        strange = ours and is_strange(source, parameters)
        things, scores = mapper.merging.things, grouping.class_scores
        flat_topped = frozenset(vocabulary.by_name(name).id for name in FLAT_TOPPED)
        if strange:
            score_of = {e.instance: thing_score(e.segments, scores, things, mapper.sightings) for e in entities}
            sure = sure_things(entities, score_of, things - flat_topped)
            entities, labelled = without_names(entities, labelled, score_of, things, unnamed)
        elif ours:
            entities, labelled = without_impossible_names(
                entities, labelled, scores, mapper.sightings, vocabulary, unnamed
            )
        if parameters.unnamed_area > 0 and ours:
            classes = Classes(
                floor=vocabulary.by_name("floor").id,
                wall=vocabulary.by_name("wall").id,
                ceiling=vocabulary.by_name("ceiling").id,
                unnamed=unnamed,
                things=things,
                tables=flat_topped,
            )
            size = {"voxel": parameters.voxel_size, "minimum_area": parameters.unnamed_area}
            if strange:
                entities, labelled = by_geometry(surface, entities, labelled, classes, **size, sure=sure)
            else:
                name_scores = share_told(labelled, scores, mapper.sightings)
                scores = without_claimed(scores, entities)
                entities, labelled = with_unnamed_pieces(surface, entities, labelled, classes, **size, told=name_scores)
            least = parameters.minimum_prediction_share
            entities, labelled = with_agreed_names(
                entities, labelled, scores, mapper.sightings, vocabulary, unnamed, least
            )
    file = EntitiesFile(
        voxel_size=parameters.voxel_size,
        truncation_distance=mapper.truncation_distance,
        frames_integrated=mapper.frames_integrated,
        segmentation=source.label,
        entities=tuple(describe(entity, vocabulary) for entity in entities),
    )
    return ClosedMap(file, entities, surface, labelled, grouping.counts, merged)
