"""The wiring of `scenewright segment`: frames in, fused segments out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.segments import FrameSegments, Segments, SegmentsFile
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.vocabulary import UNNAMED, load_vocabulary
from scenewright.stages.kit.formats.frames import FrameReader, require_depth
from scenewright.stages.kit.formats.masks import write_panoptic_zip
from scenewright.stages.kit.stage import Context
from scenewright.stages.segment.apart import Segmented, segmented_apart, segmented_here, unsegmented, worker_count
from scenewright.stages.segment.choice import BackendRequest, choose_backend, chosen_backends, fitting
from scenewright.stages.segment.parameters import SegmentParameters


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
            unfitted_request = BackendRequest(
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
            request = fitting(unfitted_request)
            backend = choose_backend(request)
        annotations: list[FrameSegments] = []
        declared = chosen_backends(request)
        nameless = all(each.nameless for each in declared)

        def segmented() -> Iterable[Segmented]:
            if nameless and parameters.fusion == "ours":
                return unsegmented(reader)
            streams = tuple(dict.fromkeys(("depth", *backend.streams)))
            workers = worker_count(len(reader), all(each.apart for each in declared), context.device)
            if workers > 1:
                return segmented_apart(request, streams, workers)
            return segmented_here(request, backend, streams, context.random)

        def images() -> Iterator[tuple[int, np.ndarray | bytes]]:
            for index, image, record in context.progress.track(segmented(), total=len(reader), description="segment"):
                annotations.append(record)
                yield index, image

        with context.progress.step("segment the frames"):
            write_panoptic_zip(context.output / "panoptic.zip", images())
    doubts = getattr(backend, "says_object_in_doubt", False)
    recognised = recognised_share(annotations, load_vocabulary().by_name(UNNAMED).id) if doubts else None
    SegmentsFile(
        backend=backend.name,
        label=backend.label,
        corruption=getattr(backend, "corruption", 0.0),
        recognised=recognised,
        networks=tuple(getattr(backend, "networks", ())) if len(getattr(backend, "networks", ())) > 1 else (),
        width=info.camera.width,
        height=info.camera.height,
        frames=tuple(annotations),
    ).write(context.output / "segments.json")
    named_count = sum(1 for frame in annotations for segment in frame.segments if segment.class_id)
    total = sum(len(frame.segments) for frame in annotations)
    summary = {
        "label": backend.label,
        "frames": len(annotations),
        "segments_per_frame": round(total / max(len(annotations), 1), 2),
        "named_share": round(named_count / max(total, 1), 3),
    }
    if recognised is not None:
        summary["recognised_share"] = round(recognised, 3)
    return Segments(context.output, outcome="ok" if named_count or nameless else "empty", summary=summary)


def recognised_share(frames: Iterable[FrameSegments], unnamed: int) -> float | None:
    """Return the share of the area of things that has another class than `unnamed`; None where no thing was found."""
    things = [segment for frame in frames for segment in frame.segments if segment.is_thing and segment.class_id]
    total = sum(segment.area for segment in things)
    return sum(s.area for s in things if s.class_id != unnamed) / total if total else None
