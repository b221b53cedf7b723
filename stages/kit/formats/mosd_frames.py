"""Real Kinect frames of tabletops with labels: the modified OSD data set (docs/DATA.md)."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera

FOLDER = "mosd_tabletop"
"""Below the folder of the real data."""
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


def read_frames(folder: Path, step: int = 1) -> list[LabelledFrame]:
    """Return every `step`-th frame of a folder, by number. Raises BadInput when it holds none or one is damaged."""
    names = frame_names(folder)
    if not names:
        raise BadInput(f"{folder}: no frames (NAME.color.png, NAME.depth.png, NAME.label.png)", hint="see docs/DATA.md")
    return [read_frame(folder, name) for name in names[::step]]


def frame_names(folder: Path) -> list[str]:
    """Return the names of the labelled frames of a folder, by number; none when it is not there."""
    return sorted((path.name.removesuffix(".label.png") for path in folder.glob("*.label.png")), key=_number)


def frame_files(folder: Path, name: str) -> list[Path]:
    """Return the files of a frame."""
    return [folder / f"{name}.{kind}.png" for kind in ("color", "depth", "label")]


def _number(name: str) -> int:
    digits = re.search(r"\d+$", name)
    return int(digits.group()) if digits else 0


def read_frame(folder: Path, name: str) -> LabelledFrame:
    """Return one frame. Raises BadInput when a file is missing or damaged."""
    color, depth, label = (cv2.imread(str(path), cv2.IMREAD_UNCHANGED) for path in frame_files(folder, name))
    size = (CAMERA.height, CAMERA.width)
    if color is None or depth is None or label is None:
        raise BadInput(
            f"{folder / name}: the colour, depth or label image is missing or no PNG", hint="copy the data set again"
        )
    if color.shape != (*size, 3) or depth.shape != size or depth.dtype != np.uint16 or label.shape != size:
        raise BadInput(f"{folder / name}: not a frame of 640x480 with 16-bit depth", hint="copy the data set again")
    parts = np.where(label >= FIRST_OBJECT, label, 0).astype(np.int32)
    color = cv2.cvtColor(color, cv2.COLOR_BGR2RGB)
    return LabelledFrame(name, color, depth.astype(np.float32) * np.float32(DEPTH_UNIT), parts // 10, parts)


def kind_of(case: str, name: str) -> str:
    """Return the kind of scene of a frame."""
    return next((kind for kind, numbers in KINDS[case].items() if _number(name) in numbers), "other")
