"""Which backend names the masks. A backend is loaded only when it is chosen: some need what others do without."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import numpy as np

from schemas.errors import MissingDependency, UsageError
from schemas.sequence import Sequence
from schemas.vocabulary import load_vocabulary
from stages.kit.formats.frames import Frame, FrameReader
from stages.segment.backend_geometric import GeometricBackend
from stages.segment.backend_ground_truth import GroundTruthBackend
from stages.segment.geometric import GeometricFrame
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


def choose_backend(
    sequence: Sequence, reader: FrameReader, weights: Path | None, parameters: SegmentParameters
) -> Backend:
    """Return the backend that the parameters ask for. Raises UsageError, BadInput or MissingDependency."""
    vocabulary = load_vocabulary()
    if parameters.corruption > 0 and parameters.backend != "ground-truth":
        raise UsageError("--corruption is for --backend ground-truth alone")
    if parameters.backend == "geometric":
        return GeometricBackend(vocabulary, minimum_pixels=parameters.fusion_minimum)
    if parameters.backend == "detector":
        return _detector_backend(sequence, reader, weights, parameters)
    return GroundTruthBackend(sequence.info, vocabulary, parameters.corruption)


def _detector_backend(
    sequence: Sequence, reader: FrameReader, weights: Path | None, parameters: SegmentParameters
) -> Backend:
    # Imported here: the other backends do not need OpenCV's dnn module.
    from stages.segment.backend_detector import DetectorBackend
    from stages.segment.yolox import Detector

    if weights is None:
        raise MissingDependency(
            "--backend detector needs the weights of a detector",
            hint="give an ONNX export of a YOLOX model (COCO-80) with --weights, or use --backend geometric",
        )
    detector = Detector(
        weights,
        score_threshold=parameters.score_threshold,
        suppression_overlap=parameters.suppression_overlap,
        tile_side=min(reader.camera.width, reader.camera.height) if parameters.tiles else 0,
    )
    return DetectorBackend(
        sequence.info,
        reader,
        load_vocabulary(),
        detector,
        weights=weights,
        geometric=geometric_settings(parameters),
        minimum_pixels=parameters.small_object_pixels,
    )
