"""From the map while it is being built to what it comes to: surface, labels, entities (Han 2024, section 2.3.4)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scenewright.schemas.base import as_vector
from scenewright.schemas.panoptic_map import Because, BecauseFile, EntitiesFile, Entity, LayoutFile
from scenewright.schemas.vocabulary import UNNAMED, Vocabulary
from scenewright.stages.fuse.agreement import Agreement, agreed
from scenewright.stages.fuse.counts import TripleCounts
from scenewright.stages.fuse.extraction import ExtractedEntity, ExtractionSettings, LabelledSurface, extract_entities
from scenewright.stages.fuse.layout.evidence import Scene
from scenewright.stages.fuse.layout.file import layout_file
from scenewright.stages.fuse.mapping import PanopticMapper
from scenewright.stages.fuse.ours import Ours
from scenewright.stages.fuse.smoothing import smoothed_tsdf
from scenewright.stages.fuse.surface import Surface, extract_surface
from scenewright.stages.fuse.testimony import Reason
from scenewright.stages.fuse.votes import Votes
from scenewright.stages.kit.formats.map_files import mesh_name
from scenewright.stages.kit.geometry.point_clouds import vertex_areas, vertex_normals
from scenewright.stages.kit.stage import Progress

MOST_SAID = 3
"""Classes of which `because` tells what was said."""


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
    layout: LayoutFile | None = None
    """None of maps of other rules than ours."""
    because: BecauseFile | None = None


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


def told(instance: int, reason: Reason, vocabulary: Vocabulary) -> Because:
    """Return the reason of an entity as because.json has it."""
    said = sorted(reason.said.scores.items(), key=lambda row: (-row[1], row[0]))[:MOST_SAID]
    naming = reason.naming
    return Because(
        instance=instance,
        shape=reason.shape,
        looks=round(reason.said.looks, 1),
        said={vocabulary.by_id(c).name: round(score, 3) for c, score in said},
        name="" if naming is None else naming.rule,
        posterior=None if naming is None else round(naming.posterior, 3),
        runners_up={vocabulary.by_id(c).name: p for c, p in (() if naming is None else naming.runners_up)},
    )


def scene_of(surface: Surface, segment: np.ndarray, votes: Votes, mapper: PanopticMapper, merging: Ours) -> Scene:
    """Return what layout is found in. segment (V,): merged label of every vertex."""
    vertices = surface.vertices.astype(float)
    return Scene(
        vertices=vertices,
        normals=vertex_normals(vertices, surface.faces),
        areas=vertex_areas(vertices, surface.faces),
        bounding=votes.share(segment, merging.bounds),
        furniture=votes.share(segment, merging.things),
        cameras=np.array(mapper.cameras, float).reshape(-1, 3),
        free=mapper.free_space,
    )


def close_map(mapper: PanopticMapper, vocabulary: Vocabulary, label: str, progress: Progress) -> ClosedMap:
    """Merge what is one instance, draw the surface and cut it into entities. Labels of the mapper are merged by it.

    `label`: whose masks these are.
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
        segment = merged[surface.segment]
        entities, labelled = extract_entities(
            surface, segment, grouping, mapper.sightings, mapper.merging.things, settings
        )
    agreement: Agreement | None = None
    if isinstance(mapper.merging, Ours):
        with progress.step("lay out the room"):
            votes = Votes(mapper.merging.class_scores.by_segment, mapper.sightings)
            scene = scene_of(surface, segment, votes, mapper, mapper.merging)
            agreement = agreed(
                surface,
                entities,
                labelled,
                scene,
                votes,
                mapper.looks,
                vocabulary,
                voxel=parameters.voxel_size,
                minimum_area=parameters.unnamed_area,
            )
            entities, labelled = agreement.entities, agreement.labelled
    file = EntitiesFile(
        voxel_size=parameters.voxel_size,
        truncation_distance=mapper.truncation_distance,
        frames_integrated=mapper.frames_integrated,
        segmentation=label,
        entities=tuple(describe(entity, vocabulary) for entity in entities),
    )
    closed = ClosedMap(file, entities, surface, labelled, grouping.counts, merged)
    if agreement is None:
        return closed
    rows = tuple(told(entity.instance, agreement.reasons[entity.instance], vocabulary) for entity in entities)
    layout = layout_file(agreement.layout, scene)
    return replace(closed, layout=layout, because=BecauseFile(entities=rows, dropped=agreement.dropped))
