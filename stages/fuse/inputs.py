"""Which frames are fused, with which pose and which segments. What does not fit together raises BadInput."""

from __future__ import annotations

from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.segments import Segments, SegmentsFile
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.vocabulary import Vocabulary


def check_segments(segments: SegmentsFile, camera: Camera, frame_count: int, vocabulary: Vocabulary) -> None:
    """Raise BadInput unless the segments can belong to this sequence."""
    remake = "run `scenewright segment` on this sequence"
    if (segments.width, segments.height) != (camera.width, camera.height):
        raise BadInput(
            f"segments are {segments.width}x{segments.height}, frames are {camera.width}x{camera.height}", hint=remake
        )
    indices = [frame.frame for frame in segments.frames]
    if len(set(indices)) != len(indices):
        twice = next(index for index in indices if indices.count(index) > 1)
        raise BadInput(f"segments.json lists frame {twice} twice", hint=remake)
    beyond = [index for index in indices if not 0 <= index < frame_count]
    if beyond:
        raise BadInput(
            f"segments are of another sequence: frame {beyond[0]} does not exist, there are {frame_count}", hint=remake
        )
    class_ids = {entry.id for entry in vocabulary.classes}
    for frame in segments.frames:
        ids = [segment.id for segment in frame.segments]
        if len(set(ids)) != len(ids) or any(value <= 0 for value in ids):
            raise BadInput(f"segments.json: ids of frame {frame.frame} are not positive and different", hint=remake)
        for segment in frame.segments:
            if segment.class_id != 0 and segment.class_id not in class_ids:
                raise BadInput(
                    f"segments.json: frame {frame.frame} has class id {segment.class_id}, which is not in the "
                    "vocabulary",
                    hint=remake,
                )


def check_origin(sequence: Sequence, segments: Segments) -> None:
    """Raise BadInput when the manifests say that the segments were made from another sequence.

    Handles without a manifest (not read from a finished artifact) pass.
    """
    if sequence.manifest is None or segments.manifest is None:
        return
    sources = [entry for entry in segments.manifest.inputs if entry.role == "sequence"]
    if sources and sources[0].digest != sequence.manifest.content_digest:
        raise BadInput(
            f"the segments were made from another sequence ({sources[0].path}, digest {sources[0].digest[:12]}) than "
            f"this one ({sequence.manifest.content_digest[:12]})",
            hint="run `scenewright segment` on this sequence",
        )
