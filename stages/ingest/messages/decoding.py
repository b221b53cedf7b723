"""Message bytes -> records: which decoder reads the messages of a channel, and why none does."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

from scenewright.stages.ingest.messages import foxglove_messages, ros_messages
from scenewright.stages.ingest.messages.container import Channel
from scenewright.stages.ingest.messages.json_messages import json_decoder
from scenewright.stages.ingest.messages.protobuf_messages import protobuf_decoder
from scenewright.stages.ingest.messages.realsense_bags import (
    is_stream_transform,
    may_state_depth_unit,
    states_depth_unit,
    with_stream_frames,
)
from scenewright.stages.ingest.messages.records import Record
from scenewright.stages.ingest.messages.ros_definitions import UnreadableDefinition, short_name

Decoder = Callable[[bytes], tuple[Record, ...]]
"""Raises Undecodable."""

_VIDEO = {
    "theora_image_transport/Packet": "Theora video",
    "ffmpeg_image_transport_msgs/FFMPEGPacket": "compressed video",
    "foxglove.CompressedVideo": "compressed video",
    "foxglove_msgs/CompressedVideo": "compressed video",
    "foxglove.CompressedPointCloud": "compressed points",
    "point_cloud_interfaces/CompressedPointCloud2": "compressed points",
}


def decoder_for(channel: Channel) -> Decoder | None:
    """Return what makes records of a channel's messages, raising Undecodable for those that are broken.

    None: messages of a type that ingest has no use for, or that cannot be read; `why_unreadable` says which.
    """
    decoder = _decoder(channel)
    return None if isinstance(decoder, str) else decoder


def why_unreadable(channel: Channel) -> str:
    """Return in words why there is no decoder for a channel; empty when there is one."""
    decoder_or_reason = _decoder(channel)
    return decoder_or_reason if isinstance(decoder_or_reason, str) else ""


@lru_cache(maxsize=256)
def _decoder(channel: Channel) -> Decoder | str:
    name, encoding = channel.type_name, channel.message_encoding.lower()
    video = _VIDEO.get(short_name(name))
    if video:
        return f"{video} is not read, only images of their own"
    if encoding in ("cdr", "ros1"):
        return _ros(channel, encoding)
    if encoding in ("protobuf", "json"):
        decoder = protobuf_decoder(name) if encoding == "protobuf" else json_decoder(name)
        return decoder or f"messages of type {_quote(name)} in {encoding} are not used"
    useful = short_name(name) in ros_messages.CONVERTERS or foxglove_messages.type_of(name) is not None
    messages = f"messages of type {_quote(name)} " if useful else "messages "
    return f"{messages}in encoding {_quote(channel.message_encoding)} are not read"


def _ros(channel: Channel, encoding: str) -> Decoder | str:
    name, topic = channel.type_name, channel.topic
    if short_name(name) == "geometry_msgs/Transform" and not is_stream_transform(topic):
        return f"messages of type {_quote(name)} name no frames and are not used"
    try:
        decoder = ros_messages.ros_decoder(name, encoding, channel.schema_encoding, channel.schema)
    except UnreadableDefinition as error:
        return f"messages of type {_quote(name)} cannot be read: {error}"
    if decoder is None:
        return f"messages of type {_quote(name)} are not used"
    if encoding != "ros1" or not may_state_depth_unit(topic):
        return lambda data: with_stream_frames(topic, decoder(data))
    unit = (ros_messages.DEPTH_UNIT,)
    longer = ros_messages.ros_decoder(name, encoding, channel.schema_encoding, channel.schema, unit)
    assert longer is not None
    return lambda data: with_stream_frames(topic, (longer if states_depth_unit(data) else decoder)(data))


def _quote(name: str) -> str:
    return repr(name[:80]) if name else "without a name"
