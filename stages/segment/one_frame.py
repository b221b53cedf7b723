"""One frame from depth and colour to fused segments (Han 2024, section 2.3.1), and its record."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.segments import FrameSegment, FrameSegments
from scenewright.stages.kit.formats.frames import Frame, FrameReader
from scenewright.stages.segment import fusion_ours, fusion_thesis, fusion_voxblox
from scenewright.stages.segment.fusion import FusedFrame, FusionRule
from scenewright.stages.segment.geometric import segment_depth
from scenewright.stages.segment.panoptic import Backend
from scenewright.stages.segment.parameters import SegmentParameters
from scenewright.stages.segment.settings import fusion_settings, geometric_settings

FUSION: dict[str, FusionRule] = {
    "ours": fusion_ours.fuse,
    "thesis": fusion_thesis.fuse,
    "voxblox++": fusion_voxblox.fuse,
}


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
                class_id=segment.class_id,
                instance=segment.instance,
                is_thing=segment.is_thing,
                score=round(segment.score, 4),
                area=segment.area,
                witnesses=tuple(
                    witness.model_copy(update={"score": round(witness.score, 4)}) for witness in segment.witnesses
                ),
            )
            for segment in fused.segments
        ),
    )
