"""The step `export`: choose frames and streams, write the layout, say what it could not hold."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from contextlib import ExitStack
from typing import Any

from scenewright.schemas.errors import UsageError
from scenewright.schemas.exported_sequence import ExportedSequence, ExportFile
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.segments import Segments
from scenewright.schemas.sequence import Sequence, SequenceFile
from scenewright.stages.export.frames import ExportJob, Tally, export_frames
from scenewright.stages.export.masks import masks_of
from scenewright.stages.export.parameters import ExportParameters
from scenewright.stages.export.registry import SequenceFormat, format_for
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.stage import Context

WORLD_NOTE = "poses are world_from_camera in the sequence's world: metres, z up, OpenCV cameras"


def run(
    sequence: Sequence, segments: Segments | None, *, parameters: ExportParameters, context: Context
) -> ExportedSequence:
    """Write a sequence in another tool's layout.

    Raises UsageError for a camera that it does not have, or for masks that the layout does not hold, and BadInput for a
    layout of masks where there are none.
    """
    info = sequence.info
    target_format = format_for(parameters.layout, parameters.dialect)
    if segments is not None and not target_format.masks:
        raise UsageError(f"export: --segments: {parameters.layout} holds no masks", hint="add --layout coco")
    cameras = chosen_cameras(info, parameters.camera, target_format)
    streams = tuple(name for name in target_format.streams if name in (parameters.streams or target_format.streams))
    tally = Tally()
    with ExitStack() as opened:
        reader = opened.enter_context(FrameReader(sequence.path("frames.mcap")))
        masks = opened.enter_context(masks_of(sequence, segments)) if target_format.masks else None
        opened.enter_context(context.progress.step("write frames"))
        numbers = context.progress.track(range(len(reader)), total=len(reader), description="frames")
        frames = export_frames(reader, numbers, parameters.every, streams, cameras, tally, masks)
        job = ExportJob(context.output, frames, cameras, info, reader.world_up, tally)
        importlib.import_module(target_format.module).write(job)
        frames_in_sequence = len(reader)
    notes = _notes(info, cameras, parameters.camera is not None, streams, target_format, tally)
    if target_format.masks:
        notes = (f"masks: {'the labels of the log' if segments is None else segments.info.label}", *notes[1:])
        if not tally.masks:
            notes = (*notes, "no mask has a class: a network or words name things (docs/SEGMENTATION.md)")
    for note in notes:
        context.logger.info("%s", note)
    ExportFile(
        layout=target_format.layout,
        dialect=target_format.dialect,
        log=target_format.log,
        cameras=tuple(cameras),
        streams=tuple(stream for stream in target_format.streams if stream in tally.streams),
        frame_count=tally.frames,
        frames_in_sequence=frames_in_sequence,
        left_out=dict(sorted(tally.left_out.items())),
        depth_pixels_zeroed=tally.depth_pixels_zeroed,
        depth_limit=target_format.depth_limit if "depth" in tally.streams else None,
        notes=notes,
    ).write(context.output / "export.json")
    return _result(tally, frames_in_sequence, target_format, context)


def chosen_cameras(info: SequenceFile, wanted: str | None, target_format: SequenceFormat) -> dict[str, Camera]:
    """Return name -> camera of those to write: the wanted one; the main one for a format that holds one; else all.

    Raises UsageError for a camera that the sequence does not have.
    """
    cameras = {camera.name: camera.camera for camera in info.cameras}
    if wanted is not None:
        if wanted not in cameras:
            raise UsageError(f"export: --camera {wanted!r} is not in it", hint=f"it has: {', '.join(cameras)}")
        return {wanted: cameras[wanted]}
    return dict(list(cameras.items())[:1]) if target_format.one_camera else cameras


def _notes(
    info: SequenceFile,
    cameras: Mapping[str, Camera],
    chosen: bool,
    streams: tuple[str, ...],
    target_format: SequenceFormat,
    tally: Tally,
) -> tuple[str, ...]:
    """What a reader of the export has to know; `chosen`: whether a camera was asked for."""
    notes = [f"{WORLD_NOTE}, {target_format.pose_note}" if target_format.pose_note else WORLD_NOTE]
    if info.gravity.method == "none":
        notes[0] = notes[0].replace("z up", "as the log had it")
    lost = [stream for stream in info.streams if stream not in streams]
    if lost:
        notes.append(f"not written: {', '.join(lost)}")
    others = [camera.name for camera in info.cameras if camera.name not in cameras]
    if others:
        written = f"cameras not written: {', '.join(others)}"
        notes.append(written if chosen else f"{written} (--camera NAME writes another one)")
    if tally.depth_pixels_zeroed:
        notes.append(
            f"{tally.depth_pixels_zeroed} depth pixels beyond {target_format.depth_limit:g} m are 0 = invalid: "
            f"{target_format.depth_limit_reason}"
        )
    if not info.color_depth_registered:
        notes.append("colour and depth are not registered to each other")
    return tuple(notes)


def _result(tally: Tally, frames_in_sequence: int, target_format: SequenceFormat, context: Context) -> ExportedSequence:
    summary: dict[str, Any] = {
        "layout": target_format.layout
        if target_format.dialect is None
        else f"{target_format.layout} {target_format.dialect}",
        "frames": tally.frames,
        "frames_in_sequence": frames_in_sequence,
    }
    if target_format.masks:
        summary["masks"] = tally.masks
    if tally.depth_pixels_zeroed:
        summary["depth_pixels_zeroed"] = tally.depth_pixels_zeroed
    if not tally.frames:
        reasons = ", ".join(f"{reason} {count}" for reason, count in tally.left_out.most_common())
        summary["reason"] = f"no frame could be written: {reasons or 'the sequence has none'}"
    return ExportedSequence(context.output, outcome="ok" if tally.frames else "empty", summary=summary)
