"""Image messages -> pixels: raw encodings of ROS and Foxglove, JPEG, PNG, WebP, and what each topic's images are.

What a message claims is compared with the bytes it has before anything is allocated. REP-118: 16UC1 depth is in
millimetres, 32FC1 in metres.
"""

from __future__ import annotations

import re
import zlib
from dataclasses import dataclass

import cv2
import numpy as np
from scenewright.stages.ingest.images import decode_image
from scenewright.stages.ingest.messages.compressed_depth import decode_compressed_depth, is_compressed_depth, stored_as
from scenewright.stages.ingest.messages.records import ImageRecord
from scenewright.stages.ingest.source import Role, Unusable
from scenewright.stages.kit.formats.foxglove import JPEG_START, PNG_START, decode_color
from scenewright.stages.kit.formats.image_headers import JPEG_BARE_MARKERS, LARGEST_IMAGE, image_size, may_be_decoded

MILLIMETRES, METRES = 1000.0, 1.0
"""Depth units per metre."""


@dataclass(frozen=True)
class _Packing:
    """How a raw encoding lays out its pixels."""

    dtype: str
    channels: int
    to_rgb: int | None = None
    """Colour conversion of OpenCV; None where pixels are red, green, blue as they stand."""


COLORS: dict[str, _Packing] = {
    "rgb8": _Packing("u1", 3),
    "bgr8": _Packing("u1", 3, cv2.COLOR_BGR2RGB),
    "8uc3": _Packing("u1", 3, cv2.COLOR_BGR2RGB),
    "rgba8": _Packing("u1", 4, cv2.COLOR_RGBA2RGB),
    "bgra8": _Packing("u1", 4, cv2.COLOR_BGRA2RGB),
    "8uc4": _Packing("u1", 4, cv2.COLOR_BGRA2RGB),
    "mono8": _Packing("u1", 1, cv2.COLOR_GRAY2RGB),
    "8uc1": _Packing("u1", 1, cv2.COLOR_GRAY2RGB),
    "mono16": _Packing("u2", 1, cv2.COLOR_GRAY2RGB),
    "rgb16": _Packing("u2", 3),
    "bgr16": _Packing("u2", 3, cv2.COLOR_BGR2RGB),
    "bayer_rggb8": _Packing("u1", 1, cv2.COLOR_BayerRGGB2RGB),
    "bayer_bggr8": _Packing("u1", 1, cv2.COLOR_BayerBGGR2RGB),
    "bayer_gbrg8": _Packing("u1", 1, cv2.COLOR_BayerGBRG2RGB),
    "bayer_grbg8": _Packing("u1", 1, cv2.COLOR_BayerGRBG2RGB),
    "yuv422": _Packing("u1", 2, cv2.COLOR_YUV2RGB_UYVY),
    "uyvy": _Packing("u1", 2, cv2.COLOR_YUV2RGB_UYVY),
    "yuv422_yuy2": _Packing("u1", 2, cv2.COLOR_YUV2RGB_YUYV),
    "yuyv": _Packing("u1", 2, cv2.COLOR_YUV2RGB_YUYV),
    "yuy2": _Packing("u1", 2, cv2.COLOR_YUV2RGB_YUYV),
}
"""Encoding in lower case -> packing. 8UC3 is blue, green, red, as OpenCV and Foxglove have it."""
PLANAR = {"nv12": cv2.COLOR_YUV2RGB_NV12, "nv21": cv2.COLOR_YUV2RGB_NV21}
"""A plane of brightness, then one of half the height with the two colours of 2x2 pixels in turn."""
DEPTHS = {"16uc1": ("u2", MILLIMETRES), "mono16": ("u2", MILLIMETRES), "32fc1": ("f4", METRES)}
ONE_CHANNEL = ("mono8", "8uc1", "mono16")
LABELS = {"mono8": "u1", "8uc1": "u1", "mono16": "u2", "16uc1": "u2", "32sc1": "i4"}
VIDEO = ("h264", "h265", "hevc", "av1", "vp9", "mpeg4", "theora")

LABEL_WORDS = frozenset(
    {"label", "labels", "instance", "instances", "segment", "segments", "segmentation", "semantic", "semantics"}
    | {"panoptic", "mask", "masks"}
)
DEPTH_WORDS = frozenset({"depth"})
COLOR_WORDS = frozenset({"color", "colour", "rgb", "bgr", "left", "right", "mono", "gray", "grey", "fisheye"})
INFRARED_WORDS = frozenset({"ir", "infra", "infrared", "amplitude", "confidence", "thermal", "intensity"})
BESIDE_DEPTH_WORDS = frozenset({"disparity", "deviation"})
"""What 16-bit and float images show that are of depth and are not depth."""
PICTURE_WORDS = frozenset({"colorized", "colourised", "colormap", "heatmap", "visualization", "overlay", "debug"})
PICTURE = "a picture of depth or labels for people, without the values"
GREY_OR_PALETTE = (b"\0", b"\3")
"""Colour types in the header of a PNG."""
LARGEST_LABEL = 65535
"""Largest label that is stored: labels are kept in 16 bits."""


# --- what a topic's images are ---------------------------------------------------------------------------------


def role_of(record: ImageRecord, topic: str) -> Role:
    """Return `color`, `depth`, `labels` or `other`: by the encoding first, where that leaves it open by the topic."""
    return _role_and_reason(record, topic)[0]


def why_other(record: ImageRecord, topic: str) -> str:
    """Return in words why images like this are neither colour, depth nor labels; empty when they are."""
    return _role_and_reason(record, topic)[1]


def _role_and_reason(record: ImageRecord, topic: str) -> tuple[Role, str]:
    words = _telling_words(topic)
    subject = next((word for word in reversed(words) if word not in PICTURE_WORDS), "")
    if record.compressed:
        return _role_of_compressed(record, subject, words)
    encoding = record.encoding.lower()
    if subject in LABEL_WORDS:
        return ("labels", "") if encoding in LABELS else ("other", f"labels in encoding {record.encoding!r:.40}")
    if subject in BESIDE_DEPTH_WORDS:
        return "other", f"{subject} is not depth"
    if encoding == "16uc1":
        of_depth = subject in DEPTH_WORDS or not subject
        return ("depth", "") if of_depth else ("other", "16-bit images of a topic that is not of depth")
    if encoding == "32fc1":
        return "depth", ""
    if encoding in ONE_CHANNEL:
        return ("depth", "") if subject in DEPTH_WORDS else ("color", "")
    if encoding in COLORS or encoding in PLANAR:
        return _color_or_picture(subject, words)
    return "other", f"unknown encoding {record.encoding!r:.40}"


def _role_of_compressed(record: ImageRecord, subject: str, words: list[str]) -> tuple[Role, str]:
    encoding, data = record.encoding.lower(), record.data
    if is_compressed_depth(encoding, data):
        return "depth", ""
    if any(video in encoding for video in VIDEO):
        return "other", f"compressed video ({record.encoding!r:.40}) is not read"
    png = data.startswith(PNG_START)
    if subject in LABEL_WORDS:
        return ("labels", "") if png else ("other", "labels that are not in PNG have lost their ids")
    if subject in BESIDE_DEPTH_WORDS:
        return "other", f"{subject} is not depth"
    one_channel = png and data[25:26] in GREY_OR_PALETTE
    if png and encoding.startswith(("16uc1", "32fc1")) or one_channel and subject in DEPTH_WORDS:
        return "depth", ""
    role, reason = _color_or_picture(subject, words)
    if role == "other" and data.startswith(JPEG_START):
        reason = f"a JPEG, which keeps 8 bits a pixel: {reason} (record raw or compressedDepth images)"
    return role, reason


def _color_or_picture(subject: str, words: list[str]) -> tuple[Role, str]:
    """Three channels of a topic about depth are made for people, and so are overlays on anything but colour."""
    values = DEPTH_WORDS | LABEL_WORDS | BESIDE_DEPTH_WORDS
    is_picture = PICTURE_WORDS.intersection(words) and values.intersection(words)
    return ("other", PICTURE) if is_picture or subject in DEPTH_WORDS else ("color", "")


def _telling_words(topic: str) -> list[str]:
    """Return the words of a topic that say what its images show.

    Depth aligned to colour is still depth (`aligned_depth_to_color`, `depth2rgb`); a depth camera has colour too.
    """
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", topic).lower()
    spaced = re.sub(r"(?:_to_|2)(?:color|colour|rgb|left|right|infra)|depth_?cam(?:era)?(?![a-z])", " ", spaced)
    telling = LABEL_WORDS | DEPTH_WORDS | COLOR_WORDS | INFRARED_WORDS | BESIDE_DEPTH_WORDS | PICTURE_WORDS
    return [word for word in re.findall(r"[a-z]+", spaced) if word in telling]


# --- colour ----------------------------------------------------------------------------------------------------


def color_pixels(record: ImageRecord) -> np.ndarray | bytes:
    """Return (H, W, 3) uint8 RGB, or the record's own bytes where they are JPEG or 8-bit RGB PNG as any viewer shows
    it. Raises Unusable."""
    if record.compressed:
        return _compressed_color(record)
    encoding = record.encoding.lower()
    if encoding in PLANAR:
        return _planar_color(record, PLANAR[encoding])
    packing = COLORS.get(encoding)
    if packing is None:
        raise Unusable("unknown_encoding", f"{record.encoding!r:.40}")
    pixels = _raw(record, packing.dtype, packing.channels, "undecodable_color")
    if pixels.dtype == np.uint16:
        pixels = (pixels >> 8).astype(np.uint8)
    return pixels.copy() if packing.to_rgb is None else _convert_color(pixels, packing.to_rgb)


def _convert_color(pixels: np.ndarray, conversion: int) -> np.ndarray:
    try:
        return cv2.cvtColor(pixels, conversion)
    except cv2.error as error:
        raise Unusable("undecodable_color", f"{pixels.shape[1]}x{pixels.shape[0]}: {error.err}") from None


def _planar_color(record: ImageRecord, conversion: int) -> np.ndarray:
    width, height = record.width, record.height
    if width % 2 or height % 2:
        raise Unusable("undecodable_color", f"{record.encoding} of odd size {width}x{height}")
    return _convert_color(_rows(record, width, height * 3 // 2, width * height, "undecodable_color"), conversion)


def _compressed_color(record: ImageRecord) -> np.ndarray | bytes:
    data = record.data
    if not data.startswith((JPEG_START, PNG_START)) and not _is_webp(data):
        video = any(word in record.encoding.lower() for word in VIDEO)
        reason = "unknown_encoding" if video else "undecodable_color"
        raise Unusable(reason, f"{len(data)} bytes of {record.encoding!r:.40}, neither JPEG, PNG nor WebP")
    _check_whole(data, "undecodable_color")
    if not may_be_decoded(data):
        raise Unusable("undecodable_color", _claimed_size(data))
    image = decode_color(data)
    if image is None:
        raise Unusable("undecodable_color", f"{len(data)} bytes of {record.encoding!r:.40}")
    if _has_swapped_colors(record.encoding):
        return np.ascontiguousarray(image[..., ::-1])
    return data if _is_plain(data) else image


def _has_swapped_colors(encoding: str) -> bool:
    """Whether red and blue stand in each other's place, as `bgr8; png compressed rgb8` says.

    compressed_image_transport hands what it calls bgr to an encoder that takes bgr, which makes an ordinary file; what
    it calls rgb becomes a file with red and blue exchanged. Where it says nothing the file is taken for ordinary.
    """
    return "compressed rgb" in encoding.lower().partition(";")[2]


def _is_plain(data: bytes) -> bool:
    """Whether every viewer shows these bytes as the same picture: JPEG of one or three channels, 8-bit RGB PNG."""
    if data.startswith(PNG_START):
        return data[24:26] == b"\x08\x02"
    return data.startswith(JPEG_START) and _jpeg_layout(data)[1] in (1, 3)


# --- depth and labels ------------------------------------------------------------------------------------------


def depth_pixels(record: ImageRecord) -> np.ndarray:
    """Return depth (H, W) as stored, uint16 or float32, in `depth_unit`. Raises Unusable."""
    if record.compressed:
        if is_compressed_depth(record.encoding, record.data):
            return decode_compressed_depth(record.encoding, record.data)
        image = _decode_png(record, "undecodable_depth")
        if image.dtype != np.uint16 or image.ndim != 2:
            raise Unusable("depth_not_16_bit", f"PNG of shape {image.shape}, {image.dtype}: a picture of depth")
        return image
    encoding = record.encoding.lower()
    if encoding not in DEPTHS:
        reason = "depth_not_16_bit" if encoding in COLORS else "unknown_encoding"
        raise Unusable(reason, f"depth in encoding {record.encoding!r:.40}")
    return _raw(record, DEPTHS[encoding][0], 1, "undecodable_depth")


def depth_unit(record: ImageRecord) -> float:
    """Return how many units of `depth_pixels` make a metre: as the message states, else by the encoding (REP-118)."""
    if record.units_per_metre is not None:
        return record.units_per_metre
    if record.compressed:
        compressed_depth = is_compressed_depth(record.encoding, record.data)
        is_float = compressed_depth and stored_as(record.encoding, record.data) == "32FC1"
        return METRES if is_float else MILLIMETRES
    return DEPTHS.get(record.encoding.lower(), ("", MILLIMETRES))[1]


def label_pixels(record: ImageRecord) -> np.ndarray:
    """Return labels (H, W) uint16. Raises Unusable."""
    if record.compressed:
        image = _decode_png(record, "undecodable_labels")
        if image.ndim != 2 or image.dtype not in (np.uint8, np.uint16):
            raise Unusable("undecodable_labels", f"PNG of shape {image.shape}, {image.dtype}")
        return image.astype(np.uint16)
    kind = LABELS.get(record.encoding.lower())
    if kind is None:
        raise Unusable("unknown_encoding", f"labels in encoding {record.encoding!r:.40}")
    image = _raw(record, kind, 1, "undecodable_labels")
    if image.dtype == np.int32 and (image.min() < 0 or image.max() > LARGEST_LABEL):
        raise Unusable("undecodable_labels", f"ids from {image.min()} to {image.max()}")
    return image.astype(np.uint16)


def _decode_png(record: ImageRecord, reason: str) -> np.ndarray:
    data = record.data
    if data.startswith(JPEG_START):
        raise Unusable("depth_not_16_bit" if "depth" in reason else reason, "JPEG does not keep values")
    if not data.startswith(PNG_START):
        raise Unusable(reason, f"{len(data)} bytes of {record.encoding!r:.40}, no PNG")
    _check_whole(data, reason)
    if not may_be_decoded(data):
        raise Unusable(reason, _claimed_size(data))
    image = decode_image(data)
    if image is None:
        raise Unusable(reason, f"PNG of {len(data)} bytes")
    return image


# --- bytes -----------------------------------------------------------------------------------------------------


def _raw(record: ImageRecord, dtype: str, channels: int, reason: str) -> np.ndarray:
    """Return the pixels (H, W) or (H, W, channels) of a raw image, native byte order. Raises Unusable(reason)."""
    kind = np.dtype(dtype).newbyteorder(">" if record.big_endian else "<")
    width, height = record.width, record.height
    rows = _rows(record, width * channels * kind.itemsize, height, width * height, reason)
    image = rows.view(kind).astype(kind.newbyteorder("="), copy=False)
    return image if channels == 1 else image.reshape(height, width, channels)


def _rows(record: ImageRecord, row: int, height: int, pixels: int, reason: str) -> np.ndarray:
    """Return (height, row) uint8 without the padding of rows."""
    step = record.step or row
    size = f"{record.width}x{record.height} {record.encoding!r:.40} image"
    if pixels == 0 or pixels > LARGEST_IMAGE:
        raise Unusable(reason, f"{size}: no size that an image has")
    needed = step * (height - 1) + row
    if step < row or len(record.data) < needed:
        raise Unusable(reason, f"{size} of step {record.step} with {len(record.data)} bytes")
    flat = np.frombuffer(record.data, np.uint8, count=needed)
    if step == row:
        return flat.reshape(height, row)
    strided = np.lib.stride_tricks.as_strided(flat, (height, row), (step, 1), writeable=False)
    return np.ascontiguousarray(strided)


def _is_webp(data: bytes) -> bool:
    return data.startswith(b"RIFF") and data[8:12] == b"WEBP"


def _claimed_size(data: bytes) -> str:
    size = image_size(data)
    claim = f"claims {size[0]}x{size[1]} pixels" if size else "has no readable header"
    return f"an image of {len(data)} bytes that {claim}"


def _check_whole(data: bytes, reason: str) -> None:
    """Raise Unusable for a JPEG without its end, which decoders fill up with grey, and a PNG with a broken part."""
    if data.startswith(JPEG_START) and data.find(b"\xff\xd9", _jpeg_layout(data)[0]) < 0:
        raise Unusable(reason, f"truncated: a JPEG of {len(data)} bytes without an end")
    if data.startswith(PNG_START):
        _check_png(data, reason)


def _jpeg_layout(data: bytes) -> tuple[int, int]:
    """Return where the compressed data of a JPEG begins, and how many channels it has; 0 where it does not say."""
    position, channels = 2, 0
    while position + 4 <= len(data) and data[position] == 0xFF:
        marker = data[position + 1]
        if marker == 0xFF:
            position += 1
        elif marker in JPEG_BARE_MARKERS:
            position += 2
        elif marker == 0xDA:
            return position, channels
        else:
            if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC) and position + 9 < len(data):
                channels = data[position + 9]
            position += 2 + int.from_bytes(data[position + 2 : position + 4], "big")
    return position, channels


def _check_png(data: bytes, reason: str) -> None:
    position, view = len(PNG_START), memoryview(data)
    while position + 12 <= len(data):
        length = int.from_bytes(view[position : position + 4], "big")
        end = position + 12 + length
        if end > len(data):
            break
        if zlib.crc32(view[position + 4 : end - 4]) != int.from_bytes(view[end - 4 : end], "big"):
            raise Unusable(reason, f"a PNG with a wrong checksum at byte {position}")
        if view[position + 4 : position + 8] == b"IEND":
            return
        position = end
    raise Unusable(reason, f"truncated: a PNG of {len(data)} bytes without an end")
