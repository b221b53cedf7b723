"""Which backend names the masks. A backend is loaded only when it is chosen: some need what others do without."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from schemas.errors import BadInput, MissingDependency, UsageError
from schemas.sequence import Sequence
from schemas.vocabulary import load_vocabulary
from stages.kit.formats.frames import Frame, FrameReader
from stages.segment.backend_names import is_service
from stages.segment.backends.geometric.backend import GeometricBackend
from stages.segment.backends.ground_truth.backend import GroundTruthBackend
from stages.segment.geometric import GeometricFrame
from stages.segment.labels import read_label_file
from stages.segment.panoptic import PanopticFrame
from stages.segment.parameters import SegmentParameters
from stages.segment.settings import geometric_settings


class Backend(Protocol):
    """Names panoptic masks in a frame."""

    name: str
    label: str
    """Printed beside every figure that rests on these masks."""
    streams: tuple[str, ...]
    """Streams of the sequence it looks at."""

    def __call__(self, frame: Frame, geometric: GeometricFrame, random: np.random.Generator) -> PanopticFrame:
        """Return the masks of one frame."""
        ...


@dataclass(frozen=True)
class BackendRequest:
    """What a backend may be made of."""

    parameters: SegmentParameters
    weights: Path | None = None
    mask_weights: Path | None = None
    labels: Path | None = None
    """Label table or list of words."""
    sidecar: Path | None = None
    device: str = "cpu"
    sequence: Sequence | None = None
    """The log, for backends that look at all of it; None when single frames are served (`models serve`)."""
    reader: FrameReader | None = None
    seed: int = 0
    ask_again: bool = False
    """Do not use what is kept of earlier runs (`--force`)."""

    def log(self) -> tuple[Sequence, FrameReader]:
        """Return the log. Raises UsageError when there is none."""
        if self.sequence is None or self.reader is None:
            raise UsageError(
                f"--backend {self.parameters.backend} looks at a whole log and cannot be served",
                hint="serve a backend that judges single frames",
            )
        return self.sequence, self.reader


def choose_backend(request: BackendRequest) -> Backend:
    """Return the backend that the parameters ask for. Raises UsageError, BadInput or MissingDependency."""
    parameters = request.parameters
    if parameters.corruption > 0 and parameters.backend != "ground-truth":
        raise UsageError("--corruption is for --backend ground-truth alone")
    if is_service(parameters.backend):
        return _service(request)
    if parameters.backend in NEEDS_COLOR and request.sequence is not None:
        _require_color(request.sequence, parameters.backend)
    if parameters.backend not in BUILDERS:
        raise MissingDependency(f"--backend {parameters.backend} is not part of this version", hint="see --help")
    return BUILDERS[parameters.backend](request)


def _ground_truth(request: BackendRequest) -> Backend:
    sequence, _ = request.log()
    return GroundTruthBackend(sequence.info, load_vocabulary(), request.parameters.corruption)


def _geometric(request: BackendRequest) -> Backend:
    return GeometricBackend(load_vocabulary(), minimum_pixels=request.parameters.fusion_minimum)


def _detector(request: BackendRequest) -> Backend:
    # Imported here: the other backends do not need OpenCV's dnn module.
    from stages.segment.backends.detector.backend import DetectorBackend
    from stages.segment.backends.detector.yolox import Detector

    parameters = request.parameters
    sequence, reader = request.log()
    if request.weights is None:
        raise MissingDependency(
            "--backend detector needs the weights of a detector",
            hint="give an ONNX export of a YOLOX model (COCO-80) with --weights, or use --backend geometric",
        )
    detector = Detector(
        request.weights,
        score_threshold=parameters.score_threshold,
        suppression_overlap=parameters.suppression_overlap,
        tile_side=min(reader.camera.width, reader.camera.height) if parameters.tiles else 0,
    )
    return DetectorBackend(
        sequence.info,
        reader,
        load_vocabulary(),
        detector,
        weights=request.weights,
        geometric=geometric_settings(parameters),
        minimum_pixels=parameters.small_object_pixels,
    )


def _huggingface(request: BackendRequest) -> Backend:
    # Imported here: transformers is an extra.
    from stages.segment.backends.huggingface.backend import make_backend

    parameters = request.parameters
    return make_backend(
        request.weights,
        request.mask_weights,
        read_label_file(request.labels) if request.labels else None,
        parameters.words,
        load_vocabulary(),
        score_threshold=parameters.score_threshold,
        suppression_overlap=parameters.suppression_overlap,
        minimum_pixels=parameters.small_object_pixels,
        device=request.device,
    )


def _onnx(request: BackendRequest) -> Backend:
    # Imported here: ONNX Runtime is an extra.
    from stages.segment.backends.onnx.backend import OnnxBackend

    parameters = request.parameters
    return OnnxBackend(
        request.weights,
        request.sidecar,
        read_label_file(request.labels) if request.labels else None,
        load_vocabulary(),
        score_threshold=parameters.score_threshold,
        suppression_overlap=parameters.suppression_overlap,
        minimum_pixels=parameters.small_object_pixels,
        device=request.device,
    )


def _service(request: BackendRequest) -> Backend:
    # Imported here: the other backends do not need HTTP.
    from stages.kit.services.connection import Connection
    from stages.segment.backends.service.backend import REFUSED_HINT, ServiceBackend

    parameters = request.parameters
    sequence, reader = request.log()
    connection = Connection(
        parameters.backend,
        timeout=parameters.request_timeout,
        retries=parameters.retries,
        retry_wait=parameters.retry_wait,
        refused_hint=REFUSED_HINT,
    )
    return ServiceBackend(
        connection,
        sequence.info,
        reader,
        load_vocabulary(),
        seed=request.seed,
        expected=parameters.service_model,
        labels=read_label_file(request.labels) if request.labels else None,
        minimum_pixels=parameters.small_object_pixels,
        ask_again=request.ask_again,
    )


def _network(request: BackendRequest) -> Backend:
    # Imported here: loading torch takes seconds, which the other backends need not wait for.
    from stages.segment.backends.network.backend import NetworkBackend

    if request.weights is not None and request.weights.suffix != ".safetensors":
        raise UsageError(
            f"{request.weights.name} is no checkpoint of the network of our own (a .safetensors file)",
            hint="say whose weights they are with --backend detector, onnx or huggingface",
        )
    sequence = request.sequence.info if request.sequence is not None else None
    return NetworkBackend(load_vocabulary(), request.weights, sequence=sequence, reader=request.reader)


def _objects(request: BackendRequest) -> Backend:
    # Imported here: its loops are compiled when they are first used.
    from stages.segment.backends.objects.backend import SCORERS, ObjectsBackend

    _, reader = request.log()
    parameters = request.parameters
    return ObjectsBackend(
        load_vocabulary(), reader.camera, scorer=SCORERS[parameters.grouping](), largest=parameters.largest_object
    )


def _require_color(sequence: Sequence, backend: str) -> None:
    if "color" not in sequence.info.streams:
        raise BadInput(
            f"this sequence has no colour for --backend {backend}", hint="use --backend objects or geometric"
        )


NEEDS_COLOR = frozenset({"huggingface", "onnx"})
"""Backends that see nothing in a frame without colour."""
BUILDERS: dict[str, Callable[[BackendRequest], Backend]] = {
    "ground-truth": _ground_truth,
    "geometric": _geometric,
    "objects": _objects,
    "detector": _detector,
    "huggingface": _huggingface,
    "onnx": _onnx,
    "network": _network,
    "auto": _network,
}
"""Name (backend_names.BACKENDS) -> how it is made."""
