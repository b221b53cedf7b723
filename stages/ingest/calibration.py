"""The camera of a Foxglove log: which calibration counts, and undoing lens distortion."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from schemas.errors import BadInput
from schemas.scene_parts import Camera
from stages.ingest.layouts.files import camera_from_options, overridden
from stages.ingest.parameters import IngestParameters
from stages.kit.geometry.cameras import intrinsic_matrix, scaled

OPENCV_MODELS = ("", "none", "plumb_bob", "rational_polynomial")
HINT = "give --fx --fy --cx --cy"


@dataclass(frozen=True)
class Calibration:
    """The camera after distortion is undone, and the pixel maps that undo it (None: there is none to undo)."""

    camera: Camera
    maps: tuple[np.ndarray, np.ndarray] | None
    notes: tuple[str, ...]

    def undistorted(self, image: np.ndarray, *, smooth: bool) -> np.ndarray:
        """Return the image without distortion; `smooth` interpolates (colour), otherwise the nearest pixel counts."""
        if self.maps is None:
            return image
        return cv2.remap(image, *self.maps, cv2.INTER_LINEAR if smooth else cv2.INTER_NEAREST)


def choose_calibration(
    calibrations: dict[str, Any],
    depth_frame: str,
    depth_topic: str,
    size: tuple[int, int],
    parameters: IngestParameters,
    where: str,
) -> Calibration:
    """Return the calibration of the depth images among topic -> CameraCalibration message.

    Preferred are the same frame, then the same size, then the longest common beginning of the topic. `size` is
    (width, height) of the depth images. Raises BadInput when there is none, or none that is possible.
    """
    all_given = all(getattr(parameters, name) is not None for name in ("fx", "fy", "cx", "cy"))
    if not calibrations or all_given:
        camera = camera_from_options(size, parameters, f"{where}: no camera calibration")
        return Calibration(camera, None, ("intrinsics given by option",))

    def preference(topic: str) -> tuple[bool, bool, int, str]:
        message = calibrations[topic]
        common = next((i for i, (a, b) in enumerate(zip(topic, depth_topic, strict=False)) if a != b), len(topic))
        return (message.frame_id != depth_frame, (message.width, message.height) != size, -common, topic)

    topic = min(calibrations, key=preference)
    camera, notes = _camera_of(calibrations[topic], size, f"{where}: topic {topic}")
    maps = _undistortion(calibrations[topic], size, f"{where}: topic {topic}")
    notes = (f"intrinsics from topic {topic}", *notes)
    if maps is not None:
        notes = (*notes, f"lens distortion ({calibrations[topic].distortion_model}) undone")
    camera, given = overridden(camera, parameters)
    return Calibration(camera, maps, (*notes, *given))


def _camera_of(message: Any, size: tuple[int, int], where: str) -> tuple[Camera, tuple[str, ...]]:
    matrix = list(message.K)
    if len(matrix) != 9 or not all(map(math.isfinite, matrix)) or matrix[0] <= 0 or matrix[4] <= 0:
        raise BadInput(f"{where}: K = {matrix} has no positive focal lengths", hint=HINT)
    if message.width <= 0 or message.height <= 0:
        raise BadInput(f"{where}: calibration is for images of {message.width}x{message.height}", hint=HINT)
    camera = Camera(width=message.width, height=message.height, fx=matrix[0], fy=matrix[4], cx=matrix[2], cy=matrix[5])
    if size in ((camera.width, camera.height), (0, 0)):  # (0, 0): no depth image can be decoded, none will be used
        return camera, ()
    if camera.width * size[1] != camera.height * size[0]:
        raise BadInput(
            f"{where}: is for {camera.width}x{camera.height}, depth images are {size[0]}x{size[1]}", hint=HINT
        )
    note = f"calibration for {camera.width}x{camera.height} scaled to the depth images' {size[0]}x{size[1]}"
    return scaled(camera, size[0] / camera.width), (note,)


def _undistortion(message: Any, size: tuple[int, int], where: str) -> tuple[np.ndarray, np.ndarray] | None:
    coefficients = np.array(message.D, dtype=float)
    if not np.isfinite(coefficients).all():
        raise BadInput(f"{where}: distortion coefficients {coefficients.tolist()} are not finite")
    if not np.abs(coefficients).max(initial=0) > 1e-9:
        return None
    if message.distortion_model not in OPENCV_MODELS or len(coefficients) not in (4, 5, 8):
        raise BadInput(
            f"{where}: distortion model {message.distortion_model!r:.40} with {len(coefficients)} coefficients is not "
            "supported",
            hint="rectify the images first",
        )
    camera = _camera_of(message, size, where)[0]
    matrix = intrinsic_matrix(camera)
    shape = (camera.width, camera.height)
    return cv2.initUndistortRectifyMap(matrix, coefficients, None, matrix, shape, cv2.CV_32FC1)
