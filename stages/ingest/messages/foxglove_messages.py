"""Foxglove messages as dictionaries of fields -> records: the same for protobuf, JSON and ROS 2."""

from __future__ import annotations

from collections.abc import Callable

from scenewright.stages.ingest.messages.record_fields import (
    Fields,
    bytes_of,
    frame_of,
    name_of,
    nested,
    numbers_of,
    part,
    pose_matrix,
    rigid,
    size_of,
    stamp_of,
)
from scenewright.stages.ingest.messages.records import (
    CalibrationRecord,
    ImageRecord,
    PointsRecord,
    PoseRecord,
    Record,
    TransformRecord,
    Undecodable,
)


def type_of(type_name: str) -> str | None:
    """Return `RawImage` of `foxglove.RawImage`, `foxglove/RawImage`, `foxglove_msgs/msg/RawImage`; None of others."""
    words = type_name.replace("/", ".").split(".")
    return words[-1] if len(words) in (2, 3) and words[0] in ("foxglove", "foxglove_msgs") else None


def _raw_image(fields: Fields) -> tuple[Record, ...]:
    image = ImageRecord(
        stamp=stamp_of(fields.get("timestamp")),
        frame_id=frame_of(fields),
        encoding=name_of(fields, "encoding"),
        compressed=False,
        width=size_of(fields, "width"),
        height=size_of(fields, "height"),
        step=size_of(fields, "step"),
        big_endian=False,
        data=bytes_of(fields, "data"),
    )
    return (image,)


def _compressed_image(fields: Fields) -> tuple[Record, ...]:
    stamp, frame, kind = stamp_of(fields.get("timestamp")), frame_of(fields), name_of(fields, "format")
    return (ImageRecord(stamp, frame, kind, True, 0, 0, 0, False, bytes_of(fields, "data")),)


def _calibration(fields: Fields) -> tuple[Record, ...]:
    return (calibration_record(stamp_of(fields.get("timestamp")), frame_of(fields), fields),)


def calibration_record(stamp: int, frame_id: str, fields: Fields) -> CalibrationRecord:
    """Return the calibration of a CameraCalibration, or of a CameraInfo, which has the same fields.

    R and P that are all zeros state nothing and become empty.
    """
    rectification, projection = numbers_of(fields, "r", (0, 9)), numbers_of(fields, "p", (0, 12))
    return CalibrationRecord(
        stamp=stamp,
        frame_id=frame_id,
        width=size_of(fields, "width"),
        height=size_of(fields, "height"),
        distortion_model=name_of(fields, "distortion_model"),
        D=numbers_of(fields, "d"),
        K=numbers_of(fields, "k", (9,)),
        R=rectification if any(rectification) else (),
        P=projection if any(projection) else (),
    )


def _transform(fields: Fields) -> TransformRecord:
    return TransformRecord(
        stamp=stamp_of(fields.get("timestamp")),
        parent=frame_of(fields, "parent_frame_id"),
        child=frame_of(fields, "child_frame_id"),
        parent_from_child=rigid(nested(fields, "translation"), nested(fields, "rotation")),
    )


def _frame_transform(fields: Fields) -> tuple[Record, ...]:
    return (_transform(fields),)


def _frame_transforms(fields: Fields) -> tuple[Record, ...]:
    return every_transform(part(fields, "transforms"), _transform)


def every_transform(messages: object, convert: Callable[[Fields], Record]) -> tuple[Record, ...]:
    """Return the records of a list of transforms. Raises Undecodable, with those that hold, when one does not."""
    if not isinstance(messages, list) or not all(isinstance(message, dict) for message in messages):
        raise Undecodable("the transforms are no list of messages")
    good: list[Record] = []
    problems = []
    for message in messages:
        try:
            good.append(convert(message))
        except Undecodable as error:
            problems.append(str(error))
    if problems:
        raise Undecodable(f"not every transform holds: {problems[0]}", tuple(good))
    return tuple(good)


def _pose_in_frame(fields: Fields) -> tuple[Record, ...]:
    matrix = pose_matrix(nested(fields, "pose"))
    return (PoseRecord(stamp_of(fields.get("timestamp")), frame_of(fields), "", matrix),)


def _odometry(fields: Fields) -> tuple[Record, ...]:
    matrix = pose_matrix(nested(fields, "pose"))
    return (PoseRecord(stamp_of(fields.get("timestamp")), frame_of(fields), frame_of(fields, "body_frame_id"), matrix),)


def _points(fields: Fields) -> tuple[Record, ...]:
    return (PointsRecord(stamp_of(fields.get("timestamp")), frame_of(fields)),)


CONVERTERS: dict[str, Callable[[Fields], tuple[Record, ...]]] = {
    "RawImage": _raw_image,
    "CompressedImage": _compressed_image,
    "CameraCalibration": _calibration,
    "FrameTransform": _frame_transform,
    "FrameTransforms": _frame_transforms,
    "PoseInFrame": _pose_in_frame,
    "Odometry": _odometry,
    "PointCloud": _points,
}
"""Foxglove type -> what makes records of its fields (lower-case names). They raise Undecodable."""
