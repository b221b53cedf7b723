"""The same room through every container and dialect gives the same frames; real logs of other people."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.detection import open_log
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.geometry.transforms import inverse, transform_from_yaw

from tests.real_data import real_data
from tests.unit.ingest.message_logs import FIRST, RECORDERS, SECOND, record_room, recorder
from tests.unit.ingest.running import ingest
from tests.unit.ingest.tiny_room import CAMERA, frames, millimetres

MOUNT = transform_from_yaw(0.2, np.array([0.05, 0.1, -0.02]))


@pytest.mark.parametrize("dialect", RECORDERS)
def test_the_same_room_through_every_container_and_dialect(tmp_path: Path, dialect: str) -> None:
    recorded = frames(4)
    with recorder(tmp_path, dialect) as log:
        record_room(log, recorded, mount=MOUNT)
    sequence = ingest(log.path, tmp_path / "out", gravity="none")
    info = sequence.info
    assert (info.source_format, info.frame_count, info.drops) == (RECORDERS[dialect][2], 4, {})
    assert info.camera == CAMERA and info.color_depth_registered and info.damage == ()
    assert "'map'" in info.rule and "/camera/aligned_depth_to_color/image_raw" in info.rule
    with FrameReader(sequence.path("frames.mcap")) as reader:
        for frame, (color, depth, pose) in zip(reader.frames(), recorded, strict=True):
            np.testing.assert_array_equal(frame.depth, millimetres(depth) / np.float32(1000))
            np.testing.assert_allclose(frame.world_from_camera, pose, atol=1e-6)
            assert np.abs(frame.color.astype(int) - color).max() < 12
            assert abs(frame.time - (FIRST / SECOND + 0.1 * frame.index)) < 1e-6


@pytest.mark.parametrize("dialect", RECORDERS)
def test_odometry_joined_with_the_tree(tmp_path: Path, dialect: str) -> None:
    """No transform moves: odometry of the base and a static mount make the poses."""
    recorded = frames(3)
    with recorder(tmp_path, dialect) as log:
        record_room(log, recorded[:0], mount=MOUNT)
        for index, (_, depth, pose) in enumerate(recorded):
            stamp = FIRST + index * SECOND
            log.info("/camera/depth/camera_info", stamp, "camera_optical")
            log.image("/camera/depth/image_raw", stamp, depth, "32FC1", "camera_optical")
            log.odometry("/odom", stamp, "odom", "camera_base", pose @ inverse(MOUNT))
    sequence = ingest(log.path, tmp_path / "out", gravity="none")
    assert sequence.info.streams == ("depth", "pose") and "/odom ('camera_base')" in sequence.info.rule
    with FrameReader(sequence.path("frames.mcap")) as reader:
        for frame, (_, _, pose) in zip(reader.frames(), recorded, strict=True):
            np.testing.assert_allclose(frame.world_from_camera, pose, atol=1e-6)


def test_every_topic_is_listed_with_what_it_is(tmp_path: Path) -> None:
    with recorder(tmp_path) as log:
        record_room(log, frames(3))
        log.text("/chatter", FIRST, "hello")
        log.write_bytes("/video", "sensor_msgs/msg/CompressedImage", b"\0\1\0\0nonsense", FIRST)
    source = open_log(log.path, IngestParameters())
    streams = {stream.name: stream for stream in source.streams}
    roles = {name: stream.role for name, stream in streams.items()}
    assert roles["/camera/color/image_raw/compressed"] == "color"
    assert roles["/camera/aligned_depth_to_color/image_raw"] == "depth"
    assert roles["/camera/color/camera_info"] == "calibration"
    assert roles["/tf"] == roles["/tf_static"] == "transforms"
    assert roles["/chatter"] == "other" and "not used" in streams["/chatter"].detail
    assert streams["/chatter"].count == 1 and streams["/tf"].count == 3
    np.testing.assert_array_equal(streams["/tf"].stamps, FIRST + np.arange(3) * SECOND // 10)
    assert streams["/tf"].log_delay == 0.0
    assert any("1 of 1 messages of /video do not decode" in line for line in source.damage)
    source.close()


def test_real_sense_recording_registers_depth(tmp_path: Path) -> None:
    """The bag of the SDK: extrinsics on topics of their own, one frame id for all, colour 101 ms before depth."""
    log = real_data("logs") / "single_depth_color_640x480.bag"
    strict = ingest(log, tmp_path / "strict")
    assert strict.outcome == "empty" and strict.info.drops == {"no_depth_within_tolerance": 1}
    sequence = ingest(log, tmp_path / "out", maximum_time_difference=0.11)
    info = sequence.info
    assert info.frame_count == 1 and info.color_depth_registered and info.streams == ("color", "depth")
    assert abs(info.camera.fx - 613.2037) < 1e-3  # the colour camera's
    assert any("carried into the colour camera, 14.3 mm" in note for note in info.notes)
    with FrameReader(sequence.path("frames.mcap")) as reader:
        depth = reader.read(0).depth
    assert 0.3 < (depth > 0).mean() < 1 and 0.2 < np.median(depth[depth > 0]) < 5


def test_log_whose_calibration_is_of_another_shape(tmp_path: Path) -> None:
    """640x480 by the calibration, 520x360 by the images: refused, and read with intrinsics that are given. Every header
    stamp of this log is the same, so its log times are used."""
    log = real_data("logs") / "custom-camera-model.mcap"
    with pytest.raises(BadInput, match="/camera_calibration: is for 640x480, colour images are 520x360"):
        ingest(log, tmp_path / "refused")
    info = ingest(log, tmp_path / "out", fx=650.0, fy=650.0, cx=260.0, cy=180.0).info
    assert info.frame_count == 10 and info.streams == ("color",)
    assert (info.camera.fx, info.camera.width, info.camera.height) == (650.0, 520, 360)
    assert any("log times are used" in note for note in info.notes)


@pytest.mark.parametrize("name", ["example.mcap", "example.bag", "watercan.bag", "no-messages.bag", "rosbag2/talker"])
def test_logs_without_images_are_empty_and_list_their_topics(tmp_path: Path, name: str) -> None:
    sequence = ingest(real_data("logs") / name, tmp_path / "out")
    assert sequence.outcome == "empty"
    assert "no image messages" in " ".join(sequence.info.notes)
