"""`make mosd`: class-agnostic objects of real Kinect frames against their labels (modified OSD data set).

    python -m benchmarks.tables.mosd --data FOLDER --out FOLDER [--quick]

Arms: `plain` (convex segments, one merging pass), `geometric` (patches over the table, geometry and colour, a table of
rules), `ours` (the same patches, trained trees). Cases: `learn`, on which constants were set and trees trained, and
`test`. Measures: benchmarks/tables/object_masks.py; objects are label // 10 from 2 up, parts the raw labels.
Writes metrics.json, table.md and frames.png, the worst and the best frames.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from benchmarks.tables.object_masks import ObjectMaskScore, score_object_masks
from schemas.errors import BadInput
from schemas.scene_parts import Camera
from stages.kit.drawing.palette import instance_color
from stages.kit.measurement.bootstrap import bootstrap_interval
from stages.segment.backends.objects.backend import BUNDLED
from stages.segment.backends.objects.boosting import read_trees
from stages.segment.backends.objects.grouping import by_trees
from stages.segment.backends.objects.pairs import FEATURES
from stages.segment.backends.objects.plain import segment_plain
from stages.segment.backends.objects.segmentation import segment_objects

CAMERA = Camera(width=640, height=480, fx=525.0, fy=525.0, cx=319.5, cy=239.5)
DEPTH_UNIT = 1e-4
"""Metres per count of the depth images."""
FIRST_OBJECT = 20
"""Labels below are table."""
KINDS = {
    "learn": {
        "boxes": range(17),
        "stacked boxes": range(17, 25),
        "occluded": range(25, 33),
        "cylinders": range(33, 45),
    },
    "test": {
        "boxes": range(16),
        "stacked boxes": range(16, 24),
        "occluded": range(24, 32),
        "cylinders": range(32, 44),
        "mixed": range(44, 56),
        "complex": range(56, 66),
    },
}
"""Kind of scene by the number of the frame."""
QUICK_STEP = 5
SHEET_FRAMES = 5
Segmenter = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class LabelledFrame:
    """One frame with its truth."""

    name: str
    color: np.ndarray
    """(H, W, 3) uint8 RGB."""
    depth: np.ndarray
    """(H, W) float32 [m], 0 missing."""
    objects: np.ndarray
    """(H, W) int32, 0 none."""
    parts: np.ndarray
    """(H, W) int32, 0 none."""


@dataclass(frozen=True)
class FrameResult:
    """What an arm makes of a frame."""

    frame: LabelledFrame
    labels: np.ndarray
    score: ObjectMaskScore
    part_score: ObjectMaskScore
    seconds: float
    processor_seconds: float


def read_frames(folder: Path, step: int = 1) -> list[LabelledFrame]:
    """Return every `step`-th frame of a folder, by number. Raises BadInput when it holds none or one is damaged."""
    names = sorted((path.name.removesuffix(".label.png") for path in folder.glob("*.label.png")), key=_number)
    if not names:
        raise BadInput(f"{folder}: no frames (NAME.color.png, NAME.depth.png, NAME.label.png)", hint="see docs/DATA.md")
    return [_read_frame(folder, name) for name in names[::step]]


def _number(name: str) -> int:
    digits = re.search(r"\d+$", name)
    return int(digits.group()) if digits else 0


def _read_frame(folder: Path, name: str) -> LabelledFrame:
    images = [
        cv2.imread(str(folder / f"{name}.{kind}.png"), cv2.IMREAD_UNCHANGED) for kind in ("color", "depth", "label")
    ]
    color, depth, label = images
    size = (CAMERA.height, CAMERA.width)
    if color is None or depth is None or label is None:
        raise BadInput(f"{folder / name}: color, depth or label is missing or no PNG", hint="copy the data set again")
    if color.shape != (*size, 3) or depth.shape != size or depth.dtype != np.uint16 or label.shape != size:
        raise BadInput(f"{folder / name}: not a frame of 640x480 with 16-bit depth", hint="copy the data set again")
    parts = np.where(label >= FIRST_OBJECT, label, 0).astype(np.int32)
    color = cv2.cvtColor(color, cv2.COLOR_BGR2RGB)
    return LabelledFrame(name, color, depth.astype(np.float32) * np.float32(DEPTH_UNIT), parts // 10, parts)


def arms() -> dict[str, Segmenter]:
    """Return the arms: RGB and depth [m] to labels. Raises BadInput when the trees cannot be read."""
    trees = read_trees(BUNDLED, FEATURES)
    return {
        "plain": lambda color, depth: segment_plain(depth, CAMERA),
        "geometric": lambda color, depth: segment_objects(color, depth, CAMERA).labels,
        "ours": lambda color, depth: segment_objects(color, depth, CAMERA, by_trees(trees)).labels,
    }


def judge(segmenter: Segmenter, frames: list[LabelledFrame]) -> list[FrameResult]:
    """Run an arm over frames. The first is run once more before, which compiles the loops and is not timed."""
    segmenter(frames[0].color, frames[0].depth)
    results = []
    for frame in frames:
        start, processor = time.perf_counter(), time.process_time()
        labels = segmenter(frame.color, frame.depth)
        seconds, processor_seconds = time.perf_counter() - start, time.process_time() - processor
        scores = score_object_masks(frame.objects, labels), score_object_masks(frame.parts, labels)
        results.append(FrameResult(frame, labels, *scores, seconds, processor_seconds))
    return results


def measures_of(results: list[FrameResult]) -> dict[str, float]:
    """Return the measures that metrics.json holds for one arm and case: means over frames, rates from the median."""
    overlap, boundary = [r.score.overlap for r in results], [r.score.boundary for r in results]
    return {
        "overlap_f": float(np.mean([a.f for a in overlap])),
        "overlap_precision": float(np.mean([a.precision for a in overlap])),
        "overlap_recall": float(np.mean([a.recall for a in overlap])),
        "boundary_f": float(np.mean([a.f for a in boundary])),
        "boundary_precision": float(np.mean([a.precision for a in boundary])),
        "boundary_recall": float(np.mean([a.recall for a in boundary])),
        "right_count": float(np.mean([r.score.right_count for r in results])),
        "recalled_share": float(np.mean([r.score.recalled_share for r in results])),
        "part_overlap_f": float(np.mean([r.part_score.overlap.f for r in results])),
        "part_boundary_f": float(np.mean([r.part_score.boundary.f for r in results])),
        "part_right_count": float(np.mean([r.part_score.right_count for r in results])),
        "frames": float(len(results)),
        "frames_per_second": float(1 / np.median([r.seconds for r in results])),
        "processor_ms": float(1000 * np.median([r.processor_seconds for r in results])),
    }


def kind_of(case: str, name: str) -> str:
    """Return the kind of scene of a frame."""
    return next((kind for kind, numbers in KINDS[case].items() if _number(name) in numbers), "other")


def _interval(values: list[float]) -> str:
    found = bootstrap_interval(np.array(values), np.random.default_rng(0))
    return f"{found.value:.3f} [{found.low:.3f}, {found.high:.3f}]" if found else "–"


def table_of(results: dict[str, dict[str, list[FrameResult]]]) -> str:
    """Return table.md: measures with intervals, kinds of scene, parts, speed."""
    lines = []
    for case in ("learn", "test"):
        some = next(iter(results.values()))[case]
        lines += [
            f"### `{case}`, {len(some)} frames",
            "",
            "| arm | overlap P | R | F [95 %] | boundary P | R | F [95 %] | right number | F@.75 | parts: overlap F "
            "| boundary F | frames/s | processor ms |",
            "|---|---|---|---|---|---|---|---|---|---|---|---|---|",
        ]
        for arm, cases in results.items():
            m = measures_of(cases[case])
            lines.append(
                f"| {arm} | {m['overlap_precision']:.3f} | {m['overlap_recall']:.3f} "
                f"| {_interval([r.score.overlap.f for r in cases[case]])} | {m['boundary_precision']:.3f} "
                f"| {m['boundary_recall']:.3f} | {_interval([r.score.boundary.f for r in cases[case]])} "
                f"| {_interval([float(r.score.right_count) for r in cases[case]])} | {m['recalled_share']:.3f} "
                f"| {m['part_overlap_f']:.3f} | {m['part_boundary_f']:.3f} | {m['frames_per_second']:.1f} "
                f"| {m['processor_ms']:.0f} |"
            )
        kinds = [kind for kind in KINDS[case] if any(kind_of(case, r.frame.name) == kind for r in some)]
        counts = [sum(kind_of(case, r.frame.name) == kind for r in some) for kind in kinds]
        heads = [f"{kind} ({count})" for kind, count in zip(kinds, counts, strict=True)]
        lines += ["", "| arm: overlap F / boundary F / right number | " + " | ".join(heads) + " |"]
        lines.append("|---|" + "---|" * len(kinds))
        for arm, cases in results.items():
            cells = []
            for kind in kinds:
                own = measures_of([r for r in cases[case] if kind_of(case, r.frame.name) == kind])
                cells.append(f"{own['overlap_f']:.3f} / {own['boundary_f']:.3f} / {own['right_count']:.2f}")
            lines.append(f"| {arm} | " + " | ".join(cells) + " |")
        lines.append("")
    load = os.getloadavg()[0]
    lines += [
        "Means over frames; intervals are percentile bootstraps over frames. `learn` helped to fit `geometric` and to "
        f"train `ours`, `test` did neither. frames/s: 1 / median wall time of a frame; {os.cpu_count()} processors "
        f"({platform.machine()}), load {load:.1f} at the end.",
        "",
    ]
    return "\n".join(lines)


def _painted(frame: LabelledFrame, labels: np.ndarray | None, text: str) -> np.ndarray:
    """A crop of the frame with labels in colour, BGR."""
    picture = frame.color.astype(np.float32)
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


def write_sheet(path: Path, results: dict[str, list[FrameResult]]) -> None:
    """Write the frames that `ours` segments worst and best: colour, truth, and every arm with its overlap F and the
    number of objects found of those that there are."""
    order = np.argsort([r.score.overlap.f for r in results["ours"]], kind="stable")
    chosen = order if len(order) <= 2 * SHEET_FRAMES else np.concatenate([order[:SHEET_FRAMES], order[-SHEET_FRAMES:]])
    rows = []
    for k in chosen:
        frame = results["ours"][k].frame
        row = [_painted(frame, None, frame.name), _painted(frame, frame.objects, "truth")]
        for arm, arm_results in results.items():
            score = arm_results[k].score
            text = f"{arm} {score.overlap.f:.3f}, {score.found_count} of {score.true_count}"
            row.append(_painted(frame, arm_results[k].labels, text))
        rows.append(np.hstack(row))
    cv2.imwrite(str(path), np.vstack(rows))


def main() -> None:
    """Run the arms over both cases and write what they reach."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder that holds mosd_tabletop")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--quick", action="store_true", help=f"every {QUICK_STEP}th frame")
    parser.add_argument("--case", choices=("learn", "test"), help="this case alone, printed and not written")
    arguments = parser.parse_args()
    root, step = arguments.data / "mosd_tabletop", QUICK_STEP if arguments.quick else 1
    if not root.is_dir():
        print(f"mosd: {root} is not there, nothing is measured (docs/DATA.md says where the data come from)")
        return
    try:
        if arguments.case:
            frames = read_frames(root / arguments.case, step)
            for arm, segmenter in arms().items():
                print(arm, json.dumps(measures_of(judge(segmenter, frames))))
            return
        frames_of = {case: read_frames(root / case, step) for case in ("learn", "test")}
        results = {
            arm: {case: judge(segmenter, frames) for case, frames in frames_of.items()}
            for arm, segmenter in arms().items()
        }
    except BadInput as error:
        raise SystemExit(f"mosd: {error}") from None
    metrics = {
        f"{arm}/{case}/{measure}": value
        for arm, cases in results.items()
        for case, case_results in cases.items()
        for measure, value in measures_of(case_results).items()
    }
    arguments.out.mkdir(parents=True, exist_ok=True)
    (arguments.out / "metrics.json").write_text(json.dumps(metrics, indent=2, sort_keys=True) + "\n")
    table = table_of(results)
    (arguments.out / "table.md").write_text(table)
    write_sheet(arguments.out / "frames.png", {arm: cases["test"] for arm, cases in results.items()})
    print(table)


if __name__ == "__main__":
    main()
