"""Writing an MCAP file of Foxglove protobuf messages, laid out like `frames.mcap` of a sequence."""

from __future__ import annotations

from scenewright.stages.export.formats.foxglove import FORMAT
from scenewright.stages.export.frames import ExportJob
from scenewright.stages.kit.formats.frames import FrameWriter


def write(job: ExportJob) -> None:
    """Write the frames."""
    info, cameras, tally = job.info, job.cameras, job.tally
    baselines = {camera.name: camera.baseline for camera in info.cameras if camera.baseline is not None}
    with FrameWriter(
        job.root / FORMAT.log,
        next(iter(cameras.values())),
        labels="labels" in info.streams,
        world_up="z" if job.world_up == "z" else "unknown",
        registered=info.color_depth_registered,
        label_table=info.label_table,
        cameras=cameras,
        baselines={name: baselines[name] for name in cameras if name in baselines},
    ) as writer:
        for frame in job.frames:
            values = {
                "color": frame.color,
                "depth": frame.depth,
                "right": frame.right,
                "labels": frame.labels,
                "pose": frame.world_from_camera,
            }
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
