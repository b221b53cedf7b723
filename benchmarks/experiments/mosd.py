"""Class-agnostic objects of real Kinect frames against their labels (modified OSD data set).

Arms: `plain` (convex segments, one merging pass), `geometric` (patches over the table, geometry and colour, a table of
rules), `ours` (the same patches, trained trees). Cases: `learn`, on which constants were set and trees trained, and
`test`. Measures: stages/kit/measurement/object_masks.py; objects are label // 10 from 2 up, parts the raw labels. Draws
frames.png, the worst and the best frames.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from pydantic import Field
from scenewright.stages.kit.drawing.palette import instance_color
from scenewright.stages.kit.formats.mosd_frames import (
    CAMERA,
    FOLDER,
    LabelledFrame,
    frame_files,
    frame_names,
    kind_of,
    read_frame,
)
from scenewright.stages.kit.measurement.object_masks import score_object_masks
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.segment import by_trees, read_trees, segment_objects, segment_plain
from scenewright.stages.segment.backends.objects.backend import BUNDLED
from scenewright.stages.segment.backends.objects.pairs import FEATURES

from benchmarks.experiment import Bench, Experiment, Measure, Results, Trial, count, mean, median

QUICK_STEP = 5
"""Every how many-th frame with --quick."""
SHEET_FRAMES = 5
LABELS = "labels.png"
"""What an arm makes of a frame, beside its record."""
Segmenter = Callable[[np.ndarray, np.ndarray], np.ndarray]


class MosdParameters(Parameters):
    """Options of the experiment."""

    data: Path = Field(Path("../shared/data"), description=f"Folder that holds {FOLDER}")


@dataclass(frozen=True)
class FrameScore:
    """What an arm makes of a frame."""

    overlap_f: float
    overlap_precision: float
    overlap_recall: float
    boundary_f: float
    boundary_precision: float
    boundary_recall: float
    right_count: float
    recalled_share: float
    part_overlap_f: float
    part_boundary_f: float
    part_right_count: float
    true_count: int
    found_count: int
    seconds: float
    processor_ms: float


def folder_of(bench: Bench, case: str) -> Path:
    """Where the frames of a case lie."""
    return bench.parameters.data / FOLDER / case


def seeds_of(bench: Bench, case: str) -> Sequence[str]:
    """The frames that are there."""
    return frame_names(folder_of(bench, case))[:: QUICK_STEP if bench.quick else 1]


def inputs(bench: Bench, trial: Trial) -> list[Path]:
    """The frame's files, and the trees of `ours`."""
    return [*frame_files(folder_of(bench, trial.case), trial.seed), *([BUNDLED] if trial.arm == "ours" else [])]


def segmenter_of(arm: str) -> Segmenter:
    """Return an arm: RGB and depth [m] to labels. Raises BadInput when the trees cannot be read."""
    if arm == "plain":
        return lambda color, depth: segment_plain(depth, CAMERA)
    if arm == "geometric":
        return lambda color, depth: segment_objects(color, depth, CAMERA).labels
    trees = read_trees(BUNDLED, FEATURES)
    return lambda color, depth: segment_objects(color, depth, CAMERA, by_trees(trees)).labels


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, FrameScore]]:
    """Yield an arm's scores. The first frame is run once more before, which compiles the loops and is not timed."""
    segmenter = segmenter_of(trials[0].arm)
    first = read_frame(folder_of(bench, trials[0].case), trials[0].seed)
    segmenter(first.color, first.depth)
    for trial in trials:
        frame = read_frame(folder_of(bench, trial.case), trial.seed)
        start, processor = time.perf_counter(), time.process_time()
        labels = segmenter(frame.color, frame.depth)
        seconds, spent = time.perf_counter() - start, time.process_time() - processor
        bench.folder(trial).mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(bench.folder(trial) / LABELS), labels.astype(np.uint16))
        yield trial, scored(frame, labels, seconds, spent)


def scored(frame: LabelledFrame, labels: np.ndarray, seconds: float, processor_seconds: float) -> FrameScore:
    """Compare labels with a frame's objects and parts."""
    score, parts = score_object_masks(frame.objects, labels), score_object_masks(frame.parts, labels)
    return FrameScore(
        score.overlap.f,
        score.overlap.precision,
        score.overlap.recall,
        score.boundary.f,
        score.boundary.precision,
        score.boundary.recall,
        float(score.right_count),
        score.recalled_share,
        parts.overlap.f,
        parts.boundary.f,
        float(parts.right_count),
        score.true_count,
        score.found_count,
        seconds,
        1000 * processor_seconds,
    )


def rate(records: Sequence[FrameScore]) -> float | None:
    """Frames a second: 1 / median wall time of a frame."""
    return float(1 / np.median([record.seconds for record in records])) if records else None


SHARES = (
    "overlap_precision",
    "overlap_recall",
    "overlap_f",
    "boundary_precision",
    "boundary_recall",
    "boundary_f",
    "right_count",
    "recalled_share",
    "part_overlap_f",
    "part_boundary_f",
    "part_right_count",
)
MEASURES = {name: mean(name) for name in SHARES} | {
    "frames": Measure(count, interval=False),
    "frames_per_second": Measure(rate, "frames/s", interval=False),
    "processor_ms": median("processor_ms", "ms", interval=False),
}


def more_figures(results: Results) -> dict[str, float | None]:
    """Figures by kind of scene."""
    flat: dict[str, float | None] = {}
    for case in results.cases:
        for arm in results.arms(case):
            kinds: dict[str, list[FrameScore]] = {}
            for name in results.seeds(case):
                if (score := results.get(arm, case, name)) is not None:
                    kinds.setdefault(kind_of(case, name), []).append(score)
            for kind, scores in kinds.items():
                own = {name: MEASURES[name].of(scores) for name in ("overlap_f", "boundary_f", "right_count", "frames")}
                flat |= {f"{arm}/{case}_{kind.replace(' ', '_')}/{name}": value for name, value in own.items()}
    return flat


def _painted(frame: LabelledFrame, labels: np.ndarray | None, text: str) -> np.ndarray:
    """A crop of the frame with labels in colour, BGR."""
    picture: np.ndarray = frame.color.astype(np.float32)
    if labels is not None:
        for k in np.unique(labels[labels > 0]):
            picture[labels == k] = 0.35 * picture[labels == k] + 0.65 * 255 * np.array(instance_color(int(k)))
        picture[labels == 0] *= 0.6
    rows, columns = np.nonzero(frame.objects)
    top, left = max(0, rows.min() - 20), max(0, columns.min() - 20)
    picture = picture[top : rows.max() + 20, left : columns.max() + 20]
    scale = min(300 / picture.shape[1], 240 / picture.shape[0])
    picture = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    canvas = np.zeros((264, 300, 3), np.uint8)
    canvas[: picture.shape[0], : picture.shape[1]] = picture[..., ::-1]
    cv2.putText(canvas, text, (4, 258), cv2.FONT_HERSHEY_SIMPLEX, 0.42, (255, 255, 255), 1, cv2.LINE_AA)
    return canvas


def write_sheet(results: Results) -> None:
    """Write the frames of `test` that `ours` segments worst and best: colour, truth, and every arm with its overlap F
    and the number of objects found of those that there are."""
    names = [name for name in results.seeds("test") if results.get("ours", "test", name)]
    order = sorted(names, key=lambda name: results.records[Trial("ours", "test", name)].overlap_f)
    chosen = order if len(order) <= 2 * SHEET_FRAMES else [*order[:SHEET_FRAMES], *order[-SHEET_FRAMES:]]
    rows = []
    for name in chosen:
        frame = read_frame(folder_of(results.bench, "test"), name)
        row = [_painted(frame, None, frame.name), _painted(frame, frame.objects, "truth")]
        for arm in results.arms("test"):
            if (score := results.get(arm, "test", name)) is None:
                continue
            labels = cv2.imread(str(results.bench.folder(Trial(arm, "test", name)) / LABELS), cv2.IMREAD_UNCHANGED)
            text = f"{arm} {score.overlap_f:.3f}, {score.found_count} of {score.true_count}"
            row.append(_painted(frame, labels, text))
        rows.append(row)
    if rows:
        widest = max(map(len, rows))
        cv2.imwrite(
            str(results.bench.out / "frames.png"), np.vstack([np.hstack(row) for row in rows if len(row) == widest])
        )


EXPERIMENT = Experiment(
    name="mosd",
    title="Objects of real tabletop frames",
    simulated="Nothing: frames of a Kinect, labelled by hand.",
    knows="Colour, depth and camera of one frame.",
    does_not_show="Other sensors, or rooms; `learn` was looked at while constants were set and trees trained.",
    arms={
        "plain": "convex segments, one merging pass",
        "geometric": "patches, a table of rules",
        "ours": "patches, trained trees",
    },
    cases=("learn", "test"),
    seeds_of=seeds_of,
    together=lambda trial: (trial.arm, trial.case),
    measure=measure,
    record=FrameScore,
    measures=MEASURES,
    parameters=MosdParameters,
    places=frozenset({"data"}),
    inputs=inputs,
    pairs=(("ours", "geometric"), ("ours", "plain")),
    compared=("overlap_f", "boundary_f", "right_count"),
    more_figures=more_figures,
    pictures=write_sheet,
)
