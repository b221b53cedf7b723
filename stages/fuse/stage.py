"""`scenewright fuse`: a sequence and its segments become one panoptic map (Han 2024, sections 2.3.2 to 2.3.4)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from scenewright.schemas.articulations import Articulations
from scenewright.schemas.panoptic_map import SNAPSHOTS, PanopticMap
from scenewright.schemas.segments import Segments
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.trajectory import Trajectory
from scenewright.schemas.vocabulary import Vocabulary, load_vocabulary
from scenewright.stages.fuse.closing import close_map
from scenewright.stages.fuse.from_mesh import run_from_mesh
from scenewright.stages.fuse.inputs import check_origin, check_segments
from scenewright.stages.fuse.layout.room import CEILING, FLOOR, WALL
from scenewright.stages.fuse.listings import Listings
from scenewright.stages.fuse.mapping import PanopticMapper
from scenewright.stages.fuse.merging import Merging
from scenewright.stages.fuse.ours import Ours
from scenewright.stages.fuse.outdated import Outdated
from scenewright.stages.fuse.parameters import FuseParameters
from scenewright.stages.fuse.payload import write_meshes, write_payload
from scenewright.stages.fuse.separate import Separate
from scenewright.stages.fuse.thesis import Thesis
from scenewright.stages.kit.formats.frames import Frame, FrameReader, require_depth
from scenewright.stages.kit.formats.masks import PanopticReader
from scenewright.stages.kit.own_trajectory import frame_poses
from scenewright.stages.kit.prefetching import prefetched
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context

RIVALS: dict[str, Callable[[FuseParameters, frozenset[int]], Merging]] = {"thesis": Thesis, "separate": Separate}


def run(
    sequence: Sequence | None = None,
    segments: Segments | None = None,
    trajectory: Trajectory | None = None,
    articulations: Articulations | None = None,
    from_mesh: Path | None = None,
    labels: Path | None = None,
    *,
    parameters: FuseParameters,
    context: Context,
) -> PanopticMap:
    """Fuse every frame that has depth and a pose; write the map, a mesh per entity, and the counts.

    Frames without depth or pose are skipped and counted; frames without segments add geometry only. With nothing to
    integrate the outcome is `empty`. Raises BadInput when the segments do not belong to the sequence.
    With `articulations` the map shows the last state of what was seen to move. With `from_mesh` it is that of a scan
    which others annotated, and there are no frames.
    """
    if from_mesh is not None:
        return run_from_mesh(from_mesh, labels, parameters=parameters, context=context)
    assert sequence is not None and segments is not None  # fuse.parameters.check
    check_origin(sequence, segments)
    vocabulary = load_vocabulary()
    with context.progress.step("integrate frames"):
        mapper, skipped, label = _integrate_frames(
            sequence, segments, trajectory, articulations, vocabulary, parameters, context
        )
    return write_map(mapper, vocabulary, label, skipped, context)


def bounds_of(vocabulary: Vocabulary) -> frozenset[int]:
    """Return the classes of what bounds a room: geometry finds it, masks of these classes are votes."""
    return frozenset(vocabulary.by_name(name).id for name in (FLOOR, WALL, CEILING))


def new_mapper(parameters: FuseParameters, vocabulary: Vocabulary) -> PanopticMapper:
    """Return an empty map of the method that the parameters ask for."""
    things = frozenset(entry.id for entry in vocabulary.classes if entry.kind == "thing")
    if parameters.merging == "ours":
        return PanopticMapper(parameters, Ours(parameters, things, bounds_of(vocabulary)))
    return PanopticMapper(parameters, RIVALS[parameters.merging](parameters, things))


def write_map(
    mapper: PanopticMapper, vocabulary: Vocabulary, label: str, skipped: Mapping[str, int], context: Context
) -> PanopticMap:
    """Write the map that was built: its entities, meshes, counts and voxels. `skipped`: how many frames were left out
    by reason."""
    closed = close_map(mapper, vocabulary, label, context.progress)
    with context.progress.step("write the map"):
        write_payload(context.output, closed, mapper.blocks, mapper.free_space)
    summary: dict[str, str | float] = {
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
    if closed.layout is not None:
        summary["bounds"] = sum(plane.bounds for plane in closed.layout.planes)
    if closed.because is not None:
        summary["masks_dropped"] = len(closed.because.dropped)
    return PanopticMap(context.output, outcome="ok" if len(closed.surface.faces) else "empty", summary=summary)


def write_snapshot(mapper: PanopticMapper, vocabulary: Vocabulary, label: str, context: Context) -> None:
    """Write the map as it would be if this frame were the last. The map that is being built does not notice."""
    with context.progress.step("snapshots"):
        closed = close_map(mapper.held(), vocabulary, label, SilentProgress())
        folder = context.output / SNAPSHOTS / f"{mapper.frames_integrated:06d}"
        write_meshes(folder, closed)


def _integrate_frames(
    sequence: Sequence,
    segments: Segments,
    trajectory: Trajectory | None,
    articulations: Articulations | None,
    vocabulary: Vocabulary,
    parameters: FuseParameters,
    context: Context,
) -> tuple[PanopticMapper, Counter[str], str]:
    """Return the map of all frames, how many frames were skipped by reason, and whose masks these are."""
    skipped: Counter[str] = Counter()
    require_depth(sequence)
    outdated = None if articulations is None else Outdated(articulations)
    with FrameReader(sequence.path("frames.mcap")) as reader, PanopticReader(segments.path("panoptic.zip")) as masks:
        info = segments.info
        check_segments(info, reader.camera, len(reader), vocabulary)
        listed, label = Listings(info), info.label
        del info  # the parsed file goes before the map grows
        poses = None
        if trajectory is not None:
            poses = frame_poses(trajectory, sequence, reader, parameters.pose_tolerance)
        cameras = reader.cameras

        def read() -> Iterator[tuple[Frame, np.ndarray | None, np.ndarray | None]]:
            """Frames with their poses and, where there are depth, pose and listing, ids."""
            for frame in reader.frames(streams=("color", "depth", "deviation"), every=parameters.every):
                pose = frame.world_from_camera if poses is None else poses[frame.index]
                used = frame.depth is not None and (frame.depth > 0).any()
                if not used:
                    frame = replace(frame, depth=None)
                has_masks = used and pose is not None and frame.index in listed
                yield frame, pose, masks.read(frame.index) if has_masks else None

        mapper = new_mapper(parameters, vocabulary)
        total = -(-len(reader) // parameters.every)
        last_snapshot = 0
        for frame, pose, ids in context.progress.track(prefetched(read()), total=total, description="fuse"):
            # Of the last frame the finished map is the snapshot, so one is taken when another frame comes.
            if parameters.snapshot_every and mapper.frames_integrated >= last_snapshot + parameters.snapshot_every:
                last_snapshot = mapper.frames_integrated
                write_snapshot(mapper, vocabulary, label, context)
            if frame.depth is None:
                skipped["no_depth"] += 1
            elif pose is None:
                skipped["no_pose"] += 1
            else:
                listing = listed.get(frame.index)
                camera = cameras[frame.camera_name]
                depth = frame.depth if outdated is None else outdated.without(frame.depth, camera, pose, frame.index)
                mapper.add_frame(
                    camera, depth, frame.color, pose, ids, listing or (), frame.deviation, frame.camera_name
                )
    return mapper, skipped, label
