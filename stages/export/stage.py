"""The step `export`: choose frames and streams, write the layout, say what it could not hold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from schemas.errors import UsageError
from schemas.exported_sequence import ExportedSequence, ExportFile
from schemas.scene_parts import Camera
from schemas.sequence import Sequence, SequenceFile
from stages.export import foxglove_mcap, nerfstudio, ros2_mcap, tum
from stages.export.frames import Tally, export_frames
from stages.export.parameters import ExportParameters
from stages.kit.formats.frames import FrameReader
from stages.kit.stage import Context

LOG_NAME = "log.mcap"
WORLD_NOTE = "poses are world_from_camera in the sequence's world: metres, z up, OpenCV cameras"
ROOT_AS_LOG = "."


def run(sequence: Sequence, *, parameters: ExportParameters, context: Context) -> ExportedSequence:
    """Write a sequence in another tool's layout. Raises UsageError for a camera that it does not have."""
    info = sequence.info
    cameras = chosen_cameras(info, parameters)
    held = held_streams(parameters)
    streams = tuple(name for name in held if name in (parameters.streams or held))
    tally = Tally()
    with FrameReader(sequence.path("frames.mcap")) as reader, context.progress.step("write frames"):
        numbers = context.progress.track(range(len(reader)), total=len(reader), description="frames")
        frames = export_frames(reader, numbers, parameters.every, streams, cameras, tally)
        _write(frames, cameras, info, reader.world_up, parameters, context, tally)
        frames_in_sequence = len(reader)
    notes = _notes(info, cameras, streams, parameters, tally)
    for note in notes:
        context.logger.info("%s", note)
    limited = parameters.layout == "tum" and "depth" in tally.streams
    ExportFile(
        layout=parameters.layout,
        dialect=parameters.dialect if parameters.layout == "mcap" else None,
        log=LOG_NAME if parameters.layout == "mcap" else ROOT_AS_LOG,
        cameras=tuple(cameras),
        streams=tuple(stream for stream in held if stream in tally.streams),
        frame_count=tally.frames,
        frames_in_sequence=frames_in_sequence,
        left_out=dict(sorted(tally.left_out.items())),
        depth_pixels_zeroed=tally.depth_pixels_zeroed,
        depth_limit=tum.LARGEST_MILLIMETRES / 1000 if limited else None,
        notes=notes,
    ).write(context.output / "export.json")
    return _result(tally, frames_in_sequence, parameters, context)


def held_streams(parameters: ExportParameters) -> tuple[str, ...]:
    """Return the streams that the layout has a place for."""
    mcap = foxglove_mcap.STREAMS if parameters.dialect == "foxglove" else ros2_mcap.STREAMS
    return {"tum": tum.STREAMS, "nerfstudio": nerfstudio.STREAMS, "mcap": mcap}[parameters.layout]


def chosen_cameras(info: SequenceFile, parameters: ExportParameters) -> dict[str, Camera]:
    """Return name -> camera of those to write: the one asked for; for TUM the main one; else all."""
    known = {camera.name: camera.camera for camera in info.cameras}
    if parameters.camera is not None:
        if parameters.camera not in known:
            raise UsageError(f"export: --camera {parameters.camera!r} is not in it", hint=f"it has: {', '.join(known)}")
        return {parameters.camera: known[parameters.camera]}
    return dict(list(known.items())[:1]) if parameters.layout == "tum" else known


def _write(
    frames: Any,
    cameras: Mapping[str, Camera],
    info: SequenceFile,
    world_up: str,
    parameters: ExportParameters,
    context: Context,
    tally: Tally,
) -> None:
    if parameters.layout == "tum":
        tum.write_tum_folder(context.output, frames, next(iter(cameras.values())), tally)
    elif parameters.layout == "nerfstudio":
        nerfstudio.write_nerfstudio_folder(context.output, frames, cameras, tally)
    else:
        write = foxglove_mcap.write_foxglove_log if parameters.dialect == "foxglove" else ros2_mcap.write_ros2_log
        write(context.output / LOG_NAME, frames, cameras, info, world_up, tally)


def _notes(
    info: SequenceFile,
    cameras: Mapping[str, Camera],
    streams: tuple[str, ...],
    parameters: ExportParameters,
    tally: Tally,
) -> tuple[str, ...]:
    """What a reader of the export has to know."""
    notes = [WORLD_NOTE if parameters.layout != "nerfstudio" else f"{WORLD_NOTE}, written as OpenGL camera-to-world"]
    if info.gravity.method == "none":
        notes[0] = notes[0].replace("z up", "as the log had it")
    lost = [stream for stream in info.streams if stream not in streams]
    if lost:
        notes.append(f"not written: {', '.join(lost)}")
    others = [camera.name for camera in info.cameras if camera.name not in cameras]
    if others:
        notes.append(f"cameras not written: {', '.join(others)} (--camera NAME writes another one)")
    if tally.depth_pixels_zeroed:
        notes.append(
            f"{tally.depth_pixels_zeroed} depth pixels beyond {tum.LARGEST_MILLIMETRES / 1000:g} m are 0 = invalid: "
            "16 bits at 5000 units per metre reach no further"
        )
    if not info.color_depth_registered:
        notes.append("colour and depth are not registered to each other")
    return tuple(notes)


def _result(tally: Tally, frames_in_sequence: int, parameters: ExportParameters, context: Context) -> ExportedSequence:
    summary: dict[str, Any] = {
        "layout": parameters.layout if parameters.layout != "mcap" else f"mcap {parameters.dialect}",
        "frames": tally.frames,
        "frames_in_sequence": frames_in_sequence,
    }
    if tally.depth_pixels_zeroed:
        summary["depth_pixels_zeroed"] = tally.depth_pixels_zeroed
    if not tally.frames:
        left = ", ".join(f"{reason} {count}" for reason, count in tally.left_out.most_common())
        summary["reason"] = f"no frame could be written: {left or 'the sequence has none'}"
    return ExportedSequence(context.output, outcome="ok" if tally.frames else "empty", summary=summary)
