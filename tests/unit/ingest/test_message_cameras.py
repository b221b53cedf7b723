"""Which topics make a camera, what it is called, and which one is used."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest.messages.topic_names import (
    calibration_names,
    camera_names,
    is_rectified,
    is_registered,
    other_side,
    place,
)
from scenewright.stages.kit.formats.frames import FrameReader, FrameWriter
from scenewright.stages.kit.geometry.transforms import transform_from_yaw

from tests.unit.ingest.message_logs import FIRST, SECOND, record_room, recorder
from tests.unit.ingest.running import ingest
from tests.unit.ingest.tiny_room import CAMERA, color_image, frames, jpeg, millimetres

FRONT, REAR = np.eye(4), transform_from_yaw(np.pi, np.array([-0.3, 0, 0]))


@pytest.mark.parametrize(
    ("topic", "expected"),
    [
        ("/camera/color/image_raw", ("camera",)),
        ("/camera/aligned_depth_to_color/image_raw/compressedDepth", ("camera",)),
        ("/camera/infra1/image_rect_raw", ("camera", "infra1")),
        ("/robot/cam_front/depth/image_rect_raw", ("robot", "cam_front")),
        ("/kinect2/qhd/image_depth_rect", ("kinect2", "qhd")),
        ("/zed/zed_node/left/image_rect_color", ("zed", "zed_node", "left")),
        ("/depth_to_rgb/image_raw", ()),
        ("/rgb/image_raw/compressed", ()),
        ("/device_0/sensor_1/Color_0/image/data", ("device_0",)),
        ("/device_0/sensor_0/Infrared_2/image/data", ("device_0", "infrared_2")),
        ("/kitti/camera_color_left/image_raw", ("kitti", "camera_left")),
    ],
)
def test_what_of_a_topic_names_the_device(topic: str, expected: tuple[str, ...]) -> None:
    assert place(topic) == expected


def test_words_of_topics() -> None:
    assert is_rectified("/a/image_rect") and is_rectified("/a/image_rect_color/compressed")
    assert not is_rectified("/correct/image_raw")
    assert is_registered("/camera/aligned_depth_to_color/image_raw") and is_registered("/depth_to_rgb/image_raw")
    assert is_registered("/camera/depth_registered/image") and not is_registered("/camera/depth/image_raw")
    assert other_side("/stereo/right/image_raw", left=True) == ["/stereo/left/image_raw"]
    assert other_side("/camera/infra1/image_rect_raw", left=False) == ["/camera/infra2/image_rect_raw"]
    assert other_side("/bright/image", left=True) == []
    assert "/camera/color/camera_info" in calibration_names("/camera/color/image_raw/compressed")
    assert "/device_0/sensor_1/Color_0/info/camera_info" in calibration_names("/device_0/sensor_1/Color_0/image/data")


def test_names_of_cameras() -> None:
    assert camera_names([("camera",)], ["color"]) == ["camera"]
    assert camera_names([("robot", "front"), ("robot", "rear")], ["color"] * 2) == ["front", "rear"]
    assert camera_names([("camera",), ("camera", "infra1")], ["color"] * 2) == ["color", "infra1"]
    assert camera_names([(), ()], ["color", "color"]) == ["color", "color_2"]
    assert camera_names([("a-b.c",), ("ä",)], ["color"] * 2) == ["a_b_c", "color"]


def _two(log: Any, count: int = 3) -> list:
    """Front and rear RGB-D cameras on one robot, triggered together."""
    recorded = frames(count)
    for name, mount in (("front", FRONT), ("rear", REAR)):
        log.transform("/tf_static", FIRST, "base", f"{name}_optical", mount)
    for index, (color, depth, pose) in enumerate(recorded):
        stamp = FIRST + index * SECOND
        log.transform("/tf", stamp, "odom", "base", pose)
        for name in ("front", "rear"):
            if name == "rear" and index == count - 1:
                continue
            log.info(f"/robot/{name}/color/camera_info", stamp, f"{name}_optical")
            log.info(f"/robot/{name}/depth/camera_info", stamp, f"{name}_optical")
            log.compressed(f"/robot/{name}/color/image_raw/compressed", stamp, jpeg(color), "jpeg", f"{name}_optical")
            log.image(f"/robot/{name}/depth/image_raw", stamp, millimetres(depth), "16UC1", f"{name}_optical")
    return recorded


def test_the_most_complete_camera_is_used_and_the_others_named(tmp_path: Path) -> None:
    with recorder(tmp_path) as log:
        recorded = _two(log)
    info = ingest(log.path, tmp_path / "out", gravity="none").info
    assert [known.name for known in info.cameras] == ["front"] and info.other_cameras == ("rear",)
    assert info.frame_count == 3 and any("--camera NAME" in note for note in info.notes)
    rear = ingest(log.path, tmp_path / "rear", gravity="none", camera=("rear",))
    assert rear.info.frame_count == 2
    with FrameReader(rear.path("frames.mcap")) as reader:
        np.testing.assert_allclose(reader.read(1).world_from_camera, recorded[1][2] @ REAR, atol=1e-6)
    with pytest.raises(BadInput, match="no camera 'left'.*cameras: front, rear"):
        ingest(log.path, tmp_path / "none", camera=("left",))


@pytest.mark.parametrize("names", [("all",), ("rear", "front")])
def test_several_cameras_at_once(tmp_path: Path, names: tuple[str, ...]) -> None:
    with recorder(tmp_path) as log:
        recorded = _two(log)
    sequence = ingest(log.path, tmp_path / "out", gravity="none", camera=names)
    info = sequence.info
    first = "front" if names == ("all",) else "rear"
    assert info.cameras[0].name == first and info.frame_count == 5 and info.other_cameras == ()
    with FrameReader(sequence.path("frames.mcap")) as reader:
        for frame in reader.frames(("color", "depth")):
            index = int(frame.time - FIRST / SECOND + 0.001)
            mount = FRONT if frame.camera_name == "front" else REAR
            np.testing.assert_allclose(frame.world_from_camera, recorded[index][2] @ mount, atol=1e-6)
    # Written by us and read again, the cameras keep their names.
    again = ingest(sequence.path("frames.mcap"), tmp_path / "again", camera=("all",))
    assert {known.name: known.frame_count for known in again.info.cameras} == {"front": 3, "rear": 2}


def test_our_own_stereo_sequences_are_read_again(tmp_path: Path) -> None:
    with FrameWriter(tmp_path / "log.mcap", CAMERA, baselines={"camera": 0.12}) as writer:
        for index, (color, depth, pose) in enumerate(frames(3)):
            writer.write(index * 0.1, jpeg(color), depth, pose, right=jpeg(np.roll(color, 5, axis=1)))
    sequence = ingest(tmp_path / "log.mcap", tmp_path / "out")
    assert sequence.info.streams == ("color", "depth", "right", "pose")
    assert sequence.info.cameras[0].baseline == pytest.approx(0.12)
    with FrameReader(tmp_path / "log.mcap") as first, FrameReader(sequence.path("frames.mcap")) as second:
        for index in range(3):
            assert first.encoded(index, "right") == second.encoded(index, "right")
            np.testing.assert_array_equal(first.read(index).depth, second.read(index).depth)


def test_depth_aligned_to_colour_comes_before_raw_depth(tmp_path: Path) -> None:
    with recorder(tmp_path) as log:
        record_room(log, frames(2))
        for index in range(2):
            stamp = FIRST + index * SECOND // 10
            log.info("/camera/depth/camera_info", stamp, "camera_depth_optical", CAMERA.model_copy(update={"fx": 60.0}))
            log.image("/camera/depth/image_rect_raw", stamp, np.full((72, 96), 900, np.uint16), "16UC1", "camera_depth")
    info = ingest(log.path, tmp_path / "out", gravity="none").info
    assert "depth from /camera/aligned_depth_to_color/image_raw" in info.rule and info.frame_count == 2
    assert any("not used: /camera/depth/image_rect_raw" in note for note in info.notes)
    with pytest.raises(BadInput, match="no camera calibration for /camera/depth/image_rect_raw|nothing says"):
        asked = ingest(log.path, tmp_path / "raw", depth_topic="/camera/depth/image_rect_raw", gravity="none")
        assert not asked.info.color_depth_registered
        raise BadInput("nothing says")


def test_colour_is_preferred_to_infrared_and_a_pair_of_eyes_can_be_chosen(tmp_path: Path) -> None:
    """A RealSense with everything on: colour with aligned depth, and two infrared eyes."""
    eyes = "camera_infra_optical"
    with recorder(tmp_path) as log:
        recorded = frames(2)
        record_room(log, recorded)
        log.transform("/tf_static", FIRST, "camera_base", eyes, np.eye(4))
        for index, (color, _, _) in enumerate(recorded):
            stamp = FIRST + index * SECOND // 10
            for eye, x in ((1, 0.0), (2, 0.05)):
                projection = [80.0, 0, 47.5, -80.0 * x, 0, 80.0, 35.5, 0, 0, 0, 1.0, 0]
                log.info(f"/camera/infra{eye}/camera_info", stamp, eyes, P=projection)
                log.image(f"/camera/infra{eye}/image_rect_raw", stamp, color[..., 1].copy(), "mono8", eyes)
    info = ingest(log.path, tmp_path / "out", gravity="none").info
    assert info.cameras[0].name == "color" and info.other_cameras == ("infra1",)
    assert info.streams == ("color", "depth", "pose")
    pair = ingest(log.path, tmp_path / "pair", gravity="none", camera=("infra1",)).info
    assert pair.streams == ("color", "right", "pose") and pair.cameras[0].baseline == pytest.approx(0.05)


def test_uncalibrated_camera_is_said_to_be_one(tmp_path: Path) -> None:
    with recorder(tmp_path) as log:
        log.info("/cam/camera_info", FIRST, "f", K=[0.0] * 9, P=[0.0] * 12)
        log.compressed("/cam/image_raw/compressed", FIRST, jpeg(color_image(0)), "jpeg", "f")
    with pytest.raises(BadInput, match="topic /cam/camera_info: K = .*the camera is uncalibrated.*--fx"):
        ingest(log.path, tmp_path / "out")
    k = CAMERA
    assert ingest(log.path, tmp_path / "given", fx=k.fx, fy=k.fy, cx=k.cx, cy=k.cy).info.camera == k


def test_calibration_of_another_camera_is_not_taken(tmp_path: Path) -> None:
    with recorder(tmp_path) as log:
        log.info("/a/camera_info", FIRST, "a")
        log.compressed("/a/image_raw/compressed", FIRST, jpeg(color_image(0)), "jpeg", "a")
        log.compressed("/b/image_raw/compressed", FIRST, jpeg(color_image(1)), "jpeg", "b")
    assert ingest(log.path, tmp_path / "out").info.cameras[0].name == "a"
    with pytest.raises(BadInput, match="no camera calibration for /b/image_raw/compressed"):
        ingest(log.path, tmp_path / "b", camera=("b",))


def test_first_calibration_counts_when_it_changes(tmp_path: Path) -> None:
    zoomed = Camera(**(CAMERA.model_dump() | {"fx": 160.0, "fy": 160.0}))
    with recorder(tmp_path) as log:
        for index, camera in enumerate((CAMERA, CAMERA, zoomed)):
            stamp = FIRST + index * SECOND
            log.info("/a/camera_info", stamp, "a", camera)
            log.compressed("/a/image_raw/compressed", stamp, jpeg(color_image(0)), "jpeg", "a")
    info = ingest(log.path, tmp_path / "out").info
    assert info.camera == CAMERA and any("/a/camera_info changes within the log" in note for note in info.notes)


def test_names_and_topics_cannot_both_choose(tmp_path: Path) -> None:
    with recorder(tmp_path) as log:
        _two(log, 1)
    with pytest.raises(BadInput, match="by name or by topic"):
        ingest(log.path, tmp_path / "out", camera=("front",), color_topic="/robot/rear/color/image_raw/compressed")
