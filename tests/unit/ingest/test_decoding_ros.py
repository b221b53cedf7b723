"""ROS 1 and ROS 2 messages become records by the definitions that logs embed; the rosbags library wrote them."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag1 import Reader
from rosbags.typesys import Stores
from scenewright.stages.ingest.messages.container import Channel
from scenewright.stages.ingest.messages.decoding import decoder_for, why_unreadable
from scenewright.stages.ingest.messages.pixels import depth_unit
from scenewright.stages.ingest.messages.records import (
    CalibrationRecord,
    ImageRecord,
    ImuRecord,
    PointsRecord,
    PoseRecord,
    Record,
    TransformRecord,
    Undecodable,
)
from scipy.spatial.transform import Rotation

from tests.real_data import real_data
from tests.unit.ingest.ros_writing import ROS1, ROS2, channel, header, serialized, xyz

STAMP = 1_700_000_123_456_789_012
QUATERNION = np.array([0.1, -0.2, 0.3, 0.9]) / np.linalg.norm([0.1, -0.2, 0.3, 0.9])
MATRIX = np.eye(4)
MATRIX[:3, :3] = Rotation.from_quat(QUATERNION).as_matrix()
MATRIX[:3, 3] = (1.0, -2.0, 3.5)
POSE = {"position": xyz(MATRIX[:3, 3]), "orientation": xyz(QUATERNION)}
TRANSFORM = {"translation": xyz(MATRIX[:3, 3]), "rotation": xyz(QUATERNION)}
BOTH = pytest.mark.parametrize("store", [ROS1, ROS2])


def decoded(store: Stores, type_name: str, *, schema: str | None = None, **fields: Any) -> tuple[Record, ...]:
    decoder = decoder_for(channel(store, type_name, schema=schema))
    assert decoder is not None
    records = decoder(serialized(store, type_name, **fields))
    if store == ROS2:  # big-endian writers exist
        other = decoder(serialized(store, type_name, little_endian=False, **fields))
        assert repr(other) == repr(records)
    return records


@BOTH
def test_image(store: Stores) -> None:
    data = np.arange(60, dtype=np.uint8)
    (record,) = decoded(
        store,
        "sensor_msgs/Image",
        header=header(store, STAMP, "/optical"),
        height=3,
        width=9,
        encoding="16UC1",
        is_bigendian=1,
        step=20,
        data=data,
    )
    assert record == ImageRecord(STAMP, "optical", "16UC1", False, 9, 3, 20, True, data.tobytes())


@BOTH
def test_compressed_image(store: Stores) -> None:
    kind = "rgb8; jpeg compressed bgr8"
    fields = {"header": header(store, STAMP, "optical"), "format": kind, "data": np.arange(9, dtype=np.uint8)}
    (record,) = decoded(store, "sensor_msgs/CompressedImage", **fields)
    assert record == ImageRecord(STAMP, "optical", kind, True, 0, 0, 0, False, bytes(range(9)))


@BOTH
@pytest.mark.parametrize("embedded", [True, False])
def test_camera_info_with_its_letters_in_either_case(store: Stores, embedded: bool) -> None:
    k = [500.0, 0, 320, 0, 501, 240, 0, 0, 1]
    p = [500.0, 0, 320, -25, 0, 501, 240, 0, 0, 0, 1, 0]
    (record,) = decoded(
        store,
        "sensor_msgs/CameraInfo",
        schema=None if embedded else "",
        header=header(store, STAMP, "optical"),
        height=480,
        width=640,
        distortion_model="plumb_bob",
        d=[0.1, -0.2, 0.001, 0.002, 0.3],
        k=k,
        r=np.eye(3).ravel(),
        p=p,
    )
    d = (0.1, -0.2, 0.001, 0.002, 0.3)
    expected = CalibrationRecord(
        STAMP, "optical", 640, 480, "plumb_bob", d, tuple(k), tuple(np.eye(3).ravel()), tuple(p)
    )
    assert record == expected


def test_matrices_of_zeros_state_nothing() -> None:
    (record,) = decoded(ROS2, "sensor_msgs/CameraInfo", header=header(ROS2, 0, ""), height=4, width=6)
    assert isinstance(record, CalibrationRecord)
    assert (record.stamp, record.R, record.P, record.D, record.K) == (0, (), (), (), (0.0,) * 9)


@BOTH
@pytest.mark.parametrize("type_name", ["tf2_msgs/TFMessage", "tf/tfMessage"])
def test_transforms(store: Stores, type_name: str) -> None:
    transforms = [
        {"header": header(store, STAMP + i, "/world"), "child_frame_id": f"/camera_{i}", "transform": TRANSFORM}
        for i in range(3)
    ]
    listed = channel(store, "tf2_msgs/TFMessage")
    decoder = decoder_for(replace(listed, type_name=type_name))
    assert decoder is not None
    records = decoder(serialized(store, "tf2_msgs/TFMessage", transforms=transforms))
    assert [(r.stamp, r.parent, r.child) for r in records if isinstance(r, TransformRecord)] == [
        (STAMP + i, "world", f"camera_{i}") for i in range(3)
    ]
    for record in records:
        np.testing.assert_allclose(record.parent_from_child, MATRIX, atol=1e-12)  # type: ignore[union-attr]


@BOTH
def test_transform_poses_and_odometry(store: Stores) -> None:
    head = header(store, STAMP, "map")
    (transform,) = decoded(
        store, "geometry_msgs/TransformStamped", header=head, child_frame_id="base", transform=TRANSFORM
    )
    (pose,) = decoded(store, "geometry_msgs/PoseStamped", header=head, pose=POSE)
    (uncertain,) = decoded(store, "geometry_msgs/PoseWithCovarianceStamped", header=head, pose={"pose": POSE})
    (odometry,) = decoded(store, "nav_msgs/Odometry", header=head, child_frame_id="base", pose={"pose": POSE})
    assert isinstance(transform, TransformRecord) and (transform.parent, transform.child) == ("map", "base")
    for record, child in ((pose, ""), (uncertain, ""), (odometry, "base")):
        assert isinstance(record, PoseRecord)
        assert (record.stamp, record.frame_id, record.child_frame_id) == (STAMP, "map", child)
    for record in (transform, pose, uncertain, odometry):
        np.testing.assert_allclose(record.parent_from_child, MATRIX, atol=1e-12)


@BOTH
def test_acceleration_and_that_there_is_none(store: Stores) -> None:
    fields = {"header": header(store, STAMP, "imu"), "linear_acceleration": xyz((0.1, 0.2, 9.8))}
    (record,) = decoded(store, "sensor_msgs/Imu", **fields)
    assert isinstance(record, ImuRecord) and record.frame_id == "imu"
    assert record.acceleration.tolist() == [0.1, 0.2, 9.8]
    unknown = [-1.0] + [0.0] * 8
    assert decoded(store, "sensor_msgs/Imu", **fields, linear_acceleration_covariance=unknown) == ()
    assert decoded(store, "sensor_msgs/Imu", header=header(store, STAMP, "gyroscope")) == ()


@BOTH
def test_points_are_noted(store: Stores) -> None:
    fields = {"height": 1, "width": 2, "point_step": 12, "row_step": 24, "data": np.zeros(24, np.uint8)}
    fields["fields"] = [{"name": name, "offset": 4 * i, "datatype": 7, "count": 1} for i, name in enumerate("xyz")]
    (record,) = decoded(store, "sensor_msgs/PointCloud2", header=header(store, STAMP, "lidar"), **fields)
    assert record == PointsRecord(STAMP, "lidar")


def test_fields_are_found_where_the_embedded_definition_has_them() -> None:
    """A log whose CompressedImage was extended in front, between and behind: the bundled layout would misread it."""
    schema = (
        "# ours\nuint8 KIND_A=1\nstring NAME='a # b'\nuint8 kind 3\nHeader header\nfloat64[2] gains\n"
        "string format\nNote[] notes\nuint8[] data\nbool flag\n"
        "================================================================================\n"
        "MSG: sensor_msgs/Note\nstring<=20 text\nint16[<=3] numbers\n"
        "================================================================================\n"
        "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
        "================================================================================\n"
        "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
    )
    decoder = decoder_for(channel(ROS2, "sensor_msgs/CompressedImage", schema=schema))
    assert decoder is not None

    def text(value: bytes) -> bytes:
        return len(value).to_bytes(4, "little") + value

    body = b"\x03" + bytes(3) + (12).to_bytes(4, "little") + (34).to_bytes(4, "little") + text(b"cam\0")
    body += bytes(-len(body) % 8) + np.array([1.0, 2.0]).tobytes() + text(b"jpeg\0")
    body += bytes(-len(body) % 4) + (1).to_bytes(4, "little") + text(b"note\0") + bytes(3)
    body += (2).to_bytes(4, "little") + np.array([5, 6], "<i2").tobytes() + text(b"\xff\xd8\xff") + b"\x01"
    (record,) = decoder(b"\0\1\0\0" + body)
    assert record == ImageRecord(12_000_000_034, "cam", "jpeg", True, 0, 0, 0, False, b"\xff\xd8\xff")


def test_stamps_out_of_range_are_refused_and_zero_stays() -> None:
    decoder = decoder_for(channel(ROS2, "sensor_msgs/CompressedImage"))
    assert decoder is not None
    for sec, nanosec in ((-1, 0), (0, 10**9), (5, 2**32 - 1)):
        head = {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": "f"}
        with pytest.raises(Undecodable, match="the stamp is negative"):
            decoder(serialized(ROS2, "sensor_msgs/CompressedImage", header=head, format="png"))
    (record,) = decoder(serialized(ROS2, "sensor_msgs/CompressedImage", format="png"))
    assert isinstance(record, ImageRecord) and record.stamp == 0
    late = bytearray(serialized(ROS1, "sensor_msgs/CompressedImage", format="png"))
    late[4:8] = (4_000_000_000).to_bytes(4, "little")  # after 2038: seconds of ROS 1 have no sign
    ros1 = decoder_for(channel(ROS1, "sensor_msgs/CompressedImage"))
    assert ros1 is not None and ros1(bytes(late))[0].stamp == 4_000_000_000 * 10**9


@pytest.mark.parametrize(
    "rotation", [(0, 0, 0, 0), (0, 0, 0, 1.03), (0, 0, 0, 0.97), (0, 0, np.nan, 1), (0, 0, np.inf, 1), (0, 0, 1e300, 1)]
)
def test_no_rigid_transform(rotation: tuple[float, ...]) -> None:
    decoder = decoder_for(channel(ROS2, "geometry_msgs/PoseStamped"))
    assert decoder is not None
    pose = {"position": xyz((0, 0, 0)), "orientation": xyz(rotation)}
    with pytest.raises(Undecodable, match="no rigid transform|not a rigid transform|not finite"):
        decoder(serialized(ROS2, "geometry_msgs/PoseStamped", header=header(ROS2, 1, "map"), pose=pose))


def test_nearly_normal_quaternions_are_normalised() -> None:
    rotation = xyz(1.019 * QUATERNION)
    (record,) = decoded(ROS2, "geometry_msgs/PoseStamped", pose=POSE | {"orientation": rotation})
    np.testing.assert_allclose(record.parent_from_child, MATRIX, atol=1e-12)  # type: ignore[union-attr]


def test_one_bad_transform_of_several_does_not_cost_the_others() -> None:
    bad = {"translation": xyz((np.nan, 0, 0)), "rotation": xyz((0, 0, 0, 1))}
    transforms = [
        {"header": header(ROS2, STAMP, "world"), "child_frame_id": name, "transform": transform}
        for name, transform in (("a", TRANSFORM), ("b", bad), ("c", TRANSFORM))
    ]
    with pytest.raises(Undecodable, match="not every transform holds: field 'x' is not finite") as caught:
        decoded(ROS2, "tf2_msgs/TFMessage", transforms=transforms)
    assert [record.child for record in caught.value.records if isinstance(record, TransformRecord)] == ["a", "c"]


@pytest.mark.parametrize(
    ("unread", "reason"),
    [
        (Channel(1, "/t", "std_msgs/msg/Empty", "cdr", "ros2msg", b""), "'std_msgs/msg/Empty' are not used"),
        (Channel(1, "/t", "theora_image_transport/Packet", "ros1", "ros1msg", b"x"), "Theora video"),
        (Channel(1, "/t", "ffmpeg_image_transport_msgs/msg/FFMPEGPacket", "cdr", "ros2msg", b"x"), "compressed video"),
        (Channel(1, "/t", "foxglove.CompressedVideo", "protobuf", "protobuf", b""), "compressed video"),
        (Channel(1, "/t", "foxglove.SceneUpdate", "protobuf", "protobuf", b""), "in protobuf are not used"),
        (Channel(1, "/t", "foxglove.RawImage", "flatbuffer", "flatbuffer", b""), "in encoding 'flatbuffer'"),
        (Channel(1, "/t", "x", "cbor", "", b""), "in encoding 'cbor'"),
        (Channel(1, "/t", "geometry_msgs/Transform", "ros1", "ros1msg", b""), "name no frames"),
        (Channel(1, "/t", "sensor_msgs/msg/Image", "cdr", "ros2msg", b"!"), "line 1 of its definition"),
        (Channel(1, "/t", "sensor_msgs/msg/Image", "cdr", "ros2msg", b"ours/Kind a"), "no definition of ours/Kind"),
        (Channel(1, "/t", "sensor_msgs/msg/Image", "cdr", "ros2msg", b"Image[] a"), "contains itself"),
        (Channel(1, "/t", "sensor_msgs/msg/Image", "cdr", "ros2msg", b"wstring a"), "of type wstring"),
        (Channel(1, "/t", "sensor_msgs/msg/Image", "cdr", "ros2msg", b"#" * 300_000), "300000 bytes"),
        (Channel(1, "/t", "foxglove_msgs/msg/RawImage", "cdr", "", b""), "no definition of foxglove_msgs/RawImage"),
        (Channel(1, "/t", "", "json", "", b""), "without a name"),
    ],
)
def test_unread_channels_say_why(unread: Channel, reason: str) -> None:
    assert decoder_for(unread) is None
    assert reason in why_unreadable(unread)


def test_why_is_empty_for_channels_that_are_read() -> None:
    assert why_unreadable(channel(ROS2, "sensor_msgs/Image")) == ""


def test_large_images_are_not_read_byte_by_byte() -> None:
    data = np.zeros(640 * 480 * 3, np.uint8)
    message = serialized(ROS2, "sensor_msgs/Image", height=480, width=640, encoding="rgb8", step=1920, data=data)
    decoder = decoder_for(channel(ROS2, "sensor_msgs/Image"))
    assert decoder is not None
    decoder(message)
    start = time.process_time()
    for _ in range(50):
        decoder(message)
    assert 50 / (time.process_time() - start) > 500


# --- real logs ---------------------------------------------------------------------------------------------------


def _bag_channel(connection: Any) -> Channel:
    schema = connection.msgdef.data.encode()
    return Channel(connection.id, connection.topic, connection.msgtype, "ros1", "ros1msg", schema)


def test_realsense_bag() -> None:
    """Frames come from the topics; the colour camera of this D415 sits 14 mm to the left of the depth camera."""
    found: dict[str, list[Record]] = {}
    with Reader(real_data("logs") / "single_depth_color_640x480.bag") as reader:
        for connection, _, data in reader.messages():
            decoder = decoder_for(_bag_channel(connection))
            if decoder is not None:
                found.setdefault(connection.topic, []).extend(decoder(bytes(data)))
    depth, color = "device_0/sensor_0/Depth_0", "device_0/sensor_1/Color_0"
    images = {frame: found[f"/{frame}/image/data"] for frame in (depth, color)}
    assert [(r.encoding, r.width, r.height, r.frame_id) for r in images[depth] + images[color]] == [  # type: ignore
        ("mono16", 640, 480, depth),
        ("mono16", 640, 480, depth),
        ("rgb8", 640, 480, color),
    ]
    assert images[depth][0].stamp == 360_815_089_000
    for frame in (depth, color):
        (calibration,) = found[f"/{frame}/info/camera_info"]
        assert isinstance(calibration, CalibrationRecord)
        assert (calibration.frame_id, calibration.distortion_model, calibration.P) == (frame, "Brown Conrady", ())
    (transform,) = found[f"/{color}/tf/0"]
    assert isinstance(transform, TransformRecord)
    assert (transform.parent, transform.child) == ("device_0/reference_0", color)
    assert transform.parent_from_child[0, 3] == pytest.approx(-0.0143, abs=2e-4)


@pytest.mark.parametrize(("unit", "expected"), [(0.001, 1000.0), (0.00025, 4000.0), (0.0001, 10000.0), (0.0, None)])
def test_newer_realsense_bags_end_images_in_the_unit_of_depth(unit: float, expected: float | None) -> None:
    """Their definition does not say so, their frame does: `1`."""
    topic = "/device_0/sensor_0/Depth_0/image/data"
    decoder = decoder_for(channel(ROS1, "sensor_msgs/Image", topic))
    assert decoder is not None
    fields = {"height": 2, "width": 2, "encoding": "mono16", "step": 4, "data": np.arange(8, dtype=np.uint8)}
    older = serialized(ROS1, "sensor_msgs/Image", header=header(ROS1, STAMP, "0"), **fields)
    newer = serialized(ROS1, "sensor_msgs/Image", header=header(ROS1, STAMP, "1"), **fields)
    (plain,), (stated,) = decoder(older), decoder(newer + np.float32(unit).tobytes())
    assert isinstance(plain, ImageRecord) and plain.units_per_metre is None
    assert stated == replace(plain, units_per_metre=expected)
    assert isinstance(stated, ImageRecord) and depth_unit(stated) == (expected or 1000)
    elsewhere = decoder_for(channel(ROS1, "sensor_msgs/Image", "/camera/depth"))
    assert elsewhere is not None
    with pytest.raises(Undecodable, match="left over"):
        elsewhere(newer + np.float32(unit).tobytes())


@pytest.mark.parametrize("name", ["watercan.bag", "example.bag"])
def test_every_message_of_real_bags_decodes(name: str) -> None:
    transforms = 0
    with Reader(real_data("logs") / name) as reader:
        for connection, _, data in reader.messages():
            decoder = decoder_for(_bag_channel(connection))
            if decoder is not None:
                transforms += sum(isinstance(record, TransformRecord) for record in decoder(bytes(data)))
    assert transforms == {"watercan.bag": 26712, "example.bag": 2689}[name]
