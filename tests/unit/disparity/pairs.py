"""A pair of pictures whose disparities are known: a box before a slanted wall, both with a pattern."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
from scenewright.schemas.scene_parts import Camera

CAMERA = Camera(width=240, height=160, fx=220.0, fy=220.0, cx=119.5, cy=79.5)
BASELINE = 0.1
BOX = (slice(45, 115), slice(95, 165))
"""Rows and columns of the box in the left picture."""
BOX_DISPARITY = 24.4


def wall_disparity() -> np.ndarray:
    """Return the disparity (H, W) [px] of the wall: it grows with the column, so that whole numbers are rare."""
    return np.broadcast_to(8.0 + 0.02 * np.arange(CAMERA.width), (CAMERA.height, CAMERA.width)).copy()


def pattern(seed: int, height: int, width: int) -> np.ndarray:
    """Return a picture (H, W, 3) float32 of soft spots of several sizes."""
    random = np.random.default_rng(seed)
    layers = [
        cv2.GaussianBlur(random.normal(0, 1, (height, width)).astype(np.float32), (0, 0), sigma) * sigma * gain
        for sigma, gain in ((1.2, 60), (3.0, 60), (8.0, 40))
    ]
    gray = np.clip(120 + sum(layers), 5, 250).astype(np.float32)
    return np.repeat(gray[..., None], 3, axis=2)


def pair(noise: float = 1.0, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return left and right (H, W, 3) uint8, the true disparity (H, W) of the left, and whether the right sees it."""
    height, width = CAMERA.height, CAMERA.width
    column, row = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    wall, box = pattern(seed, height, width + 80), pattern(seed + 1, height, width + 80)

    def seen(texture: np.ndarray, place: np.ndarray) -> np.ndarray:
        return cv2.remap(texture, (place + 40).astype(np.float32), row, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)

    left, right = seen(wall, column), seen(wall, (column + 8.0) / 0.98)  # x_left - d(x_left) = x_right
    truth = wall_disparity()
    left[BOX], truth[BOX] = seen(box, column)[BOX], BOX_DISPARITY
    before = np.zeros((height, width), bool)
    before[BOX] = True
    shifted = seen(box, column + BOX_DISPARITY)
    inside = (column + BOX_DISPARITY >= BOX[1].start) & (column + BOX_DISPARITY < BOX[1].stop)
    inside &= (row >= BOX[0].start) & (row < BOX[0].stop)
    right[inside] = shifted[inside]
    target = column - truth
    hidden = ~before & (target >= BOX[1].start - BOX_DISPARITY) & (target < BOX[1].stop - BOX_DISPARITY)
    hidden &= (row >= BOX[0].start) & (row < BOX[0].stop)
    random = np.random.default_rng(seed + 2)
    noisy = [
        np.clip(np.rint(one + random.normal(0, noise, one.shape)), 0, 255).astype(np.uint8) for one in (left, right)
    ]
    return noisy[0], noisy[1], truth, ~hidden & (target >= 0)


def write_folder(
    root: Path, pairs: list[tuple[np.ndarray, np.ndarray]], baseline: float = BASELINE, calibrated: bool = True
) -> Path:
    """Write pairs into left/ and right/ with an OpenCV stereo calibration."""
    for name, which in (("left", 0), ("right", 1)):
        (root / name).mkdir(parents=True)
        for index, eyes in enumerate(pairs):
            cv2.imwrite(str(root / name / f"{index:04d}.png"), eyes[which][..., ::-1])
    matrix = [CAMERA.fx, 0.0, CAMERA.cx, 0.0, CAMERA.fy, CAMERA.cy, 0.0, 0.0, 1.0]
    lines = ["%YAML:1.0", "---"]
    for name, values, shape in (
        ("M1", matrix, (3, 3)),
        ("D1", [0.0] * 5, (1, 5)),
        ("M2", matrix, (3, 3)),
        ("D2", [0.0] * 5, (1, 5)),
        ("R", np.eye(3).ravel().tolist(), (3, 3)),
        ("T", [-baseline, 0.0, 0.0], (3, 1)),
    ):
        data = json.dumps(values)
        lines += [
            f"{name}: !!opencv-matrix",
            f"   rows: {shape[0]}",
            f"   cols: {shape[1]}",
            "   dt: d",
            f"   data: {data}",
        ]
    if calibrated:
        (root / "calibration.yaml").write_text("\n".join(lines) + "\n")
    return root
