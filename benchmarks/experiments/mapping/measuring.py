"""One room through arms and cases: frames are read once, geometric segments and masks are shared."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.sequence import Sequence as SequenceArtifact
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.evaluate import (
    EvaluateParameters,
    Part,
    PredictedMap,
    TrueRoom,
    box_candidates,
    instance_candidates,
    label_true_points,
    load_map,
    load_truth,
    measure_quality,
    quality_thesis_code,
)
from scenewright.stages.fuse import MaskSource, PanopticMapper, new_mapper, write_map
from scenewright.stages.kit.formats.frames import Frame, FrameReader
from scenewright.stages.kit.measurement.average_precision import Candidates, match_greedily
from scenewright.stages.kit.measurement.panoptic_quality import ClassQuality
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.segment import (
    BackendRequest,
    GeometricFrame,
    GeometricSettings,
    SegmentParameters,
    choose_backend,
    fusion_settings,
    geometric_settings,
    segment_depth,
)
from scenewright.stages.segment.one_frame import FUSION, describe

from benchmarks.experiment import Bench, Trial
from benchmarks.experiments.mapping.arms import (
    BENT,
    DRIFTING,
    ESTIMATED,
    LASTING,
    LASTING_CASES,
    LEVELS,
    NETWORK,
    Arm,
    all_arms,
)
from benchmarks.experiments.mapping.depth_faults import DepthFaults, drawn_faults
from benchmarks.experiments.mapping.drift import drifting_poses
from benchmarks.experiments.mapping.estimated import estimated_poses
from benchmarks.generated_rooms import RoomFolder, error_seed, make_room, room_of
from benchmarks.steps import context_in, opened, unrecorded

DRIFT_STREAM, FAULT_STREAM = 11, 12
SEED = 0
"""Of the steps; what is drawn of a room is drawn by its name (`error_seed`)."""


class MappingParameters(Parameters):
    """Options of the experiment."""

    voxel_size: float = Field(0.02, gt=0, description="Voxel edge of all arms [m] (the publications: 0.01)")
    frames: int = Field(60, ge=1, description="Frames of every room")
    width: int = Field(640, ge=64, description="Width of the pictures [pixels]; their height is three quarters of it")
    rescaled: float = Field(0.0, ge=0, le=0.3, description="By what share things are larger or smaller than models")
    untrained: bool = Field(False, description="With --tuning: rooms that our own network never saw")


@dataclass(frozen=True)
class Ranked:
    """Predictions of one class in one room with whether each found something true. Matching never crosses rooms, so
    that it is done once and pooling is a sort."""

    confidence: tuple[float, ...]
    hits: tuple[bool, ...]
    true_count: int


@dataclass(frozen=True)
class Outcome:
    """What one arm made of one room in one case, by class."""

    qualities: dict[str, ClassQuality]
    qualities_thesis_code: dict[str, ClassQuality]
    instances: dict[str, Ranked]
    boxes: dict[str, Ranked]
    boxes_refined: dict[str, Ranked]
    frames: int = 0
    seconds: float = 0.0
    """Wall clock of this arm's own work on the frames: geometric segments, fusion with the masks, integration."""


@dataclass(frozen=True)
class SharedFrame:
    """What every arm and case gets of a frame."""

    frame: Frame
    geometric: dict[GeometricSettings, tuple[GeometricFrame, float]]
    """Geometric segments by settings, and the seconds they took."""


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Outcome]]:
    """Yield the outcomes of the trials of one room, case after case; the maps are left in the folders of the trials."""
    parameters: MappingParameters = bench.parameters
    room, drawn = room_for(bench.out / "rooms", trials[0].seed, parameters), error_seed(trials[0].seed)
    sequence, truth_artifact = opened(SequenceArtifact, room.sequence), opened(GroundTruth, room.ground_truth)
    options = EvaluateParameters.model_validate({})
    truth = load_truth(truth_artifact, np.array(sequence.info.gravity.world_from_log), options.minimum_visible_points)
    arms = {arm.name: arm for arm in all_arms(parameters.voxel_size)}
    with FrameReader(sequence.path("frames.mcap")) as reader:
        shared = read_frames(reader, [arms[name] for name in dict.fromkeys(trial.arm for trial in trials)])
        for case in dict.fromkeys(trial.case for trial in trials):
            present = {trial.arm: trial for trial in trials if trial.case == case}
            seconds = dict.fromkeys(present, 0.0)
            poses = poses_of(case, bench.out / "rooms", trials[0].seed, shared, parameters)
            mappers = build_maps(sequence, reader, shared, poses, [arms[n] for n in present], case, drawn, seconds)
            for name, trial in present.items():
                output = bench.folder(trial)
                panoptic_map = finish_map(mappers.pop(name), output, SEED)
                found = outcome_of(arms[name], truth, panoptic_map, options, output)
                yield trial, replace(found, frames=len(shared), seconds=seconds[name])


def room_for(root: Path, seed: str, parameters: MappingParameters) -> RoomFolder:
    """Make the room of a trial's seed unless it is up to date."""
    return make_room(root, room_of(seed), parameters.frames, size=size_of(parameters), rescaled=parameters.rescaled)


def size_of(parameters: MappingParameters) -> tuple[int, int]:
    """Return width and height of the pictures [pixels]."""
    return parameters.width, 3 * parameters.width // 4


def read_frames(reader: FrameReader, arms: Sequence[Arm]) -> list[SharedFrame]:
    """Return the frames that have depth and a pose, with the geometric segments that the arms need."""
    wanted = list(dict.fromkeys(geometric_settings(arm.segment) for arm in arms))
    shared = []
    for frame in reader.frames():
        if frame.depth is None or frame.world_from_camera is None:
            continue
        made = {}
        for settings in wanted:
            start = time.perf_counter()
            geometric = segment_depth(frame.depth, reader.cameras[frame.camera_name], settings)
            made[settings] = (geometric, time.perf_counter() - start)
        shared.append(SharedFrame(frame, made))
    return shared


def poses_of(
    case: str, root: Path, seed: str, shared: Sequence[SharedFrame], parameters: MappingParameters
) -> np.ndarray:
    """Return the poses (N, 4, 4) of a case; NaN for frames that have none. Raises StepFailed."""
    poses = np.array([entry.frame.world_from_camera for entry in shared])
    if case == DRIFTING:
        return drifting_poses(poses, np.random.default_rng([error_seed(seed), DRIFT_STREAM]))
    if case == ESTIMATED:
        times = np.array([entry.frame.time for entry in shared])
        return estimated_poses(root, seed, times, size=size_of(parameters), rescaled=parameters.rescaled)
    return poses


def build_maps(
    sequence: SequenceArtifact,
    reader: FrameReader,
    shared: Sequence[SharedFrame],
    poses: np.ndarray,
    arms: Sequence[Arm],
    case: str,
    seed: int,
    seconds: dict[str, float],
) -> dict[str, PanopticMapper]:
    """Return the map of every arm after the frames of a case that have a pose; adds the time of each to `seconds`."""
    vocabulary = load_vocabulary()
    mappers = {arm.name: new_mapper(arm.fuse, vocabulary) for arm in arms}
    asked = SegmentParameters.model_validate(masks_of(case))
    backend = choose_backend(BackendRequest(asked, sequence=sequence, reader=reader, seed=seed))
    faults = drawn_faults(np.random.default_rng([seed, FAULT_STREAM])) if case == BENT else None
    for entry, pose in zip(shared, poses, strict=True):
        if np.isnan(pose).any():
            continue
        frame, camera = entry.frame, reader.cameras[entry.frame.camera_name]
        made = entry.geometric if faults is None else spoiled(frame, camera, faults, entry.geometric)
        assert frame.depth is not None
        depth = frame.depth if faults is None else faults.depth(frame.depth, camera)
        # The same generator for every case: levels differ in their rates alone.
        random = np.random.default_rng([seed, frame.index])
        masks = backend(frame, next(iter(entry.geometric.values()))[0], random)
        if faults is not None:
            masks = replace(masks, ids=faults.shifted(masks.ids))
        for arm in arms:
            geometric, spent = made[geometric_settings(arm.segment)]
            start = time.perf_counter()
            fuse = FUSION[arm.segment.fusion]
            fused = fuse(geometric.labels, masks, geometric.points, fusion_settings(arm.segment), geometric.small)
            listing = describe(frame.index, fused).segments
            mappers[arm.name].add_frame(camera, depth, frame.color, pose, fused.ids, listing)
            seconds[arm.name] += spent + time.perf_counter() - start
    return mappers


def masks_of(case: str) -> dict[str, Any]:
    """Return the options of `segment` of a case."""
    if case == NETWORK:
        return {"backend": NETWORK}
    if case in LEVELS:
        return {"backend": "ground-truth", "corruption": LEVELS[case]}
    return {"backend": "ground-truth", "lasting": LASTING_CASES.get(case, LASTING_CASES[LASTING])}


def spoiled(
    frame: Frame, camera: Camera, faults: DepthFaults, wanted: Iterable[GeometricSettings]
) -> dict[GeometricSettings, tuple[GeometricFrame, float]]:
    """Return the geometric segments of a frame's spoiled depth, and the seconds they took."""
    assert frame.depth is not None
    depth, found = faults.depth(frame.depth, camera), {}
    for each in wanted:
        start = time.perf_counter()
        geometric = segment_depth(depth, camera, each)
        found[each] = (geometric, time.perf_counter() - start)
    return found


def finish_map(mapper: PanopticMapper, output: Path, seed: int) -> PanopticMap:
    """Close the map and write it as a panoptic_map without a manifest under `output`."""
    mapper.regularize()
    return write_map(mapper, load_vocabulary(), MaskSource("benchmark"), {}, context_in(output / "panoptic_map", seed))


def outcome_of(
    arm: Arm, truth: TrueRoom, panoptic_map: PanopticMap, options: EvaluateParameters, output: Path
) -> Outcome:
    """Measure a finished map: PQ, instances, and the boxes of the contact graph built from it."""
    graph = unrecorded("graph", output / "contact_graph", arm.graph, seed=SEED, panoptic_map=panoptic_map).info
    return outcome_of_map(truth, load_map(panoptic_map), graph, options)


def outcome_of_map(
    truth: TrueRoom, predicted: PredictedMap, graph: ContactGraphFile, options: EvaluateParameters
) -> Outcome:
    """Measure a map and the boxes of its contact graph against the truth, by class."""
    labels = label_true_points(truth, predicted, options.label_distance)
    points: Mapping[int, int] = {entity.instance: entity.vertices for entity in predicted.info.entities}
    return Outcome(
        qualities=measure_quality(Part("map"), truth, predicted, labels, options),
        qualities_thesis_code=quality_thesis_code(truth, predicted, options),
        instances=ranked(instance_candidates(truth, predicted, labels)),
        boxes=ranked(box_candidates(truth, graph, points, "box_observed", options.match_iou)),
        boxes_refined=ranked(box_candidates(truth, graph, points, "box", options.match_iou)),
    )


def ranked(candidates: Mapping[str, Candidates]) -> dict[str, Ranked]:
    """Match the predictions of each class in falling confidence (`average_precision.match_greedily`)."""
    result = {}
    for name, found in candidates.items():
        matches = match_greedily(found.iou, found.confidence)
        confidence = tuple(float(found.confidence[row]) for row, _ in matches)
        result[name] = Ranked(confidence, tuple(truth is not None for _, truth in matches), found.iou.shape[1])
    return result
