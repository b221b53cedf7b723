"""What is in an MCAP log with Foxglove protobuf messages: images by topic, calibrations, transforms. One pass."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from google.protobuf.message import DecodeError

from schemas.errors import BadInput
from stages.ingest.images import decode_image
from stages.ingest.transform_tree import TransformTree
from stages.kit.formats.foxglove import stamp_nanoseconds, transform_matrix
from stages.kit.formats.mcap_log import Location, McapLog

TYPES: dict[str, Any] = {
    "foxglove.CompressedImage": CompressedImage,
    "foxglove.RawImage": RawImage,
    "foxglove.CameraCalibration": CameraCalibration,
    "foxglove.FrameTransforms": FrameTransforms,
    "foxglove.FrameTransform": FrameTransform,
    "foxglove.PoseInFrame": PoseInFrame,
}
COLOR_ENCODINGS = ("rgb8", "bgr8", "8UC3", "rgba8", "bgra8")
DEPTH_ENCODINGS = ("16UC1", "32FC1", "mono16")
LABEL_WORDS = ("label", "instance", "segment", "mask")


@dataclass(frozen=True)
class ImageMessage:
    """Where an image stands in the log."""

    stamp: int
    location: Location
    frame_id: str


@dataclass
class TopicImages:
    """The images of one topic."""

    role: str
    """`color`, `depth`, `labels` or `other`."""
    encoding: str
    size: tuple[int, int]
    """(width, height) of the first depth image that has a size; (0, 0) where none has, and for colour."""
    messages: list[ImageMessage] = field(default_factory=list)


@dataclass
class LogContent:
    """Everything but the pixels."""

    images: dict[str, TopicImages] = field(default_factory=dict)
    calibrations: dict[str, Any] = field(default_factory=dict)
    """Topic -> first CameraCalibration message."""
    changed_calibrations: set[str] = field(default_factory=set)
    tree: TransformTree = field(default_factory=TransformTree)
    poses: dict[str, list[tuple[int, str, np.ndarray]]] = field(default_factory=dict)
    """Topic -> (stamp, frame, frame_from_posed) of PoseInFrame messages."""
    bad: Counter[str] = field(default_factory=Counter)
    """Reason -> number of messages that could not be used."""


def readable_topics(log: McapLog) -> dict[int, str]:
    """Return channel id -> schema name of the channels that can be read here."""
    found = {}
    for channel in log.channels.values():
        schema = log.schemas.get(channel.schema_id)
        if (
            schema is not None
            and channel.message_encoding == "protobuf"
            and schema.encoding == "protobuf"
            and schema.name in TYPES
        ):
            found[channel.id] = schema.name
    return found


def described_topics(log: McapLog) -> str:
    """Return the topics of a log with their types, for error messages."""
    rows = set()
    for channel in log.channels.values():
        schema = log.schemas.get(channel.schema_id)
        rows.add(f"{channel.topic} ({schema.name if schema else 'no schema'}, {channel.message_encoding})")
    return ", ".join(sorted(rows)[:12]) or "none"


def survey(log: McapLog) -> LogContent:
    """Read a log once, keeping stamps, places, calibrations and transforms; pixels are not kept."""
    content = LogContent()
    names = readable_topics(log)
    for message in log.messages(names):
        name = names[message.channel.id]
        try:
            body = TYPES[name].FromString(message.data)
        except DecodeError:
            content.bad[f"undecodable_message {message.channel.topic}"] += 1
            continue
        topic = message.channel.topic
        if name in ("foxglove.CompressedImage", "foxglove.RawImage"):
            _add_image(content, topic, body, message.log_time, message.location)
        elif name == "foxglove.CameraCalibration":
            first = content.calibrations.setdefault(topic, body)
            if (first.K, first.D, first.width, first.height) != (body.K, body.D, body.width, body.height):
                content.changed_calibrations.add(topic)
        elif name == "foxglove.PoseInFrame":
            _add_pose(content, topic, body, message.log_time)
        else:
            transforms = body.transforms if name == "foxglove.FrameTransforms" else (body,)
            for transform in transforms:
                _add_transform(content, topic, transform, message.log_time)
    for images in content.images.values():
        images.messages.sort(key=lambda image: image.stamp)
    return content


def _stamp(body: Any, log_time: int, content: LogContent) -> int:
    """Header stamp; messages without one are placed at the time they were logged, and counted."""
    stamp = stamp_nanoseconds(body) if body.HasField("timestamp") else 0
    if stamp == 0 and log_time != 0:
        content.bad["message without header stamp, log time used"] += 1
        return log_time
    return stamp


def _add_image(content: LogContent, topic: str, body: Any, log_time: int, location: Location) -> None:
    if topic not in content.images:
        content.images[topic] = _describe(topic, body)
    elif content.images[topic].size == (0, 0) and content.images[topic].role == "depth":
        content.images[topic].size = _describe(topic, body).size
    stamp = _stamp(body, log_time, content)
    content.images[topic].messages.append(ImageMessage(stamp, location, body.frame_id))


def _describe(topic: str, body: Any) -> TopicImages:
    lowered = topic.lower()
    labelled = any(word in lowered for word in LABEL_WORDS)
    if isinstance(body, RawImage):
        size = (body.width, body.height)
        if body.encoding in COLOR_ENCODINGS:
            return TopicImages("color", body.encoding, size)
        if body.encoding in DEPTH_ENCODINGS:
            return TopicImages("labels" if labelled else "depth", body.encoding, size)
        return TopicImages("other", body.encoding, size)
    if "depth" not in lowered and not labelled:
        return TopicImages("color", body.format, (0, 0))
    image = decode_image(body.data)
    size = (image.shape[1], image.shape[0]) if image is not None else (0, 0)
    return TopicImages("labels" if labelled else "depth", body.format, size)


def _add_pose(content: LogContent, topic: str, body: Any, log_time: int) -> None:
    try:
        matrix = transform_matrix(body.pose.position, body.pose.orientation)
    except ValueError:
        content.bad[f"non_rigid_transform {topic}"] += 1
        return
    content.poses.setdefault(topic, []).append((_stamp(body, log_time, content), body.frame_id, matrix))


def _add_transform(content: LogContent, topic: str, transform: Any, log_time: int) -> None:
    try:
        matrix = transform_matrix(transform.translation, transform.rotation)
    except ValueError:
        content.bad[f"non_rigid_transform {topic}"] += 1
        return
    parent, child = transform.parent_frame_id, transform.child_frame_id
    if not child or parent == child:
        raise BadInput(f"topic {topic}: transform from frame {parent!r} to {child!r} makes no tree")
    static = topic.endswith("tf_static")
    content.tree.add(parent, child, _stamp(transform, log_time, content), matrix, static)
