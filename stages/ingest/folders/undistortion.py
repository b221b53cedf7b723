"""Undoing lens distortion of the images in folders, and bringing cameras that differ a little to one."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import cv2
import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest.folders.files import resized_camera
from scenewright.stages.ingest.lenses import FISHEYE_MODELS
from scenewright.stages.ingest.messages.records import CalibrationRecord
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.kit.geometry.cameras import intrinsic_matrix

NEGLIGIBLE = 1e-9
"""Coefficients up to here move no pixel."""


@dataclass(frozen=True)
class Lens:
    """Distortion of a lens."""

    model: Literal["opencv", "fisheye"] = "opencv"
    coefficients: tuple[float, ...] = ()
    """opencv: k1 k2 p1 p2 [k3 [k4 k5 k6]]; fisheye: k1 k2 k3 k4 (OpenCV's equidistant model)."""

    @property
    def is_pinhole(self) -> bool:
        """Whether there is nothing to undo."""
        return self.model == "opencv" and all(abs(value) <= NEGLIGIBLE for value in self.coefficients)

    @property
    def words(self) -> str:
        """The distortion, for people."""
        return f"{self.model} {' '.join(f'{value:g}' for value in self.coefficients)}"


PINHOLE = Lens()


@dataclass(frozen=True)
class RecordedCamera:
    """A camera as it took the pictures: the pinhole part, which stays, and the lens, which is undone."""

    camera: Camera
    """Width and height are 0 when the log does not state them."""
    lens: Lens = PINHOLE

    def at(self, size: tuple[int, int] | None, where: str) -> RecordedCamera:
        """Return the camera for images of `size` (width, height). Raises BadInput for another shape."""
        return replace(self, camera=resized_camera(self.camera, size, where))


def recorded_camera(record: CalibrationRecord, size: tuple[int, int] | None, where: str) -> RecordedCamera:
    """Return the camera of a calibration for images of `size` (width, height). Raises BadInput for another shape."""
    fx, _, cx, _, fy, cy, *_ = record.K
    camera = Camera.of_outside(
        where, width=record.width, height=record.height, fx=fx, fy=fy, cx=cx, cy=cy, hint="correct the calibration"
    )
    lens = lens_of(record.D, where, fisheye=record.distortion_model in FISHEYE_MODELS)
    return RecordedCamera(camera, lens).at(size, where)


def lens_of(coefficients: list[float] | tuple[float, ...], where: str, *, fisheye: bool = False) -> Lens:
    """Return the lens of OpenCV coefficients (4, 5 or 8; fisheye 4). Raises BadInput for what is none."""
    values = tuple(float(value) for value in coefficients)
    if not all(map(math.isfinite, values)):
        raise BadInput(
            f"{where}: distortion coefficients {list(values)} are not finite", hint="correct the calibration"
        )
    if fisheye:
        if len(values) > 4:
            raise BadInput(
                f"{where}: {len(values)} fisheye coefficients, expected 4", hint="calibrate with OpenCV's fisheye model"
            )
        return Lens("fisheye", values + (0.0,) * (4 - len(values)))
    while values and abs(values[-1]) <= NEGLIGIBLE:  # files pad with zeros
        values = values[:-1]
    count = next((count for count in (0, 4, 5, 8) if len(values) <= count), None)
    if count is None:
        raise BadInput(
            f"{where}: {len(values)} distortion coefficients, at most 8 are understood",
            hint="undistort the images first, or calibrate with fewer",
        )
    return Lens("opencv", values + (0.0,) * (count - len(values)))


def overridden_recording(
    recorded: RecordedCamera, parameters: IngestParameters
) -> tuple[RecordedCamera, tuple[str, ...]]:
    """Return the camera with the intrinsics that the user gave, and notes. All four given mean a pinhole camera."""
    given_intrinsics = {name: getattr(parameters, name) for name in ("fx", "fy", "cx", "cy")}
    given_intrinsics = {name: value for name, value in given_intrinsics.items() if value is not None}
    if not given_intrinsics:
        return recorded, ()
    notes: tuple[str, ...] = (
        f"intrinsics given by option: {', '.join(f'{name} {value:g}' for name, value in given_intrinsics.items())}",
    )
    lens = recorded.lens
    if len(given_intrinsics) == 4 and not lens.is_pinhole:
        lens = PINHOLE
        notes = (*notes, "lens distortion of the log is not undone, as all intrinsics are given")
    return RecordedCamera(recorded.camera.model_copy(update=given_intrinsics), lens), notes


def undistorted(image: np.ndarray, recorded: RecordedCamera, target: Camera, *, smooth: bool) -> np.ndarray:
    """Return the image (H, W, ...) of `recorded`'s size as the pinhole camera `target` of the same size sees it.

    `smooth` interpolates (colour), otherwise the nearest pixel counts (depth). What was not seen is 0.
    """
    if recorded.lens.is_pinhole and recorded.camera == target:
        return image
    return cv2.remap(image, *_maps(recorded, target), cv2.INTER_LINEAR if smooth else cv2.INTER_NEAREST)


@lru_cache(maxsize=8)
def _maps(recorded: RecordedCamera, target: Camera) -> tuple[np.ndarray, np.ndarray]:
    matrix, coefficients = intrinsic_matrix(recorded.camera), np.array(recorded.lens.coefficients)
    size, target_matrix = (target.width, target.height), intrinsic_matrix(target)
    if recorded.lens.model == "fisheye":
        return cv2.fisheye.initUndistortRectifyMap(matrix, coefficients, np.eye(3), target_matrix, size, cv2.CV_32FC1)
    return cv2.initUndistortRectifyMap(matrix, coefficients, None, target_matrix, size, cv2.CV_32FC1)
