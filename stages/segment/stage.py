"""The wiring of `scenewright segment`: frames in, fused segments out."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Protocol

import numpy as np

from schemas.errors import BadInput, MissingDependency, UsageError
from schemas.segments import FrameSegment, FrameSegments, Segments, SegmentsFile
from schemas.sequence import Sequence
from schemas.vocabulary import load_vocabulary
from stages.kit.formats.frames import Frame, FrameReader, require_depth
from stages.kit.formats.masks import write_panoptic_zip
from stages.kit.stage import Context
from stages.segment.backend_geometric import GeometricBackend
from stages.segment.backend_ground_truth import GroundTruthBackend
from stages.segment.fusion import FusedFrame, FusionSettings, fuse
from stages.segment.geometric import GeometricFrame, GeometricSettings, segment_depth
from stages.segment.panoptic import PanopticFrame
from stages.segment.parameters import SegmentParameters


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


def run(sequence: Sequence, weights: Path | None, *, parameters: SegmentParameters, context: Context) -> Segments:
    """Segment every frame geometrically and panoptically, and fuse both (Han 2024, section 2.3.1)."""
    info = sequence.info
    if "depth" not in info.streams:
        raise BadInput("this sequence has no depth", hint="compute it first: `scenewright disparity`")
    require_depth(sequence)
    with FrameReader(sequence.path("frames.mcap")) as reader:
        with context.progress.step("prepare the backend"):
            backend = choose_backend(sequence, reader, weights, parameters)
        annotations: list[FrameSegments] = []

        def images() -> Iterator[tuple[int, np.ndarray]]:
            frames = reader.frames(streams=backend.streams)
            for frame in context.progress.track(frames, total=len(reader), description="segment"):
                fused = segment_frame(frame, reader, backend, parameters, context.random(frame.index))
                annotations.append(describe(frame.index, fused))
                yield frame.index, fused.ids

        with context.progress.step("segment the frames"):
            write_panoptic_zip(context.output / "panoptic.zip", images())
    SegmentsFile(
        backend=backend.name,
        label=backend.label,
        corruption=parameters.corruption if backend.name == "ground-truth" else 0.0,
        width=info.camera.width,
        height=info.camera.height,
        frames=tuple(annotations),
    ).write(context.output / "segments.json")
    named = sum(1 for frame in annotations for segment in frame.segments if segment.category_id)
    total = sum(len(frame.segments) for frame in annotations)
    summary = {
        "label": backend.label,
        "frames": len(annotations),
        "segments_per_frame": round(total / max(len(annotations), 1), 2),
        "named_share": round(named / max(total, 1), 3),
    }
    return Segments(context.output, outcome="ok" if named else "empty", summary=summary)


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


def segment_frame(
    frame: Frame, reader: FrameReader, backend: Backend, parameters: SegmentParameters, random: np.random.Generator
) -> FusedFrame:
    """Return the fused segments of one frame; a frame without depth has none."""
    camera = reader.cameras[frame.camera_name]
    shape = (camera.height, camera.width)
    depth = frame.depth if frame.depth is not None else np.zeros(shape, dtype=np.float32)
    geometric = segment_depth(depth, camera, geometric_settings(parameters))
    panoptic = backend(frame, geometric, random)
    return fuse(geometric.labels, panoptic, geometric.points, fusion_settings(parameters))


def geometric_settings(parameters: SegmentParameters) -> GeometricSettings:
    """Return the constants of the geometric segmentation."""
    return GeometricSettings(
        smoothing_window=parameters.smoothing_window,
        smoothing_deviation=parameters.smoothing_deviation,
        normal_window=parameters.normal_window,
        normal_step=parameters.normal_step,
        normal_distance_factor=parameters.normal_distance_factor,
        convexity_window=parameters.convexity_window,
        convexity_threshold=parameters.convexity_threshold,
        convexity_mask_threshold=parameters.convexity_mask_threshold,
        mutual_convexity=parameters.mutual_convexity,
        discontinuity_ratio=parameters.discontinuity_ratio,
        discontinuity_window=parameters.discontinuity_window,
        opening=parameters.opening,
        closing=parameters.closing,
        minimum_pixels=parameters.geometric_minimum,
    )


def fusion_settings(parameters: SegmentParameters) -> FusionSettings:
    """Return the constants of the fusion."""
    return FusionSettings(
        rule=parameters.fusion,
        minimum_pixels=parameters.fusion_minimum,
        contained_share=parameters.contained_share,
        largest_part=parameters.largest_part,
        majority_share=parameters.majority_share,
        cluster_distance=parameters.cluster_distance,
        cluster_step=parameters.cluster_step,
        small_object_pixels=parameters.small_object_pixels,
    )


def describe(index: int, fused: FusedFrame) -> FrameSegments:
    """Return the record of a frame for segments.json."""
    return FrameSegments(
        frame=index,
        segments=tuple(
            FrameSegment(
                id=segment.id,
                category_id=segment.category_id,
                instance=segment.instance,
                is_thing=segment.is_thing,
                score=round(segment.score, 4),
                area=segment.area,
            )
            for segment in fused.segments
        ),
    )
