"""The reference server of the segmentation protocol: a backend of ours behind HTTP (`scenewright models serve`).

It has no users and no passwords: it listens on this machine alone unless it is told otherwise.
"""

from __future__ import annotations

import json
import logging
import threading

import numpy as np
from scenewright.schemas.base import canonical_json
from scenewright.schemas.errors import ScenewrightError
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.digests import sha256_of_text
from scenewright.stages.kit.services.receiving import BoundedHandler, BoundedServer
from scenewright.stages.kit.services.segmentation_protocol import (
    HEALTH_PATH,
    INFO_PATH,
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
from scenewright.stages.segment.geometric import GeometricSettings, segment_depth
from scenewright.stages.segment.panoptic import Backend

MOST_WAITING = 16
"""Requests that may wait for the model; more are told to come back."""
MOST_PIXELS = 10_000_000
"""Most pixels of a frame: what a small file says it unpacks to takes a hundred bytes a pixel until it is segmented."""

logger = logging.getLogger("scenewright")


class SegmentationServer(BoundedServer):
    """Answers requests with the masks of one backend; one frame at a time, as networks want the whole machine.

    `port` 0 takes a free one. Raises MachineFailure when the address cannot be had, UsageError when it is none.
    """

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
        super().__init__(host, port, _Handler)

    def segment(self, body: bytes, content_type: str) -> Reply | None:
        """Return the masks of the frame in a request, or None when too many are waiting. Raises BadInput.

        Pictures are unpacked when it is their turn, so that one frame is in memory at a time.
        """
        if not self._places.acquire(blocking=False):
            return None
        try:
            with self._model:
                request = parse_request(body, content_type, most_pixels=MOST_PIXELS)
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
            number: ReplySegment(mask.class_id, mask.is_thing, float(mask.score))
            for number, mask in panoptic.masks.items()
        },
    )


def revision_of(parts: dict[str, object]) -> str:
    """Return the first digits of a digest of all that decides a backend's answers."""
    return sha256_of_text(canonical_json(parts))[:16]


class _Handler(BoundedHandler):
    server: SegmentationServer

    def health(self) -> None:
        self.answer(200, json.dumps({"status": "ok", "protocol": PROTOCOL}).encode())

    def info(self) -> None:
        self.answer(200, encode_info(self.server.info))

    def segment(self) -> None:
        body = self.body()
        if body is None:
            return
        try:
            reply = self.server.segment(body, self.headers.get("Content-Type", ""))
        except ScenewrightError as error:
            self.refuse(400, str(error))
        except Exception as error:
            logger.error("a frame could not be segmented: %s: %s", type(error).__name__, error)
            logger.debug("where", exc_info=True)
            self.refuse(500, f"{type(error).__name__} in the backend; see the server's output")
        else:
            if reply is None:
                self.refuse(503, f"more than {MOST_WAITING} frames are waiting", {"Retry-After": "1"})
            else:
                self.answer(200, encode_reply(reply))
        finally:
            self.done()

    routes = {
        HEALTH_PATH: {"GET": health, "HEAD": health},
        INFO_PATH: {"GET": info, "HEAD": info},
        SEGMENT_PATH: {"POST": segment},
    }
