"""What is in a log of messages: images by topic, calibrations, transforms, poses, inertial samples. One pass."""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Hashable
from dataclasses import dataclass, field

import numpy as np
from scenewright.stages.ingest.lenses import is_calibrated
from scenewright.stages.ingest.messages.container import MessageLog
from scenewright.stages.ingest.messages.decoding import decoder_for, why_unreadable
from scenewright.stages.ingest.messages.pixels import color_pixels, depth_pixels, label_pixels, role_of, why_other
from scenewright.stages.ingest.messages.realsense_bags import is_stream_transform
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
from scenewright.stages.ingest.source import Role, StreamInfo, Unusable
from scenewright.stages.ingest.transform_tree import Track, TransformTree
from scenewright.stages.kit.formats.image_headers import image_size as size_in_header

IMU_STEP = 50_000_000
"""Inertial samples nearer to the last one kept than this [ns] are not kept: up is a mean."""
SIZE_ATTEMPTS = 20
"""Compressed images of a topic that are decoded to learn their size."""
MOST_REASONS = 20
"""Most reasons a topic that are counted apart; the rest are "other reasons"."""
LATEST = 1 << 62
"""Log times [ns] beyond this, in the year 2116, are damage and count as this."""
STATIC = "tf_static"
UNUSED = "not used"
"""How the reason of topics ends that are well understood and have nothing to do with cameras."""


@dataclass
class Topic:
    """What was recorded under one topic."""

    name: str
    kinds: dict[str, None] = field(default_factory=dict)
    """Types with encodings, in order of appearance."""
    role: Role = "other"
    count: int = 0
    stamps: array[int] = field(default_factory=lambda: array("q"))
    """Header stamps [ns] in file order; of messages without one, the log time."""
    delays: array[int] = field(default_factory=lambda: array("q"))
    """Log time minus stamp [ns], for each of `stamps`."""
    without_stamp: int = 0
    unreadable: str = ""
    undecodable: Counter[str] = field(default_factory=Counter)
    """Reason -> number of messages."""

    def broken(self, reason: str) -> None:
        """Count a message that does not decode. Reasons may name numbers, so that there can be one for each message."""
        is_listed = reason in self.undecodable or len(self.undecodable) < MOST_REASONS
        self.undecodable[reason if is_listed else "other reasons"] += 1

    def described(self) -> str:
        """Type and encoding, for people."""
        return ", ".join(self.kinds)


@dataclass
class Images:
    """The images of one topic. Places, not pixels, are kept."""

    topic: str
    role: Role
    encoding: str
    compressed: bool
    frame_id: str
    size: tuple[int, int] = (0, 0)
    """(width, height) of the first image that has one."""
    stamps: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))
    """(N,) int64 [ns], ascending; filled when the survey is done, as is the order of `locations`."""
    locations: list[Hashable] = field(default_factory=list)
    other_frames: int = 0
    """Images that name another frame than the first did."""


@dataclass
class Poses:
    """The poses of one topic."""

    topic: str
    frame_id: str
    child_frame_id: str
    """Empty where the messages do not say whose pose it is."""
    track: Track = field(default_factory=Track)
    other_frames: int = 0
    """Poses between other frames than those of the first, not kept."""


@dataclass
class Inertial:
    """The inertial samples of one topic, thinned out."""

    topic: str
    frame_id: str
    samples: list[tuple[int, np.ndarray]] = field(default_factory=list)


@dataclass
class LogContent:
    """Everything but the pixels."""

    topics: dict[str, Topic] = field(default_factory=dict)
    images: dict[str, Images] = field(default_factory=dict)
    calibrations: dict[str, CalibrationRecord] = field(default_factory=dict)
    """Topic -> first calibration that has focal lengths, else the first."""
    changed_calibrations: set[str] = field(default_factory=set)
    tree: TransformTree = field(default_factory=TransformTree)
    transform_topics: dict[str, None] = field(default_factory=dict)
    poses: dict[str, Poses] = field(default_factory=dict)
    inertial: dict[str, Inertial] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def damage(self) -> list[str]:
        """Return a line for every topic with messages that do not decode."""
        return [line for _, line in self._damage_by_topic()]

    def _damage_by_topic(self) -> list[tuple[str, str]]:
        lines = []
        for name, topic in sorted(self.topics.items()):
            if topic.undecodable:
                number, reason = topic.undecodable.total(), topic.undecodable.most_common(1)[0][0]
                lines.append((name, f"{number} of {topic.count} messages of {name} do not decode: {reason}"))
        return lines

    def undecodable_calibrations(self) -> str:
        """Return which calibrations do not decode, to be put behind what is missing; empty when all do."""
        kinds = ("CameraInfo", "CameraCalibration")
        lines = [
            line
            for name, line in self._damage_by_topic()
            if any(kind in self.topics[name].described() for kind in kinds)
        ]
        return f" ({'; '.join(lines)})" if lines else ""

    def described_topics(self) -> str:
        """Return the topics with their types, for error messages."""
        rows = [f"{name} ({topic.described()})" for name, topic in sorted(self.topics.items())]
        return ", ".join(rows[:12]) + (f", ... ({len(rows)} topics)" if len(rows) > 12 else "") or "none"

    def streams(self) -> tuple[StreamInfo, ...]:
        """Return every topic of the log, unreadable ones with the reason."""
        return tuple(_stream(topic) for _, topic in sorted(self.topics.items()))


def survey(log: MessageLog) -> LogContent:
    """Read a log once. Raises BadInput when it is damaged and was opened to refuse that."""
    content = LogContent()
    decoders = {}
    for channel in log.channels:
        topic = content.topics.setdefault(channel.topic, Topic(channel.topic))
        topic.kinds[f"{channel.type_name or 'no type'}, {channel.message_encoding}"] = None
        decoder = decoder_for(channel)
        if decoder is None:
            topic.unreadable = why_unreadable(channel)
            topic.count += channel.count or 0
        else:
            decoders[channel.id] = decoder
    reader = _Reader(content)
    for message in log.messages(decoders):
        topic = content.topics[message.channel.topic]
        topic.count += 1
        try:
            records = decoders[message.channel.id](message.data)
        except Undecodable as problem:
            topic.broken(str(problem))
            records = problem.records
        for position, record in enumerate(records):
            reader.add(record, topic, min(message.log_time, LATEST), message.location, position == 0)
    _finish(content)
    return content


class _Reader:
    """Sorts records into a LogContent."""

    def __init__(self, content: LogContent) -> None:
        self._content = content
        self._attempts: Counter[str] = Counter()
        self._last_kept: dict[str, int] = {}

    def add(self, record: Record, topic: Topic, log_time: int, location: Hashable, first: bool) -> None:
        """Keep what is needed of a record; `first` is that of its message."""
        static = topic.name.endswith(STATIC) or is_stream_transform(topic.name)
        stamp = record.stamp
        if stamp == 0 and log_time != 0:
            topic.without_stamp += first and not static and not isinstance(record, CalibrationRecord)
            stamp = log_time
        if first:
            topic.stamps.append(stamp)
            topic.delays.append(log_time - stamp)
        if isinstance(record, ImageRecord):
            self._add_image(record, topic, location)
        elif isinstance(record, TransformRecord):
            self._add_transform(record, topic, stamp, static)
        elif isinstance(record, CalibrationRecord):
            self._add_calibration(record, topic)
        elif isinstance(record, PoseRecord):
            self._add_pose(record, topic, stamp)
        elif isinstance(record, ImuRecord):
            self._add_inertial(record, topic, stamp)
        elif isinstance(record, PointsRecord):
            topic.role = "points"

    def _add_image(self, record: ImageRecord, topic: Topic, location: Hashable) -> None:
        images = self._content.images.get(topic.name)
        if images is None:
            images = Images(topic.name, "other", record.encoding, record.compressed, record.frame_id)
            self._content.images[topic.name] = images
        if images.role == "other":  # what the first image that can be told shows
            images.role, images.encoding = role_of(record, topic.name), record.encoding
            topic.role, topic.unreadable = images.role, why_other(record, topic.name)
        if images.role != "other" and images.size == (0, 0) and self._attempts[topic.name] < SIZE_ATTEMPTS:
            self._attempts[topic.name] += 1
            images.size = image_size(record, images.role)
        images.other_frames += record.frame_id != images.frame_id
        images.locations.append(location)

    def _add_transform(self, record: TransformRecord, topic: Topic, stamp: int, static: bool) -> None:
        topic.role = "transforms"
        if record.parent == record.child or not record.child or not record.parent:
            topic.broken(f"a transform from frame {record.parent!r} to {record.child!r} is none")
            return
        self._content.transform_topics[topic.name] = None
        self._content.tree.add(record.parent, record.child, stamp, record.parent_from_child, static)

    def _add_calibration(self, record: CalibrationRecord, topic: Topic) -> None:
        topic.role = "calibration"
        first_record = self._content.calibrations.get(topic.name)
        if first_record is None or (is_calibrated(record) and not is_calibrated(first_record)):
            self._content.calibrations[topic.name] = record
        elif is_calibrated(record) and _numbers(record) != _numbers(first_record):
            self._content.changed_calibrations.add(topic.name)

    def _add_pose(self, record: PoseRecord, topic: Topic, stamp: int) -> None:
        topic.role = "pose"
        poses = self._content.poses.setdefault(topic.name, Poses(topic.name, record.frame_id, record.child_frame_id))
        if (poses.frame_id, poses.child_frame_id) != (record.frame_id, record.child_frame_id):
            poses.other_frames += 1
            return
        poses.track.add(stamp, record.parent_from_child)

    def _add_inertial(self, record: ImuRecord, topic: Topic, stamp: int) -> None:
        topic.role = "imu"
        inertial = self._content.inertial.setdefault(topic.name, Inertial(topic.name, record.frame_id))
        last = self._last_kept.get(topic.name)
        if last is None or stamp >= last + IMU_STEP or stamp < last:
            self._last_kept[topic.name] = stamp
            inertial.samples.append((stamp, record.acceleration))


def image_size(record: ImageRecord, role: str) -> tuple[int, int]:
    """Return (width, height) of an image; (0, 0) when it cannot be decoded."""
    if not record.compressed:
        return record.width, record.height
    try:
        if role == "depth":
            pixels: np.ndarray | bytes = depth_pixels(record)
        else:
            pixels = label_pixels(record) if role == "labels" else color_pixels(record)
    except Unusable:
        return 0, 0
    if isinstance(pixels, bytes):
        return size_in_header(pixels) or (0, 0)
    return pixels.shape[1], pixels.shape[0]


def _numbers(record: CalibrationRecord) -> tuple[object, ...]:
    return record.width, record.height, record.K, record.D, record.R, record.P


def _finish(content: LogContent) -> None:
    """Sort images by stamp, and note what is odd."""
    for name, images in content.images.items():
        topic = content.topics[name]
        stamps = np.array(topic.stamps, dtype=np.int64)
        log_times = stamps + np.array(topic.delays, dtype=np.int64)
        if len(stamps) >= 3 and (stamps == stamps[0]).all() and not (log_times == log_times[0]).all():
            content.notes.append(f"WARNING: all {len(stamps)} stamps of {name} are the same: its log times are used")
            stamps = log_times
        order = np.argsort(stamps, kind="stable")
        images.stamps = stamps[order]
        images.locations = [images.locations[i] for i in order]
        if images.other_frames:
            content.notes.append(
                f"{images.other_frames} images of {name} name another frame than {images.frame_id!r}: taken as the same"
            )
    for name, topic in content.topics.items():
        if topic.without_stamp:
            content.notes.append(f"{topic.without_stamp} messages of {name} have no header stamp: log time used")
        if topic.role in ("color", "depth", "labels", "pose") and len(topic.stamps) > 1:
            back = int((np.diff(np.array(topic.stamps, dtype=np.int64)) < 0).sum())
            if back:
                content.notes.append(f"stamps of {name} go back {back} times: sorted by stamp")
    for name, poses in content.poses.items():
        if poses.other_frames:
            content.notes.append(
                f"{poses.other_frames} poses of {name} are not between {poses.frame_id!r} and "
                f"{poses.child_frame_id!r}: left out"
            )
    for frame in content.tree.frames:
        parents = content.tree.parents(frame)
        if len(parents) > 1:
            parent_names = " and ".join(repr(parent) for parent in parents)
            content.notes.append(f"WARNING: frame {frame!r} has {len(parents)} parents: {parent_names}")
    for frame in content.tree.changes_though_static():
        content.notes.append(
            f"WARNING: the static transform of {frame!r} changes within the log: the first one is used"
        )


def _stream(topic: Topic) -> StreamInfo:
    role: Role = topic.role
    if role == "other" and topic.unreadable and not topic.unreadable.endswith(UNUSED):
        role = "unreadable"
    detail = topic.described() + (f": {topic.unreadable}" if topic.unreadable else "")
    delays = np.array(topic.delays, dtype=np.int64)
    return StreamInfo(
        name=topic.name,
        role=role,
        detail=detail,
        stamps=np.array(topic.stamps, dtype=np.int64),
        count=topic.count,
        log_delay=float(np.median(delays)) * 1e-9 if len(delays) else None,
    )
