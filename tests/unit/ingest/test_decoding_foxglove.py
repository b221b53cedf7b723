"""Foxglove messages give the same records in protobuf, in JSON and as ROS 2 messages."""

from __future__ import annotations

import base64
import json
from typing import Any

import numpy as np
import pytest
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Odometry_pb2 import Odometry
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from mcap.reader import make_reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scenewright.stages.ingest.messages.container import Channel
from scenewright.stages.ingest.messages.decoding import decoder_for
from scenewright.stages.ingest.messages.records import (
    CalibrationRecord,
    ImageRecord,
    PointsRecord,
    PoseRecord,
    Record,
    TransformRecord,
)

from tests.real_data import real_data

SECOND, NANOSECOND = 1_700_000_123, 456_789_012
STAMP = SECOND * 10**9 + NANOSECOND
VECTOR = {"x": 1.0, "y": -2.0, "z": 3.5}
ROTATION = {"x": 0.0, "y": 0.0, "z": 0.6, "w": 0.8}
MATRIX = np.array([[0.28, -0.96, 0, 1], [0.96, 0.28, 0, -2], [0, 0, 1, 3.5], [0, 0, 0, 1]])
K = [500.0, 0.0, 320.0, 0.0, 501.0, 240.0, 0.0, 0.0, 1.0]
P = [500.0, 0.0, 320.0, -25.0, 0.0, 501.0, 240.0, 0.0, 0.0, 0.0, 1.0, 0.0]
EYE = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
POSE = {"position": VECTOR, "orientation": ROTATION}
FRAMES = {"parent_frame_id": "world", "child_frame_id": "camera", "translation": VECTOR, "rotation": ROTATION}
CASES: dict[str, tuple[Any, dict[str, Any]]] = {
    "RawImage": (
        RawImage,
        {"frame_id": "c", "width": 9, "height": 3, "encoding": "16UC1", "step": 20, "data": bytes(range(60))},
    ),
    "CompressedImage": (CompressedImage, {"frame_id": "c", "format": "jpeg", "data": b"\xff\xd8\xff\x00"}),
    "CameraCalibration": (
        CameraCalibration,
        {"frame_id": "c", "width": 640, "height": 480, "distortion_model": "plumb_bob"}
        | {"D": [0.1, 0.2, 0.0, 0.0, 0.3], "K": K, "R": EYE, "P": P},
    ),
    "FrameTransform": (FrameTransform, FRAMES),
    "FrameTransforms": (FrameTransforms, {"transforms": [FRAMES, FRAMES | {"child_frame_id": "lidar"}]}),
    "PoseInFrame": (PoseInFrame, {"frame_id": "map", "pose": POSE}),
    "Odometry": (Odometry, {"frame_id": "map", "body_frame_id": "base", "pose": POSE}),
    "PointCloud": (PointCloud, {"frame_id": "lidar", "point_stride": 4, "data": b"1234"}),
}
ROS_DEFINITIONS = {
    "RawImage": "string frame_id\nuint32 width\nuint32 height\nstring encoding\nuint32 step\nuint8[] data",
    "CompressedImage": "string frame_id\nuint8[] data\nstring format",
    "CameraCalibration": "string frame_id\nuint32 width\nuint32 height\nstring distortion_model\n"
    "float64[] D\nfloat64[9] K\nfloat64[9] R\nfloat64[12] P",
    "FrameTransform": "string parent_frame_id\nstring child_frame_id\n"
    "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation",
    "FrameTransforms": "foxglove_msgs/FrameTransform[] transforms",
    "PoseInFrame": "string frame_id\ngeometry_msgs/Pose pose",
}
LINE = "=" * 80


def _stamped(fields: dict[str, Any], stamp: dict[str, int]) -> dict[str, Any]:
    if "transforms" in fields:
        return {"transforms": [_stamped(one, stamp) for one in fields["transforms"]]}
    return {"timestamp": stamp} | fields


def _in_protobuf(name: str) -> tuple[Record, ...]:
    kind, fields = CASES[name]
    data = kind(**_stamped(fields, {"seconds": SECOND, "nanos": NANOSECOND})).SerializeToString()
    decoder = decoder_for(Channel(1, "/t", f"foxglove.{name}", "protobuf", "protobuf", b"not looked at"))
    assert decoder is not None
    return decoder(data)


def _as_json(name: str, stamp: dict[str, int], **changes: Any) -> bytes:
    fields = _stamped(CASES[name][1], stamp) | changes
    return json.dumps(fields, default=lambda data: base64.b64encode(data).decode()).encode()


def _in_json(name: str, type_name: str, **stamp: int) -> tuple[Record, ...]:
    decoder = decoder_for(Channel(1, "/t", type_name, "json", "jsonschema", b"{}"))
    assert decoder is not None
    return decoder(_as_json(name, stamp))


def _in_ros2(name: str) -> tuple[Record, ...]:
    types = get_typestore(Stores.ROS2_HUMBLE)
    texts = {kind: f"builtin_interfaces/Time timestamp\n{text}" for kind, text in ROS_DEFINITIONS.items()}
    texts["FrameTransforms"] = ROS_DEFINITIONS["FrameTransforms"]
    for kind, text in texts.items():
        types.register(get_types_from_msg(text, f"foxglove_msgs/msg/{kind}"))

    def built(type_name: str, fields: dict[str, Any]) -> Any:
        values: dict[str, Any] = {}
        for field, (node, detail) in types.fielddefs[type_name][1]:
            value = fields[field]
            if node == 2:
                value = built(detail, value)
            elif node in (3, 4) and detail[0][0] == 2:
                value = [built(detail[0][1], one) for one in value]
            elif isinstance(value, bytes):
                value = np.frombuffer(value, np.uint8)
            values[field] = np.array(value) if isinstance(value, list) and "transforms" not in field else value
        return types.types[type_name](**values)

    full = f"foxglove_msgs/msg/{name}"
    data = types.serialize_cdr(built(full, _stamped(CASES[name][1], {"sec": SECOND, "nanosec": NANOSECOND})), full)
    schema = types.generate_msgdef(full, ros_version=2)[0]
    decoder = decoder_for(Channel(1, "/t", full, "cdr", "ros2msg", schema.encode()))
    assert decoder is not None
    return decoder(bytes(data))


EXPECTED: dict[str, Record] = {
    "RawImage": ImageRecord(STAMP, "c", "16UC1", False, 9, 3, 20, False, bytes(range(60))),
    "CompressedImage": ImageRecord(STAMP, "c", "jpeg", True, 0, 0, 0, False, b"\xff\xd8\xff\x00"),
    "CameraCalibration": CalibrationRecord(
        STAMP, "c", 640, 480, "plumb_bob", (0.1, 0.2, 0.0, 0.0, 0.3), tuple(K), tuple(EYE), tuple(P)
    ),
    "FrameTransform": TransformRecord(STAMP, "world", "camera", MATRIX),
    "FrameTransforms": TransformRecord(STAMP, "world", "camera", MATRIX),
    "PoseInFrame": PoseRecord(STAMP, "map", "", MATRIX),
    "Odometry": PoseRecord(STAMP, "map", "base", MATRIX),
    "PointCloud": PointsRecord(STAMP, "lidar"),
}


@pytest.mark.parametrize("name", sorted(CASES))
def test_every_dialect_gives_the_same_records(name: str) -> None:
    dialects = [
        _in_protobuf(name),
        _in_json(name, f"foxglove.{name}", sec=SECOND, nsec=NANOSECOND),
        _in_json(name, f"foxglove_msgs/msg/{name}", sec=SECOND, nanosec=NANOSECOND),
    ]
    if name in ROS_DEFINITIONS:
        dialects.append(_in_ros2(name))
    expected = EXPECTED[name]
    for records in dialects:
        assert len(records) == (2 if name == "FrameTransforms" else 1)
        first = vars(records[0]).copy()
        wanted = vars(expected).copy()
        assert type(records[0]) is type(expected)
        np.testing.assert_allclose(first.pop("parent_from_child", 0), wanted.pop("parent_from_child", 0), atol=1e-12)
        assert first == wanted
    if name == "FrameTransforms":
        assert all(records[1].child == "lidar" for records in dialects)  # type: ignore[union-attr]


def test_missing_stamps_are_zero() -> None:
    decoder = decoder_for(Channel(1, "/t", "foxglove.CompressedImage", "protobuf", "protobuf", b""))
    assert decoder is not None
    (record,) = decoder(CompressedImage(data=b"x").SerializeToString())
    assert record == ImageRecord(0, "", "", True, 0, 0, 0, False, b"x")
    without = json.dumps({"frame_id": "c", "format": "png", "data": "eA=="}).encode()
    in_json = decoder_for(Channel(1, "/t", "foxglove.CompressedImage", "json", "", b""))
    assert in_json is not None and in_json(without)[0].stamp == 0


def test_real_json_log_with_a_camera_model_of_its_own() -> None:
    records: dict[str, list[Record]] = {}
    with (real_data("logs") / "custom-camera-model.mcap").open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            assert schema is not None
            decoder = decoder_for(
                Channel(1, channel.topic, schema.name, channel.message_encoding, schema.encoding, schema.data)
            )
            assert decoder is not None
            records.setdefault(channel.topic, []).extend(decoder(message.data))
    assert [len(found) for found in records.values()] == [10, 10, 10]
    plain, custom = records["/camera_calibration"][0], records["/camera_calibration/custom"][0]
    assert isinstance(plain, CalibrationRecord) and isinstance(custom, CalibrationRecord)
    assert (plain.distortion_model, custom.distortion_model) == ("plumb_bob", "CylinderCameraModel")
    assert (plain.width, plain.height, plain.K[0]) == (640, 480, 800.0)
    image = records["/image/compressed"][0]
    assert isinstance(image, ImageRecord) and image.data.startswith(b"\xff\xd8\xff")
