"""Foxglove protobuf messages -> records.

The classes of the foxglove-schemas-protobuf package decode them: protobuf fields are compatible by number, so that no
descriptor out of a log is ever built.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Odometry_pb2 import Odometry
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from google.protobuf.message import DecodeError
from scenewright.stages.ingest.messages.foxglove_messages import CONVERTERS, type_of
from scenewright.stages.ingest.messages.records import Record, Undecodable

CLASSES: dict[str, Any] = {
    "RawImage": RawImage,
    "CompressedImage": CompressedImage,
    "CameraCalibration": CameraCalibration,
    "FrameTransform": FrameTransform,
    "FrameTransforms": FrameTransforms,
    "PoseInFrame": PoseInFrame,
    "Odometry": Odometry,
    "PointCloud": PointCloud,
}
UNREAD = ("fields", "metadata", "pose_covariance", "velocity_covariance")
"""Fields that no record has."""


def protobuf_decoder(type_name: str) -> Callable[[bytes], tuple[Record, ...]] | None:
    """Return what decodes messages of a Foxglove type, raising Undecodable; None for types without a record."""
    name = type_of(type_name)
    if name not in CLASSES:
        return None
    message_class, convert = CLASSES[name], CONVERTERS[name]

    def decode(data: bytes) -> tuple[Record, ...]:
        try:
            message = message_class.FromString(data)
        except DecodeError as error:
            raise Undecodable(f"no {type_name} in protobuf: {error}") from None
        return convert(_fields(message))

    return decode


def _fields(message: Any) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for field in message.DESCRIPTOR.fields:
        if field.name in UNREAD:
            continue
        value = getattr(message, field.name)
        if field.message_type is not None:
            values[field.name] = [_fields(part) for part in value] if field.is_repeated else _fields(value)
        else:
            values[field.name.lower()] = list(value) if field.is_repeated else value
    return values
