"""The wiring of `scenewright segment`: frames in, fused segments out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from schemas.errors import BadInput
from schemas.segments import FrameSegment, FrameSegments, Segments, SegmentsFile
from schemas.sequence import Sequence
from schemas.vocabulary import UNNAMED, load_vocabulary
from stages.kit.formats.frames import Frame, FrameReader, require_depth
from stages.kit.formats.masks import write_panoptic_zip
from stages.kit.stage import Context
from stages.segment import fusion_ours, fusion_thesis, fusion_voxblox
from stages.segment.choice import Backend, BackendRequest, choose_backend
from stages.segment.fusion import FusedFrame, FusionRule
from stages.segment.geometric import segment_depth
from stages.segment.parameters import SegmentParameters
from stages.segment.settings import fusion_settings, geometric_settings

FUSION: dict[str, FusionRule] = {
    "ours": fusion_ours.fuse,
    "thesis": fusion_thesis.fuse,
    "voxblox++": fusion_voxblox.fuse,
}


def run(
    sequence: Sequence,
    weights: Path | None = None,
    mask_weights: Path | None = None,
    semantic_weights: Path | None = None,
    labels: Path | None = None,
    sidecar: Path | None = None,
    masks: Path | None = None,
    *,
    parameters: SegmentParameters,
    context: Context,
) -> Segments:
    """Segment every frame geometrically and panoptically, and fuse both (Han 2024, section 2.3.1)."""
    info = sequence.info
    if "depth" not in info.streams:
        raise BadInput("this sequence has no depth", hint="compute it first: `scenewright disparity`")
    require_depth(sequence)
    with FrameReader(sequence.path("frames.mcap")) as reader:
        with context.progress.step("prepare the backend"):
            backend = choose_backend(
                BackendRequest(
                    parameters,
                    weights,
                    mask_weights=mask_weights,
                    semantic_weights=semantic_weights,
                    labels=labels,
                    sidecar=sidecar,
                    masks=masks,
                    device=context.device,
                    sequence=sequence,
                    reader=reader,
                    seed=context.seed,
                    ask_again=context.force,
                )
            )
        annotations: list[FrameSegments] = []

        def images() -> Iterator[tuple[int, np.ndarray]]:
            frames = reader.frames(streams=dict.fromkeys(("depth", *backend.streams)))
            for frame in context.progress.track(frames, total=len(reader), description="segment"):
                fused = segment_frame(frame, reader, backend, parameters, context.random(frame.index))
                annotations.append(describe(frame.index, fused))
                yield frame.index, fused.ids

        with context.progress.step("segment the frames"):
            write_panoptic_zip(context.output / "panoptic.zip", images())
    doubts = getattr(backend, "says_object_in_doubt", False)
    recognised = recognised_share(annotations, load_vocabulary().by_name(UNNAMED).id) if doubts else None
    SegmentsFile(
        backend=backend.name,
        label=backend.label,
        corruption=getattr(backend, "corruption", 0.0),
        recognised=recognised,
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
    if recognised is not None:
        summary["recognised_share"] = round(recognised, 3)
    return Segments(context.output, outcome="ok" if named else "empty", summary=summary)


def recognised_share(frames: Iterable[FrameSegments], unnamed: int) -> float | None:
    """Return the share of the area of things that has another class than `unnamed`; None where no thing was found."""
    things = [segment for frame in frames for segment in frame.segments if segment.is_thing and segment.category_id]
    total = sum(segment.area for segment in things)
    return sum(s.area for s in things if s.category_id != unnamed) / total if total else None


def segment_frame(
    frame: Frame, reader: FrameReader, backend: Backend, parameters: SegmentParameters, random: np.random.Generator
) -> FusedFrame:
    """Return the fused segments of one frame; a frame without depth has none."""
    camera = reader.cameras[frame.camera_name]
    shape = (camera.height, camera.width)
    depth = frame.depth if frame.depth is not None else np.zeros(shape, dtype=np.float32)
    geometric = segment_depth(depth, camera, geometric_settings(parameters))
    panoptic = backend(frame, geometric, random)
    fuse = FUSION[parameters.fusion]
    return fuse(geometric.labels, panoptic, geometric.points, fusion_settings(parameters), geometric.small)


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
