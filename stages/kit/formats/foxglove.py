"""Foxglove protobuf messages <-> arrays: images, depth, calibration, transforms."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.formats.image_headers import may_be_decoded
from scenewright.stages.kit.geometry.transforms import quaternion_of, transform_from_quaternion

JPEG_QUALITY = 95
"""JPEG quality of colour images in a sequence."""
DEVIATION_STEP = 1e-4
"""Unit of the deviation of depth in a sequence [m]."""
JPEG_START = b"\xff\xd8\xff"
PNG_START = b"\x89PNG\r\n\x1a\n"
RAW_TYPES: dict[str, tuple[np.dtype[Any], int]] = {
    "mono8": (np.dtype("u1"), 1),
    "8UC1": (np.dtype("u1"), 1),
    "mono16": (np.dtype("<u2"), 1),
    "16UC1": (np.dtype("<u2"), 1),
    "32FC1": (np.dtype("<f4"), 1),
    "rgb8": (np.dtype("u1"), 3),
    "bgr8": (np.dtype("u1"), 3),
    "8UC3": (np.dtype("u1"), 3),
    "rgba8": (np.dtype("u1"), 4),
    "bgra8": (np.dtype("u1"), 4),
}
"""Raw image encodings: type and channels of a pixel (names of sensor_msgs/Image)."""


def nanoseconds(seconds: float) -> int:
    """Return a time in whole nanoseconds."""
    return round(seconds * 1e9)


def stamp_nanoseconds(message: Any) -> int:
    """Return the `timestamp` field of a message [ns]."""
    return message.timestamp.seconds * 1_000_000_000 + message.timestamp.nanos


def encode_jpeg(color: np.ndarray) -> bytes:
    """Encode an (H, W, 3) uint8 RGB image as JPEG, quality 95."""
    ok, data = cv2.imencode(".jpg", cv2.cvtColor(color, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    if not ok:
        raise ValueError(f"colour image of shape {color.shape} cannot be encoded")
    return data.tobytes()


def decode_color(data: bytes) -> np.ndarray | None:
    """Decode JPEG, PNG, ... bytes to (H, W, 3) uint8 RGB, as stored (EXIF rotation ignored).

    None when that is impossible, or when they declare too many pixels.
    """
    if not may_be_decoded(data):
        return None
    try:
        flags = cv2.IMREAD_COLOR_RGB | cv2.IMREAD_IGNORE_ORIENTATION
        return cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error:
        return None


def depth_to_millimetres(depth: np.ndarray) -> np.ndarray:
    """Return uint16 millimetres of float metres; what is not in (0, 65.534] m becomes 0 = invalid."""
    with np.errstate(over="ignore", invalid="ignore"):
        millimetres = np.rint(np.asarray(depth, dtype=np.float32) * np.float32(1000))
    valid = (millimetres > 0) & (millimetres < 65535)  # NaN compares false
    return np.where(valid, millimetres, np.float32(0)).astype("<u2")


def millimetres_to_depth(millimetres: np.ndarray) -> np.ndarray:
    """Return float32 metres of uint16 millimetres; 0 and 65535 become 0 = invalid."""
    depth = millimetres.astype(np.float32) / np.float32(1000)
    depth[millimetres == 65535] = 0
    return depth


def deviation_to_steps(deviation: np.ndarray) -> np.ndarray:
    """Return uint16 steps of 0.1 mm of float metres: at least one where it is known, 0 where it is 0 or NaN.

    Over 6.5535 m it is that much. Raises ValueError for a negative one.
    """
    metres = np.nan_to_num(np.asarray(deviation, dtype=np.float32), nan=0.0)
    if metres.size and metres.min() < 0:
        raise ValueError(f"deviation of {metres.min():g} m is negative")
    steps = np.clip(np.rint(np.minimum(metres, np.float32(7)) / np.float32(DEVIATION_STEP)), 1, 65535)
    return np.where(metres > 0, steps, np.float32(0)).astype("<u2")


def steps_to_deviation(steps: np.ndarray) -> np.ndarray:
    """Return float32 metres of uint16 steps of 0.1 mm; 0 stays 0 = unknown."""
    return steps.astype(np.float32) * np.float32(DEVIATION_STEP)


def color_message(time: int, encoded: bytes, frame_id: str) -> CompressedImage:
    """Return a CompressedImage of JPEG or PNG bytes, stamped `time` [ns]."""
    kind = "png" if encoded.startswith(PNG_START) else "jpeg"
    message = CompressedImage(frame_id=frame_id, data=encoded, format=kind)
    message.timestamp.FromNanoseconds(time)
    return message


def raw_message(time: int, image: np.ndarray, encoding: str, frame_id: str) -> RawImage:
    """Return a RawImage of an (H, W) array, stamped `time` [ns], rows without padding, little-endian."""
    height, width = image.shape
    image = np.ascontiguousarray(image, dtype=RAW_TYPES[encoding][0])
    message = RawImage(
        frame_id=frame_id,
        width=width,
        height=height,
        encoding=encoding,
        step=width * image.dtype.itemsize,
        data=image.tobytes(),
    )
    message.timestamp.FromNanoseconds(time)
    return message


def raw_array(message: Any) -> np.ndarray:
    """Return the pixels of a RawImage, (H, W) or (H, W, channels), row padding removed.

    Raises ValueError for an unknown encoding, a zero size, or too few bytes.
    """
    if message.encoding not in RAW_TYPES:
        raise ValueError(f"unknown encoding {message.encoding!r:.40}")
    kind, channels = RAW_TYPES[message.encoding]
    row = message.width * channels * kind.itemsize
    step = message.step or row
    needed = step * (message.height - 1) + row
    if message.width == 0 or message.height == 0 or step < row or len(message.data) < needed:
        raise ValueError(
            f"{message.width}x{message.height} {message.encoding} image of step {step} with {len(message.data)} bytes"
        )
    data = bytes(message.data)[:needed].ljust(step * message.height, b"\0")
    pixels = np.frombuffer(data, np.uint8).reshape(message.height, step)[:, :row]
    image = np.ascontiguousarray(pixels).view(kind)
    return image if channels == 1 else image.reshape(message.height, message.width, channels)


def calibration_message(time: int, camera: Camera, frame_id: str, *, baseline: float = 0.0) -> CameraCalibration:
    """Return the CameraCalibration of an undistorted pinhole camera.

    With a `baseline` [m] it is that of the right eye of a rectified pair: P[3] = -fx baseline (ROS CameraInfo).
    """
    matrix = [camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0]
    message = CameraCalibration(
        frame_id=frame_id,
        width=camera.width,
        height=camera.height,
        distortion_model="plumb_bob",
        D=[0.0] * 5,
        K=matrix,
        R=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        P=[camera.fx, 0.0, camera.cx, -camera.fx * baseline, 0.0, camera.fy, camera.cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    )
    message.timestamp.FromNanoseconds(time)
    return message


def transforms_message(time: int, parent: str, child: str, parent_from_child: np.ndarray) -> FrameTransforms:
    """Return FrameTransforms with the one transform parent -> child, stamped `time` [ns]."""
    transform = FrameTransform(parent_frame_id=parent, child_frame_id=child)
    transform.timestamp.FromNanoseconds(time)
    x, y, z = (float(value) for value in parent_from_child[:3, 3])
    transform.translation.x, transform.translation.y, transform.translation.z = x, y, z
    qx, qy, qz, qw = (float(value) for value in quaternion_of(parent_from_child))
    rotation = transform.rotation
    rotation.x, rotation.y, rotation.z, rotation.w = qx, qy, qz, qw
    return FrameTransforms(transforms=[transform])


def transform_matrix(translation: Any, rotation: Any) -> np.ndarray:
    """Return (4, 4) of a Foxglove Vector3 and Quaternion. Raises ValueError when not finite or of zero norm."""
    vector = np.array([translation.x, translation.y, translation.z])
    quaternion = np.array([rotation.x, rotation.y, rotation.z, rotation.w])
    with np.errstate(over="ignore"):
        norm = np.linalg.norm(quaternion)
    if not (np.isfinite(vector).all() and np.isfinite(norm)) or abs(norm - 1) > 0.02:
        raise ValueError(f"translation {vector.tolist()}, quaternion {quaternion.tolist()} is not a rigid transform")
    return transform_from_quaternion(quaternion / norm, vector)
