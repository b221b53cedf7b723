"""MCAP logs with Foxglove protobuf messages, our own among them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from google.protobuf.message import DecodeError

from schemas.errors import BadInput
from schemas.scene_parts import Camera
from schemas.sequence import LabelEntry
from stages.ingest.association import mutual_nearest
from stages.ingest.calibration import Calibration, choose_calibration
from stages.ingest.images import decode_image, depth_millimetres, fitted_color, usable_color
from stages.ingest.messages.survey import (
    TYPES,
    ImageMessage,
    LogContent,
    TopicImages,
    described_topics,
    readable_topics,
    survey,
)
from stages.ingest.parameters import IngestParameters
from stages.ingest.source import Entry, LoadedFrame, LogSource, SourceCamera, Unusable
from stages.kit.formats.foxglove import decode_color, raw_array
from stages.kit.formats.frames import LABELS_METADATA, WORLD_METADATA
from stages.kit.formats.mcap_log import MAGIC, McapLog

TYPE_HINT = "only Foxglove protobuf images, calibrations and transforms are read so far"


def matches(path: Path) -> str | None:
    """Return the rule that matched, or None."""
    if not path.is_file():
        return None
    with path.open("rb") as file:
        return "file with the MCAP magic: MCAP with Foxglove messages" if file.read(len(MAGIC)) == MAGIC else None


def open_source(path: Path, parameters: IngestParameters, rule: str) -> LogSource:
    """Survey an MCAP log. Raises BadInput when it is damaged, or holds no depth, calibration or known messages."""
    log = McapLog(path)
    try:
        return _source(log, parameters, rule)
    except BaseException:
        log.close()
        raise


def _source(log: McapLog, parameters: IngestParameters, rule: str) -> LogSource:
    where = str(log.path)
    content = survey(log)
    color_topic = _choose(content, "color", parameters.color_topic, ("color", "rgb"), log)
    depth_topic = _choose(content, "depth", parameters.depth_topic, ("aligned", "registered", "depth"), log)
    if color_topic is None or depth_topic is None:
        return _without_frames(log, content, color_topic, rule)
    colors, depths = content.images[color_topic], content.images[depth_topic]
    label_topics = sorted(t for t, images in content.images.items() if images.role == "labels")
    labels = content.images[label_topics[0]] if label_topics else None
    depth_frame = depths.messages[0].frame_id
    calibration = choose_calibration(content.calibrations, depth_frame, depth_topic, depths.size, parameters, where)
    world, pose_note = _world_frame(content, depth_frame, parameters, where)
    notes = [*calibration.notes, *pose_note, *_depth_note(depths, parameters)]
    notes += [f"{count} times {reason}" for reason, count in sorted(content.bad.items())]
    if depth_topic in content.changed_calibrations:
        notes.append("the calibration changes within the log; the first one is used")
    registered, registration_note = _registration(content, colors, depths)
    entries = _entries(log, content, colors, depths, labels, calibration, world, depth_frame, parameters)
    unused = len(depths.messages) - sum(entry.problem is None for entry in entries)
    if unused > 0:
        notes.append(f"{unused} depth images without a colour image of their own were left")
    metadata = dict(log.metadata)
    stated = metadata.get(WORLD_METADATA, {})
    registered = registered and stated.get("registered") != "no"
    given = stated.get("world_up") == "z" and stated.get("world_frame") == world
    return LogSource(
        format="mcap",
        rule=f"{rule}; colour from {color_topic}, depth from {depth_topic} ({depths.encoding}), poses in {world!r}",
        cameras=(SourceCamera("camera", calibration.camera, registered=registered),),
        entries=tuple(entries),
        notes=(*notes, *registration_note),
        world_up="z" if given else "unknown",
        world_up_detail=f"metadata record {WORLD_METADATA!r} of the log says that z of frame {world!r} is up",
        label_table=_label_table(metadata.get(LABELS_METADATA, {}), where),
        has_labels=labels is not None,
        close=log.close,
    )


def _without_frames(log: McapLog, content: LogContent, color_topic: str | None, rule: str) -> LogSource:
    """A log that could hold frames and holds none is empty; one that cannot is bad input."""
    if content.images or not readable_topics(log):
        what = "depth" if color_topic else "colour"
        raise BadInput(f"{log.path}: no {what} images; topics: {described_topics(log)}", hint=TYPE_HINT)
    camera = Camera(width=0, height=0, fx=1, fy=1, cx=0, cy=0)
    return LogSource(
        "mcap", rule, (SourceCamera("camera", camera),), (), ("the log holds no image messages",), close=log.close
    )


def _choose(content: LogContent, role: str, wanted: str | None, words: tuple[str, ...], log: McapLog) -> str | None:
    topics = sorted(topic for topic, images in content.images.items() if images.role == role)
    if wanted is not None:
        if wanted not in topics:
            raise BadInput(f"{log.path}: no {role} images on topic {wanted!r}", hint=f"topics: {described_topics(log)}")
        return wanted

    def preference(topic: str) -> tuple[int, str]:
        lowered = topic.lower()
        return next((i for i, word in enumerate(words) if word in lowered), len(words)), topic

    return min(topics, key=preference) if topics else None


def _world_frame(
    content: LogContent, camera_frame: str, parameters: IngestParameters, where: str
) -> tuple[str | None, list[str]]:
    """Return the frame of the poses (None: the log has none), and what was assumed."""
    tree, notes = content.tree, []
    if not tree.has_parent(camera_frame) and content.poses:
        topic = sorted(content.poses)[0]
        for stamp, frame, matrix in content.poses[topic]:
            tree.add(frame, camera_frame, stamp, matrix)
        notes.append(f"poses from PoseInFrame topic {topic}, taken as poses of the camera {camera_frame!r}")
    if not tree.has_parent(camera_frame):
        notes.append(f"no transforms lead to the camera frame {camera_frame!r}: frames have no poses")
        return None, notes
    chain = tree.chain(camera_frame)
    world = parameters.world_frame or chain[-1]
    if world not in tree.frames:
        raise BadInput(f"{where}: no frame {world!r}", hint=f"frames: {', '.join(tree.frames)}")
    if all(tree.is_constant(frame) for frame in chain[:-1]):
        notes.append("all transforms to the camera are constant: the camera is taken to stand still")
    return world, notes


def _registration(content: LogContent, colors: TopicImages, depths: TopicImages) -> tuple[bool, list[str]]:
    color_frame, depth_frame = colors.messages[0].frame_id, depths.messages[0].frame_id
    if color_frame == depth_frame:
        return True, []
    stamp = depths.messages[0].stamp
    tree = content.tree
    known = color_frame in tree.frames and depth_frame in tree.frames
    offset = tree.lookup(depth_frame, color_frame, stamp, gap=1 << 62, tolerance=1 << 62) if known else None
    if offset is not None and np.abs(offset - np.eye(4)).max() < 1e-6:
        return True, []
    return False, [f"colour ({color_frame!r}) and depth ({depth_frame!r}) are different frames and not registered"]


def _depth_note(depths: TopicImages, parameters: IngestParameters) -> list[str]:
    if parameters.depth_scale is not None:
        return [f"depth unit given by option: 1/{parameters.depth_scale:g} m"]
    if depths.encoding == "32FC1":
        return ["depth in metres (32FC1, REP-118)"]
    return [f"depth in millimetres ({depths.encoding}, REP-118)"]


def _entries(
    log: McapLog,
    content: LogContent,
    colors: TopicImages,
    depths: TopicImages,
    labels: TopicImages | None,
    calibration: Calibration,
    world: str | None,
    camera_frame: str,
    parameters: IngestParameters,
) -> list[Entry]:
    tolerance = round(parameters.maximum_time_difference * 1e9)
    gap = round(parameters.maximum_transform_gap * 1e9)
    color_stamps = np.array([image.stamp for image in colors.messages], dtype=np.int64)
    unique = np.ones(len(color_stamps), dtype=bool)
    unique[1:] = np.diff(color_stamps) > 0
    depth_stamps = np.array([image.stamp for image in depths.messages], dtype=np.int64)
    depth_of = np.full(len(color_stamps), -1)
    depth_of[unique] = mutual_nearest(color_stamps[unique], depth_stamps, tolerance)
    label_of = np.full(len(color_stamps), -1)
    if labels is not None:
        stamps = np.array([image.stamp for image in labels.messages], dtype=np.int64)
        label_of[unique] = mutual_nearest(color_stamps[unique], stamps, tolerance)
    entries = []
    for index, image in enumerate(colors.messages):
        if depth_of[index] < 0:
            problem = "no_depth_within_tolerance" if unique[index] else "duplicate_stamp"
            entries.append(Entry(_name(image), image.stamp * 1e-9, None, _never, problem))
            continue
        depth = depths.messages[int(depth_of[index])]
        label = labels.messages[int(label_of[index])] if labels is not None and label_of[index] >= 0 else None
        pose = None
        if world is not None:
            pose = content.tree.lookup(world, camera_frame, depth.stamp, gap=gap, tolerance=tolerance)
        load = _loader(log, image, depth, label, depths.encoding, calibration, parameters)
        entries.append(Entry(_name(image), depth.stamp * 1e-9, pose, load))
    return entries


def _name(image: ImageMessage) -> str:
    return f"{image.stamp * 1e-9:.6f} s"


def _never() -> LoadedFrame:
    raise Unusable("no_depth_within_tolerance")


def _loader(
    log: McapLog,
    color: ImageMessage,
    depth: ImageMessage,
    label: ImageMessage | None,
    encoding: str,
    calibration: Calibration,
    parameters: IngestParameters,
) -> Callable[[], LoadedFrame]:
    units = parameters.depth_scale or (1.0 if encoding == "32FC1" else 1000.0)
    camera = calibration.camera

    def load() -> LoadedFrame:
        picture = _color(log, color, calibration)
        millimetres = depth_millimetres(_single_channel(log, depth, "depth"), camera, units)
        ids = None if label is None else _single_channel(log, label, "labels")
        if ids is not None and ids.shape != millimetres.shape:
            raise Unusable("size_mismatch", f"labels {ids.shape[1]}x{ids.shape[0]}")
        return LoadedFrame(
            picture,
            calibration.undistorted(millimetres, smooth=False),
            None if ids is None else calibration.undistorted(ids.astype(np.uint16), smooth=False),
        )

    return load


def _body(log: McapLog, image: ImageMessage) -> Any:
    """Fetch and parse an image message."""
    message = log.fetch(image.location)
    schema = log.schemas[message.channel.schema_id]
    try:
        return TYPES[schema.name].FromString(message.data)
    except DecodeError:  # surveyed before, so the file changed meanwhile
        raise Unusable("undecodable_message") from None


def _color(log: McapLog, image: ImageMessage, calibration: Calibration) -> np.ndarray | bytes:
    body = _body(log, image)
    if hasattr(body, "format"):
        data = bytes(body.data)
        if calibration.maps is None:
            return usable_color(data, calibration.camera)
        pixels = decode_color(data)
        if pixels is None:
            raise Unusable("undecodable_color", f"{len(data)} bytes")
    else:
        try:
            pixels = raw_array(body)
        except ValueError as error:
            raise Unusable("undecodable_color", str(error)) from None
        if pixels.ndim != 3:
            raise Unusable("undecodable_color", f"encoding {body.encoding}")
        pixels = pixels[..., 2::-1] if body.encoding.startswith(("bgr", "8UC3")) else pixels[..., :3]
        pixels = np.ascontiguousarray(pixels)
    return calibration.undistorted(fitted_color(pixels, calibration.camera), smooth=True)


def _single_channel(log: McapLog, image: ImageMessage, role: str) -> np.ndarray:
    body = _body(log, image)
    if hasattr(body, "format"):
        pixels = decode_image(bytes(body.data))
        if pixels is None:
            raise Unusable(f"undecodable_{role}", f"{len(body.data)} bytes")
        return pixels
    try:
        return raw_array(body)
    except ValueError as error:
        raise Unusable(f"undecodable_{role}", str(error)) from None


def _label_table(table: dict[str, str], where: str) -> tuple[LabelEntry, ...]:
    try:
        return tuple(LabelEntry(instance=int(key), class_name=table[key]) for key in sorted(table, key=int))
    except ValueError:
        raise BadInput(f"{where}: metadata record {LABELS_METADATA!r} has a key that is no number") from None
