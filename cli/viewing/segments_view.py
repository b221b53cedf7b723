"""Segments: class and instance of every pixel over the picture."""

from __future__ import annotations

import numpy as np
from scenewright.cli.viewing.inputs import input_artifact
from scenewright.cli.viewing.sequence_view import MAXIMUM_FRAMES
from scenewright.schemas.segments import FrameSegments, Segments
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.drawing.palette import instance_color
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.formats.masks import PanopticReader
from scenewright.stages.kit.viewing.canvas import Canvas


def draw_segments(segments: Segments, canvas: Canvas) -> None:
    """Draw, per frame, the picture (when the sequence is still there), classes, instances and fused segments."""
    info = segments.info
    canvas.document("segments", f"backend {info.backend}: {info.label}, {len(info.frames)} frames")
    classes = [(entry.id, entry.name, instance_color(entry.id)) for entry in load_vocabulary().classes]
    canvas.label_names("class", classes)
    numbers = range(1, 1 + max((s.id for frame in info.frames for s in frame.segments), default=0))
    for path in ("instance", "segment"):
        canvas.label_names(path, [(number, f"{path} {number}", instance_color(number)) for number in numbers[:2000]])
    sequence = input_artifact(segments, Sequence)
    reader = FrameReader(sequence.path("frames.mcap")) if sequence is not None else None
    try:
        with PanopticReader(segments.path("panoptic.zip")) as masks:
            for frame in info.frames[:: -(-len(info.frames) // MAXIMUM_FRAMES) or 1]:
                canvas.time(reader.times[frame.frame] if reader is not None else float(frame.frame))
                _draw_frame(canvas, frame, masks.read(frame.frame), reader)
    finally:
        if reader is not None:
            reader.close()


def _draw_frame(canvas: Canvas, frame: FrameSegments, ids: np.ndarray, reader: FrameReader | None) -> None:
    color = reader.encoded(frame.frame) if reader is not None else None
    for path, values in segment_images(frame, ids).items():
        if color is not None:
            canvas.picture(f"{path}/color", color)
        canvas.labels(f"{path}/labels", values)


def segment_images(frame: FrameSegments, ids: np.ndarray) -> dict[str, np.ndarray]:
    """Return id images (H, W) of class, instance and fused segment from the ids (H, W) of a panoptic PNG."""
    values, inverse = np.unique(ids, return_inverse=True)
    records = {segment.id: segment for segment in frame.segments}
    category = np.array([records[int(v)].class_id if int(v) in records else 0 for v in values])
    instance = np.array([records[int(v)].instance if int(v) in records else 0 for v in values])
    inverse = inverse.reshape(ids.shape)
    return {"class": category[inverse], "instance": instance[inverse], "segment": ids}
