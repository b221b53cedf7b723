"""`make bench-network`: what our own network finds in generated rooms held back, in real clouds and in real logs.

    python -m benchmarks.tables.network --data REAL_DATA --out FOLDER [--quick] [--weights FILE] [--rooms FOLDER]

Rooms: recipes with seeds of their reporting range, furnished from another library than that of the training, recorded
at 640x480 with sensor noise. Every frame is judged for itself: PQ per class over all frames, mean over the classes that
are there or were named; a class that was missed everywhere counts as 0. Arms: with everything that a log knows; without
colour; without poses, so without gravity. Beside the network's own masks those after the fusion with geometric
segments, which is what `segment` writes. mOSD: overlap and boundary F of class-agnostic objects (every mask of a thing
but tables and desks) on its test frames; nothing was chosen on mOSD, neither on `learn` nor on `test`. Real logs: how
many masks of each class a frame has, and pictures to look at. Writes metrics.json, table.md and pictures/.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from benchmarks.mapping.rooms import REPORTING, make_room
from benchmarks.tables.object_masks import score_object_masks
from schemas.scene_parts import Camera
from schemas.sequence import Sequence
from schemas.vocabulary import load_vocabulary
from stages.engine.chain import run_command
from stages.engine.reading import open_artifact
from stages.kit.drawing.palette import entity_color
from stages.kit.formats.frames import Frame, FrameReader
from stages.kit.measurement.panoptic_quality import ClassQuality, average_quality, panoptic_quality
from stages.segment.backends.network.backend import Predictor, load_predictor
from stages.segment.backends.network.features import mount_of_pose
from stages.segment.backends.network.weights import BUNDLED
from stages.segment.fusion_ours import fuse
from stages.segment.geometric import segment_depth
from stages.segment.panoptic import PanopticFrame
from stages.segment.parameters import SegmentParameters
from stages.segment.settings import fusion_settings, geometric_settings

ROOMS, FRAMES, QUICK_ROOMS, QUICK_FRAMES, QUICK_CLOUDS = 6, 20, 2, 6, 6
ARMS = ("network", "network_no_colour", "network_no_gravity")
VOCABULARY = load_vocabulary()
NAMES = {entry.id: entry.name for entry in VOCABULARY.classes}
STUFF = frozenset(entry.name for entry in VOCABULARY.classes if entry.kind == "stuff")
SURFACES = frozenset({"table", "desk"})
"""Things that carry the objects of a tabletop and are none."""
MOSD_CAMERA = Camera(width=640, height=480, fx=525.0, fy=525.0, cx=319.5, cy=239.5)
MOSD_DEPTH_UNIT = 0.0001
"""[m]"""
LOGS = {"kitchen": ("7scenes_redkitchen", 25), "livingroom": ("redwood_livingroom1", 10)}
"""Name -> folder of the real data and every how many-th frame is looked at."""
PICTURES_PER_LOG = 8


@dataclass
class Cost:
    """Time of the network on the frames of the rooms."""

    frames: int = 0
    wall: float = 0.0
    processor: float = 0.0


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
    parameters = SegmentParameters(backend="network")
    geometric = segment_depth(frame.depth, camera, geometric_settings(parameters))
    fused = fuse(geometric.labels, masks, geometric.points, fusion_settings(parameters))
    lookup = np.zeros(int(fused.ids.max(initial=0)) + 1, dtype=np.int64)
    names: dict[int, str] = {}
    joined: dict[tuple[int, int], int] = {}
    for segment in fused.segments:
        if segment.category_id:
            key = (segment.category_id, segment.instance or -segment.id)
            lookup[segment.id] = joined.setdefault(key, len(joined) + 1)
            names[joined[key]] = NAMES[segment.category_id]
    return lookup[fused.ids], names


def quality(frame: Frame, truth: dict[int, str], ids: np.ndarray, names: dict[int, str]) -> dict[str, ClassQuality]:
    """Return the sums of PQ per class of one frame."""
    assert frame.labels is not None
    return panoptic_quality(
        frame.labels.ravel().astype(np.int64), ids.ravel().astype(np.int64), truth, names, STUFF
    )  # fmt: skip


def judge_rooms(
    predictor: Predictor, root: Path, rooms: tuple[tuple[str, int], ...], frames: int
) -> tuple[dict[str, dict[str, ClassQuality]], Cost]:
    """Return (arm -> class -> sums over all rooms and frames, cost of the arm `network`)."""
    sums: dict[str, dict[str, ClassQuality]] = {}
    cost = Cost()
    for recipe, seed in rooms:
        sequence = open_artifact(make_room(root, recipe, seed, frames).sequence, Sequence)
        assert isinstance(sequence, Sequence)
        truth = {entry.instance: entry.class_name for entry in sequence.info.label_table}
        with FrameReader(sequence.path("frames.mcap")) as reader:
            for frame in reader.frames(streams=("color", "depth", "labels")):
                camera = reader.cameras[frame.camera_name]
                for arm in ARMS:
                    started, processor = time.perf_counter(), time.process_time()
                    masks = masks_of(predictor, frame, camera, arm)
                    if arm == "network":
                        cost.frames += 1
                        cost.wall += time.perf_counter() - started
                        cost.processor += time.process_time() - processor
                    results = {arm: (masks.ids, names_of(masks))}
                    if arm != "network_no_gravity":
                        results[f"{arm}_fused"] = fused_masks(frame, camera, masks)
                    for name, (ids, names) in results.items():
                        into = sums.setdefault(name, {})
                        for class_name, entry in quality(frame, truth, ids, names).items():
                            into[class_name] = into.get(class_name, ClassQuality()) + entry
        print(f"{recipe} {seed}: judged", flush=True)
    return sums, cost


def names_of(masks: PanopticFrame) -> dict[int, str]:
    """Return the class name of every mask."""
    return {number: NAMES[mask.category_id] for number, mask in masks.masks.items()}


def objects_of(ids: np.ndarray, names: dict[int, str]) -> np.ndarray:
    """Return the ids (H, W) of the masks of things that are no tables or desks."""
    kept = [number for number, name in names.items() if name not in STUFF | SURFACES]
    return np.where(np.isin(ids, kept), ids, 0)


def mosd_frames(folder: Path) -> Iterator[tuple[str, Frame, np.ndarray]]:
    """Yield (name, frame, object labels (H, W)) of a folder of mOSD; labels 20 to 29 are object 2 and so on."""
    for file in sorted(folder.glob("*.depth.png")):
        name = file.name.removesuffix(".depth.png")
        depth = cv2.imread(str(file), cv2.IMREAD_UNCHANGED).astype(np.float32) * np.float32(MOSD_DEPTH_UNIT)
        color = cv2.imread(str(folder / f"{name}.color.png"), cv2.IMREAD_COLOR)[..., ::-1]
        labels = cv2.imread(str(folder / f"{name}.label.png"), cv2.IMREAD_UNCHANGED)
        parts = labels.astype(np.int64) // 10
        truth = np.where(parts >= 2, parts, 0)
        yield name, Frame(0, 0.0, np.ascontiguousarray(color), depth, None, None), truth


def judge_mosd(predictor: Predictor, folder: Path, most: int | None, pictures: Path) -> dict[str, dict[str, float]]:
    """Return arm -> measure -> mean over the frames."""
    found: dict[str, dict[str, float]] = {}
    for arm in ("network", "network_no_colour"):
        scores, fused_scores = [], []
        for k, (name, frame, truth) in enumerate(mosd_frames(folder)):
            if most is not None and k >= most:
                break
            masks = masks_of(predictor, frame, MOSD_CAMERA, arm)
            scores.append(score_object_masks(truth, objects_of(masks.ids, names_of(masks))))
            fused_scores.append(score_object_masks(truth, objects_of(*fused_masks(frame, MOSD_CAMERA, masks))))
            if arm == "network" and k % 3 == 0:
                draw(pictures / f"mosd_{name}.png", frame, masks)
        for into, frame_scores in ((arm, scores), (f"{arm}_fused", fused_scores)):
            found[into] = {
                "overlap_f": float(np.mean([score.overlap.f for score in frame_scores])),
                "overlap_precision": float(np.mean([score.overlap.precision for score in frame_scores])),
                "overlap_recall": float(np.mean([score.overlap.recall for score in frame_scores])),
                "boundary_f": float(np.mean([score.boundary.f for score in frame_scores])),
                "right_count": float(np.mean([score.right_count for score in frame_scores])),
                "frames": float(len(frame_scores)),
            }
    return found


def judge_log(
    predictor: Predictor, log: Path, out: Path, name: str, every: int, quick: bool
) -> dict[str, dict[str, float]]:
    """Return arm -> class -> mean number of masks a frame, of a real log; draws some of its frames."""
    code, _ = run_command(
        ["ingest", "--log", str(log), "--out", str(out / "logs" / name), "--every", str(every * (4 if quick else 1))]
    )
    if code:
        raise SystemExit(code)
    sequence = open_artifact(out / "logs" / name, Sequence)
    assert isinstance(sequence, Sequence)
    method = sequence.info.gravity.method
    counts: dict[str, Counter[str]] = {}
    with FrameReader(sequence.path("frames.mcap")) as reader:
        number = len(reader)
        for arm in ARMS:
            counts[arm] = Counter()
            for k, frame in enumerate(reader.frames(streams=("color", "depth"))):
                masks = masks_of(
                    predictor, frame, reader.cameras[frame.camera_name], arm,
                    gravity=method != "none", floor=method in ("given", "floor_plane"),
                )  # fmt: skip
                counts[arm].update(NAMES[mask.category_id] for mask in masks.masks.values())
                if k % max(1, number // PICTURES_PER_LOG) == 0 and arm != "network_no_gravity":
                    draw(out / "pictures" / f"{name}_{k:03d}_{arm}.png", frame, masks)
    return {
        arm: {class_name: total / number for class_name, total in sorted(counter.items())}
        for arm, counter in counts.items()
    }


def draw(file: Path, frame: Frame, masks: PanopticFrame) -> None:
    """Write the picture beside its masks with their names and scores."""
    shape = masks.ids.shape
    picture = frame.color if frame.color is not None else np.zeros((*shape, 3), dtype=np.uint8)
    painted = np.full((*shape, 3), 40, dtype=np.uint8)
    for number, mask in masks.masks.items():
        name = NAMES[mask.category_id]
        painted[masks.ids == number] = np.round(255 * np.array(entity_color(number, name)))
    for number, mask in masks.masks.items():
        rows, columns = np.nonzero(masks.ids == number)
        if len(rows) > 150:
            text = f"{NAMES[mask.category_id]} {mask.score:.2f}"
            at = (int(columns.mean()) - 25, int(rows.mean()))
            cv2.putText(painted, text, at, cv2.FONT_HERSHEY_SIMPLEX, 0.4, (255, 255, 255), 1, cv2.LINE_AA)
    file.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(file), np.hstack([picture, painted])[..., ::-1])


def room_table(sums: dict[str, dict[str, ClassQuality]], cost: Cost) -> tuple[list[str], dict[str, float]]:
    """Return (lines, metrics) of the rooms."""
    metrics: dict[str, float] = {}
    lines = ["| masks | PQ | SQ | RQ | classes |", "|---|---|---|---|---|"]
    for arm, by_class in sums.items():
        mean = average_quality(by_class.values())
        values = {"pq": mean.pq or 0.0, "sq": mean.sq or 0.0, "rq": mean.rq or 0.0}
        lines.append(f"| {arm} | " + " | ".join(f"{100 * v:.1f}" for v in values.values()) + f" | {mean.classes} |")
        metrics |= {f"{arm}/rooms/{measure}": value for measure, value in values.items()}
        metrics |= {f"{arm}/rooms/pq_{name}": entry.pq for name, entry in by_class.items()}
    names = sorted({name for by_class in sums.values() for name in by_class})
    lines += ["", "PQ per class (true segments over all frames in brackets):", ""]
    lines += ["| class | " + " | ".join(sums) + " |", "|" + "---|" * (len(sums) + 1)]
    first = next(iter(sums.values()))
    for name in names:
        own = first.get(name, ClassQuality())
        cells = [f"{100 * by_class.get(name, ClassQuality()).pq:.1f}" for by_class in sums.values()]
        lines.append(f"| {name} ({own.true_positives + own.false_negatives}) | " + " | ".join(cells) + " |")
    rate = cost.frames / max(cost.wall, 1e-9)
    metrics["network/rooms/frames_per_second"] = rate
    metrics["network/rooms/processor_seconds_per_frame"] = cost.processor / max(cost.frames, 1)
    lines += [
        "",
        f"{rate:.1f} frames/s for the network and its grouping, {1000 * cost.processor / max(cost.frames, 1):.0f} ms "
        f"of processor time a frame ({os.cpu_count()} cores, {platform.machine()}, load {os.getloadavg()[0]:.1f}).",
    ]
    return lines, metrics


def main() -> None:
    """Judge, print the table, write metrics.json and table.md."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder with the real logs")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--quick", action="store_true", help="2 rooms of 6 frames, 6 clouds, fewer frames of the logs")
    parser.add_argument("--weights", type=Path, default=BUNDLED)
    parser.add_argument("--rooms", type=Path, help="folder of rooms [default: OUT/rooms]")
    arguments = parser.parse_args()
    predictor = load_predictor(arguments.weights, VOCABULARY)
    rooms = REPORTING[: QUICK_ROOMS if arguments.quick else ROOMS]
    frames = QUICK_FRAMES if arguments.quick else FRAMES
    arguments.out.mkdir(parents=True, exist_ok=True)
    sums, cost = judge_rooms(predictor, arguments.rooms or arguments.out / "rooms", rooms, frames)
    lines, metrics = room_table(sums, cost)
    named = ", ".join(f"{recipe} {seed}" for recipe, seed in rooms)
    head = [
        f"Checkpoint: {predictor.checkpoint.description}.",
        "",
        f"Rooms held back ({named}; {frames} frames each):",
        "",
    ]
    lines = head + lines
    clouds = arguments.data / "mosd_tabletop" / "test"
    if clouds.is_dir():
        found = judge_mosd(predictor, clouds, QUICK_CLOUDS if arguments.quick else None, arguments.out / "pictures")
        lines += ["", f"mOSD test frames ({next(iter(found.values()))['frames']:.0f}), class-agnostic:", ""]
        lines += ["| masks | overlap F | precision | recall | boundary F | right number |", "|" + "---|" * 6]
        for arm, values in found.items():
            shown = ("overlap_f", "overlap_precision", "overlap_recall", "boundary_f", "right_count")
            lines.append(f"| {arm} | " + " | ".join(f"{100 * values[measure]:.1f}" for measure in shown) + " |")
            metrics |= {f"{arm}/mosd_test/{measure}": value for measure, value in values.items()}
    for name, (folder, every) in LOGS.items():
        if (arguments.data / folder).is_dir():
            log = judge_log(predictor, arguments.data / folder, arguments.out, name, every, arguments.quick)
            classes = sorted({entry for counts in log.values() for entry in counts})
            lines += ["", f"{name}: masks a frame", "", "| masks | " + " | ".join(classes) + " |"]
            lines.append("|" + "---|" * (len(classes) + 1))
            for arm, counts in log.items():
                lines.append(f"| {arm} | " + " | ".join(f"{counts.get(entry, 0):.2f}" for entry in classes) + " |")
                metrics |= {f"{arm}/{name}/masks_{entry}": value for entry, value in counts.items()}
    (arguments.out / "metrics.json").write_text(json.dumps(metrics, indent=1, sort_keys=True) + "\n")
    (arguments.out / "table.md").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
