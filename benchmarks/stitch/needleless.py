"""Stereo pairs of real pictures without a needle: an endoscope's, a motorcycle, tables and rooms.

Tables and rooms were seen by depth cameras: the right eye is made of the left one's picture and depth, 6 mm beside it,
with lengths made DOLLS times as long, so that what they show lies where a needle would.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from scenewright.schemas.sequence import Sequence
from scenewright.stages.suture import StereoRig
from scenewright.stages.suture.pairs import StereoPairs

from benchmarks.steps import made, opened

DOLLS, BASELINE = 0.15, 0.006
"""Factor of lengths, and the distance [m] of the made eye."""
FARTHEST = 20.0
"""Depth [m] beyond which it is none."""
DEPTH_CAMERAS = {
    "table": ("mosd_tabletop", "*/*.color.png", (".color.png", ".depth.png"), 1e-4, (525.0, 319.5, 239.5), 5),
    "room": ("redwood_livingroom1", "image/*.jpg", ("image/", "depth/"), 1e-3, (525.0, 319.5, 239.5), 26),
    "kitchen": ("7scenes_redkitchen", "*.color.jpg", (".color.jpg", ".depth.png"), 1e-3, (585.0, 320.0, 240.0), 63),
    "tableware": (
        "tableware/realsense_tabletop",
        "*-color.png",
        ("-color.png", "-depth.png"),
        1e-3,
        (615.0, 320.0, 240.0),
        1,
    ),
}
"""Of each: folder, pictures, what to put for what in a picture's path for that of its depth, the depth's unit [m],
focal length and principal point [px], and that every n-th is used."""


@dataclass(frozen=True)
class RealPair:
    """Two pictures (H, W, 3) uint8 RGB and their rig."""

    left: np.ndarray
    right: np.ndarray
    rig: StereoRig

    def scaled(self, factor: float) -> RealPair:
        """Return the pair with pixels `factor` times as many each way."""
        if factor == 1.0:
            return self
        rig = self.rig
        size = round(rig.width * factor), round(rig.height * factor)
        how = cv2.INTER_AREA if factor < 1.0 else cv2.INTER_CUBIC
        left, right = (cv2.resize(picture, size, interpolation=how) for picture in (self.left, self.right))
        by = size[0] / rig.width
        centre = (rig.centre[0] + 0.5) * by - 0.5, (rig.centre[1] + 0.5) * by - 0.5
        return RealPair(left, right, StereoRig(*size, rig.focal * by, centre, rig.baseline))


@cache
def needleless_pairs(data: Path, work: Path) -> dict[str, Callable[[], RealPair]]:
    """Return name -> what reads a pair of the folder of data, as far as they are there; the endoscope's recording is
    read into `work`."""
    pairs: dict[str, Callable[[], RealPair]] = {}
    if (data / "surgt_stereo").is_dir():
        sequence = opened(Sequence, made("ingest", work / "recorded", "--log", data / "surgt_stereo"))
        with StereoPairs(sequence) as frames:
            rig = frames.rig
            pairs |= {f"endoscope {f.index}": lambda f=f: RealPair(f.left, f.right, rig) for f in frames}  # type: ignore[misc]
    motorcycle = data / "middlebury_motorcycle"
    if motorcycle.is_dir():
        pairs["motorcycle"] = lambda: _motorcycle(motorcycle)
    for name, (folder, pattern, swap, unit, camera, every) in DEPTH_CAMERAS.items():
        for index, path in enumerate(sorted((data / folder).glob(pattern))[::every]):
            depth = Path(str(path).replace(*swap)).with_suffix(".png")
            pairs[f"{name} {index}"] = lambda path=path, depth=depth, unit=unit, camera=camera: _with_made_eye(  # type: ignore[misc]
                path, depth, unit, camera
            )
    return pairs


def _picture(path: Path) -> np.ndarray:
    picture = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if picture is None:
        raise FileNotFoundError(path)
    return np.ascontiguousarray(picture[..., ::-1])


def _motorcycle(folder: Path) -> RealPair:
    left, right = (_picture(folder / f"motorcycle_{side}.png") for side in ("left", "right"))
    return RealPair(left, right, StereoRig(741, 500, 994.978, (311.193, 254.877), 0.193001))


def _with_made_eye(path: Path, depth_path: Path, unit: float, camera: tuple[float, float, float]) -> RealPair:
    left, stored = _picture(path), cv2.imread(str(depth_path), cv2.IMREAD_UNCHANGED)
    if stored is None:
        raise FileNotFoundError(depth_path)
    depth = cv2.resize(stored.astype(np.float32) * unit, left.shape[1::-1], interpolation=cv2.INTER_NEAREST)
    depth[depth > FARTHEST] = 0.0
    rig = StereoRig(left.shape[1], left.shape[0], camera[0], camera[1:], BASELINE)
    return RealPair(left, _right_eye(left, DOLLS * depth, rig), rig)


def _right_eye(left: np.ndarray, depth: np.ndarray, rig: StereoRig) -> np.ndarray:
    """Return the picture of the right eye; what the left one does not see is filled with what lies behind beside it."""
    known = depth > 0
    filled = np.where(known, depth, np.percentile(depth[known], 60)).astype(np.float32)
    disparity = rig.focal * rig.baseline / cv2.medianBlur(filled, 5)
    rows, columns = np.mgrid[: rig.height, : rig.width]
    order = np.argsort(disparity, axis=None)
    target = np.round(columns - disparity).astype(int).ravel()[order]
    inside = (target >= 0) & (target < rig.width)
    of_right = np.full(depth.shape, -1.0, np.float32)
    of_right[rows.ravel()[order][inside], target[inside]] = disparity.ravel()[order][inside]
    for row in of_right:
        there = np.flatnonzero(row >= 0)
        if len(there):
            after = np.searchsorted(there, np.arange(rig.width))
            before = there[np.clip(after - 1, 0, len(there) - 1)], there[np.clip(after, 0, len(there) - 1)]
            row[row < 0] = np.minimum(row[before[0]], row[before[1]])[row < 0]
    places = (columns + of_right).astype(np.float32), rows.astype(np.float32)
    return np.asarray(cv2.remap(left, *places, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))
