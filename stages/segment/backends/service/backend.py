"""Backend `http://...`: masks that a segmentation service gives (docs/SEGMENTATION.md)."""

from __future__ import annotations

import logging

import numpy as np
from scenewright.schemas.errors import BadInput, MachineFailure
from scenewright.schemas.vocabulary import Vocabulary, load_vocabulary
from scenewright.stages.kit.formats.frames import Frame
from scenewright.stages.kit.labels import Label, LabelSet, match_labels, read_label_file
from scenewright.stages.kit.services.connection import Connection
from scenewright.stages.kit.services.segmentation_client import connect, read_info
from scenewright.stages.kit.services.segmentation_protocol import (
    SEGMENT_PATH,
    Category,
    Reply,
    SegmentRequest,
    ServiceInfo,
    encode_request,
    parse_reply,
)
from scenewright.stages.segment.backends.service import ServiceParameters
from scenewright.stages.segment.backends.service.reply_cache import ReplyCache, prune
from scenewright.stages.segment.choice import BackendRequest
from scenewright.stages.segment.geometric import GeometricFrame
from scenewright.stages.segment.naming import NamedSegment, name_segments
from scenewright.stages.segment.panoptic import PanopticFrame, PanopticMask

logger = logging.getLogger("scenewright")


class ServiceBackend:
    """Asks a service for the masks of every frame. Replies are kept, so that a run that broke off can go on.

    Raises UsageError without a log, MissingDependency when no service answers, BadInput when the sequence lacks a
    stream that the service needs, or it is another service than the one that was expected.
    """

    name = "masks"
    """As of those of a folder (backends/masks): the same masks are the same artifact, whichever way they came."""

    def __init__(self, request: BackendRequest) -> None:
        sequence, self._reader = request.log()
        options, vocabulary = request.own(ServiceParameters), load_vocabulary()
        labels = read_label_file(request.labels) if request.labels else None
        connection = connected(request.parameters.backend, options)
        self._connection, self._vocabulary = connection, vocabulary
        self._seed, self._minimum_pixels = request.seed, request.parameters.small_object_pixels
        expected = options.service_model
        self.info = read_info(connection)
        if expected and self.info.identity != expected:
            raise BadInput(
                f"{connection.address}: runs {self.info.identity!r}, not {expected!r}",
                hint="start that service, or change --service-model",
            )
        missing = [stream for stream in self.info.required if stream != "pose" and stream not in sequence.info.streams]
        if missing:
            raise BadInput(
                f"this sequence has no {missing[0]}, which {connection.address} needs",
                hint="use another service, or --backend geometric",
            )
        self.label = f"masks of {self.info.identity}"
        self.streams: tuple[str, ...] = tuple(s for s in self.info.streams if s != "pose")
        self._categories = {category.id: category for category in self.info.categories}
        self._speaks_ours = _is_vocabulary(self._categories, vocabulary) and labels is None
        self._labels = {} if self._speaks_ours else _labels(self.info, labels, connection.address)
        self._replies = ReplyCache(self.info.identity, read_only_new=request.ask_again)
        prune()

    def __call__(self, frame: Frame, geometric: GeometricFrame, random: np.random.Generator) -> PanopticFrame:
        """Return the masks of a frame; none when it lacks what the service needs. Raises BadInput, MachineFailure."""
        shape = geometric.labels.shape
        have = {"color": frame.color, "depth": frame.depth, "pose": frame.world_from_camera}
        if any(have[stream] is None for stream in self.info.required):
            return PanopticFrame(np.zeros(shape, dtype=np.int32))
        camera = self._reader.cameras[frame.camera_name]
        stored = self._reader.encoded(frame.index) if frame.color is not None else None
        request = SegmentRequest(frame, camera, self._seed)
        body, content_type = encode_request(request, self.info.streams, stored)
        return self._panoptic_frame(self._ask(frame.index, body, content_type, (shape[0], shape[1])))

    def _ask(self, index: int, body: bytes, content_type: str, shape: tuple[int, int]) -> Reply:
        kept_reply = self._replies.find(body)
        if kept_reply is not None:
            try:
                return parse_reply(kept_reply, "application/json", shape, self._categories)
            except BadInput as error:
                logger.warning("frame %d: a kept reply is damaged (%s): asked again", index, error.message)
        try:
            answer = self._connection.post(SEGMENT_PATH, body, content_type)
            reply = parse_reply(answer.body, answer.content_type, shape, self._categories)
        except MachineFailure as error:
            raise MachineFailure(
                f"frame {index}: {error.message}",
                hint="run the same command again: it goes on with this frame; see --request-timeout and --retries",
            ) from None
        except BadInput as error:
            where = "" if self._connection.address in error.message else f"{self._connection.address}: reply: "
            raise BadInput(f"frame {index}: {where}{error.message}", hint=error.hint or "mend the service") from None
        self._replies.keep(body, answer.body)
        return reply

    def _panoptic_frame(self, reply: Reply) -> PanopticFrame:
        # Small numbers in the same order: tables over ids stay small, and ties are broken as the service had them.
        numbers = sorted(reply.segments)
        ids = np.searchsorted(np.array([0, *numbers]), reply.ids).astype(np.int32)
        segments = {k + 1: reply.segments[number] for k, number in enumerate(numbers)}
        if self._speaks_ours:
            return PanopticFrame(ids, {k: PanopticMask(s.class_id, s.is_thing, s.score) for k, s in segments.items()})
        named_segments = {
            k: NamedSegment(self._labels[s.class_id], s.score)
            for k, s in segments.items()
            if s.class_id in self._labels
        }
        return name_segments(ids, named_segments, self._vocabulary, minimum_pixels=self._minimum_pixels)


def connected(address: str, own: ServiceParameters) -> Connection:
    """Return a connection to the service at `address`; nothing is asked yet."""
    return connect(address, timeout=own.request_timeout, retries=own.retries, retry_wait=own.retry_wait)


def _is_vocabulary(categories: dict[int, Category], vocabulary: Vocabulary) -> bool:
    ours = {entry.id: entry.name for entry in vocabulary.classes}
    return {number: category.name for number, category in categories.items()} == ours


def _labels(info: ServiceInfo, label_set: LabelSet | None, address: str) -> dict[int, Label]:
    names = {category.id: category.name for category in info.categories}
    matched = match_labels(names, label_set, where=address)
    if matched.unknown:
        logger.warning(
            "%s: %d of its categories are in no table and stay void: %s",
            address,
            len(matched.unknown),
            ", ".join(matched.unknown[:10]),
        )
    kinds = {category.id: "thing" if category.isthing else "stuff" for category in info.categories}
    return {number: label.model_copy(update={"kind": kinds[number]}) for number, label in matched.labels.items()}


def open_backend(request: BackendRequest) -> ServiceBackend:
    """Return the backend that the request asks for. Raises as the class does, and BadInput for damaged labels."""
    return ServiceBackend(request)
