"""`scenewright fuse`: a sequence and its segments become one panoptic map (Han 2024, sections 2.3.2 to 2.3.4)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from schemas.panoptic_map import EntitiesFile, PanopticMap
from schemas.segments import Segments
from schemas.sequence import Sequence
from schemas.trajectory import Trajectory
from schemas.vocabulary import Vocabulary, load_vocabulary
from stages.fuse.extraction import extract_entities
from stages.fuse.inputs import check_origin, check_segments, poses_at
from stages.fuse.listings import Listings
from stages.fuse.mapping import PanopticMapper
from stages.fuse.parameters import FuseParameters
from stages.fuse.partition import group_things
from stages.fuse.payload import describe, write_payload
from stages.fuse.smoothing import smoothed_tsdf
from stages.fuse.surface import extract_surface
from stages.kit.formats.frames import FrameReader, require_depth
from stages.kit.formats.masks import PanopticReader
from stages.kit.formats.trajectories import read_tum
from stages.kit.stage import Context

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


def write_map(
    mapper: PanopticMapper, vocabulary: Vocabulary, label: str, skipped: Mapping[str, int], context: Context
) -> PanopticMap:
    """Write the map that was built: its entities, meshes, counts and voxels. `label` says whose masks these are,
    `skipped` how many frames were left out by reason."""
    parameters = mapper.parameters
    with context.progress.step("merge instances"):
        mapper.regularize()
    with context.progress.step("extract surface"):
        tsdf = smoothed_tsdf(mapper.blocks, parameters.smoothing)
        surface = extract_surface(mapper.blocks, minimum_weight=parameters.minimum_weight, tsdf=tsdf)
    with context.progress.step("extract entities"):
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
    with context.progress.step("write the map"):
        file = EntitiesFile(
            voxel_size=parameters.voxel_size,
            truncation_distance=mapper.truncation_distance,
            frames_integrated=mapper.frames_integrated,
            segmentation=label,
            entities=tuple(describe(entity, vocabulary) for entity in entities),
        )
        write_payload(context.output, file, entities, surface, labelled, counts, mapper.blocks, merged)
    summary = {
        "frames": mapper.frames_integrated,
        **{f"skipped_{reason}": count for reason, count in sorted(skipped.items())},
        "frames_without_segments": mapper.frames_integrated - mapper.labelled_frames,
        "entities": len(entities),
        "segments": int(len(set(merged.tolist())) - 1),
        "segment_merges": mapper.segment_merges,
        "instance_merges": mapper.instance_merges,
        "vertices": len(surface.vertices),
        "blocks": mapper.blocks.count,
    }
    return PanopticMap(context.output, outcome="ok" if len(surface.faces) else "empty", summary=summary)


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
        for frame in context.progress.track(frames, total=total, description="fuse"):
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
