"""The truth images of a scene: each eye's bodies, and the left eye's disparity."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.suture.world.render import Eye, StereoView
from scenewright.stages.suture.world.tubes import LEFT_DRIVER, NEEDLE, RIGHT_DRIVER, THREAD

BODIES = {"needle": NEEDLE, "thread": THREAD, "left_driver": LEFT_DRIVER, "right_driver": RIGHT_DRIVER}
SIDES = ("left", "right")
DISPARITY_UNIT = 128.0
"""Steps a pixel of disparity."""


def write_truth(folder: Path, frame: int, view: StereoView) -> None:
    """Write `<frame:06d>_left.png`, `_right.png` and `_disparity.png` of a view."""
    for side, eye in zip(SIDES, (view.left, view.right), strict=True):
        _write(folder / f"{frame:06d}_{side}.png", eye.bodies)
    steps = np.rint(np.nan_to_num(view.disparity, nan=0.0) * DISPARITY_UNIT)
    _write(folder / f"{frame:06d}_disparity.png", np.clip(steps, 0, 65535).astype(np.uint16))


def _write(path: Path, picture: np.ndarray) -> None:
    if not cv2.imwrite(str(path), picture):
        raise OSError(f"{path} could not be written")


def read_label_image(path: Path, size: tuple[int, int]) -> np.ndarray:
    """Return an 8-bit image of one channel, (H, W) uint8.

    Raises BadInput when it is missing, is no such image, or is not of `size` (rows, columns).
    """
    if not path.is_file():
        raise BadInput(f"{path}: there is no such mask", hint="give one file an eye and a frame: 000000_left.png")
    picture = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if picture is None or picture.ndim != 2 or picture.dtype != np.uint8:
        raise BadInput(f"{path}: not an 8-bit image of one channel", hint="write masks as grey PNG")
    if picture.shape != size:
        raise BadInput(
            f"{path}: {picture.shape[1]} x {picture.shape[0]} pixels, the images have {size[1]} x {size[0]}",
            hint="give masks of the rectified images at full size",
        )
    return picture


def eyes_of_truth(folder: Path, frame: int, size: tuple[int, int]) -> tuple[Eye, Eye]:
    """Return both eyes' bodies of a frame; their pictures and depths are not there. Raises BadInput as above."""
    nothing = np.zeros((0, 0), np.float32)
    left, right = (
        Eye(None, read_label_image(folder / f"{frame:06d}_{side}.png", size), nothing, np.zeros(0, bool))
        for side in SIDES
    )
    return left, right
