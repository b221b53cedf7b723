"""Harnesses of what networks and services bring along: replies, requests, descriptions, label files, sidecars."""

from __future__ import annotations

import base64
import json

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.formats.frames import Frame
from scenewright.stages.kit.formats.masks import encode_panoptic_png
from scenewright.stages.kit.labels import LABEL_FILES, LABELS_FOLDER, read_label_file
from scenewright.stages.kit.services.segmentation_protocol import (
    Category,
    Reply,
    ReplySegment,
    SegmentRequest,
    ServiceInfo,
    encode_info,
    encode_reply,
    encode_request,
    parse_info,
    parse_reply,
    parse_request,
)
from scenewright.stages.segment.networks.sidecar import read_sidecar

from tests.fuzz.harness import Harness, as_file, refused

CATEGORIES = {3: Category(id=3, name="chair"), 7: Category(id=7, name="wall", isthing=0)}
SHAPE = (4, 6)
BOUNDARY = b"--fuzz"


def service_reply(data: bytes) -> None:
    """Judge a reply; one that is taken keeps what the protocol promises."""
    with refused(BadInput):
        reply = parse_reply(data, "application/json", SHAPE, CATEGORIES)
        assert reply.ids.shape == SHAPE and set(np.unique(reply.ids)) - {0} == set(reply.segments)
        assert all(s.class_id in CATEGORIES and 0 <= s.score <= 1 for s in reply.segments.values())


def _reply_seeds() -> dict[str, bytes]:
    ids = np.arange(24, dtype=np.int32).reshape(SHAPE) % 3
    reply = Reply(ids, {1: ReplySegment(3, True, 0.5), 2: ReplySegment(7, False, 1.0)})
    bare = {"protocol": "scenewright-segmentation/1", "segments_info": [], "extra": [1e3, None, {"a": "é"}]}
    bare["panoptic_png"] = base64.b64encode(encode_panoptic_png(np.zeros(SHAPE, dtype=int))).decode()
    return {"two segments": encode_reply(reply), "nothing found": json.dumps(bare).encode()}


def service_info(data: bytes) -> None:
    """Judge a description."""
    with refused(BadInput):
        info = parse_info(data, "application/json")
        assert (
            info.categories
            and info.identity.isprintable()
            and parse_info(encode_info(info), "application/json") == info
        )


def _info_seeds() -> dict[str, bytes]:
    return {"two categories": encode_info(ServiceInfo("net", "1", tuple(CATEGORIES.values()), ("color",), ("color",)))}


def service_request(data: bytes) -> None:
    """Judge a request."""
    with refused(BadInput):
        request = parse_request(data, f"multipart/form-data; boundary={BOUNDARY[2:].decode()}")
        size = (request.camera.height, request.camera.width)
        assert request.frame.depth is None or request.frame.depth.shape == size
        assert request.frame.color is None or request.frame.color.shape == (*size, 3)


def _request_seeds() -> dict[str, bytes]:
    frame = Frame(0, 0.0, np.zeros((*SHAPE, 3), np.uint8), np.ones(SHAPE, np.float32), None, np.eye(4))
    camera = Camera(width=SHAPE[1], height=SHAPE[0], fx=20, fy=20, cx=3, cy=2)
    body, kind = encode_request(SegmentRequest(frame, camera, 0), ("color", "depth", "pose"))
    return {"whole": body.replace(b"--" + kind.partition("boundary=")[2].encode(), BOUNDARY)}


def label_table(data: bytes) -> None:
    """Read labels as TOML and as words."""
    for name in ("labels.toml", "labels.txt"):
        with refused(BadInput):
            assert all(label.name for label in read_label_file(as_file(name, data)).labels)


def _label_seeds() -> dict[str, bytes]:
    words = (LABELS_FOLDER.parent / LABEL_FILES["words"]).read_bytes()
    return {"words of ours": words, "list": b"cup\nblue mug = cup  # comment\n\nkettle\n"}


def onnx_sidecar(data: bytes) -> None:
    """Read a sidecar."""
    with refused(BadInput):
        assert read_sidecar(as_file("net.toml", data)).scale > 0


def _sidecar_seeds() -> dict[str, bytes]:
    text = 'layout = "panoptic"\nlabels = ["cup", "wall"]\nsize = [64, 48]\nmean = [0.4, 0.4, 0.4]\norder = "bgr"\n'
    return {"panoptic": (text + '[outputs]\nclasses = "a"\nmasks = "b"\n').encode()}


HARNESSES = {
    "service_reply": Harness(service_reply, _reply_seeds),
    "service_info": Harness(service_info, _info_seeds),
    "service_request": Harness(service_request, _request_seeds),
    "label_table": Harness(label_table, _label_seeds),
    "onnx_sidecar": Harness(onnx_sidecar, _sidecar_seeds),
}
