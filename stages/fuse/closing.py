"""From the map while it is being built to what it comes to: surface, labels, entities (Han 2024, section 2.3.4)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scenewright.schemas.base import as_vector
from scenewright.schemas.panoptic_map import EntitiesFile, Entity
from scenewright.schemas.vocabulary import UNNAMED, Vocabulary
from scenewright.stages.fuse.agreed_names import with_agreed_names, without_claimed
from scenewright.stages.fuse.belief import doubted, flush_shares
from scenewright.stages.fuse.belief import usual_score as usual_score_of
from scenewright.stages.fuse.counts import TripleCounts
from scenewright.stages.fuse.extraction import ExtractedEntity, ExtractionSettings, LabelledSurface, extract_entities
from scenewright.stages.fuse.impossible_names import without_impossible_names
from scenewright.stages.fuse.names import name_of, rates_of, said_of
from scenewright.stages.kit.class_extents import extent_of
from scenewright.stages.fuse.mapping import PanopticMapper
from scenewright.stages.fuse.parameters import FuseParameters
from scenewright.stages.fuse.layout.evidence import Scene
from scenewright.stages.fuse.layout.room import find_layout
from scenewright.stages.fuse.layout_entities import with_layout
from scenewright.stages.fuse.piece_entities import Classes, with_pieces
from scenewright.stages.fuse.smoothing import smoothed_tsdf
from scenewright.stages.fuse.strange_places import share_told
from scenewright.stages.fuse.surface import Surface, extract_surface
from scenewright.stages.kit.formats.map_files import mesh_name
from scenewright.stages.kit.geometry.point_clouds import vertex_normals
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


BOUNDS = ("floor", "wall", "ceiling")


def bounds_of(vocabulary: Vocabulary) -> frozenset[int]:
    """Return the classes of what bounds a room: geometry finds it, masks of these classes are votes."""
    return frozenset(vocabulary.by_name(name).id for name in BOUNDS)


def scene_of(surface: Surface, labels: np.ndarray, scores: Mapping[int, Mapping[int, float]], mapper: PanopticMapper, bounds: frozenset[int]) -> Scene:
    """Return what layout is found in."""
    vertices = surface.vertices.astype(float)
    corners = vertices[surface.faces]
    face_area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    areas = np.bincount(surface.faces.ravel(), weights=np.repeat(face_area / 3, 3), minlength=len(vertices))
    bounding, furniture = np.zeros(int(labels.max(initial=0)) + 1), np.zeros(int(labels.max(initial=0)) + 1)
    for label in range(1, len(bounding)):
        looks = max(1, mapper.sightings.get(label, 0))
        for c, score in scores.get(label, {}).items():
            (bounding if c in bounds else furniture)[label] += score / looks
    return Scene(vertices, vertex_normals(vertices, surface.faces), areas, bounding[labels], furniture[labels], np.array(mapper.cameras).reshape(-1, 3), mapper.free_space)


def things_told(segment, scores, sightings, things):
    table = np.zeros(int(segment.max(initial=0)) + 1)
    for label in range(1, len(table)):
        table[label] = sum(x for c, x in scores.get(label, {}).items() if c in things) / max(1, sightings.get(label, 0))
    return np.minimum(table, 1.0)[segment]


def without_doubted(entities, labelled, told, things, scene, voxel):
    mean = {e.instance: float(told[labelled.instance == e.instance].mean()) if (labelled.instance == e.instance).any() else 0.0 for e in entities if e.class_id in things}
    flush = flush_shares(scene.vertices, scene.normals, labelled.instance, voxel)
    reasons = doubted(sorted(mean), mean, flush)
    import os
    if os.environ.get("DBG"):
        for e in entities:
            if e.instance in mean: print("   ", e.class_id, len(e.mesh.vertices), round(mean[e.instance],2), "flush", round(float(flush[e.instance]),2), reasons.get(e.instance,""))
    gone = np.isin(labelled.instance, sorted(reasons))
    return [e for e in entities if e.instance not in reasons], LabelledSurface(labelled.segment, np.where(gone, 0, labelled.class_id).astype(np.int32), np.where(gone, 0, labelled.instance).astype(np.int32)), usual_score_of(sorted(mean), mean, flush)


def with_names(entities, labelled, scores, sightings, vocabulary, unnamed, things):
    claimed = {k: {l for e in entities if e.instance != k for l in e.segments} for k in ()}
    of_masks = {label: e.instance for e in entities for label in e.segments}
    said = {}
    for e in entities:
        if e.class_id in things:
            own = labelled.segment[labelled.instance == e.instance]
            others = frozenset(label for label, k in of_masks.items() if k != e.instance)
            said[e.instance] = said_of(own, scores, sightings, others)
    usual = rates_of([said[e.instance] for e in entities if e.instance in said and e.segments], things - {unnamed})
    result, class_id = [], labelled.class_id.copy()
    for e in entities:
        if e.instance in said:
            import os
            if os.environ.get('DBG'): print(usual)
            naming = name_of(said[e.instance], usual, extent_of(np.asarray(e.mesh.vertices)), vocabulary, unnamed)
            class_id[labelled.instance == e.instance] = naming.class_id
            e = replace(e, class_id=naming.class_id)
        result.append(e)
    return result, replace(labelled, class_id=class_id)


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
        things, scores = mapper.merging.things, grouping.class_scores
        if parameters.merging == "ours":
            flat_topped = frozenset(vocabulary.by_name(name).id for name in FLAT_TOPPED)
            bounds = bounds_of(vocabulary)
            scene = scene_of(surface, merged[surface.segment], mapper.merging.class_scores.by_segment, mapper, bounds)
            layout = find_layout(scene)
            told = things_told(labelled.segment, scores, mapper.sightings, things)
            entities, labelled, usual = without_doubted(entities, labelled, told, things, scene, parameters.voxel_size)
            entities, labelled = with_layout(surface, entities, labelled, layout, told, things, vocabulary)
            classes = Classes(
                floor=vocabulary.by_name("floor").id,
                wall=vocabulary.by_name("wall").id,
                ceiling=vocabulary.by_name("ceiling").id,
                unnamed=unnamed,
                things=things,
                tables=flat_topped,
            )
            size = {"voxel": parameters.voxel_size, "minimum_area": parameters.unnamed_area}
            told = share_told(labelled, scores, mapper.sightings)
            if parameters.unnamed_area > 0:
                entities, labelled = with_pieces(surface, entities, labelled, classes, scene, layout, told, **size)
            entities, labelled = with_names(entities, labelled, scores, mapper.sightings, vocabulary, unnamed, things)
    file = EntitiesFile(
        voxel_size=parameters.voxel_size,
        truncation_distance=mapper.truncation_distance,
        frames_integrated=mapper.frames_integrated,
        segmentation=source.label,
        entities=tuple(describe(entity, vocabulary) for entity in entities),
    )
    return ClosedMap(file, entities, surface, labelled, grouping.counts, merged)
