"""One room through all arms and cases: frames are read once, geometric segments and masks are shared."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.mapping.arms import DRIFTING, EVERYWHERE, LEVELS, NETWORK, SHOWN, Arm
from benchmarks.mapping.drift import drifting_poses
from benchmarks.mapping.rooms import RoomFolder
from schemas.ground_truth import GroundTruth
from schemas.panoptic_map import PanopticMap
from schemas.sequence import Sequence as SequenceArtifact
from schemas.vocabulary import load_vocabulary
from stages.engine.reading import open_artifact
from stages.evaluate.graph_measures import box_candidates
from stages.evaluate.map_measures import (
    instance_candidates,
    label_true_points,
    load_map,
    measure_quality,
    quality_thesis_code,
)
from stages.evaluate.parameters import EvaluateParameters
from stages.evaluate.results import Part
from stages.evaluate.truth import TrueRoom, load_truth
from stages.fuse.mapping import PanopticMapper
from stages.fuse.stage import new_mapper, write_map
from stages.graph.stage import run as build_graph
from stages.kit.formats.frames import Frame, FrameReader
from stages.kit.measurement.average_precision import Candidates
from stages.kit.measurement.panoptic_quality import ClassQuality
from stages.kit.progress import SilentProgress
from stages.kit.stage import Context
from stages.segment.choice import BackendRequest, choose_backend
from stages.segment.geometric import GeometricFrame, GeometricSettings, segment_depth
from stages.segment.parameters import SegmentParameters
from stages.segment.settings import fusion_settings, geometric_settings
from stages.segment.stage import FUSION, describe

DRIFT_STREAM = 11


@dataclass(frozen=True)
class Outcome:
    """What one arm made of one room in one case."""

    room: str
    arm: str
    case: str
    qualities: dict[str, ClassQuality]
    qualities_thesis_code: dict[str, ClassQuality]
    instances: dict[str, Candidates]
    boxes: dict[str, Candidates]
    boxes_refined: dict[str, Candidates]
    frames: int = 0
    seconds: float = 0.0
    """Wall clock of this arm's own work on the frames: geometric segments, fusion with the masks, integration."""


@dataclass(frozen=True)
class SharedFrame:
    """What every arm and case gets of a frame."""

    frame: Frame
    geometric: dict[GeometricSettings, tuple[GeometricFrame, float]]
    """Geometric segments by settings, and the seconds they took."""


def run_room(
    room: RoomFolder, arms: Sequence[Arm], cases: Sequence[str], scratch: Path, seed: int
) -> Iterator[tuple[str, list[Outcome]]]:
    """Yield case after case with the outcome of every arm. Maps are written under `scratch` and stay there."""
    sequence = open_artifact(room.sequence, SequenceArtifact)
    truth_artifact = open_artifact(room.ground_truth, GroundTruth)
    assert isinstance(sequence, SequenceArtifact) and isinstance(truth_artifact, GroundTruth)
    options = EvaluateParameters()
    truth = load_truth(truth_artifact, np.array(sequence.info.gravity.world_from_log), options.minimum_visible_points)
    with FrameReader(sequence.path("frames.mcap")) as reader:
        shared = read_frames(reader, arms) if cases else []
        for case in cases:
            outcomes = []
            present = [arm for arm in arms if case == SHOWN or arm.name in EVERYWHERE]
            seconds = dict.fromkeys([arm.name for arm in present], 0.0)
            mappers = build_maps(sequence, reader, shared, present, case, seed, seconds)
            for arm in present:
                output = scratch / room.name / case / arm.name
                panoptic_map = finish_map(mappers.pop(arm.name), output, seed)
                scene = (room.name, arm, case)
                found = measure(scene, truth, panoptic_map, options, output, seed)
                outcomes.append(replace(found, frames=len(shared), seconds=seconds[arm.name]))
            yield case, outcomes


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


def build_maps(
    sequence: SequenceArtifact,
    reader: FrameReader,
    shared: Sequence[SharedFrame],
    arms: Sequence[Arm],
    case: str,
    seed: int,
    seconds: dict[str, float],
) -> dict[str, PanopticMapper]:
    """Return the map of every arm after all frames of a case; adds the time of each to `seconds`."""
    vocabulary = load_vocabulary()
    mappers = {arm.name: new_mapper(arm.fuse, vocabulary) for arm in arms}
    own = {"backend": NETWORK} if case == NETWORK else {"backend": "ground-truth", "corruption": _level(case)}
    backend = choose_backend(BackendRequest(SegmentParameters.model_validate(own), sequence=sequence, reader=reader))
    poses = np.array([entry.frame.world_from_camera for entry in shared])
    if case == DRIFTING:
        poses = drifting_poses(poses, np.random.default_rng([seed, DRIFT_STREAM]))
    for entry, pose in zip(shared, poses, strict=True):
        frame, camera = entry.frame, reader.cameras[entry.frame.camera_name]
        # The same generator for every case: levels differ in their rates alone.
        random = np.random.default_rng([seed, frame.index])
        masks = backend(frame, next(iter(entry.geometric.values()))[0], random)
        for arm in arms:
            geometric, spent = entry.geometric[geometric_settings(arm.segment)]
            start = time.perf_counter()
            fuse = FUSION[arm.segment.fusion]
            fused = fuse(geometric.labels, masks, geometric.points, fusion_settings(arm.segment), geometric.small)
            listing = describe(frame.index, fused).segments
            assert frame.depth is not None
            mappers[arm.name].add_frame(camera, frame.depth, frame.color, pose, fused.ids, listing)
            seconds[arm.name] += spent + time.perf_counter() - start
    return mappers


def _level(case: str) -> float:
    return LEVELS[case.split("/")[0]]


def finish_map(mapper: PanopticMapper, output: Path, seed: int) -> PanopticMap:
    """Close the map and write it as a panoptic_map without a manifest under `output`."""
    folder = output / "panoptic_map"
    folder.mkdir(parents=True, exist_ok=True)
    mapper.regularize()
    context = Context(folder, seed=seed, device="cpu", progress=SilentProgress())
    return write_map(mapper, load_vocabulary(), "benchmark", {}, context)


def measure(
    scene: tuple[str, Arm, str],
    truth: TrueRoom,
    panoptic_map: PanopticMap,
    options: EvaluateParameters,
    output: Path,
    seed: int,
) -> Outcome:
    """Measure a finished map: PQ, instance candidates, and the boxes of the contact graph built from it."""
    room, arm, case = scene
    predicted = load_map(panoptic_map)
    labels = label_true_points(truth, predicted, options.label_distance)
    folder = output / "contact_graph"
    folder.mkdir(parents=True, exist_ok=True)
    context = Context(folder, seed=seed, device="cpu", progress=SilentProgress())
    graph = build_graph(panoptic_map, parameters=arm.graph, context=context).info
    points: Mapping[int, int] = {entity.instance: entity.vertices for entity in predicted.info.entities}
    return Outcome(
        room=room,
        arm=arm.name,
        case=case,
        qualities=measure_quality(Part("map"), truth, predicted, labels, options),
        qualities_thesis_code=quality_thesis_code(truth, predicted, options),
        instances=instance_candidates(truth, predicted, labels),
        boxes=box_candidates(truth, graph, points, "box_observed", options.match_iou),
        boxes_refined=box_candidates(truth, graph, points, "box", options.match_iou),
    )
