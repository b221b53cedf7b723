"""Which topics of a log make a camera, and which cameras are used."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.lenses import is_calibrated
from scenewright.stages.ingest.messages.records import CalibrationRecord
from scenewright.stages.ingest.messages.survey import Images, LogContent
from scenewright.stages.ingest.messages.topic_names import (
    calibration_names,
    camera_names,
    common_length,
    is_rectified,
    is_registered,
    is_within,
    other_side,
    place,
    without_transport,
    words,
)
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.stereo import is_pair

ALMOST_ALL = 0.9
"""A topic with this share of another's images may stand in for it."""
ENDLESS = 1 << 62
"""Longest time over which a pose is carried [ns]: any, as only the fixed part of the tree is asked."""
EVERY_CAMERA = "all"


@dataclass(frozen=True)
class CameraTopics:
    """The topics of one camera. At least one of colour and depth is there."""

    name: str
    color: str | None
    depth: str | None
    right: str | None = None
    labels: str | None = None

    @property
    def main(self) -> str:
        """The topic that frames are counted by."""
        topic = self.color or self.depth
        assert topic is not None
        return topic

    @property
    def all(self) -> tuple[str, ...]:
        """Every topic."""
        return tuple(topic for topic in (self.color, self.depth, self.right, self.labels) if topic is not None)


def calibration_topic(topic: str, content: LogContent) -> str | None:
    """Return the topic with the calibration of an image topic, None when the log has none.

    The one beside it in its namespace, unless its frame is that of other images; else one of the same frame; else one
    that belongs to no images. Of several: the same size, then the longest common beginning of the topics.
    Calibrations without focal lengths do not count.
    """
    calibrated = {name: record for name, record in content.calibrations.items() if is_calibrated(record)}
    images = content.images[topic]
    frames = {image_topic.frame_id for image_topic in content.images.values()} - {images.frame_id}
    beside = next(
        (n for n in calibration_names(topic) if n in calibrated and calibrated[n].frame_id not in frames), None
    )
    if beside is not None:
        return beside
    owned = {name for image_topic in content.images for name in calibration_names(image_topic)}
    candidates = [
        name
        for name, record in calibrated.items()
        if record.frame_id == images.frame_id or (name not in owned and record.frame_id not in frames)
    ]

    def preference(name: str) -> tuple[bool, bool, int, str]:
        record = calibrated[name]
        other_size = (record.width, record.height) != images.size
        return record.frame_id != images.frame_id, other_size, -common_length(name, topic), name

    return min(candidates, key=preference, default=None)


def calibration_of(topic: str, content: LogContent) -> CalibrationRecord | None:
    """Return the calibration of an image topic."""
    name = calibration_topic(topic, content)
    return None if name is None else content.calibrations[name]


def fixed_transform(target: str, source: str, content: LogContent) -> np.ndarray | None:
    """Return target_from_source (4, 4) of two frames that do not move against each other, None when that is not known.

    Raises BadInput for a loop of frames.
    """
    if target == source:
        return np.eye(4)
    tree = content.tree
    if target not in tree.frames or source not in tree.frames or not tree.connected(target, source):
        return None
    if not all(tree.is_constant(frame) for frame in tree.between(target, source)):
        return None
    return tree.lookup(target, source, 0, gap=ENDLESS, tolerance=ENDLESS)


def find_cameras(content: LogContent) -> list[CameraTopics]:
    """Group the image topics of a log into cameras, in order of their names."""
    colors = _without_duplicates([name for name, images in content.images.items() if images.role == "color"], content)
    right_of = _right_eyes(colors, content)
    lefts = [topic for topic in colors if topic not in right_of.values()]
    depths = sorted(name for name, images in content.images.items() if images.role == "depth")
    depth_of = _depth_topics(lefts, depths, content)
    cameras = [CameraTopics("", topic, depth_of.get(topic), right_of.get(topic)) for topic in lefts]
    cameras += [CameraTopics("", None, topic) for topic in _lonely_depths(depths, depth_of, content)]
    cameras = [_with_labels(camera, len(cameras) == 1, content) for camera in cameras]
    cameras.sort(key=lambda camera: camera.main)
    names = camera_names(
        [place(camera.main) for camera in cameras], ["color" if camera.color else "depth" for camera in cameras]
    )
    named_cameras = [replace(camera, name=name) for camera, name in zip(cameras, names, strict=True)]
    return sorted(named_cameras, key=lambda camera: camera.name)


def _without_duplicates(topics: list[str], content: LogContent) -> list[str]:
    """Return the topics without those that show the same as another one: of one device and one frame."""
    groups: dict[tuple[tuple[str, ...], str], list[str]] = {}
    for topic in sorted(topics):
        groups.setdefault((place(topic), content.images[topic].frame_id), []).append(topic)
    return sorted(min(group, key=_rank(group, content)) for group in groups.values())


def _rank(group: Iterable[str], content: LogContent) -> Callable[[str], tuple[bool, bool, bool, bool, str]]:
    most = max(len(content.images[topic].stamps) for topic in group)

    def rank(topic: str) -> tuple[bool, bool, bool, bool, str]:
        images = content.images[topic]
        has_few = len(images.stamps) < ALMOST_ALL * most
        return has_few, is_grey(images), images.compressed, not is_rectified(topic), topic

    return rank


def is_grey(images: Images) -> bool:
    """Whether the images of a topic have no colour, as far as their encoding says."""
    return images.encoding.lower().startswith(("mono", "8uc1", "16uc1"))


def _right_eyes(colors: list[str], content: LogContent) -> dict[str, str]:
    """Return left topic -> right topic of the stereo pairs among colour topics."""
    right_of: dict[str, str] = {}
    for right in colors:
        for left in (*other_side(right, left=True), *_beside_right(right, colors)):
            if left in colors and left not in right_of and left != right and _looks_like_pair(left, right, content):
                right_of[left] = right
                break
    return right_of


def _beside_right(right: str, colors: list[str]) -> list[str]:
    """Return the colour topics of the place that a topic called `right` is at."""
    where = place(right)
    if not where or where[-1].lower() != "right":
        return []
    return [topic for topic in colors if place(topic) == where[:-1]]


def _looks_like_pair(left: str, right: str, content: LogContent) -> bool:
    calibrations = calibration_of(left, content), calibration_of(right, content)
    if calibrations[0] is None or calibrations[1] is None:
        return False
    frames = content.images[left].frame_id, content.images[right].frame_id
    return is_pair(calibrations[0], calibrations[1], fixed_transform(*frames, content))


def _depth_topics(colors: list[str], depths: list[str], content: LogContent) -> dict[str, str]:
    """Return colour topic -> depth topic. Each is used once; depth that is registered to the colour comes first."""
    ranked = []
    for color in colors:
        for depth in depths:
            same_frame = content.images[color].frame_id == content.images[depth].frame_id
            color_place, depth_place = place(color), place(depth)
            if not (same_frame or is_within(color_place, depth_place) or len(colors) == len(depths) == 1):
                continue
            rank = (
                not (same_frame and color_place == depth_place),
                not (same_frame and is_within(color_place, depth_place)),
                not is_registered(depth) or not is_within(color_place, depth_place),
                color_place != depth_place,
                not same_frame,
                is_grey(content.images[color]),
                content.images[depth].compressed,
                not is_within(color_place, depth_place),
                color,
                depth,
            )
            ranked.append((rank, color, depth))
    depth_of: dict[str, str] = {}
    for _, color, depth in sorted(ranked):
        if color not in depth_of and depth not in depth_of.values():
            depth_of[color] = depth
    return depth_of


def _lonely_depths(depths: list[str], depth_of: dict[str, str], content: LogContent) -> list[str]:
    """Return a depth topic for each device whose depth no colour camera uses."""
    used = [place(topic) for topic in depth_of.values()] + [place(topic) for topic in depth_of]
    groups: dict[tuple[str, ...], list[str]] = {}
    for topic in depths:
        if not any(is_within(place(topic), used_place) for used_place in used):
            groups.setdefault(place(topic), []).append(topic)
    return sorted(min(group, key=_rank(group, content)) for group in groups.values())


def _with_labels(camera: CameraTopics, alone: bool, content: LogContent) -> CameraTopics:
    topics = sorted(name for name, images in content.images.items() if images.role == "labels")
    main_place, frame = place(camera.main), content.images[camera.main].frame_id
    fitting = [
        topic
        for topic in topics
        if alone or (content.images[topic].frame_id == frame and is_within(main_place, place(topic)))
    ]
    return replace(camera, labels=fitting[0] if fitting else None)


def completeness(camera: CameraTopics, content: LogContent, posed: bool) -> tuple[int, int, bool, bool, int]:
    """Return how much of a camera there is, to be compared: calibrated, streams, colour, a right eye, frames."""
    calibrated = calibration_topic(camera.main, content) is not None
    streams = (camera.color is not None) + (camera.depth is not None) + posed
    real_color = camera.color is not None and not is_grey(content.images[camera.color])
    count = min(len(content.images[topic].stamps) for topic in (camera.color, camera.depth) if topic is not None)
    return int(calibrated), streams, real_color, camera.right is not None, count


def chosen_cameras(
    cameras: list[CameraTopics], content: LogContent, parameters: IngestParameters, where: str
) -> tuple[list[CameraTopics], list[CameraTopics]]:
    """Return the cameras that the options choose, and the others. Raises BadInput for names and topics that the log
    does not have."""
    if parameters.color_topic or parameters.depth_topic or parameters.right_topic:
        if parameters.camera:
            raise BadInput(f"{where}: cameras are chosen by name or by topic, not both", hint="leave out --camera")
        chosen = _camera_by_topic(cameras, content, parameters, where)
        return [chosen], [camera for camera in cameras if not set(camera.all) & set(chosen.all)]
    if EVERY_CAMERA in parameters.camera:
        return cameras, []
    if parameters.camera:
        names = [camera.name for camera in cameras]
        for name in parameters.camera:
            if name not in names:
                raise BadInput(f"{where}: has no camera {name!r}", hint=f"cameras: {', '.join(names)}")
        in_asked_order = [
            camera for name in dict.fromkeys(parameters.camera) for camera in cameras if camera.name == name
        ]
        return in_asked_order, [camera for camera in cameras if camera not in in_asked_order]

    def preference(camera: CameraTopics) -> tuple[int, ...]:
        frame = content.images[camera.main].frame_id
        posed = content.tree.has_parent(frame) or bool(content.poses)
        return tuple(-int(part) for part in completeness(camera, content, posed))

    best = min(cameras, key=lambda camera: (preference(camera), camera.name))
    return [best], [camera for camera in cameras if camera is not best]


def _camera_by_topic(
    cameras: list[CameraTopics], content: LogContent, parameters: IngestParameters, where: str
) -> CameraTopics:
    topic_of = {"color": parameters.color_topic, "depth": parameters.depth_topic, "right": parameters.right_topic}
    for stream, topic in topic_of.items():
        role = "color" if stream == "right" else stream
        if topic is not None and (topic not in content.images or content.images[topic].role != role):
            has = sorted(name for name, images in content.images.items() if images.role == role)
            why = content.topics[topic].unreadable if topic in content.topics else ""
            raise BadInput(
                f"{where}: no {'colour' if role == 'color' else role} images on topic {topic!r}{why and f' ({why})'}",
                hint=f"topics with such images: {', '.join(has) or 'none'}",
            )
    color, depth, right = topic_of["color"], topic_of["depth"], topic_of["right"]
    if color is None:
        color = _color_beside(cameras, content, depth, right)
    if depth is None and color is not None:
        depths = sorted(name for name, images in content.images.items() if images.role == "depth")
        depth = _depth_topics([color], depths, content).get(color)
    same_color = next((camera for camera in cameras if color is not None and camera.color == color), None)
    if right is None and same_color is not None:
        right = same_color.right
    camera = CameraTopics(same_color.name if same_color else "camera", color, depth, right)
    return _with_labels(camera, True, content)


def _color_beside(cameras: list[CameraTopics], content: LogContent, depth: str | None, right: str | None) -> str | None:
    """Return the colour topic that goes with a depth topic or a right eye."""
    if right is not None:
        for camera in cameras:
            if camera.right == right:
                return camera.color
        left_topics = [topic for topic in other_side(right, left=True) if topic in content.images]
        if left_topics:
            return left_topics[0]
    colors = [camera.color for camera in cameras if camera.color is not None and camera.color != right]
    if depth is not None:
        return next(iter(_depth_topics(colors, [depth], content)), None)
    return colors[0] if colors else None


def unpaired_side(camera: CameraTopics, content: LogContent) -> str | None:
    """Return a note when the colour topic has a counterpart by name, but their calibrations make no pair."""
    if camera.color is None or camera.right is not None:
        return None
    for left in (True, False):
        for partner in other_side(camera.color, left=left):
            if partner in content.images and content.images[partner].role == "color":
                return (
                    f"{camera.color} and {partner} look like a stereo pair by name, but neither P[3] of their "
                    "calibrations nor transforms between their frames give a baseline"
                )
    return None


def unread_depth(content: LogContent) -> str:
    """Return which topics of images are called depth and are none, and why; empty without any."""
    lines = [
        f"{name}: {content.topics[name].unreadable}"
        for name, images in sorted(content.images.items())
        if images.role == "other" and "depth" in words(name) and content.topics[name].unreadable
    ]
    return "; ".join(lines)


def alternatives(camera: CameraTopics, content: LogContent) -> list[str]:
    """Return the image topics of a camera's device that are not used, but could be asked for."""
    main_place = place(camera.main)
    return sorted(
        name
        for name, images in content.images.items()
        if images.role in ("color", "depth")
        and place(name) == main_place
        and name not in camera.all
        and without_transport(name) not in camera.all
    )
