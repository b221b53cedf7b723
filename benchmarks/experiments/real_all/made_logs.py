"""Data sets that are no logs, written in layouts that the chain reads: one frame of a bin, one of a tabletop, points
with boxes. Each function returns (log, masks); masks are the truth's, None without any."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.mosd_frames import CAMERA, DEPTH_UNIT, read_frames

TABLETOP = "test40"
"""Which of the reporting frames: cups and a can, one behind the other."""
BOX_MARGIN = 0.02
"""Points so far outside a box are still its own [m]."""


def bin_frame(source: Path, folder: Path) -> tuple[Path, Path]:
    """One RGB-D frame of a bin with the visible masks of its things."""
    with np.load(source / "data.npz", allow_pickle=False) as data:
        depth, masks, labels = data["depth"], data["masks"] == 1, data["labels"]
    names = (source / "class_names.txt").read_text(encoding="utf-8").split()
    picture = cv2.imread(str(source / "rgb.jpg"))
    if picture is None:
        raise BadInput(f"{source / 'rgb.jpg'}: no picture that can be read", hint="see docs/DATA.md")
    log = _frame(folder, picture, np.nan_to_num(depth) * 1000)
    shutil.copy(source / "camera_info.json", log / "camera_info.json")
    classes = np.array([names[k] for k in labels])
    return log, _masks(folder, masks, {name: "object" for name in sorted(set(classes))}, classes)


def labelled_tabletop(source: Path, folder: Path) -> tuple[Path, Path]:
    """One Kinect frame of a tabletop with the masks of its things."""
    frame = next(frame for frame in read_frames(source) if frame.name == TABLETOP)
    log = _frame(folder, frame.color[..., ::-1], frame.depth / DEPTH_UNIT)
    numbers = {name: getattr(CAMERA, name) for name in ("fx", "fy", "cx", "cy", "width", "height")}
    (log / "camera.json").write_text(json.dumps(numbers), encoding="utf-8")
    masks = np.array([frame.objects == k for k in np.unique(frame.objects) if k])
    return log, _masks(folder, masks, {"object": "object"}, np.array(["object"] * len(masks)))


def boxed_points(source: Path, folder: Path) -> tuple[Path, None]:
    """Points of a room, each of the smallest annotated box that holds it."""
    told = json.loads((source / "scannet_scene0000_00_boxes.json").read_text(encoding="utf-8"))
    with np.load(source / "scannet_scene0000_00_points.npz", allow_pickle=False) as data:
        raw, colors = data["xyz"].astype(float), data["rgb"]
    level = np.array(told["axis_align_matrix"])
    points = raw @ level[:3, :3].T + level[:3, 3]
    instance = np.zeros(len(points), np.int32)
    boxes = sorted(enumerate(told["instances"], 1), key=lambda box: -float(np.prod(box[1]["size_xyz"])))
    for number, box in boxes:
        half = np.array(box["size_xyz"]) / 2 + BOX_MARGIN
        instance[(np.abs(points - box["center_xyz"]) < half).all(axis=1)] = number
    floor = (instance == 0) & (points[:, 2] < np.quantile(points[:, 2], 0.01) + 0.05)
    instance[floor] = len(boxes) + 1
    folder.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(
        folder / "points.npz",
        points=points.astype(np.float32),
        instance=instance,
        id=np.arange(1, len(boxes) + 2, dtype=np.int32),
        classes=np.array([*(box["class"] for box in told["instances"]), "floor"]),
        colors=np.clip(colors if colors.max() > 1 else colors * 255, 0, 255).astype(np.uint8),
    )
    return folder / "points.npz", None


MADE: dict[str, Callable[[Path, Path], tuple[Path, Path | None]]] = {
    "bin": bin_frame,
    "labelled_tabletop": labelled_tabletop,
    "boxed_points": boxed_points,
}


def _frame(folder: Path, color: np.ndarray, depth: np.ndarray) -> Path:
    log = folder / "log"
    for name, image in (("color", color), ("depth", np.clip(depth, 0, 65535).astype(np.uint16))):
        (log / name).mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(log / name / "000000.png"), image)
    row = " ".join(f"{value:g}" for value in np.eye(4).ravel())
    (log / "poses.txt").write_text(f"000000 {row}\n", encoding="ascii")  # one frame has no path to estimate
    return log


def _masks(folder: Path, masks: np.ndarray, words: dict[str, str], classes: np.ndarray) -> Path:
    out = folder / "masks"
    out.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(out / "000000.npz", masks=masks, classes=np.array([words[name] for name in classes]))
    return out
