"""Vision on real images: oblique RealSense frames of tabletops, and photographs of a restaurant table.

    python -m benchmarks.tidy.detect_real --data FOLDER --out FOLDER

`--data` holds `realsense_tabletop` (colour and depth PNGs; the truth is data/annotations/tableware, by eye) and `meal`
(photographs with YOLO boxes). A detection in a frame counts when its rim's middle lies within 30 px of one of its kind;
an outline in a photograph when its box overlaps one of its class by half (intersection over union), or, the weaker
measure, when its middle lies in one. Writes metrics.json, table.md and the pictures.
"""

from __future__ import annotations

import argparse
import json
import tomllib
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from scipy.optimize import linear_sum_assignment

from schemas.scene_parts import Camera
from stages.tableware.vision.image_files import read_image
from stages.tableware.vision.overlay import draw_outlines, draw_sight
from stages.tableware.vision.photographs import Outline, find_outlines
from stages.tableware.vision.seeing import Sight, Sizes, see

ANNOTATIONS = Path(__file__).resolve().parents[2] / "data" / "annotations" / "tableware" / "realsense_tabletop.toml"
NEAR = 30.0
"""[px]"""
PICTURE_WIDTH = 1.6
"""What the photographs' width shows of the table [m]: our guess."""
CLASSES = {6: "plate", 7: "plate", 8: "cup", 9: "cup"}
"""Of the photographs' classes plate, plate bottom, shot and tea; the others are food and a board."""
OVERLAP = 0.5
Box = tuple[float, float, float, float]


def matched(gain: np.ndarray, least: float) -> list[tuple[int, int]]:
    """Return pairs of rows and columns of greatest total gain, each at least `least`."""
    if gain.size == 0:
        return []
    rows, columns = linear_sum_assignment(-np.where(gain >= least, gain, -1e3))
    return [(int(r), int(c)) for r, c in zip(rows, columns, strict=True) if gain[r, c] >= least]


def frame_counts(truth: list[tuple[str, float, float]], sight: Sight) -> Counter[tuple[str, str]]:
    """Return counts by (class, true | found | right) of a frame; things of unknown kind count as `unknown`."""
    camera_from_world = np.linalg.inv(sight.world_from_camera)
    counts: Counter[tuple[str, str]] = Counter((kind, "true") for kind, _, _ in truth)
    seen = []
    for one in sight.detections:
        counts[one.kind or "unknown", "found"] += 1
        point = camera_from_world @ np.array([one.position[0], one.position[1], one.lip, 1.0])
        seen.append((one.kind, sight.camera.fx * point[0] / point[2] + sight.camera.cx,
                     sight.camera.fy * point[1] / point[2] + sight.camera.cy))  # fmt: skip
    gain = np.array([[-np.hypot(u - x, v - y) if kind == other else -1e6 for other, x, y in seen]
                     for kind, u, v in truth]).reshape(len(truth), len(seen))  # fmt: skip
    for row, _ in matched(gain, -NEAR):
        counts[truth[row][0], "right"] += 1
    return counts


def overlap(a: Box, b: Box) -> float:
    """Return the intersection over union of two boxes (left, top, right, bottom)."""
    width, height = (max(0.0, min(a[k + 2], b[k + 2]) - max(a[k], b[k])) for k in (0, 1))
    areas = [(box[2] - box[0]) * (box[3] - box[1]) for box in (a, b)]
    return width * height / max(sum(areas) - width * height, 1e-9)


def middle_inside(a: Box, b: Box) -> float:
    """Return 1 when the middle of box b lies in box a, else 0."""
    u, v = 0.5 * (b[0] + b[2]), 0.5 * (b[1] + b[3])
    return float(a[0] <= u <= a[2] and a[1] <= v <= a[3])


def photograph_counts(
    truth: list[tuple[str, Box]], outlines: tuple[Outline, ...], gain: Callable[[Box, Box], float], any_class: bool
) -> Counter[tuple[str, str]]:
    """Return counts by (class, true | found | right) of a photograph; with `any_class` kinds do not matter."""
    counts: Counter[tuple[str, str]] = Counter()
    for kind, _ in truth:
        counts["any" if any_class else kind, "true"] += 1
    for one in outlines:
        counts["any" if any_class else str(one.kind), "found"] += 1
    gains = np.array([[gain(box, one.box) if any_class or one.kind == kind else -1.0 for one in outlines]
                      for kind, box in truth]).reshape(len(truth), len(outlines))  # fmt: skip
    for row, _ in matched(gains, OVERLAP):
        counts["any" if any_class else truth[row][0], "right"] += 1
    return counts


def read_boxes(path: Path, width: int, height: int) -> list[tuple[str, Box]]:
    """Return the boxes [px] of a YOLO label file that map to our classes."""
    boxes = []
    for line in path.read_text(encoding="utf-8").splitlines():
        number, *numbers = line.split()
        if int(number) in CLASSES:
            u, v, w, h = (float(value) for value in numbers[:4])
            box = ((u - w / 2) * width, (v - h / 2) * height, (u + w / 2) * width, (v + h / 2) * height)
            boxes.append((CLASSES[int(number)], box))
    return boxes


def main() -> None:
    """Parse the command line and run."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.tidy.detect_real", description=__doc__)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    counts: dict[str, Counter[tuple[str, str]]] = {}
    told = tomllib.loads(ANNOTATIONS.read_text(encoding="utf-8"))
    camera = Camera(**told["camera"])
    modes: tuple[Sizes, ...] = ("known", "estimated")
    for name, marks in sorted(told["frames"].items()):
        folder = options.data / "realsense_tabletop"
        read = read_image(folder / f"{name}-color.png", folder / f"{name}-depth.png")
        truth = [(str(kind), float(u), float(v)) for kind, u, v in marks]
        for mode in modes:
            sight = see(read.color, read.depth, camera, sizes=mode)
            counts.setdefault(f"frames_{mode}", Counter()).update(frame_counts(truth, sight))
            _save(options.out / f"frame_{name}_{mode}.png", draw_sight(read.color, sight))
    for path in sorted((options.data / "meal").glob("*/images/*.jpg")):
        color = read_image(path).color
        outlines = find_outlines(color, PICTURE_WIDTH)
        boxes = read_boxes(path.parent.parent / "labels" / f"{path.stem}.txt", color.shape[1], color.shape[0])
        for name, gain in (("overlap", overlap), ("middle", middle_inside)):
            for any_class in (False, True):
                case = counts.setdefault(f"photographs_{name}", Counter())
                case.update(photograph_counts(boxes, outlines, gain, any_class))
        _save(options.out / f"photograph_{path.parent.parent.name}_{path.stem}.png",
              draw_outlines(color, outlines, "a photograph without depth: heights are unknown"))  # fmt: skip
    write(options.out, counts)


def write(out: Path, counts: dict[str, Counter[tuple[str, str]]]) -> None:
    """Write metrics.json (`ours/detect_<case>/<class>/<measure>`) and table.md."""
    lines = ["| case | class | true | found | right | precision | recall |", "|---" * 7 + "|"]
    metrics: dict[str, float] = {}
    for case, count in counts.items():
        for kind in sorted({kind for kind, _ in count}):
            true, found, right = (count[kind, name] for name in ("true", "found", "right"))
            shares = {"precision": right / found if found else None, "recall": right / true if true else None}
            at = f"ours/detect_{case}/{kind}"
            metrics |= {f"{at}/true": true, f"{at}/found": found, f"{at}/right": right}
            metrics |= {f"{at}/{name}": round(value, 4) for name, value in shares.items() if value is not None}
            said = ["" if value is None or kind == "unknown" else f"{value:.3f}" for value in shares.values()]
            lines.append(f"| {case} | {kind} | {true} | {found} | {right} | {said[0]} | {said[1]} |")
    (out / "metrics.json").write_text(json.dumps(metrics, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    (out / "table.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


def _save(path: Path, picture: np.ndarray) -> None:
    cv2.imwrite(str(path), cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))


if __name__ == "__main__":
    main()
