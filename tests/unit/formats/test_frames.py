"""Frames in MCAP: what is written is read, the same bytes each time, readable by the mcap package."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.sequence import LabelEntry
from scenewright.stages.kit.formats.foxglove import depth_to_millimetres, millimetres_to_depth
from scenewright.stages.kit.formats.frames import FrameReader, FrameWriter
from scenewright.stages.kit.geometry.transforms import transform_from_yaw

CAMERA = Camera(width=40, height=30, fx=50.0, fy=51.0, cx=19.5, cy=14.5)


def _write(path: Path, count: int = 5, **options) -> Path:
    with FrameWriter(path, CAMERA, labels=True, **options) as writer:
        for index in range(count):
            color = np.full((30, 40, 3), (200, 20 * index, 30), np.uint8)
            depth = np.full((30, 40), 1.0 + 0.1 * index, np.float32)
            depth[0, :4] = [0, np.nan, np.inf, 70]
            labels = np.full((30, 40), 60000 + index, np.uint16)
            writer.write(
                1.5 + index / 10, color, depth, transform_from_yaw(0.1 * index, np.array([index, 0, 1])), labels
            )
    return path


def test_what_is_written_is_read(tmp_path: Path) -> None:
    path = _write(tmp_path / "frames.mcap", label_table=[LabelEntry(instance=12, class_name="table")])
    with FrameReader(path) as reader:
        assert len(reader) == 5
        assert reader.camera == CAMERA
        assert reader.world_up == "z"
        assert reader.streams == ("color", "depth", "labels", "pose")
        assert reader.label_table == (LabelEntry(instance=12, class_name="table"),)
        np.testing.assert_allclose(reader.times, [1.5, 1.6, 1.7, 1.8, 1.9], atol=1e-12)
        for index, frame in enumerate(reader.frames()):
            assert frame.index == index
            assert np.abs(frame.color[10, 10].astype(int) - [200, 20 * index, 30]).max() <= 4
            assert frame.depth.dtype == np.float32
            assert frame.depth[5, 5] == np.float32(1.0 + 0.1 * index).round(3)
            np.testing.assert_array_equal(frame.depth[0, :4], 0)
            assert (frame.labels == 60000 + index).all()
            expected = transform_from_yaw(0.1 * index, np.array([index, 0, 1]))
            np.testing.assert_allclose(frame.world_from_camera, expected, atol=1e-12)


def test_only_asked_streams_are_decoded_and_random_access_agrees(tmp_path: Path) -> None:
    with FrameReader(_write(tmp_path / "frames.mcap")) as reader:
        depth_only = list(reader.frames(("depth",), every=2))
        assert [frame.index for frame in depth_only] == [0, 2, 4]
        assert depth_only[1].color is None and depth_only[1].labels is None
        np.testing.assert_array_equal(depth_only[1].depth, reader.read(2).depth)
        with pytest.raises(IndexError):
            reader.read(5)


def test_same_frames_same_bytes(tmp_path: Path) -> None:
    assert _write(tmp_path / "a").read_bytes() == _write(tmp_path / "b").read_bytes()
    assert _write(tmp_path / "c", count=4).read_bytes() != (tmp_path / "a").read_bytes()


def test_other_readers_understand_it(tmp_path: Path) -> None:
    path = _write(tmp_path / "frames.mcap")
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        seen = {}
        for schema, channel, message, body in reader.iter_decoded_messages():
            seen.setdefault(channel.topic, []).append((schema.name, body, message.log_time))
    assert {topic: rows[0][0] for topic, rows in seen.items()} == {
        "/camera/color": "foxglove.CompressedImage",
        "/camera/depth": "foxglove.RawImage",
        "/camera/labels": "foxglove.RawImage",
        "/camera/calibration": "foxglove.CameraCalibration",
        "/tf": "foxglove.FrameTransforms",
    }
    depth, log_time = seen["/camera/depth"][2][1:]
    assert (depth.encoding, depth.width, depth.height, depth.step) == ("16UC1", 40, 30, 80)
    assert depth.timestamp.ToNanoseconds() == log_time == 1_700_000_000
    assert int.from_bytes(depth.data[-2:], "little") == 1200
    transform = seen["/tf"][1][1].transforms[0]
    assert (transform.parent_frame_id, transform.child_frame_id, transform.translation.x) == ("world", "camera", 1.0)


def test_stored_jpeg_is_kept_as_it_is(tmp_path: Path) -> None:
    with FrameReader(_write(tmp_path / "a")) as reader:
        jpeg = reader.encoded(1)
    with FrameWriter(tmp_path / "b", CAMERA) as writer:
        writer.write(0.0, jpeg, None)
    with FrameReader(tmp_path / "b") as reader:
        assert reader.encoded(0) == jpeg
        frame = reader.read(0)
        assert frame.depth is None and frame.labels is None and frame.world_from_camera is None


def test_writer_refuses_what_makes_no_frame(tmp_path: Path) -> None:
    color, depth = np.zeros((30, 40, 3), np.uint8), np.ones((30, 40), np.float32)
    mirrored = np.diag([1.0, 1.0, -1.0, 1.0])
    with FrameWriter(tmp_path / "a", CAMERA) as writer:
        writer.write(1.0, color, depth)
        for time, c, d, pose, labels in [
            (1.0, color, depth, None, None),
            (2.0, color[:20], depth, None, None),
            (2.0, color.astype(float), depth, None, None),
            (2.0, color, depth.T, None, None),
            (2.0, color, depth, mirrored, None),
            (2.0, color, depth, None, np.zeros((30, 40), np.uint16)),
        ]:
            with pytest.raises(ValueError):
                writer.write(time, c, d, pose, labels)


def test_file_left_by_an_exception_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), FrameWriter(tmp_path / "a", CAMERA) as writer:
        writer.write(1.0, np.zeros((30, 40, 3), np.uint8), None)
        raise RuntimeError("killed")
    with pytest.raises(BadInput):
        FrameReader(tmp_path / "a")


def test_empty_sequence_can_be_read(tmp_path: Path) -> None:
    with FrameWriter(tmp_path / "a", CAMERA):
        pass
    with FrameReader(tmp_path / "a") as reader:
        assert len(reader) == 0 and list(reader.frames()) == [] and reader.streams == ()
        with pytest.raises(BadInput, match="no camera calibration"):
            _ = reader.camera


@settings(max_examples=50, deadline=None)
@given(arrays(np.uint16, (3, 4), elements=st.integers(0, 65535)))
def test_depth_in_millimetres_is_lossless(millimetres: np.ndarray) -> None:
    expected = np.where(millimetres == 65535, 0, millimetres)
    np.testing.assert_array_equal(depth_to_millimetres(millimetres_to_depth(millimetres)), expected)


@settings(max_examples=50, deadline=None)
@given(arrays(np.float32, (2, 3), elements=st.floats(width=32, allow_nan=True, allow_infinity=True)))
def test_depth_is_within_half_a_millimetre_or_invalid(depth: np.ndarray) -> None:
    stored = millimetres_to_depth(depth_to_millimetres(depth))
    kept = stored > 0
    assert (np.abs(stored[kept] - depth[kept]) <= 0.00051 + 1e-6 * depth[kept]).all()
    sensible = np.isfinite(depth) & (depth > 0.001) & (depth < 65.5)
    assert kept[sensible].all()


def test_several_cameras_and_stereo_pairs(tmp_path: Path) -> None:
    wide = Camera(width=20, height=10, fx=9.0, fy=9.5, cx=9.5, cy=4.5)
    path = tmp_path / "frames.mcap"
    left = cv2.imencode(".png", np.full((30, 40, 3), 7, np.uint8))[1].tobytes()
    with FrameWriter(path, CAMERA, cameras={"front": CAMERA, "wrist": wide}, baselines={"front": 0.12}) as writer:
        for index in range(3):
            pose = transform_from_yaw(0.1 * index, np.array([index, 0, 1]))
            right = np.full((30, 40, 3), 50 * index, np.uint8)
            writer.write(1.0 + index, left, None, pose, right=right, camera_name="front")
            writer.write(1.5 + index, None, np.full((10, 20), 2.0, np.float32), None, camera_name="wrist")
        with pytest.raises(ValueError, match="not announced"):
            writer.write(9.0, left, None, camera_name="rear")
        with pytest.raises(ValueError, match="no baseline"):
            writer.write(9.0, None, None, right=np.zeros((10, 20, 3), np.uint8), camera_name="wrist")
    with FrameReader(path) as reader:
        assert reader.cameras == {"front": CAMERA, "wrist": wide} and reader.camera == CAMERA
        assert reader.baselines == {"front": pytest.approx(0.12)}
        assert reader.streams == ("color", "depth", "right", "pose")
        frames = list(reader.frames(("color", "depth", "right")))
        assert [frame.camera_name for frame in frames] == ["front", "wrist"] * 3
        assert reader.encoded(0) == left and reader.encoded(1, "right") is None
        assert frames[0].depth is None and frames[1].color is None and frames[1].depth.shape == (10, 20)
        np.testing.assert_array_equal(frames[0].color, 7)
        assert frames[2].right.mean() == pytest.approx(50, abs=2)
        with pytest.raises(ValueError, match="no stream"):
            reader.read(0, ("colour",))


def test_cameras_need_plain_names(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="letters"):
        FrameWriter(tmp_path / "a", CAMERA, cameras={"../x": CAMERA})


def test_deviation_and_pictures_at_their_full_size(tmp_path: Path) -> None:
    full = Camera(width=120, height=90, fx=150.0, fy=153.0, cx=59.5, cy=44.5)
    path, deviation = tmp_path / "frames.mcap", np.arange(1200, dtype=np.float32).reshape(30, 40) / 1000
    picture = cv2.imencode(".png", np.full((90, 120, 3), 9, np.uint8))[1].tobytes()
    depth = np.full((30, 40), 2.0, np.float32)
    deviation[0, 1:5] = 1e-6, np.nan, np.inf, 7.0
    with FrameWriter(path, CAMERA, deviation=True, picture_cameras={"camera": full}) as writer:
        writer.write(1.0, None, depth, deviation=deviation, picture=picture)
        writer.write(2.0, None, depth)
        for wrong, reason in (
            ({"deviation": deviation - 1}, "negative"),
            ({"deviation": deviation[1:]}, "shape"),
            ({"picture": np.zeros((30, 40, 3), np.uint8)}, "shape"),
        ):
            with pytest.raises(ValueError, match=reason):
                writer.write(3.0, None, depth, **wrong)
    with FrameReader(path) as reader:
        assert reader.streams == ("depth", "deviation", "picture")
        assert reader.cameras == {"camera": CAMERA} and reader.picture_cameras == {"camera": full}
        first, second = reader.frames(("depth", "deviation", "picture"))
        assert first.deviation.dtype == np.float32 and first.picture.shape == (90, 120, 3)
        np.testing.assert_allclose(first.deviation[1:], deviation[1:], atol=5e-8)
        np.testing.assert_allclose(first.deviation[0, :6], [0, 1e-4, 0, 6.5535, 6.5535, 0.005])
        assert (first.picture == 9).all() and reader.encoded(0, "picture") == picture
        assert second.deviation is None and second.picture is None
    with FrameWriter(tmp_path / "plain", CAMERA) as writer, pytest.raises(ValueError, match="deviation=True"):
        writer.write(1.0, None, depth, deviation=deviation)
