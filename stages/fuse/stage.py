"""`scenewright fuse`: a sequence and its segments become one panoptic map (Han 2024, sections 2.3.2 to 2.3.4)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from schemas.panoptic_map import SNAPSHOTS, EntitiesFile, PanopticMap
from schemas.segments import Segments
from schemas.sequence import Sequence
from schemas.trajectory import Trajectory
from schemas.vocabulary import Vocabulary, load_vocabulary
from stages.fuse.counts import TripleCounts
from stages.fuse.extraction import ExtractedEntity, LabelledSurface, extract_entities
from stages.fuse.inputs import check_origin, check_segments, poses_at
from stages.fuse.listings import Listings
from stages.fuse.mapping import PanopticMapper
from stages.fuse.parameters import FuseParameters
from stages.fuse.partition import group_things
from stages.fuse.payload import describe, write_meshes, write_payload
from stages.fuse.smoothing import smoothed_tsdf
from stages.fuse.surface import Surface, extract_surface
from stages.kit.formats.frames import FrameReader, require_depth
from stages.kit.formats.masks import PanopticReader
from stages.kit.formats.trajectories import read_tum
from stages.kit.progress import SilentProgress
from stages.kit.stage import Context, Progress

UNNAMED = "object"
"""The class of things that masks found and did not recognise."""


def run(
    sequence: Sequence,
    segments: Segments,
    trajectory: Trajectory | None = None,
    *,
    parameters: FuseParameters,
    context: Context,
) -> PanopticMap:
    """Fuse every frame that has depth and a pose; write the map, a mesh per entity, and the counts.

    Frames without depth or pose are skipped and counted; frames without segments add geometry only. With nothing to
    integrate the outcome is `empty`. Raises BadInput when the segments do not belong to the sequence.
    """
    check_origin(sequence, segments)
    vocabulary = load_vocabulary()
    with context.progress.step("integrate frames"):
        mapper, skipped, label = _integrate_frames(sequence, segments, trajectory, vocabulary, parameters, context)
    return write_map(mapper, vocabulary, label, skipped, context)


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


def close_map(mapper: PanopticMapper, vocabulary: Vocabulary, label: str, progress: Progress) -> ClosedMap:
    """Merge what is one instance, draw the surface and cut it into entities. `label` says whose masks these are.

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
        counts, seen_in, grouped = mapper.counts, mapper.seen_in, None
        fewest = min(parameters.minimum_observations, max(1, mapper.labelled_frames // 10))
        if parameters.merging == "ours":
            things = group_things(
                mapper.counts, mapper.segment_evidence, mapper.things, mapper.seen_in, fewest,
                scores=mapper.class_scores.by_segment, unnamed=unnamed,
            )  # fmt: skip
            counts, seen_in, grouped = things.counts, things.seen_in, things.best
        entities, labelled = extract_entities(
            surface, merged[surface.segment], counts, seen_in, mapper.sightings, mapper.things,
            minimum_share=parameters.minimum_prediction_share, minimum_voxels=parameters.minimum_entity_voxels,
            minimum_observations=fewest, speck_share=parameters.speck_share, part_distance=parameters.part_distance,
            spread_steps=parameters.spread_steps, piece_share=parameters.piece_share, unnamed=unnamed, grouped=grouped,
        )  # fmt: skip
    file = EntitiesFile(
        voxel_size=parameters.voxel_size,
        truncation_distance=mapper.truncation_distance,
        frames_integrated=mapper.frames_integrated,
        segmentation=label,
        entities=tuple(describe(entity, vocabulary) for entity in entities),
    )
    return ClosedMap(file, entities, surface, labelled, counts, merged)


def write_map(
    mapper: PanopticMapper, vocabulary: Vocabulary, label: str, skipped: Mapping[str, int], context: Context
) -> PanopticMap:
    """Write the map that was built: its entities, meshes, counts and voxels. `label` says whose masks these are,
    `skipped` how many frames were left out by reason."""
    closed = close_map(mapper, vocabulary, label, context.progress)
    with context.progress.step("write the map"):
        write_payload(
            context.output, closed.file, closed.entities, closed.surface, closed.labelled, closed.counts, mapper.blocks,
            closed.merged,
        )  # fmt: skip
    summary = {
        "frames": mapper.frames_integrated,
        **{f"skipped_{reason}": count for reason, count in sorted(skipped.items())},
        "frames_without_segments": mapper.frames_integrated - mapper.labelled_frames,
        "entities": len(closed.entities),
        "segments": int(len(set(closed.merged.tolist())) - 1),
        "segment_merges": mapper.segment_merges,
        "instance_merges": mapper.instance_merges,
        "vertices": len(closed.surface.vertices),
        "blocks": mapper.blocks.count,
    }
    return PanopticMap(context.output, outcome="ok" if len(closed.surface.faces) else "empty", summary=summary)


def write_snapshot(mapper: PanopticMapper, vocabulary: Vocabulary, label: str, context: Context) -> None:
    """Write the map as it would be if this frame were the last. The map that is being built does not notice."""
    with context.progress.step("snapshots"):
        closed = close_map(mapper.held(), vocabulary, label, SilentProgress())
        folder = context.output / SNAPSHOTS / f"{mapper.frames_integrated:06d}"
        write_meshes(folder, closed.file, closed.entities, closed.surface)


def _integrate_frames(
    sequence: Sequence,
    segments: Segments,
    trajectory: Trajectory | None,
    vocabulary: Vocabulary,
    parameters: FuseParameters,
    context: Context,
) -> tuple[PanopticMapper, Counter[str], str]:
    """Return the map of all frames, how many frames were skipped by reason, and whose masks these are."""
    things = frozenset(entry.id for entry in vocabulary.classes if entry.kind == "thing")
    skipped: Counter[str] = Counter()
    require_depth(sequence)
    with FrameReader(sequence.path("frames.mcap")) as reader, PanopticReader(segments.path("panoptic.zip")) as masks:
        info = segments.info
        check_segments(info, reader.camera, len(reader), vocabulary)
        listed, label = Listings(info), info.label
        del info  # the parsed file goes before the map grows
        poses = None
        if trajectory is not None:
            poses = poses_at(reader.times, *read_tum(trajectory.path("trajectory.tum")), parameters.pose_tolerance)
        mapper = PanopticMapper(parameters, things)
        total = -(-len(reader) // parameters.every)
        frames = reader.frames(streams=("color", "depth"), every=parameters.every)
        kept = 0
        for frame in context.progress.track(frames, total=total, description="fuse"):
            # Of the last frame the finished map is the snapshot, so one is taken when another frame comes.
            if parameters.snapshot_every and mapper.frames_integrated >= kept + parameters.snapshot_every:
                kept = mapper.frames_integrated
                write_snapshot(mapper, vocabulary, label, context)
            pose = frame.world_from_camera if poses is None else poses[frame.index]
            if frame.depth is None or not (frame.depth > 0).any():
                skipped["no_depth"] += 1
            elif pose is None:
                skipped["no_pose"] += 1
            else:
                listing = listed.get(frame.index)
                ids = None if listing is None else masks.read(frame.index)
                camera = reader.cameras[frame.camera_name]
                mapper.add_frame(camera, frame.depth, frame.color, pose, ids, listing or ())
    return mapper, skipped, label
