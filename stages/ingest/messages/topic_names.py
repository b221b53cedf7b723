"""What the names of topics tell: which device a stream belongs to, which are left and right, which is the calibration.

Names are conventions, so they only ever choose between topics; they never stand in for numbers.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

TRANSPORTS = frozenset({"compressed", "compresseddepth", "theora", "ffmpeg", "zstd", "draco"})
STREAM_WORDS = frozenset(
    {
        "color",
        "colour",
        "rgb",
        "bgr",
        "image",
        "images",
        "img",
        "raw",
        "rect",
        "rectified",
        "mono",
        "gray",
        "grey",
        "depth",
        "aligned",
        "align",
        "registered",
        "to",
        "data",
        "hw",
        "sw",
        "float",
        "unrectified",
        "stereo",
        "frame",
        "label",
        "labels",
        "instance",
        "instances",
        "segment",
        "segments",
        "segmentation",
        "semantic",
        "panoptic",
        "mask",
        "masks",
    }
    | TRANSPORTS
)
"""Words that say what a stream shows, not which device it comes from."""
REGISTERED_WORDS = frozenset({"aligned", "registered"})
SIDES = (
    ("left", "right"),
    ("infra1", "infra2"),
    ("infra_1", "infra_2"),
    ("infrared_1", "infrared_2"),
    ("ir1", "ir2"),
    ("image_0", "image_1"),
    ("cam0", "cam1"),
    ("cam_0", "cam_1"),
    ("camera_0", "camera_1"),
)
"""Words for the left and the right eye. Whether two such cameras are a pair, only their calibration can say."""
CALIBRATION_NAMES = ("camera_info", "calibration", "camera_calibration", "info")
_REALSENSE = re.compile(r"(/device_\d+)/sensor_\d+/([A-Za-z]+_?\d*)/image/data")


def without_transport(topic: str) -> str:
    """Return `/camera/color/image_raw` of `/camera/color/image_raw/compressed`."""
    head, _, last = topic.rpartition("/")
    return head if head and last.lower() in TRANSPORTS else topic


def words(text: str) -> list[str]:
    """Return the words of a topic or a part of one, in lower case."""
    return [word for word in re.split(r"[^A-Za-z0-9]+", text.lower()) if word]


def place(topic: str) -> tuple[str, ...]:
    """Return what of a topic names the device, part by part, without the words that name the stream."""
    match = _REALSENSE.fullmatch(topic)
    if match:
        return (match[1].lstrip("/"), *(part for part in [match[2].lower()] if part.startswith("infra")))
    place_words = []
    for part in without_transport(topic).split("/"):
        own_words = [word for word in re.split(r"[^A-Za-z0-9]+", part) if word and word.lower() not in STREAM_WORDS]
        if own_words:
            place_words.append("_".join(own_words))
    return tuple(place_words)


def is_within(first: tuple[str, ...], second: tuple[str, ...]) -> bool:
    """Whether one place is the beginning of the other."""
    shorter = min(len(first), len(second))
    return first[:shorter] == second[:shorter]


def common_length(first: str, second: str) -> int:
    """Return how many characters two topics begin with in common."""
    return next(
        (i for i, (a, b) in enumerate(zip(first, second, strict=False)) if a != b), min(len(first), len(second))
    )


def is_rectified(topic: str) -> bool:
    """Whether a topic promises images without distortion, as image_proc names them."""
    topic_words = words(without_transport(topic))
    return "rect" in topic_words or "rectified" in topic_words


def is_registered(topic: str) -> bool:
    """Whether a depth topic promises that its pixels are those of the colour image."""
    topic_words = words(topic)
    return bool(REGISTERED_WORDS & set(topic_words)) or ("depth", "to", "rgb") in zip(
        topic_words, topic_words[1:], topic_words[2:], strict=False
    )


def calibration_names(topic: str) -> tuple[str, ...]:
    """Return the topics on which the calibration of an image topic is expected, the most specific first."""
    base = without_transport(topic)
    space = base.rpartition("/")[0]
    above = space.rpartition("/")[0]
    names = [f"{base}_{name}" for name in CALIBRATION_NAMES] + [f"{base}/{name}" for name in CALIBRATION_NAMES]
    names += [f"{space}/{name}" for name in CALIBRATION_NAMES]
    if _REALSENSE.fullmatch(base):
        names.append(f"{above}/info/camera_info")
    return tuple(names)


def other_side(topic: str, *, left: bool) -> list[str]:
    """Return what the topic of the left (or right) eye may be called, given that of the other one."""
    names = []
    for pair in SIDES:
        side_word, given_word = pair if left else pair[::-1]
        pattern = re.compile(rf"(?<![A-Za-z0-9]){re.escape(given_word)}(?![0-9A-Za-z])", re.IGNORECASE)
        if pattern.search(topic):
            names.append(pattern.sub(side_word, topic))
    return names


def camera_names(places: Iterable[tuple[str, ...]], streams: Iterable[str]) -> list[str]:
    """Return a name for each camera: what tells its place from the others', of letters, digits and underscores.

    A single camera is called `camera`. `streams` say what to call one whose place tells nothing.
    """
    places_left = list(places)
    if len(places_left) == 1:
        return ["camera"]
    shared = 0
    while (
        places_left
        and all(len(place_words) > shared for place_words in places_left)
        and len({place_words[shared] for place_words in places_left}) == 1
    ):
        shared += 1
    names: list[str] = []
    for place_words, stream in zip(places_left, streams, strict=True):
        name = re.sub(r"[^A-Za-z0-9]+", "_", "_".join(place_words[shared:])).strip("_") or stream
        unique, number = name, 2
        while unique in names:
            unique, number = f"{name}_{number}", number + 1
        names.append(unique)
    return names
