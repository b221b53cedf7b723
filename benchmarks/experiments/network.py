"""What our own network finds in generated rooms held back, in real tabletop clouds and in real logs.

Rooms: recipes with seeds of their reporting range, furnished from another library than that of the training, recorded
at 640x480 with sensor noise. Every frame is judged for itself: PQ per class over all frames, mean over the classes that
are there or were named; a class that was missed everywhere counts as 0. Arms: with everything that a log knows; without
colour; without poses, so without gravity. Beside the network's own masks those after the fusion with geometric
segments, which is what `segment` writes. mOSD: overlap and boundary F of class-agnostic objects (every mask of a thing
but tables and desks) on its test frames; nothing was chosen on mOSD, neither on `learn` nor on `test`. Real logs: how
many masks of each class a frame has. Pictures of frames lie beside the records.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
from pydantic import Field
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.sequence import Sequence as SequenceArtifact
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.drawing.palette import entity_color
from scenewright.stages.kit.formats.frames import Frame, FrameReader
from scenewright.stages.kit.formats.mosd_frames import CAMERA, FOLDER, frame_files, frame_names, read_frame
from scenewright.stages.kit.measurement.object_masks import score_object_masks
from scenewright.stages.kit.measurement.panoptic_quality import ClassQuality, average_quality, panoptic_quality
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.segment import (
    PanopticFrame,
    Predictor,
    SegmentParameters,
    fuse,
    fusion_settings,
    geometric_settings,
    load_predictor,
    mount_of_pose,
    segment_depth,
)
from scenewright.stages.segment.backends.network.weights import BUNDLED

from benchmarks.experiment import Bench, Experiment, Measure, Results, Trial
from benchmarks.experiments.scenenn.figures_of_merit import summed_qualities
from benchmarks.generated_rooms import RECIPES, STEPS, make_room
from benchmarks.steps import made, opened

ROOMS, CLOUDS = "rooms", "mosd_test"
SEEDS = tuple(f"{recipe}-{seed}" for seed in (1000, 1001) for recipe in RECIPES)[:6]
"""Rooms held back from training, measured before: they are not fresh."""
QUICK = {ROOMS: 2, CLOUDS: 6}
"""Seeds of a case with --quick."""
FUSED = "_fused"
OWN_ARMS = {
    "network": "everything that a log knows",
    "network_no_colour": "without colour",
    "network_no_gravity": "without poses, so without gravity",
}
ARMS = {
    name: title
    for arm, words in OWN_ARMS.items()
    for name, title in ((arm, words), (arm + FUSED, f"{words}; fused with geometric segments"))
    if name != "network_no_gravity" + FUSED
}
VOCABULARY = load_vocabulary()
NAMES = {entry.id: entry.name for entry in VOCABULARY.classes}
STUFF = frozenset(entry.name for entry in VOCABULARY.classes if entry.kind == "stuff")
SURFACES = frozenset({"table", "desk"})
"""Things that carry the objects of a tabletop and are none."""
LOGS = {"kitchen": ("7scenes_redkitchen", 25), "livingroom": ("redwood_livingroom1", 10)}
"""Name -> folder of the real data and every how many-th frame is looked at."""
PICTURES_PER_LOG = 8


class NetworkParameters(Parameters):
    """Options of the experiment."""

    data: Path = Field(Path("../shared/data"), description="Folder with the real logs")
    weights: Path = Field(BUNDLED, description="Checkpoint of the network")
    rooms: Path | None = Field(None, description="Folder of rooms; otherwise made in OUT/rooms")
    frames: int = Field(20, ge=1, description="Frames of every room")
    thinned: int = Field(1, ge=1, description="Frames of real logs are looked at so many times more rarely")


@dataclass(frozen=True)
class Judged:
    """What an arm makes of a room, a cloud or a log; only the part of its case is filled."""

    qualities: dict[str, ClassQuality] = field(default_factory=dict)
    scores: dict[str, float] = field(default_factory=dict)
    masks: dict[str, float] = field(default_factory=dict)
    """Class -> masks a frame."""
    frames: int = 0
    seconds: float = 0.0
    processor_seconds: float = 0.0
    """Of the network and its grouping, in rooms."""


def masks_of(
    predictor: Predictor, frame: Frame, camera: Camera, arm: str, *, gravity: bool = True, floor: bool = True
) -> PanopticFrame:
    """Return the network's masks under an arm; `gravity` and `floor` say what the log knows at best."""
    assert frame.depth is not None
    known = gravity and arm != "network_no_gravity"
    mount = mount_of_pose(frame.world_from_camera, gravity_known=known, floor_is_zero=floor)
    color = None if arm == "network_no_colour" else frame.color
    return predictor.predict(frame.depth, color, camera, mount)


def fused_masks(frame: Frame, camera: Camera, masks: PanopticFrame) -> tuple[np.ndarray, dict[int, str]]:
    """Return (ids (H, W), class names) after the fusion with geometric segments, as `segment` makes it: segments of one
    instance of one class joined."""
    assert frame.depth is not None
    parameters = SegmentParameters.model_validate({"backend": "network"})
    geometric = segment_depth(frame.depth, camera, geometric_settings(parameters))
    fused = fuse(geometric.labels, masks, geometric.points, fusion_settings(parameters))
    lookup = np.zeros(int(fused.ids.max(initial=0)) + 1, dtype=np.int64)
    names: dict[int, str] = {}
    joined: dict[tuple[int, int], int] = {}
    for segment in fused.segments:
        if segment.class_id:
            key = (segment.class_id, segment.instance or -segment.id)
            lookup[segment.id] = joined.setdefault(key, len(joined) + 1)
            names[joined[key]] = NAMES[segment.class_id]
    return lookup[fused.ids], names


def quality(frame: Frame, truth: dict[int, str], ids: np.ndarray, names: dict[int, str]) -> dict[str, ClassQuality]:
    """Return the sums of PQ per class of one frame."""
    assert frame.labels is not None
    return panoptic_quality(frame.labels.ravel().astype(np.int64), ids.ravel().astype(np.int64), truth, names, STUFF)


def runs(arm: str, case: str) -> bool:
    """Clouds have no gravity to take away; masks a frame of logs are the network's own."""
    if case == CLOUDS:
        return arm != "network_no_gravity"
    return case == ROOMS or arm in OWN_ARMS


def seeds_of(bench: Bench, case: str) -> Sequence[str]:
    """Rooms, clouds, or the log where it is there."""
    if case == ROOMS:
        return SEEDS[: QUICK[ROOMS] if bench.quick else None]
    if case == CLOUDS:
        return frame_names(bench.parameters.data / FOLDER / "test")[: QUICK[CLOUDS] if bench.quick else None]
    return [case] if (bench.parameters.data / LOGS[case][0]).is_dir() else []


def inputs(bench: Bench, trial: Trial) -> list[Path]:
    """The checkpoint, and a cloud's files."""
    clouds = bench.parameters.data / FOLDER / "test"
    return [bench.parameters.weights, *(frame_files(clouds, trial.seed) if trial.case == CLOUDS else ())]


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Judged]]:
    """Yield what the arms make of one room, cloud or log."""
    predictor = load_predictor(bench.parameters.weights, VOCABULARY)
    judge = {ROOMS: judge_room, CLOUDS: judge_cloud}.get(trials[0].case, judge_log)
    judged = judge(predictor, bench, {trial.arm: trial for trial in trials})
    yield from ((trial, judged[trial.arm]) for trial in trials)


def own_arms(trials: Mapping[str, Trial]) -> list[str]:
    """The arms whose masks are needed."""
    return [arm for arm in OWN_ARMS if {arm, arm + FUSED} & set(trials)]


def judge_room(predictor: Predictor, bench: Bench, trials: Mapping[str, Trial]) -> dict[str, Judged]:
    """Return the sums over all frames of a room, by arm."""
    name = next(iter(trials.values())).seed
    room = make_room(bench.parameters.rooms or bench.out / "rooms", name, bench.parameters.frames)
    sequence = opened(SequenceArtifact, room.sequence)
    truth = {entry.instance: entry.class_name for entry in sequence.info.label_table}
    sums: dict[str, dict[str, ClassQuality]] = {arm: {} for arm in ARMS}
    frames, wall, processor = 0, dict.fromkeys(ARMS, 0.0), dict.fromkeys(ARMS, 0.0)
    with FrameReader(sequence.path("frames.mcap")) as reader:
        for frame in reader.frames(streams=("color", "depth", "labels")):
            camera = reader.cameras[frame.camera_name]
            frames += 1
            for arm in own_arms(trials):
                started, spent = time.perf_counter(), time.process_time()
                masks = masks_of(predictor, frame, camera, arm)
                wall[arm] += time.perf_counter() - started
                processor[arm] += time.process_time() - spent
                results = {arm: (masks.ids, names_of(masks))}
                if arm + FUSED in trials:
                    results[arm + FUSED] = fused_masks(frame, camera, masks)
                for into, (ids, names) in results.items():
                    for class_name, entry in quality(frame, truth, ids, names).items():
                        sums[into][class_name] = sums[into].get(class_name, ClassQuality()) + entry
    return {
        arm: Judged(sums[arm], frames=frames, seconds=wall[arm], processor_seconds=processor[arm]) for arm in trials
    }


def names_of(masks: PanopticFrame) -> dict[int, str]:
    """Return the class name of every mask."""
    return {number: NAMES[mask.class_id] for number, mask in masks.masks.items()}


def objects_of(ids: np.ndarray, names: dict[int, str]) -> np.ndarray:
    """Return the ids (H, W) of the masks of things that are no tables or desks."""
    kept = [number for number, name in names.items() if name not in STUFF | SURFACES]
    return np.where(np.isin(ids, kept), ids, 0)


def judge_cloud(predictor: Predictor, bench: Bench, trials: Mapping[str, Trial]) -> dict[str, Judged]:
    """Return the scores of one tabletop frame, by arm."""
    name = next(iter(trials.values())).seed
    cloud = read_frame(bench.parameters.data / FOLDER / "test", name)
    frame = Frame(0, 0.0, cloud.color, cloud.depth, None, None)
    judged = {}
    for arm in own_arms(trials):
        masks = masks_of(predictor, frame, CAMERA, arm)
        found = {arm: objects_of(masks.ids, names_of(masks))}
        if arm + FUSED in trials:
            found[arm + FUSED] = objects_of(*fused_masks(frame, CAMERA, masks))
        if arm in trials:
            draw(bench.folder(trials[arm]) / "masks.png", frame, masks)
        for into, ids in found.items():
            score = score_object_masks(cloud.objects, ids)
            judged[into] = Judged(
                scores={
                    "overlap_f": score.overlap.f,
                    "overlap_precision": score.overlap.precision,
                    "overlap_recall": score.overlap.recall,
                    "boundary_f": score.boundary.f,
                    "right_count": float(score.right_count),
                }
            )
    return judged


def judge_log(predictor: Predictor, bench: Bench, trials: Mapping[str, Trial]) -> dict[str, Judged]:
    """Return the mean number of masks a frame of a real log, by arm; draws some of its frames."""
    case = next(iter(trials.values())).case
    folder, every = LOGS[case]
    log, thinned = bench.parameters.data / folder, every * bench.parameters.thinned
    path = made("ingest", bench.out / "logs" / f"{case}-{thinned}", "--log", log, "--every", thinned)
    sequence = opened(SequenceArtifact, path)
    method = sequence.info.gravity.method
    counts: dict[str, Counter[str]] = {arm: Counter() for arm in trials}
    with FrameReader(sequence.path("frames.mcap")) as reader:
        total = len(reader)
        for arm, trial in trials.items():
            for k, frame in enumerate(reader.frames(streams=("color", "depth"))):
                masks = masks_of(
                    predictor,
                    frame,
                    reader.cameras[frame.camera_name],
                    arm,
                    gravity=method != "none",
                    floor=method in ("given", "floor_plane"),
                )
                counts[arm].update(NAMES[mask.class_id] for mask in masks.masks.values())
                if k % max(1, total // PICTURES_PER_LOG) == 0 and arm != "network_no_gravity":
                    draw(bench.folder(trial) / f"{k:03d}.png", frame, masks)
    return {
        arm: Judged(masks={name: count / total for name, count in sorted(counter.items())}, frames=total)
        for arm, counter in counts.items()
    }


def draw(file: Path, frame: Frame, masks: PanopticFrame) -> None:
    """Write the picture beside its masks with their names and scores."""
    shape = masks.ids.shape
    picture = frame.color if frame.color is not None else np.zeros((*shape, 3), dtype=np.uint8)
    painted = np.full((*shape, 3), 40, dtype=np.uint8)
    for identity, mask in masks.masks.items():
        name = NAMES[mask.class_id]
        painted[masks.ids == identity] = np.round(255 * np.array(entity_color(identity, name)))
    for identity, mask in masks.masks.items():
        rows, columns = np.nonzero(masks.ids == identity)
        if len(rows) > 150:
            text = f"{NAMES[mask.class_id]} {mask.score:.2f}"
            at = (int(columns.mean()) - 25, int(rows.mean()))
            cv2.putText(painted, text, at, cv2.FONT_HERSHEY_SIMPLEX, 0.4, (255, 255, 255), 1, cv2.LINE_AA)
    file.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(file), np.hstack([picture, painted])[..., ::-1])


def of_quality(which: str) -> Measure:
    """PQ, SQ or RQ: the mean over classes."""

    def figure(records: Sequence[Judged]) -> float | None:
        sums = summed_qualities(records)
        return (getattr(average_quality(sums.values()), which) or 0.0) if sums else None

    return Measure(figure)


def of_score(name: str) -> Measure:
    """Mean over clouds."""

    def figure(records: Sequence[Judged]) -> float | None:
        values = [record.scores[name] for record in records if record.scores]
        return float(np.mean(values)) if values else None

    return Measure(figure)


def rate(records: Sequence[Judged]) -> float | None:
    """Frames a second of the network and its grouping."""
    seconds = sum(record.seconds for record in records)
    return sum(record.frames for record in records) / seconds if seconds else None


def processor_seconds(records: Sequence[Judged]) -> float | None:
    """Processor time a frame."""
    spent = sum(record.processor_seconds for record in records)
    return spent / sum(record.frames for record in records) if spent else None


def clouds(records: Sequence[Judged]) -> float | None:
    """Number of clouds."""
    return float(sum(bool(record.scores) for record in records)) or None


SCORES = ("overlap_f", "overlap_precision", "overlap_recall", "boundary_f", "right_count")
MEASURES = {name: of_quality(name) for name in ("pq", "sq", "rq")} | {name: of_score(name) for name in SCORES}
MEASURES |= {
    "frames": Measure(clouds, interval=False),
    "frames_per_second": Measure(rate, "frames/s", interval=False),
    "processor_seconds_per_frame": Measure(processor_seconds, "s", interval=False),
}


def more_figures(results: Results) -> dict[str, float | None]:
    """PQ of every class, and masks a frame of every class."""
    flat: dict[str, float | None] = {}
    for case in results.cases:
        for arm in results.arms(case):
            records = results.of(arm, case)
            flat |= {f"{arm}/{case}/pq_{name}": entry.pq for name, entry in summed_qualities(records).items()}
            for record in records:
                flat |= {f"{arm}/{case}/masks_{name}": value for name, value in record.masks.items()}
    return flat


EXPERIMENT = Experiment(
    name="network",
    title="Our own segmentation network",
    simulated="The rooms, their pictures and noisy depth. Tabletops and logs are recordings.",
    knows="Colour, depth, camera, gravity and poses, less what the arm takes away.",
    does_not_show="Quality on real rooms: their logs have no labels, so that masks are counted alone.",
    arms=ARMS,
    cases=(ROOMS, CLOUDS, *LOGS),
    runs=runs,
    reporting=SEEDS,
    seeds_of=seeds_of,
    together=lambda trial: (trial.case, trial.seed),
    measure=measure,
    record=Judged,
    measures=MEASURES,
    more_figures=more_figures,
    parameters=NetworkParameters,
    places=frozenset({"data", "weights", "rooms"}),
    quick={"frames": 6, "thinned": 4},
    inputs=inputs,
    steps=STEPS,
)
