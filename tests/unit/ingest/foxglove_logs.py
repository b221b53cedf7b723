"""Writes MCAP logs as other people's recorders would: several topics, offsets between stamps, odd encodings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter
from mcap_protobuf.schema import register_schema
from scenewright.stages.kit.geometry.transforms import quaternion_of

from tests.unit.ingest.tiny_room import CAMERA, jpeg


class LogWriter:
    """A minimal recorder. `write` takes any message with its topic and log time [ns]."""

    def __init__(self, path: Path, compression: CompressionType = CompressionType.ZSTD, **options: Any) -> None:
        self._file = path.open("wb")
        self._writer = McapWriter(self._file, compression=compression, **options)
        self._writer.start()
        self._channels: dict[str, int] = {}

    def __enter__(self) -> LogWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self._writer.finish()
        self._file.close()

    def write(self, topic: str, message: Any, log_time: int) -> None:
        """Append a message."""
        if topic not in self._channels:
            schema = register_schema(self._writer, type(message))
            self._channels[topic] = self._writer.register_channel(topic, "protobuf", schema)
        self._writer.add_message(self._channels[topic], log_time, message.SerializeToString(), log_time)


def compressed(stamp: int, data: bytes, frame: str = "optical", kind: str = "jpeg") -> CompressedImage:
    """Return a CompressedImage."""
    message = CompressedImage(frame_id=frame, data=data, format=kind)
    message.timestamp.FromNanoseconds(stamp)
    return message


def raw(stamp: int, image: np.ndarray, encoding: str, frame: str = "optical", padding: int = 0) -> RawImage:
    """Return a RawImage whose rows are padded by `padding` bytes."""
    height, width = image.shape[:2]
    rows = np.ascontiguousarray(image).view(np.uint8).reshape(height, -1)
    rows = np.pad(rows, ((0, 0), (0, padding)), constant_values=255)
    message = RawImage(
        frame_id=frame, width=width, height=height, encoding=encoding, step=rows.shape[1], data=rows.tobytes()
    )
    message.timestamp.FromNanoseconds(stamp)
    return message


def calibration(stamp: int, frame: str = "optical", **changes: Any) -> CameraCalibration:
    """Return the calibration of the tiny room's camera."""
    k = CAMERA
    fields: dict[str, Any] = {
        "frame_id": frame,
        "width": k.width,
        "height": k.height,
        "distortion_model": "plumb_bob",
        "D": [0.0] * 5,
        "K": [k.fx, 0, k.cx, 0, k.fy, k.cy, 0, 0, 1],
    }
    message = CameraCalibration(**(fields | changes))
    message.timestamp.FromNanoseconds(stamp)
    return message


def transform(stamp: int, parent: str, child: str, matrix: np.ndarray) -> FrameTransform:
    """Return a FrameTransform."""
    message = FrameTransform(parent_frame_id=parent, child_frame_id=child)
    message.timestamp.FromNanoseconds(stamp)
    message.translation.x, message.translation.y, message.translation.z = (float(v) for v in matrix[:3, 3])
    x, y, z, w = (float(v) for v in quaternion_of(matrix))
    message.rotation.x, message.rotation.y, message.rotation.z, message.rotation.w = x, y, z, w
    return message


def pose_in_frame(stamp: int, frame: str, matrix: np.ndarray) -> PoseInFrame:
    """Return a PoseInFrame."""
    message = PoseInFrame(frame_id=frame)
    message.timestamp.FromNanoseconds(stamp)
    position, orientation = message.pose.position, message.pose.orientation
    position.x, position.y, position.z = (float(v) for v in matrix[:3, 3])
    orientation.x, orientation.y, orientation.z, orientation.w = (float(v) for v in quaternion_of(matrix))
    return message


def write_simple_log(path: Path, recorded: list, *, calibrated: bool = True, **options: Any) -> Path:
    """Write colour, depth, calibration and map -> optical transforms with equal stamps, 10 frames a second."""
    with LogWriter(path, **options) as log:
        for index, (color, depth, pose) in enumerate(recorded):
            stamp = 1_000_000_000 + index * 100_000_000
            log.write("/tf", transform(stamp, "map", "optical", pose), stamp)
            if calibrated:
                log.write("/camera_info", calibration(stamp), stamp)
            log.write("/rgb/image", compressed(stamp, jpeg(color)), stamp)
            image = np.rint(depth * 1000).astype("<u2")
            log.write("/depth/image", raw(stamp, image, "16UC1"), stamp)
    return path


__all__ = ["CompressionType", "IndexType"]
