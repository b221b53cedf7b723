"""Small messages of every type that is decoded, in every dialect, and what a decoded one holds."""

from __future__ import annotations

from typing import Any

import numpy as np
from scenewright.stages.ingest.messages.container import Channel
from scenewright.stages.ingest.messages.records import (
    CalibrationRecord,
    ImageRecord,
    ImuRecord,
    PointsRecord,
    PoseRecord,
    Record,
    TransformRecord,
)
from scenewright.stages.kit.geometry.transforms import is_rigid

from tests.unit.ingest.ros_writing import ROS1, ROS2, channel, header, serialized, xyz
from tests.unit.ingest.test_decoding_foxglove import CASES, _as_json

STAMP = 1_700_000_000_000_000_001
POSE = {"position": xyz((1, 2, 3)), "orientation": xyz((0, 0, 0.6, 0.8))}
TRANSFORM = {"translation": xyz((1, 2, 3)), "rotation": xyz((0, 0, 0.6, 0.8))}


def ros_messages() -> list[tuple[Channel, bytes]]:
    """Return messages of ROS 1 and ROS 2."""
    found = []
    for store in (ROS1, ROS2):
        head = header(store, STAMP, "camera")
        edge = {"header": head, "child_frame_id": "c", "transform": TRANSFORM}
        image = {"height": 2, "width": 3, "encoding": "mono8", "step": 3, "data": np.arange(6, dtype=np.uint8)}
        messages: dict[str, dict[str, Any]] = {
            "sensor_msgs/Image": image,
            "sensor_msgs/CompressedImage": {"format": "png", "data": np.arange(9, dtype=np.uint8)},
            "sensor_msgs/CameraInfo": {"height": 2, "width": 3, "d": [0.1] * 5, "k": [1.0] * 9},
            "sensor_msgs/Imu": {"linear_acceleration": xyz((0, 0, 9.8))},
            "sensor_msgs/PointCloud2": {"fields": [{"name": "x", "count": 1}], "data": np.zeros(4, np.uint8)},
            "geometry_msgs/PoseStamped": {"pose": POSE},
            "nav_msgs/Odometry": {"child_frame_id": "base", "pose": {"pose": POSE}},
        }
        found += [(channel(store, n), serialized(store, n, header=head, **fields)) for n, fields in messages.items()]
        found.append(
            (channel(store, "tf2_msgs/TFMessage"), serialized(store, "tf2_msgs/TFMessage", transforms=[edge] * 3))
        )
    return found


def foxglove_messages() -> list[tuple[Channel, bytes]]:
    """Return messages of Foxglove's types in protobuf and in JSON."""
    found = []
    for name, (kind, fields) in CASES.items():
        type_name = f"foxglove.{name}"
        found.append((Channel(1, "/t", type_name, "protobuf", "protobuf", b""), kind(**fields).SerializeToString()))
        found.append((Channel(1, "/t", type_name, "json", "", b""), _as_json(name, {"sec": 1, "nsec": 2})))
    return found


def check_record(record: Record) -> None:
    """A record that comes out of a decoder holds what its description promises."""
    assert 0 <= record.stamp < 2**63
    if isinstance(record, TransformRecord | PoseRecord):
        assert record.parent_from_child.shape == (4, 4) and is_rigid(record.parent_from_child)
    elif isinstance(record, ImuRecord):
        assert record.acceleration.shape == (3,) and np.isfinite(record.acceleration).all()
    elif isinstance(record, CalibrationRecord):
        assert (len(record.K), len(record.R) in (0, 9), len(record.P) in (0, 12)) == (9, True, True)
        assert np.isfinite([*record.D, *record.K, *record.R, *record.P]).all()
    elif isinstance(record, ImageRecord):
        assert isinstance(record.data, bytes) and min(record.width, record.height, record.step) >= 0
    else:
        assert isinstance(record, PointsRecord)
