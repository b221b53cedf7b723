"""Version 1 of the segmentation protocol (docs/FORMATS.md): what is said over HTTP, and how it is judged.

Everything that comes over the wire is checked here, on both sides, and nothing of it is executed.
"""

from __future__ import annotations

import base64
import binascii
import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NoReturn, TypeGuard

import cv2
import numpy as np
from pydantic import ValidationError
from scenewright.schemas.base import Model, canonical_json
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.formats import foxglove
from scenewright.stages.kit.formats.frames import Frame
from scenewright.stages.kit.formats.image_headers import LARGEST_IMAGE, PNG_START, image_size, may_be_decoded
from scenewright.stages.kit.formats.masks import LARGEST_ID, decode_panoptic_png, encode_panoptic_png

PROTOCOL = "scenewright-segmentation/1"
INFO_PATH, SEGMENT_PATH, HEALTH_PATH = "/v1/info", "/v1/segment", "/health"
STREAMS = ("color", "depth", "pose")
LARGEST_BODY = 64 * 2**20
"""Largest request or reply [bytes]."""
MOST_SEGMENTS = 65536
"""Most segments of an answer; a bound, by eye."""
LONGEST_TEXT = 200
"""Longest name [characters]."""
PART_HEADER_LIMIT = 4096
"""Longest header of a part [bytes]; a bound, by eye."""
LARGEST_PART = 64 * 2**10
"""Bytes of the part `request`: JSON takes many times as much when it is read."""
MOST_PARTS = 8
"""Most parts of a message; a bound, by eye."""


class Category(Model):
    """One category of a service, as COCO writes it."""

    id: int
    name: str
    isthing: int = 1


@dataclass(frozen=True)
class ServiceInfo:
    """What a service says of itself."""

    name: str
    revision: str
    """Changes whenever its answers may: weights, settings, code."""
    categories: tuple[Category, ...]
    streams: tuple[str, ...]
    """What it wants to be sent, of STREAMS."""
    required: tuple[str, ...]
    """What it cannot do without."""

    @property
    def identity(self) -> str:
        """Name, revision and a digest of the categories: part of the key and of every label."""
        rows = [[c.id, c.name, c.isthing] for c in self.categories]
        digest = hashlib.sha256(canonical_json([rows, self.streams, self.required]).encode()).hexdigest()
        return f"{self.name} {self.revision} labels {digest[:8]}"


@dataclass(frozen=True)
class SegmentRequest:
    """What a service is asked."""

    frame: Frame
    camera: Camera
    seed: int


@dataclass(frozen=True)
class ReplySegment:
    """One entry of segments_info."""

    class_id: int
    is_thing: bool
    score: float


@dataclass(frozen=True)
class Reply:
    """A checked reply: every id of the image is listed, every category known, the size that of the request."""

    ids: np.ndarray
    """(H, W) int32, 0 = void."""
    segments: dict[int, ReplySegment]


def encode_info(info: ServiceInfo) -> bytes:
    """Return the JSON of a service's description."""
    return canonical_json(
        {
            "protocol": PROTOCOL,
            "name": info.name,
            "revision": info.revision,
            "streams": list(info.streams),
            "required": list(info.required),
            "categories": [category.model_dump() for category in info.categories],
        }
    ).encode()


def parse_info(body: bytes, content_type: str) -> ServiceInfo:
    """Return a service's description. Raises BadInput when it is not one of this protocol's version."""
    data = _json_object(body, content_type)
    _check_protocol(data)
    rows = data.get("categories")
    if not isinstance(rows, list) or not 0 < len(rows) <= MOST_SEGMENTS:
        _refuse("its description lists no categories")
    try:
        # Services may say more of a category than is read here (COCO's colour, supercategory).
        fields = Category.model_fields
        categories = tuple(Category(**{k: v for k, v in row.items() if k in fields}) for row in rows)
    except (ValidationError, AttributeError, TypeError) as error:
        _refuse(f"a category of its description is malformed ({str(error).splitlines()[0]})")
    if len({category.id for category in categories}) < len(categories):
        _refuse("its description gives a category id twice")
    for category in categories:
        if not 0 < category.id < 2**31 or category.isthing not in (0, 1):
            _refuse(f"category {category.id} of its description is malformed")
        _text(category.name, "the name of a category")
    return ServiceInfo(
        name=_text(data.get("name"), "its name"),
        revision=_text(data.get("revision"), "its revision"),
        categories=categories,
        streams=_streams(data.get("streams", ["color"]), "streams"),
        required=_streams(data.get("required", []), "required"),
    )


def encode_request(request: SegmentRequest, streams: tuple[str, ...], color: bytes | None = None) -> tuple[bytes, str]:
    """Return body and content type (multipart/form-data) of a request with the `streams` that the service wants.

    `color` is the frame's stored JPEG or PNG; without it the pixels are sent as PNG. Depth is a 16-bit PNG of
    millimetres, which is what a sequence holds, so nothing is lost. The same request has the same bytes.
    """
    frame, camera = request.frame, request.camera
    description: dict[str, Any] = {
        "protocol": PROTOCOL,
        "frame": frame.index,
        "seed": request.seed,
        "camera": frame.camera_name,
        "intrinsics": camera.model_dump(),
        "depth_unit_m": 0.001,
    }
    if "pose" in streams and frame.world_from_camera is not None:
        description["world_from_camera"] = frame.world_from_camera.tolist()
    sections = [("request", "application/json", canonical_json(description).encode())]
    if "color" in streams and frame.color is not None:
        data = color or _png(np.ascontiguousarray(frame.color[..., ::-1]))
        sections.append(("color", "image/png" if data.startswith(PNG_START) else "image/jpeg", data))
    if "depth" in streams and frame.depth is not None:
        sections.append(("depth", "image/png", _png(foxglove.depth_to_millimetres(frame.depth))))
    return _multipart(sections)


def parse_request(body: bytes, content_type: str, *, most_pixels: int = LARGEST_IMAGE) -> SegmentRequest:
    """Return what a client asks, about a frame of at most `most_pixels`. Raises BadInput."""
    content_of = split_multipart(body, content_type)
    if "request" not in content_of:
        _refuse("the part `request` is missing")
    if len(content_of["request"]) > LARGEST_PART:
        _refuse(f"the part `request` has more than {LARGEST_PART} bytes")
    description = _json_object(content_of["request"], "application/json")
    _check_protocol(description)
    try:
        camera = Camera(**description["intrinsics"])
        index, seed = _integer(description["frame"]), _integer(description.get("seed", 0))
        pose = description.get("world_from_camera")
        world_from_camera = None if pose is None else np.array(pose, dtype=float).reshape(4, 4)
    except (KeyError, TypeError, ValueError) as error:
        _refuse(f"the part `request` is malformed ({str(error).splitlines()[0]})")
    if not (camera.width > 0 and camera.height > 0 and camera.fx > 0 and camera.fy > 0):
        _refuse("the intrinsics are no camera's")
    if camera.width * camera.height > most_pixels:
        _refuse(f"a frame of {camera.width}x{camera.height}, more than {most_pixels} pixels")
    if (
        index < 0
        or not 0 <= seed < 2**63
        or (world_from_camera is not None and not np.isfinite(world_from_camera).all())
    ):
        _refuse("the part `request` is malformed (frame, seed or world_from_camera)")
    color = depth = None
    if "color" in content_of:
        color = _decode("color", content_of["color"], camera, foxglove.decode_color)
    if "depth" in content_of:
        depth = _decode("depth", content_of["depth"], camera, _millimetres)
        if description.get("depth_unit_m") != 0.001:
            _refuse("depth_unit_m is not 0.001")
        depth = foxglove.millimetres_to_depth(depth)
    name = description.get("camera") if isinstance(description.get("camera"), str) else "camera"
    return SegmentRequest(Frame(index, 0.0, color, depth, None, world_from_camera, str(name)), camera, seed)


def encode_reply(reply: Reply) -> bytes:
    """Return the JSON of a reply."""
    return canonical_json(
        {
            "protocol": PROTOCOL,
            "segments_info": [
                {"id": i, "category_id": s.class_id, "isthing": int(s.is_thing), "score": s.score}
                for i, s in sorted(reply.segments.items())
            ],
            "panoptic_png": base64.b64encode(encode_panoptic_png(reply.ids)).decode(),
        }
    ).encode()


def parse_reply(body: bytes, content_type: str, shape: tuple[int, int], categories: Mapping[int, Category]) -> Reply:
    """Return a reply for an image of `shape` (H, W). Raises BadInput, saying what is wrong with it."""
    data = _json_object(body, content_type)
    _check_protocol(data)
    segments = _segments(data.get("segments_info"), categories)
    ids = decode_panoptic_png(_base64(data.get("panoptic_png")))
    if ids.shape != shape:
        _refuse(f"its image is {ids.shape[1]}x{ids.shape[0]}, that of the frame {shape[1]}x{shape[0]}")
    present = np.unique(ids)
    unlisted = [int(i) for i in present if i and int(i) not in segments]
    if unlisted:
        _refuse(f"id {unlisted[0]} of its image is not in segments_info ({len(unlisted)} such ids)")
    return Reply(ids, {int(i): segments[int(i)] for i in present if i})


def split_multipart(body: bytes, content_type: str) -> dict[str, bytes]:
    """Return name -> content of the parts of multipart/form-data. Raises BadInput."""
    kind, _, options = content_type.partition(";")
    boundaries = [
        item.strip()[len("boundary=") :] for item in options.split(";") if item.strip().startswith("boundary=")
    ]
    boundary = boundaries[0].strip('"').encode("ascii", "replace") if boundaries else b""
    if kind.strip().lower() != "multipart/form-data" or not 0 < len(boundary) <= 70:
        _refuse(f"content type {content_type!r:.80} is not multipart/form-data with a boundary")
    pieces = (b"\r\n" + body).split(b"\r\n--" + boundary, MOST_PARTS + 2)
    if len(pieces) < 3 or not pieces[-1].startswith(b"--") or len(pieces) - 2 > MOST_PARTS:
        _refuse("its parts are torn, or too many")
    content_of: dict[str, bytes] = {}
    for piece in pieces[1:-1]:
        head, separator, content = piece.partition(b"\r\n\r\n")
        if not separator or len(head) > PART_HEADER_LIMIT:
            _refuse("a part has no header, or one that does not end")
        name = _part_name(head)
        if name in content_of:
            _refuse(f"part {name!r:.60} comes twice")
        content_of[name] = content
    return content_of


def _part_name(head: bytes) -> str:
    for line in head.decode("latin-1").split("\r\n"):
        key, _, value = line.partition(":")
        if key.strip().lower() == "content-disposition":
            for item in value.split(";"):
                if item.strip().startswith("name="):
                    return item.strip()[len("name=") :].strip('"')
    _refuse("a part has no name")


def _multipart(sections: list[tuple[str, str, bytes]]) -> tuple[bytes, str]:
    # Made of the content, so that the same request has the same bytes, and so long that no content holds it by chance.
    boundary = "scenewright-" + hashlib.sha256(b"".join(content for _, _, content in sections)).hexdigest()[:40]
    lines = []
    for name, kind, content in sections:
        file_name = "" if name == "request" else f'; filename="{name}.{kind.split("/")[1]}"'
        head = (
            f'--{boundary}\r\nContent-Disposition: form-data; name="{name}"{file_name}\r\nContent-Type: {kind}\r\n\r\n'
        )
        lines += [head.encode(), content, b"\r\n"]
    lines.append(f"--{boundary}--\r\n".encode())
    return b"".join(lines), f"multipart/form-data; boundary={boundary}"


def _png(image: np.ndarray) -> bytes:
    done, data = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    if not done:
        raise BadInput(f"an image {image.shape} cannot be written as PNG")
    return data.tobytes()


def _millimetres(data: bytes) -> np.ndarray | None:
    image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    return image if image is not None and image.ndim == 2 and image.dtype == np.uint16 else None


def _decode(name: str, data: bytes, camera: Camera, decode: Any) -> np.ndarray:
    if not may_be_decoded(data):
        _refuse(f"the part `{name}` is not an image, or declares more pixels than it holds")
    if image_size(data) != (camera.width, camera.height):
        _refuse(f"the part `{name}` does not have the size that the intrinsics state")
    try:
        image = decode(data)
    except cv2.error as error:
        _refuse(f"the part `{name}` cannot be decoded ({error.err})")
    if image is None:
        _refuse(f"the part `{name}` cannot be decoded ({'8-bit colour' if name == 'color' else '16-bit PNG'} expected)")
    return image


def _json_object(body: bytes, content_type: str) -> dict[str, Any]:
    if content_type.partition(";")[0].strip().lower() != "application/json":
        _refuse(f"its content type is {content_type!r:.60}, not application/json")
    try:
        data = json.loads(body.decode("utf-8"), parse_constant=_no_constant)
    except (ValueError, RecursionError) as error:
        _refuse(f"it is not JSON ({str(error).splitlines()[0]:.80})")
    if not isinstance(data, dict):
        _refuse("it is not a JSON object")
    return data


def _no_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a number of JSON")


def _check_protocol(data: Mapping[str, Any]) -> None:
    if data.get("protocol") != PROTOCOL:
        _refuse(f"it speaks {data.get('protocol')!r:.60}, not {PROTOCOL}")


def _segments(rows: Any, categories: Mapping[int, Category]) -> dict[int, ReplySegment]:
    if not isinstance(rows, list):
        _refuse("segments_info is not a list")
    if len(rows) > MOST_SEGMENTS:
        _refuse(f"{len(rows)} segments, more than {MOST_SEGMENTS}")
    segments: dict[int, ReplySegment] = {}
    for row in rows:
        if not isinstance(row, dict):
            _refuse("an entry of segments_info is not an object")
        segment_id, class_id, score = row.get("id"), row.get("category_id"), row.get("score", 1.0)
        if not _is_integer(segment_id) or not 0 < segment_id <= LARGEST_ID:
            _refuse(f"segment id {segment_id!r:.40} is not an integer in 1..{LARGEST_ID}")
        if segment_id in segments:
            _refuse(f"segment id {segment_id} comes twice")
        if not _is_integer(class_id) or class_id not in categories:
            _refuse(f"segment {segment_id} has category {class_id!r:.40}, which its description does not list")
        if isinstance(score, bool) or not isinstance(score, int | float) or not _in_unit(score):
            _refuse(f"segment {segment_id} has score {score!r:.40}, not one in 0..1")
        is_thing = row.get("isthing", categories[class_id].isthing)
        if is_thing not in (0, 1):
            _refuse(f"segment {segment_id} has isthing {is_thing!r:.40}, not 0 or 1")
        segments[segment_id] = ReplySegment(class_id, bool(is_thing), float(score))
    return segments


def _in_unit(score: float) -> bool:
    return 0 <= score <= 1 and math.isfinite(score)


def _base64(text: Any) -> bytes:
    if not isinstance(text, str):
        _refuse("panoptic_png is missing")
    try:
        return base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError):
        _refuse("panoptic_png is not base64")


def _is_integer(value: Any) -> TypeGuard[int]:
    return isinstance(value, int) and not isinstance(value, bool)


def _integer(value: Any) -> int:
    if not _is_integer(value):
        raise ValueError(f"{value!r:.40} is not an integer")
    return value


def _text(value: Any, subject: str) -> str:
    if not isinstance(value, str) or not 0 < len(value) <= LONGEST_TEXT or not value.isprintable():
        _refuse(f"{subject} is not printable text of at most {LONGEST_TEXT} characters")
    return value


def _streams(value: Any, subject: str) -> tuple[str, ...]:
    if not isinstance(value, list) or any(item not in STREAMS for item in value):
        _refuse(f"{subject} of its description are not among {', '.join(STREAMS)}")
    return tuple(stream for stream in STREAMS if stream in value)


def _refuse(reason: str) -> NoReturn:
    raise BadInput(reason)
