"""MCAP with Foxglove protobuf messages: what Foxglove, Rerun and our own `ingest` open."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from schemas.scene_parts import Camera
from schemas.sequence import SequenceFile
from stages.export.frames import ExportFrame, Tally
from stages.kit.formats.frames import FrameWriter

STREAMS = ("color", "depth", "right", "labels", "pose")


def write_foxglove_log(
    path: Path,
    frames: Iterable[ExportFrame],
    cameras: Mapping[str, Camera],
    info: SequenceFile,
    world_up: str,
    tally: Tally,
) -> None:
    """Write the frames to an MCAP file laid out like `frames.mcap` of a sequence."""
    baselines = {known.name: known.baseline for known in info.cameras if known.baseline is not None}
    with FrameWriter(
        path,
        next(iter(cameras.values())),
        labels="labels" in info.streams,
        world_up="z" if world_up == "z" else "unknown",
        registered=info.color_depth_registered,
        label_table=info.label_table,
        cameras=cameras,
        baselines={name: baselines[name] for name in cameras if name in baselines},
    ) as writer:
        for frame in frames:
            values = {
                "color": frame.color, "depth": frame.depth, "right": frame.right, "labels": frame.labels,
                "pose": frame.world_from_camera,
            }  # fmt: skip
            tally.streams |= {stream for stream, value in values.items() if value is not None}
            writer.write(
                frame.stamp * 1e-9,
                frame.color,
                frame.depth,
                frame.world_from_camera,
                frame.labels,
                right=frame.right,
                camera_name=frame.camera_name,
            )
            tally.frames += 1
