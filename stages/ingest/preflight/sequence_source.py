"""A sequence artifact as a source, so that it can be inspected like a log."""

from __future__ import annotations

from collections.abc import Callable

from scenewright.schemas.sequence import Sequence
from scenewright.stages.ingest.source import Entry, LoadedFrame, LogSource, SourceCamera, Unusable
from scenewright.stages.kit.formats.foxglove import depth_to_millimetres
from scenewright.stages.kit.formats.frames import FrameReader


def sequence_source(sequence: Sequence) -> LogSource:
    """Open the frames of a sequence as a source; the caller closes it. Raises BadInput for a damaged one."""
    info = sequence.info
    reader = FrameReader(sequence.path("frames.mcap"))
    try:
        streams = tuple(stream for stream in ("color", "depth", "right") if stream in reader.streams)
        entries = []
        for index in range(len(reader)):
            frame = reader.read(index, ())
            entries.append(
                Entry(
                    name=f"frame {index}",
                    time=frame.time,
                    world_from_camera=frame.world_from_camera,
                    load=_loader(reader, index, streams),
                    camera_name=frame.camera_name,
                )
            )
        return LogSource(
            format="sequence",
            rule="sequence artifact",
            cameras=tuple(
                SourceCamera(entry.name, entry.camera, entry.baseline, info.color_depth_registered)
                for entry in info.cameras
            ),
            entries=tuple(entries),
            notes=info.notes,
            world_up="z" if reader.world_up == "z" else "unknown",
            world_up_detail=f"ingest made it so: {info.gravity.method}: {info.gravity.detail}",
            label_table=info.label_table,
            has_labels="labels" in reader.streams,
            damage=info.damage,
            other_cameras=info.other_cameras,
            close=reader.close,
        )
    except BaseException:
        reader.close()
        raise


def _loader(reader: FrameReader, index: int, streams: tuple[str, ...]) -> Callable[[], LoadedFrame]:
    def load() -> LoadedFrame:
        frame = reader.read(index, streams)
        if frame.color is None and frame.depth is None:
            raise Unusable("no_pictures")
        depth = None if frame.depth is None else depth_to_millimetres(frame.depth)
        return LoadedFrame(frame.color, depth, right=frame.right)

    return load
