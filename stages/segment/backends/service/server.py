"""The reference server of the segmentation protocol: a backend of ours behind HTTP (`scenewright models serve`).

It has no users and no passwords: it listens on this machine alone unless it is told otherwise.
"""

from __future__ import annotations

import json
import logging
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import numpy as np

from schemas.base import canonical_json
from schemas.errors import MachineFailure, ScenewrightError
from schemas.vocabulary import load_vocabulary
from stages.kit.digests import sha256_of_text
from stages.segment.backends.service.protocol import (
    HEALTH_PATH,
    INFO_PATH,
    LARGEST_BODY,
    PROTOCOL,
    SEGMENT_PATH,
    Category,
    Reply,
    ReplySegment,
    SegmentRequest,
    ServiceInfo,
    encode_info,
    encode_reply,
    parse_request,
)
from stages.segment.choice import Backend
from stages.segment.geometric import GeometricSettings, segment_depth

IDLE_SECONDS = 60.0
"""A connection on which nothing comes for so long is closed."""
MOST_WAITING = 16
"""Requests that may wait for the model; more are told to come back."""
JSON = "application/json"

logger = logging.getLogger("scenewright")


class SegmentationServer(ThreadingHTTPServer):
    """Answers requests with the masks of one backend; one frame at a time, as networks want the whole machine.

    `port` 0 takes a free one. Raises MachineFailure when the address cannot be had.
    """

    daemon_threads = True
    request_queue_size = 64

    def __init__(
        self,
        host: str,
        port: int,
        backend: Backend,
        geometric: GeometricSettings,
        *,
        revision: str,
        required: tuple[str, ...],
    ) -> None:
        self.backend, self.geometric = backend, geometric
        streams = (*(stream for stream in backend.streams if stream in ("color", "depth")), "pose")
        self.info = ServiceInfo(
            name=backend.label[:100],
            revision=revision,
            categories=tuple(
                Category(id=entry.id, name=entry.name, isthing=int(entry.kind == "thing"))
                for entry in load_vocabulary().classes
            ),
            streams=streams,
            required=required,
        )
        self._model = threading.Lock()
        self._places = threading.BoundedSemaphore(MOST_WAITING)
        try:
            super().__init__((host, port), _Handler)
        except (OSError, OverflowError) as error:
            raise MachineFailure(
                f"{host}:{port}: {getattr(error, 'strerror', None) or error}", hint="choose another --port"
            ) from None

    @property
    def address(self) -> str:
        """Where it answers."""
        host, port = self.server_address[:2]
        return f"http://{host if isinstance(host, str) else host.decode()}:{port}"

    def segment(self, request: SegmentRequest) -> Reply | None:
        """Return the masks of a frame, or None when too many are waiting."""
        if not self._places.acquire(blocking=False):
            return None
        try:
            with self._model:
                return segment_request(request, self.backend, self.geometric)
        finally:
            self._places.release()


def segment_request(request: SegmentRequest, backend: Backend, geometric: GeometricSettings) -> Reply:
    """Return what a backend says of a frame; its geometric segments are made here, of the depth that came along."""
    frame, camera = request.frame, request.camera
    depth = frame.depth if frame.depth is not None else np.zeros((camera.height, camera.width), dtype=np.float32)
    # The numbers that `scenewright segment --seed` would draw for this frame.
    random = np.random.default_rng([request.seed, frame.index])
    panoptic = backend(frame, segment_depth(depth, camera, geometric), random)
    return Reply(
        panoptic.ids,
        {
            number: ReplySegment(mask.category_id, mask.is_thing, float(mask.score))
            for number, mask in panoptic.masks.items()
        },
    )


def revision_of(parts: dict[str, object]) -> str:
    """Return the first digits of a digest of all that decides a backend's answers."""
    return sha256_of_text(canonical_json(parts))[:16]


class _Handler(BaseHTTPRequestHandler):
    server: SegmentationServer
    protocol_version = "HTTP/1.1"
    server_version = "scenewright"
    sys_version = ""
    timeout = IDLE_SECONDS

    def do_GET(self) -> None:
        if self.path == HEALTH_PATH:
            self._answer(200, json.dumps({"status": "ok", "protocol": PROTOCOL}).encode())
        elif self.path == INFO_PATH:
            self._answer(200, encode_info(self.server.info))
        else:
            self._refuse(404, f"no {self.path:.80}; there are {HEALTH_PATH}, {INFO_PATH} and {SEGMENT_PATH}")

    def do_POST(self) -> None:
        body = self._body()
        if body is None:
            return
        if self.path != SEGMENT_PATH:
            self._refuse(404, f"no {self.path:.80}; frames are posted to {SEGMENT_PATH}")
            return
        try:
            request = parse_request(body, self.headers.get("Content-Type", ""))
            reply = self.server.segment(request)
        except ScenewrightError as error:
            self._refuse(400, str(error))
        except Exception as error:
            logger.exception("a frame could not be segmented")
            self._refuse(500, f"{type(error).__name__} in the backend; see the server's output")
        else:
            if reply is None:
                self._refuse(503, f"more than {MOST_WAITING} frames are waiting", {"Retry-After": "1"})
            else:
                self._answer(200, encode_reply(reply))

    def _body(self) -> bytes | None:
        declared = self.headers.get("Content-Length", "")
        if not (declared.isascii() and declared.isdigit()):
            self.close_connection = True
            self._refuse(411, "a Content-Length is needed")
            return None
        length = int(declared[:20])
        if length > LARGEST_BODY:
            self.close_connection = True
            self._refuse(413, f"more than {LARGEST_BODY} bytes")
            return None
        body = self.rfile.read(length)
        if len(body) < length:
            self.close_connection = True
            return None  # the client is gone
        return body

    def _refuse(self, status: int, reason: str, headers: dict[str, str] | None = None) -> None:
        self._answer(status, json.dumps({"error": reason}).encode(), headers)

    def _answer(self, status: int, body: bytes, headers: dict[str, str] | None = None) -> None:
        self.send_response(status)
        self.send_header("Content-Type", JSON)
        self.send_header("Content-Length", str(len(body)))
        for name, value in (headers or {}).items():
            self.send_header(name, value)
        if self.close_connection:
            self.send_header("Connection", "close")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *arguments: object) -> None:
        logger.debug("%s %s", self.address_string(), format % arguments)
