"""Lenses: how the images of one topic become those of a pinhole camera, from what the log says of its calibration."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest.images import fitted_color
from scenewright.stages.ingest.messages.records import CalibrationRecord
from scenewright.stages.ingest.source import Unusable
from scenewright.stages.kit.geometry.cameras import intrinsic_matrix

OPENCV_MODELS = (
    "",
    "none",
    "plumb_bob",
    "rational_polynomial",
    "thin_prism",
    "brown_conrady",
    "radtan",
    "radial_tangential",
    "pinhole",
)
"""Names under which logs mean OpenCV's radial, tangential and thin prism coefficients, in OpenCV's order."""
OPENCV_COUNTS = (4, 5, 8, 12, 14)
"""Numbers of distortion coefficients that OpenCV's models have."""
FISHEYE_MODELS = ("equidistant", "fisheye", "kannala_brandt", "kannala_brandt4")
SAME_RAY = 0.5
"""Pixels by which two cameras may differ anywhere in the image and still count as one."""
HINT = "give --fx --fy --cx --cy"


@dataclass(frozen=True)
class Lens:
    """How images of one topic become those of a pinhole camera."""

    camera: Camera
    """Of the images that `pictures` and `pixels` return."""
    size: tuple[int, int]
    """(width, height) of the images as they were recorded; (0, 0) when none could be decoded."""
    maps: tuple[np.ndarray, np.ndarray] | None = None
    """Where the pixels of `camera` lie in the recorded image; None: they are the same."""
    camera_from_frame: np.ndarray | None = None
    """(3, 3) rotation from the frame of the log's messages to the frame of `camera`; None: it is the same frame."""
    notes: tuple[str, ...] = ()

    def picture(self, image: np.ndarray) -> np.ndarray:
        """Return colour (H, W, 3) or grey (H, W) uint8 as `camera` sees it, interpolated. Raises Unusable for another
        shape."""
        as_recorded = self.camera.model_copy(update={"width": self.size[0], "height": self.size[1]})
        image = fitted_color(image, as_recorded)
        return image if self.maps is None else cv2.remap(image, *self.maps, cv2.INTER_LINEAR)

    def pixels(self, image: np.ndarray, what: str) -> np.ndarray:
        """Return depth or labels (H, W) as `camera` sees them, nearest pixel. Raises Unusable for another size."""
        if (image.shape[1], image.shape[0]) != self.size:
            raise Unusable(
                "size_mismatch", f"{what} {image.shape[1]}x{image.shape[0]}, before it {self.size[0]}x{self.size[1]}"
            )
        return image if self.maps is None else cv2.remap(image, *self.maps, cv2.INTER_NEAREST)


def is_calibrated(record: CalibrationRecord) -> bool:
    """Whether a calibration has focal lengths: drivers of uncalibrated cameras publish zeros."""
    return len(record.K) == 9 and all(map(math.isfinite, record.K)) and record.K[0] > 0 and record.K[4] > 0


def check_calibrated(record: CalibrationRecord, where: str) -> None:
    """Raise BadInput for a calibration without focal lengths."""
    if not is_calibrated(record):
        raise BadInput(
            f"{where}: K = {list(record.K)} has no positive focal lengths: the camera is uncalibrated", hint=HINT
        )


def lens_of(record: CalibrationRecord, size: tuple[int, int], rectified: bool, where: str, what: str) -> Lens:
    """Return the lens of images of `size` (width, height) with the calibration `record`.

    Images of a rectified topic already are those of a pinhole camera, whose intrinsics are in P; those of any other
    are undistorted, K staying as it is. `where` and `what` ("depth images") are for messages. Raises BadInput for a
    calibration that cannot be, or of another image shape, or a distortion model that is not known.
    """
    matrix, notes = scaled_matrix(record, _projection(record) if rectified else record.K, size, where, what)
    camera = _camera(matrix, size if size != (0, 0) else (record.width, record.height), where)
    if rectified:
        matrix_name = "P" if has_projection(record) else "K"
        return Lens(camera, size, notes=(*notes, f"{what} are rectified: intrinsics are those of {matrix_name}"))
    maps = undistortion(record, matrix, None, camera, where)
    if maps is not None:
        notes = (*notes, f"lens distortion ({record.distortion_model}) undone")
    return Lens(camera, size, maps, notes=notes)


def turned_lens(
    record: CalibrationRecord,
    size: tuple[int, int],
    rectified: bool,
    camera: Camera,
    camera_from_frame: np.ndarray,
    where: str,
    what: str,
) -> Lens:
    """Return the lens whose images are those of `camera`, turned by `camera_from_frame` (3, 3) out of the frame of the
    recorded ones. Raises BadInput as `lens_of` does."""
    matrix, notes = scaled_matrix(record, _projection(record) if rectified else record.K, size, where, what)
    same = np.abs(camera_from_frame - np.eye(3)).max() < 1e-6
    turned = None if same else camera_from_frame
    if size == (0, 0):
        return Lens(camera, size, None, turned, notes)
    if rectified:
        recorded = _camera(matrix, size, where)
        if same and recorded == camera:
            return Lens(camera, size, None, None, notes)
        maps = _maps(matrix, np.zeros(5), camera_from_frame, camera)
    else:
        undistorted = undistortion(record, matrix, camera_from_frame, camera, where)
        if undistorted is None:
            return Lens(camera, size, None, None, notes)
        maps = undistorted
    return Lens(camera, size, maps, turned, notes)


def has_projection(record: CalibrationRecord) -> bool:
    """Whether P holds a rectified camera."""
    return len(record.P) == 12 and all(map(math.isfinite, record.P)) and record.P[0] > 0 and record.P[5] > 0


def _projection(record: CalibrationRecord) -> tuple[float, ...]:
    """Return the intrinsics (9 numbers) of the rectified images."""
    return tuple(record.P[i] for i in (0, 1, 2, 4, 5, 6, 8, 9, 10)) if has_projection(record) else record.K


def scaled_matrix(
    record: CalibrationRecord, numbers: tuple[float, ...], size: tuple[int, int], where: str, what: str
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return the intrinsic matrix (3, 3) for images of `size`, and a note when that took scaling.

    Raises BadInput when there are no focal lengths, or the calibration is for images of another shape.
    """
    check_calibrated(record, where)
    if record.width <= 0 or record.height <= 0:
        raise BadInput(f"{where}: calibration is for images of {record.width}x{record.height}", hint=HINT)
    matrix = np.array([[numbers[0], 0, numbers[2]], [0, numbers[4], numbers[5]], [0, 0, 1]], dtype=float)
    if size in ((record.width, record.height), (0, 0)):  # (0, 0): no image can be decoded, none will be used
        return matrix, ()
    if abs(record.width * size[1] - record.height * size[0]) > max(record.width, record.height):
        raise BadInput(f"{where}: is for {record.width}x{record.height}, {what} are {size[0]}x{size[1]}", hint=HINT)
    shift = np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1]])  # pixel centres are at integers
    scale = np.diag([size[0] / record.width, size[1] / record.height, 1.0])
    note = f"calibration for {record.width}x{record.height} scaled to {what} of {size[0]}x{size[1]}"
    return np.linalg.inv(shift) @ scale @ shift @ matrix, (note,)


def _camera(matrix: np.ndarray, size: tuple[int, int], where: str) -> Camera:
    return Camera.of_outside(
        where,
        hint=HINT,
        width=size[0],
        height=size[1],
        fx=float(matrix[0, 0]),
        fy=float(matrix[1, 1]),
        cx=float(matrix[0, 2]),
        cy=float(matrix[1, 2]),
    )


def undistortion(
    record: CalibrationRecord, matrix: np.ndarray, rotation: np.ndarray | None, camera: Camera, where: str
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the maps from the pixels of `camera` to those of the recorded image, None when they are the same.

    `matrix` (3, 3) are the intrinsics of the recorded image, `rotation` (3, 3) is camera_from_frame. Raises BadInput
    for a distortion model that is not known.
    """
    coefficients = np.array(record.D, dtype=float)
    if not np.isfinite(coefficients).all():
        raise BadInput(f"{where}: distortion coefficients {coefficients.tolist()} are not finite", hint=HINT)
    model = record.distortion_model.lower().replace(" ", "_").replace("-", "_")
    fisheye = model in FISHEYE_MODELS
    straight = not np.abs(coefficients).max(initial=0) > 1e-9
    is_known_model = (model in OPENCV_MODELS and len(coefficients) in OPENCV_COUNTS) or (
        fisheye and len(coefficients) == 4
    )
    if not is_known_model and (fisheye or not straight):
        raise BadInput(
            f"{where}: distortion model {record.distortion_model!r:.40} with {len(coefficients)} coefficients is not "
            "supported",
            hint="rectify the images first",
        )
    if fisheye:
        return _fisheye_maps(matrix, coefficients, rotation, camera)
    same = rotation is None or np.abs(rotation - np.eye(3)).max() < 1e-6
    if straight and same and np.abs(matrix - intrinsic_matrix(camera)).max() < 1e-6:
        return None
    return _maps(matrix, coefficients if not straight else np.zeros(5), rotation, camera)


def _maps(
    matrix: np.ndarray, coefficients: np.ndarray, rotation: np.ndarray | None, camera: Camera
) -> tuple[np.ndarray, np.ndarray]:
    size = (camera.width, camera.height)
    return cv2.initUndistortRectifyMap(matrix, coefficients, rotation, intrinsic_matrix(camera), size, cv2.CV_32FC1)


def _fisheye_maps(
    matrix: np.ndarray, coefficients: np.ndarray, rotation: np.ndarray | None, camera: Camera
) -> tuple[np.ndarray, np.ndarray]:
    turn = np.eye(3) if rotation is None else rotation
    size = (camera.width, camera.height)
    return cv2.fisheye.initUndistortRectifyMap(matrix, coefficients, turn, intrinsic_matrix(camera), size, cv2.CV_32FC1)


def same_rays(first: Camera, second: Camera) -> bool:
    """Whether two cameras at one place see the same ray in every pixel, `first` resized to the size of `second`."""
    if not first.width * first.height * second.width * second.height:
        return True
    if abs(first.width * second.height - first.height * second.width) > max(second.width, second.height):
        return False
    across, down = second.width / first.width, second.height / first.height
    for u, v in ((0.0, 0.0), (second.width - 1.0, second.height - 1.0)):
        x, y = (u - second.cx) / second.fx, (v - second.cy) / second.fy
        seen_u = (first.fx * x + first.cx + 0.5) * across - 0.5
        seen_v = (first.fy * y + first.cy + 0.5) * down - 0.5
        if abs(seen_u - u) > SAME_RAY or abs(seen_v - v) > SAME_RAY:
            return False
    return True
