"""Bags that the RealSense SDK records: the topic says which stream a message belongs to, its frames say nothing.

Every image has frame `0` or `1`, and extrinsics are bare transforms on `.../tf/<reference>`. They carry points of the
reference into the stream (librealsense, `rs2_extrinsics` from the reference to the stream). Images with frame `1` end
in a field that their definition does not have, the unit of depth.
"""

from __future__ import annotations

import re
from dataclasses import replace

from scenewright.stages.ingest.messages.records import Record, TransformRecord
from scenewright.stages.kit.geometry.transforms import inverse

_TOPIC = re.compile(
    r"/(?P<device>device_\d+)/(?P<sensor>sensor_\d+)/(?P<stream>\w+)/"
    r"(?:info/camera_info|image/data|imu/data|tf/(?P<reference>\d+))"
)


def is_stream_transform(topic: str) -> bool:
    """Whether a topic carries the extrinsics of a RealSense stream."""
    match = _TOPIC.fullmatch(topic)
    return match is not None and match["reference"] is not None


def may_state_depth_unit(topic: str) -> bool:
    """Whether a topic carries the images of a RealSense stream."""
    return _TOPIC.fullmatch(topic) is not None and topic.endswith("/image/data")


def states_depth_unit(data: bytes) -> bool:
    """Whether the bytes of such an image end in the unit of depth: by its frame, after a number and a stamp."""
    return data[12:17] == b"\x01\0\0\x001"


def with_stream_frames(topic: str, records: tuple[Record, ...]) -> tuple[Record, ...]:
    """Return the records with the stream's name as their frame; those of other topics as they are."""
    match = _TOPIC.fullmatch(topic)
    if match is None:
        return records
    frame = f"{match['device']}/{match['sensor']}/{match['stream']}"
    with_frames: list[Record] = []
    for record in records:
        if isinstance(record, TransformRecord):
            reference = f"{match['device']}/reference_{match['reference']}"
            with_frames.append(TransformRecord(record.stamp, reference, frame, inverse(record.parent_from_child)))
        else:
            with_frames.append(replace(record, frame_id=frame))
    return tuple(with_frames)
