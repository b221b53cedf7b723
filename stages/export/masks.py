"""Masks to export, a frame at a time: those that `segment` found, or the true ones of a generated log."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.segments import FrameSegment, Segments
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.vocabulary import VOID, load_vocabulary
from scenewright.stages.export.frames import ExportMask, FrameMasks
from scenewright.stages.kit.formats.frames import Frame
from scenewright.stages.kit.formats.masks import PanopticReader


class MaskSource(Protocol):
    """Gives the masks of a frame, or None where it has none."""

    def __call__(self, frame: Frame) -> FrameMasks | None: ...


@contextmanager
def masks_of(sequence: Sequence, segments: Segments | None) -> Iterator[MaskSource]:
    """Open the masks of a sequence: those of `segments`, else the sequence's own labels.

    Raises BadInput when there are neither, when `segments` is of another sequence, or its ids are not those it lists.
    """
    if segments is None:
        yield _true_masks(sequence)
        return
    info = segments.info
    listed = {entry.frame: entry.segments for entry in info.frames}
    if listed and max(listed) >= sequence.info.frame_count:
        raise BadInput(
            f"{segments.root}: has masks of frame {max(listed)}, the sequence has {sequence.info.frame_count} frames",
            hint="give the sequence that it was made of",
        )
    with PanopticReader(segments.path("panoptic.zip")) as reader:

        def of(frame: Frame) -> FrameMasks | None:
            if frame.index not in listed:
                return None
            ids = reader.read(frame.index)
            size = sequence.info.cameras[0].camera
            size = next((c.camera for c in sequence.info.cameras if c.name == frame.camera_name), size)
            if ids.shape != (size.height, size.width):
                raise BadInput(
                    f"{segments.root}: masks of frame {frame.index} are {ids.shape[1]} x {ids.shape[0]}, its images "
                    f"{size.width} x {size.height}",
                    hint="give the sequence that it was made of",
                )
            return joined(ids, listed[frame.index], f"{segments.root}: frame {frame.index}")

        yield of


def joined(ids: np.ndarray, segments: tuple[FrameSegment, ...], where: str) -> FrameMasks:
    """Return one mask for each (class, instance) of a frame's fused segments; its id is the smallest of theirs.

    What has no label is void: COCO has no place for it. Raises BadInput for an id that is not listed.
    """
    present_ids = np.unique(ids)
    table = np.zeros(int(present_ids[-1]) + 1, dtype=np.int32)
    listed = np.zeros(len(table), dtype=bool)
    listed[0] = True
    groups: dict[tuple[int, int], int] = {}
    masks: dict[int, ExportMask] = {}
    for segment in sorted(segments, key=lambda entry: entry.id):
        if not 0 < segment.id < len(table):
            continue
        listed[segment.id] = True
        if segment.class_id == VOID:
            continue
        group = groups.setdefault((segment.class_id, segment.instance), segment.id)
        table[segment.id] = group
        best = max(segment.score, masks[group].score if group in masks else 0.0)
        masks[group] = ExportMask(segment.class_id, segment.is_thing, best)
    unknown = present_ids[~listed[present_ids]]
    if len(unknown):
        raise BadInput(f"{where}: id {unknown[0]} is not in segments.json", hint="run `scenewright segment` again")
    return FrameMasks(table[ids], masks)


def _true_masks(sequence: Sequence) -> MaskSource:
    info = sequence.info
    if "labels" not in info.streams or not info.label_table:
        raise BadInput(
            f"{sequence.root}: has no masks of its own", hint="give those that `scenewright segment` found: --segments"
        )
    vocabulary = load_vocabulary()
    table = np.zeros(1 << 16, dtype=np.int32)
    masks: dict[int, ExportMask] = {}
    stuff: dict[int, int] = {}
    for entry in info.label_table:
        semantic = vocabulary.by_name(entry.class_name)
        # A stuff class is one mask: every wall is the wall.
        number = stuff.setdefault(semantic.id, entry.instance) if semantic.kind == "stuff" else entry.instance
        table[entry.instance] = number
        masks[number] = ExportMask(semantic.id, semantic.kind == "thing", 1.0)
    table[0] = 0

    def of(frame: Frame) -> FrameMasks | None:
        if frame.labels is None:
            return None
        ids = table[frame.labels]
        present = set(np.unique(ids).tolist()) - {0}
        return FrameMasks(ids, {number: masks[number] for number in sorted(present)})

    return of
