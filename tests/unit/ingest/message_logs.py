"""Writes logs as other people's recorders would: the same messages into every container and dialect."""

from __future__ import annotations

import base64
import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Odometry_pb2 import Odometry
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Bag1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Bag2Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.geometry.transforms import quaternion_of

from tests.unit.ingest import foxglove_logs
from tests.unit.ingest.tiny_room import CAMERA, jpeg, millimetres

SECOND = 1_000_000_000
FIRST = 1_700_000_000 * SECOND
"""A stamp as robots have them."""


class Recorder:
    """What every recorder can write. Stamps in nanoseconds; `log_time` is the stamp unless given."""

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *_: object) -> None:
        raise NotImplementedError

    def image(self, topic: str, stamp: int, pixels: np.ndarray, encoding: str, frame: str, **options: Any) -> None:
        """Write a raw image."""
        raise NotImplementedError

    def compressed(self, topic: str, stamp: int, data: bytes, kind: str, frame: str, **options: Any) -> None:
        """Write a compressed image."""
        raise NotImplementedError

    def info(self, topic: str, stamp: int, frame: str, camera: Camera = CAMERA, **options: Any) -> None:
        """Write a calibration; options D, K, R, P, model, log_time."""
        raise NotImplementedError

    def transform(self, topic: str, stamp: int, parent: str, child: str, matrix: np.ndarray, **options: Any) -> None:
        """Write one transform."""
        raise NotImplementedError

    def odometry(self, topic: str, stamp: int, frame: str, child: str, matrix: np.ndarray, **options: Any) -> None:
        """Write odometry; without `child` a pose."""
        raise NotImplementedError


def calibration_fields(camera: Camera, options: dict[str, Any]) -> dict[str, Any]:
    """Return D, K, R, P and the model of a calibration, options first."""
    matrix = [camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0]
    projection = [camera.fx, 0.0, camera.cx, 0.0, 0.0, camera.fy, camera.cy, 0.0, 0.0, 0.0, 1.0, 0.0]
    fields = {"D": [0.0] * 5, "K": matrix, "R": [1.0, 0, 0, 0, 1.0, 0, 0, 0, 1.0], "P": projection}
    fields["model"] = "plumb_bob"
    return fields | {name: value for name, value in options.items() if name in fields}


class RosRecorder(Recorder):
    """ROS 1 bags, ROS 2 bags in MCAP or SQLite."""

    def __init__(self, path: Path, dialect: str) -> None:
        self.path = path
        self._is_ros1 = dialect == "ros1"
        self.store = get_typestore(Stores.ROS1_NOETIC if self._is_ros1 else Stores.ROS2_HUMBLE)
        if self._is_ros1:
            self._writer: Any = Bag1Writer(path)
        else:
            plugin = StoragePlugin.MCAP if dialect == "ros2-mcap" else StoragePlugin.SQLITE3
            self._writer = Bag2Writer(path, version=9, storage_plugin=plugin)
        if self._is_ros1:  # not among the types of ROS 1 that come with rosbags
            kind, text = "tf2_msgs/msg/TFMessage", "geometry_msgs/TransformStamped[] transforms"
            self.store.register(get_types_from_msg(text, kind))
        self._connections: dict[str, Any] = {}

    def __enter__(self) -> RosRecorder:
        self._writer.open()
        return self

    def __exit__(self, *_: object) -> None:
        self._writer.close()

    def type(self, name: str) -> Any:
        """Return a message type."""
        return self.store.types[name]

    def write(self, topic: str, message: Any, log_time: int) -> None:
        """Append any message."""
        name = message.__msgtype__
        if topic not in self._connections:
            self._connections[topic] = self._writer.add_connection(topic, name, typestore=self.store)
        serialize = self.store.serialize_ros1 if self._is_ros1 else self.store.serialize_cdr
        self._writer.write(self._connections[topic], log_time, serialize(message, name))

    def write_bytes(self, topic: str, name: str, data: bytes, log_time: int) -> None:
        """Append bytes that claim to be a message."""
        if topic not in self._connections:
            self._connections[topic] = self._writer.add_connection(topic, name, typestore=self.store)
        self._writer.write(self._connections[topic], log_time, data)

    def header(self, stamp: int, frame: str) -> Any:
        """Return a header."""
        time = self.type("builtin_interfaces/msg/Time")(sec=stamp // SECOND, nanosec=stamp % SECOND)
        sequence = {"seq": 0} if self._is_ros1 else {}
        return self.type("std_msgs/msg/Header")(stamp=time, frame_id=frame, **sequence)

    def image(self, topic: str, stamp: int, pixels: np.ndarray, encoding: str, frame: str, **options: Any) -> None:
        big_endian = options.get("big_endian", False)
        if big_endian:
            pixels = pixels.astype(pixels.dtype.newbyteorder(">"))
        data = np.frombuffer(pixels.tobytes(), np.uint8)
        message = self.type("sensor_msgs/msg/Image")(
            header=self.header(stamp, frame),
            height=pixels.shape[0],
            width=pixels.shape[1],
            encoding=encoding,
            is_bigendian=int(big_endian),
            step=len(data) // pixels.shape[0],
            data=data,
        )
        self.write(topic, message, options.get("log_time", stamp))

    def compressed(self, topic: str, stamp: int, data: bytes, kind: str, frame: str, **options: Any) -> None:
        message = self.type("sensor_msgs/msg/CompressedImage")(
            header=self.header(stamp, frame), format=kind, data=np.frombuffer(data, np.uint8)
        )
        self.write(topic, message, options.get("log_time", stamp))

    def info(self, topic: str, stamp: int, frame: str, camera: Camera = CAMERA, **options: Any) -> None:
        fields = calibration_fields(camera, options)
        names = ("D", "K", "R", "P") if self._is_ros1 else ("d", "k", "r", "p")
        region = {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0} | options.get("roi", {})
        message = self.type("sensor_msgs/msg/CameraInfo")(
            header=self.header(stamp, frame),
            height=options.get("height", camera.height),
            width=options.get("width", camera.width),
            distortion_model=fields["model"],
            binning_x=options.get("binning", 0),
            binning_y=options.get("binning", 0),
            roi=self.type("sensor_msgs/msg/RegionOfInterest")(**region, do_rectify=False),
            **{name: np.array(fields[name.upper()], dtype=np.float64) for name in names},
        )
        self.write(topic, message, options.get("log_time", stamp))

    def _vector(self, values: np.ndarray, kind: str = "Vector3") -> Any:
        x, y, z = (float(value) for value in values)
        return self.type(f"geometry_msgs/msg/{kind}")(x=x, y=y, z=z)

    def _quaternion(self, matrix: np.ndarray) -> Any:
        x, y, z, w = (float(value) for value in quaternion_of(matrix))
        return self.type("geometry_msgs/msg/Quaternion")(x=x, y=y, z=z, w=w)

    def transform(self, topic: str, stamp: int, parent: str, child: str, matrix: np.ndarray, **options: Any) -> None:
        transform = self.type("geometry_msgs/msg/Transform")(
            translation=self._vector(matrix[:3, 3]), rotation=self._quaternion(matrix)
        )
        stamped = self.type("geometry_msgs/msg/TransformStamped")(
            header=self.header(stamp, parent), child_frame_id=child, transform=transform
        )
        message = self.type("tf2_msgs/msg/TFMessage")(transforms=[stamped])
        self.write(topic, message, options.get("log_time", stamp))

    def odometry(self, topic: str, stamp: int, frame: str, child: str, matrix: np.ndarray, **options: Any) -> None:
        pose = self.type("geometry_msgs/msg/Pose")(
            position=self._vector(matrix[:3, 3], "Point"), orientation=self._quaternion(matrix)
        )
        header = self.header(stamp, frame)
        if not child:
            self.write(topic, self.type("geometry_msgs/msg/PoseStamped")(header=header, pose=pose), stamp)
            return
        nothing = np.zeros(36)
        zero = self._vector(np.zeros(3))
        twist = self.type("geometry_msgs/msg/Twist")(linear=zero, angular=zero)
        message = self.type("nav_msgs/msg/Odometry")(
            header=header,
            child_frame_id=child,
            pose=self.type("geometry_msgs/msg/PoseWithCovariance")(pose=pose, covariance=nothing),
            twist=self.type("geometry_msgs/msg/TwistWithCovariance")(twist=twist, covariance=nothing),
        )
        self.write(topic, message, options.get("log_time", stamp))

    def imu(self, topic: str, stamp: int, frame: str, acceleration: np.ndarray) -> None:
        """Write an inertial measurement."""
        message = self.type("sensor_msgs/msg/Imu")(
            header=self.header(stamp, frame),
            orientation=self._quaternion(np.eye(4)),
            orientation_covariance=np.zeros(9),
            angular_velocity=self._vector(np.zeros(3)),
            angular_velocity_covariance=np.zeros(9),
            linear_acceleration=self._vector(acceleration),
            linear_acceleration_covariance=np.zeros(9),
        )
        self.write(topic, message, stamp)

    def text(self, topic: str, stamp: int, text: str) -> None:
        """Write a message that has nothing to do with cameras."""
        self.write(topic, self.type("std_msgs/msg/String")(data=text), stamp)


class ProtobufRecorder(Recorder):
    """Foxglove messages in protobuf."""

    def __init__(self, path: Path, dialect: str) -> None:
        self.path = path
        self._log = foxglove_logs.LogWriter(path)

    def __exit__(self, *_: object) -> None:
        self._log.__exit__()

    def image(self, topic: str, stamp: int, pixels: np.ndarray, encoding: str, frame: str, **options: Any) -> None:
        self._log.write(topic, foxglove_logs.raw(stamp, pixels, encoding, frame), options.get("log_time", stamp))

    def compressed(self, topic: str, stamp: int, data: bytes, kind: str, frame: str, **options: Any) -> None:
        self._log.write(topic, foxglove_logs.compressed(stamp, data, frame, kind), options.get("log_time", stamp))

    def info(self, topic: str, stamp: int, frame: str, camera: Camera = CAMERA, **options: Any) -> None:
        fields = calibration_fields(camera, options)
        fields["distortion_model"] = fields.pop("model")
        message = foxglove_logs.calibration(stamp, frame, width=camera.width, height=camera.height, **fields)
        self._log.write(topic, message, options.get("log_time", stamp))

    def transform(self, topic: str, stamp: int, parent: str, child: str, matrix: np.ndarray, **options: Any) -> None:
        message = FrameTransforms(transforms=[foxglove_logs.transform(stamp, parent, child, matrix)])
        self._log.write(topic, message, options.get("log_time", stamp))

    def odometry(self, topic: str, stamp: int, frame: str, child: str, matrix: np.ndarray, **options: Any) -> None:
        posed = foxglove_logs.pose_in_frame(stamp, frame, matrix)
        if child:
            posed = Odometry(timestamp=posed.timestamp, frame_id=frame, body_frame_id=child, pose=posed.pose)
        self._log.write(topic, posed, stamp)


class JsonRecorder(Recorder):
    """Foxglove messages in JSON."""

    def __init__(self, path: Path, dialect: str) -> None:
        self.path = path
        self._file = path.open("wb")
        self._writer = McapWriter(self._file)
        self._writer.start()
        self._channels: dict[str, int] = {}

    def __exit__(self, *_: object) -> None:
        self._writer.finish()
        self._file.close()

    def write(self, topic: str, name: str, stamp: int, fields: dict[str, Any], log_time: int) -> None:
        """Append an object."""
        if topic not in self._channels:
            schema = self._writer.register_schema(f"foxglove.{name}", "jsonschema", b"{}")
            self._channels[topic] = self._writer.register_channel(topic, "json", schema)
        fields = {"timestamp": {"sec": stamp // SECOND, "nsec": stamp % SECOND}} | fields
        self._writer.add_message(self._channels[topic], log_time, json.dumps(fields).encode(), log_time)

    def image(self, topic: str, stamp: int, pixels: np.ndarray, encoding: str, frame: str, **options: Any) -> None:
        data = pixels.tobytes()
        fields = {
            "frame_id": frame,
            "width": pixels.shape[1],
            "height": pixels.shape[0],
            "encoding": encoding,
            "step": len(data) // pixels.shape[0],
            "data": base64.b64encode(data).decode(),
        }
        self.write(topic, "RawImage", stamp, fields, options.get("log_time", stamp))

    def compressed(self, topic: str, stamp: int, data: bytes, kind: str, frame: str, **options: Any) -> None:
        fields = {"frame_id": frame, "format": kind, "data": base64.b64encode(data).decode()}
        self.write(topic, "CompressedImage", stamp, fields, options.get("log_time", stamp))

    def info(self, topic: str, stamp: int, frame: str, camera: Camera = CAMERA, **options: Any) -> None:
        fields = calibration_fields(camera, options)
        fields["distortion_model"] = fields.pop("model")
        fields |= {"frame_id": frame, "width": camera.width, "height": camera.height}
        self.write(topic, "CameraCalibration", stamp, fields, options.get("log_time", stamp))

    def transform(self, topic: str, stamp: int, parent: str, child: str, matrix: np.ndarray, **options: Any) -> None:
        fields = {"parent_frame_id": parent, "child_frame_id": child, **_pose(matrix, "translation", "rotation")}
        self.write(topic, "FrameTransform", stamp, fields, options.get("log_time", stamp))

    def odometry(self, topic: str, stamp: int, frame: str, child: str, matrix: np.ndarray, **options: Any) -> None:
        fields: dict[str, Any] = {"frame_id": frame, "pose": _pose(matrix, "position", "orientation")}
        if child:
            fields["body_frame_id"] = child
        self.write(topic, "Odometry" if child else "PoseInFrame", stamp, fields, stamp)


def _pose(matrix: np.ndarray, position: str, orientation: str) -> dict[str, Any]:
    numbers = (float(value) for value in quaternion_of(matrix))
    return {
        position: dict(zip("xyz", (float(value) for value in matrix[:3, 3]), strict=True)),
        orientation: dict(zip("xyzw", numbers, strict=True)),
    }


RECORDERS: dict[str, tuple[Callable[[Path, str], Any], str, str]] = {
    "ros1": (RosRecorder, "log.bag", "rosbag1"),
    "ros2-mcap": (RosRecorder, "bag", "rosbag2"),
    "ros2-sqlite": (RosRecorder, "bag", "rosbag2"),
    "foxglove-protobuf": (ProtobufRecorder, "log.mcap", "mcap"),
    "foxglove-json": (JsonRecorder, "log.mcap", "mcap"),
}
"""Dialect -> recorder, name of the log, its format."""


def recorder(folder: Path, dialect: str = "ros2-mcap") -> Any:
    """Return a recorder of a new log in a folder; its `path` is the log."""
    folder.mkdir(parents=True, exist_ok=True)
    make, name, _ = RECORDERS[dialect]
    return make(folder / name, dialect)


def record_room(log: Any, recorded: list, start: int = FIRST, step: int = SECOND // 10, **options: Any) -> None:
    """Write the tiny room as an RGB-D camera in a hand: colour, depth, calibration, map -> base -> optical."""
    base_from_optical = options.get("mount", np.eye(4))
    name = options.get("name", "camera")
    frame = f"{name}_optical"
    log.transform("/tf_static", start, f"{name}_base", frame, base_from_optical)
    for index, (color, depth, pose) in enumerate(recorded):
        stamp = start + index * step
        log.transform("/tf", stamp, "map", f"{name}_base", pose @ np.linalg.inv(base_from_optical))
        log.info(f"/{name}/color/camera_info", stamp, frame)
        log.compressed(f"/{name}/color/image_raw/compressed", stamp, jpeg(color), options.get("kind", "jpeg"), frame)
        log.image(f"/{name}/aligned_depth_to_color/image_raw", stamp, millimetres(depth), "16UC1", frame)


def compressed_depth(packed: bytes) -> bytes:
    """Return the data of a compressedDepth image of 16UC1 depth that is packed as PNG or RVL."""
    return struct.pack("<iff", 0, 0.0, 0.0) + packed
