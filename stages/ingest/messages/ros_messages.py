"""ROS 1 and ROS 2 messages -> records, decoded by the definition that the log embeds."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scenewright.stages.ingest.messages import foxglove_messages
from scenewright.stages.ingest.messages.foxglove_messages import calibration_record, every_transform
from scenewright.stages.ingest.messages.image_window import of_published_images
from scenewright.stages.ingest.messages.record_fields import (
    Fields,
    bytes_of,
    frame_of,
    name_of,
    nested,
    part,
    pose_matrix,
    rigid,
    size_of,
    stamp_of,
    vector_of,
)
from scenewright.stages.ingest.messages.records import (
    ImageRecord,
    ImuRecord,
    PointsRecord,
    PoseRecord,
    Record,
    TransformRecord,
)
from scenewright.stages.ingest.messages.ros_definitions import Field, definitions_of, short_name
from scenewright.stages.ingest.messages.ros_serialization import RosReader

DEPTH_UNIT = Field("depth_units", "f")
"""Metres per unit of depth, where an image states it."""


def ros_decoder(
    type_name: str, message_encoding: str, schema_encoding: str, schema: bytes, more: tuple[Field, ...] = ()
) -> Callable[[bytes], tuple[Record, ...]] | None:
    """Return what decodes messages of a type, raising Undecodable; None for types without a record.

    `message_encoding` is `cdr` or `ros1`; `more` are fields that follow those of the definition. Raises
    UnreadableDefinition.
    """
    convert = _converter(type_name)
    if convert is None:
        return None
    if message_encoding == "ros1":
        schema_encoding = "ros1msg"
    name = short_name(type_name)
    definitions = definitions_of(name, schema_encoding, schema)
    definitions[name] += more
    reader = RosReader(name, definitions, aligned=message_encoding == "cdr")
    return lambda data: convert(reader.read(data))


def _converter(type_name: str) -> Callable[[Fields], tuple[Record, ...]] | None:
    foxglove = foxglove_messages.type_of(type_name)
    return foxglove_messages.CONVERTERS.get(foxglove) if foxglove else CONVERTERS.get(short_name(type_name))


def _stamp_and_frame(fields: Fields) -> tuple[int, str]:
    header = nested(fields, "header")
    return stamp_of(nested(header, "stamp")), frame_of(header)


def _image(fields: Fields) -> tuple[Record, ...]:
    stamp, frame = _stamp_and_frame(fields)
    image = ImageRecord(
        stamp=stamp,
        frame_id=frame,
        encoding=name_of(fields, "encoding"),
        compressed=False,
        width=size_of(fields, "width"),
        height=size_of(fields, "height"),
        step=size_of(fields, "step"),
        big_endian=bool(size_of(fields, "is_bigendian")),
        data=bytes_of(fields, "data"),
        units_per_metre=_units_per_metre(fields),
    )
    return (image,)


def _units_per_metre(fields: Fields) -> float | None:
    """Of the metres per unit that the RealSense SDK adds; they come as float32 of round numbers."""
    unit = fields.get(DEPTH_UNIT.name)
    return round(1 / unit, 3) if isinstance(unit, float) and 1e-6 < unit < 1e3 else None


def _compressed_image(fields: Fields) -> tuple[Record, ...]:
    stamp, frame = _stamp_and_frame(fields)
    return (ImageRecord(stamp, frame, name_of(fields, "format"), True, 0, 0, 0, False, bytes_of(fields, "data")),)


def _camera_info(fields: Fields) -> tuple[Record, ...]:
    return (of_published_images(calibration_record(*_stamp_and_frame(fields), fields), fields),)


def _imu(fields: Fields) -> tuple[Record, ...]:
    """REP-145: a covariance that starts with -1 means that there is no such measurement; all zeros is a gyroscope's
    message."""
    stamp, frame = _stamp_and_frame(fields)
    acceleration = vector_of(nested(fields, "linear_acceleration"))
    covariance = part(fields, "linear_acceleration_covariance")
    absent = isinstance(covariance, np.ndarray) and covariance.size > 0 and covariance[0] == -1
    if absent or not acceleration.any():
        return ()
    return (ImuRecord(stamp, frame, acceleration),)


def _transform_stamped(fields: Fields) -> tuple[Record, ...]:
    stamp, parent = _stamp_and_frame(fields)
    transform = nested(fields, "transform")
    matrix = rigid(nested(transform, "translation"), nested(transform, "rotation"))
    return (TransformRecord(stamp, parent, frame_of(fields, "child_frame_id"), matrix),)


def _transform_list(fields: Fields) -> tuple[Record, ...]:
    return every_transform(part(fields, "transforms"), lambda transform: _transform_stamped(transform)[0])


def _bare_transform(fields: Fields) -> tuple[Record, ...]:
    """Without frames: only the topic can say what they are."""
    return (TransformRecord(0, "", "", rigid(nested(fields, "translation"), nested(fields, "rotation"))),)


def _pose_stamped(fields: Fields) -> tuple[Record, ...]:
    return (PoseRecord(*_stamp_and_frame(fields), "", pose_matrix(nested(fields, "pose"))),)


def _pose_with_covariance(fields: Fields) -> tuple[Record, ...]:
    return (PoseRecord(*_stamp_and_frame(fields), "", pose_matrix(nested(nested(fields, "pose"), "pose"))),)


def _odometry(fields: Fields) -> tuple[Record, ...]:
    matrix = pose_matrix(nested(nested(fields, "pose"), "pose"))
    return (PoseRecord(*_stamp_and_frame(fields), frame_of(fields, "child_frame_id"), matrix),)


def _points(fields: Fields) -> tuple[Record, ...]:
    return (PointsRecord(*_stamp_and_frame(fields)),)


CONVERTERS: dict[str, Callable[[Fields], tuple[Record, ...]]] = {
    "sensor_msgs/Image": _image,
    "sensor_msgs/CompressedImage": _compressed_image,
    "sensor_msgs/CameraInfo": _camera_info,
    "sensor_msgs/Imu": _imu,
    "sensor_msgs/PointCloud2": _points,
    "tf2_msgs/TFMessage": _transform_list,
    "tf/tfMessage": _transform_list,
    "geometry_msgs/TransformStamped": _transform_stamped,
    "geometry_msgs/Transform": _bare_transform,
    "geometry_msgs/PoseStamped": _pose_stamped,
    "geometry_msgs/PoseWithCovarianceStamped": _pose_with_covariance,
    "nav_msgs/Odometry": _odometry,
}
"""Type -> what makes records of its fields. They raise Undecodable."""
