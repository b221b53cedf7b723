"""Small sequences to export, and what an export is compared with."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from scenewright.schemas.exported_sequence import ExportedSequence
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.segments import Segments
from scenewright.schemas.sequence import Gravity, LabelEntry, Sequence, SequenceCamera, SequenceFile
from scenewright.stages.export.parameters import ExportParameters
from scenewright.stages.export.stage import run
from scenewright.stages.kit.formats.frames import FrameReader, FrameWriter
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context

from tests.unit.ingest.tiny_room import CAMERA, camera_poses, color_image, jpeg, png, room_depth

OTHER = Camera(width=64, height=48, fx=60.0, fy=61.0, cx=31.0, cy=24.5)
LABELS = (LabelEntry(instance=3, class_name="table"),)


def write_sequence(
    root: Path,
    count: int = 5,
    *,
    cameras: dict[str, Camera] | None = None,
    start: float = 1.7e9 + 0.123456,
    baseline: float | None = None,
    labels: bool = False,
    without: dict[int, tuple[str, ...]] | None = None,
    registered: bool = True,
    picture: Any = jpeg,
) -> Sequence:
    """Write a sequence; the cameras take turns, frame 0 has depth up to 20 m. `without`: frame -> streams it lacks."""
    root.mkdir(parents=True)
    cameras = cameras or {"camera": CAMERA}
    names = list(cameras)
    baselines = {} if baseline is None else {names[0]: baseline}
    streams = {"color", "depth", "pose"} | ({"labels"} if labels else set()) | ({"right"} if baseline else set())
    with FrameWriter(
        root / "frames.mcap",
        cameras[names[0]],
        labels=labels,
        cameras=cameras,
        baselines=baselines,
        label_table=LABELS if labels else (),
        registered=registered,
    ) as writer:
        for index, pose in enumerate(camera_poses(count)):
            name = names[index % len(names)]
            camera = cameras[name]
            depth = room_depth(camera, pose)
            if index == 0:
                depth[0, :3] = [13.106, 13.107, 20.0]
            lacking = (without or {}).get(index, ())
            writer.write(
                start + 0.1 * index,
                None if "color" in lacking else picture(color_image(index, camera)),
                None if "depth" in lacking else depth,
                None if "pose" in lacking else pose,
                np.full(depth.shape, 3, np.uint16) if labels else None,
                right=picture(color_image(index + 1, camera)) if name in baselines else None,
                camera_name=name,
            )
    SequenceFile(
        source_format="test",
        rule="written by a test",
        camera=cameras[names[0]],
        cameras=tuple(
            SequenceCamera(name=name, camera=camera, baseline=baselines.get(name)) for name, camera in cameras.items()
        ),
        streams=tuple(sorted(streams)),
        frame_count=count,
        frames_in_log=count,
        gravity=Gravity(method="given", world_from_log=np.eye(4).tolist()),
        label_table=LABELS if labels else (),
        color_depth_registered=registered,
    ).write(root / "sequence.json")
    return Sequence(root)


def export(sequence: Sequence, output: Path, segments: Segments | None = None, **options: Any) -> ExportedSequence:
    """Export a sequence into a new folder."""
    output.mkdir(parents=True)
    context = Context(output=output, seed=0, device="cpu", progress=SilentProgress())
    return run(sequence, segments, parameters=ExportParameters(**options), context=context)


def assert_same_frames(
    first: Path, again: Path, *, deepest: float | None = None, streams: tuple[str, ...] = ("depth",), named: bool = True
) -> None:
    """Compare two frames.mcap: poses (1e-6), depth to the last unit up to `deepest` [m], pictures by bytes; with
    `named` also times (1e-6 s) and names of cameras."""
    with FrameReader(first) as one, FrameReader(again) as two:
        assert len(one) == len(two) > 0
        assert len(one.cameras) == len(two.cameras)
        if named:
            np.testing.assert_allclose(one.times, two.times, atol=1e-6, rtol=0)
            assert list(one.cameras) == list(two.cameras)
        for index in range(len(one)):
            old, new = one.read(index, streams), two.read(index, streams)
            assert old.camera_name == new.camera_name or not named
            camera, other = one.cameras[old.camera_name], two.cameras[new.camera_name]
            assert (camera.width, camera.height) == (other.width, other.height)
            np.testing.assert_allclose(
                [camera.fx, camera.fy, camera.cx, camera.cy], [other.fx, other.fy, other.cx, other.cy], rtol=1e-12
            )
            assert (old.world_from_camera is None) == (new.world_from_camera is None)
            if old.world_from_camera is not None:
                np.testing.assert_allclose(old.world_from_camera, new.world_from_camera, atol=1e-6)
            assert one.encoded(index) == two.encoded(index)
            assert one.encoded(index, "right") == two.encoded(index, "right")
            for stream in streams:
                expected, found = getattr(old, stream), getattr(new, stream)
                if stream == "depth" and deepest is not None and expected is not None:
                    expected = np.where(expected > deepest, 0, expected)
                np.testing.assert_array_equal(expected, found)


__all__ = ["CAMERA", "LABELS", "OTHER", "png"]
