"""MCAP logs with Foxglove messages: association, transform tree, encodings, calibration."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.schemas.sequence import LabelEntry
from scenewright.stages.kit.formats.frames import FrameReader, FrameWriter
from scenewright.stages.kit.formats.trajectories import read_tum
from scenewright.stages.kit.geometry.transforms import inverse, transform_from_yaw

from tests.real_data import real_data
from tests.unit.ingest.foxglove_logs import (
    CompressionType,
    IndexType,
    LogWriter,
    calibration,
    compressed,
    pose_in_frame,
    raw,
    transform,
    write_simple_log,
)
from tests.unit.ingest.running import ingest
from tests.unit.ingest.tiny_room import CAMERA, color_image, frames, jpeg, millimetres, png, write_seven_scenes

SECOND = 1_000_000_000


def _check_frames(sequence, recorded: list, world_from_log: np.ndarray | None = None) -> None:
    lift = np.eye(4) if world_from_log is None else world_from_log
    with FrameReader(sequence.path("frames.mcap")) as reader:
        assert len(reader) == len(recorded)
        for frame, (color, depth, pose) in zip(reader.frames(), recorded, strict=True):
            np.testing.assert_allclose(frame.depth, depth, atol=0.00051)
            assert np.abs(frame.color.astype(int) - color).max() < 12
            np.testing.assert_allclose(frame.world_from_camera, lift @ pose, atol=1e-9)


def test_ingested_seven_scenes_ingests_again_to_the_same(tmp_path: Path) -> None:
    first = ingest(write_seven_scenes(tmp_path / "log", frames(6)), tmp_path / "a")
    second = ingest(first.path("frames.mcap"), tmp_path / "b")
    assert second.info.source_format == "mcap"
    assert second.info.gravity.method == "given" and "metadata" in second.info.gravity.detail
    assert second.info.camera == first.info.camera
    assert second.info.color_depth_registered is first.info.color_depth_registered  # kept in the file
    _same_frames(first, second)


def _same_frames(first, second) -> None:
    a, b = read_tum(first.path("trajectory.tum")), read_tum(second.path("trajectory.tum"))
    np.testing.assert_allclose(a[0], b[0], atol=2e-9)
    np.testing.assert_allclose(a[1], b[1], atol=2e-9)
    with FrameReader(first.path("frames.mcap")) as one, FrameReader(second.path("frames.mcap")) as two:
        assert len(one) == len(two) > 0
        for index in range(len(one)):
            assert one.encoded(index) == two.encoded(index)  # no second JPEG generation
            left, right = one.read(index), two.read(index)
            np.testing.assert_array_equal(left.depth, right.depth)
            np.testing.assert_allclose(left.world_from_camera, right.world_from_camera, atol=1e-12)


def test_real_kitchen_as_mcap_is_the_same_kitchen(tmp_path: Path) -> None:
    first = ingest(real_data("7scenes_redkitchen"), tmp_path / "a", every=100)
    _same_frames(first, ingest(first.path("frames.mcap"), tmp_path / "b"))


def test_generated_log_states_up_and_what_labels_mean(tmp_path: Path) -> None:
    recorded = frames(3)
    table = [LabelEntry(instance=7, class_name="table"), LabelEntry(instance=10, class_name="floor")]
    with FrameWriter(tmp_path / "log.mcap", CAMERA, labels=True, label_table=table) as writer:
        for index, (color, depth, pose) in enumerate(recorded):
            writer.write(index / 10, color, depth, pose, np.where(depth > 2, 7, 300).astype(np.uint16))
    sequence = ingest(tmp_path / "log.mcap", tmp_path / "out")
    assert sequence.info.label_table == tuple(table)
    assert sequence.info.streams == ("color", "depth", "labels", "pose")
    assert sequence.info.gravity.method == "given"
    with FrameReader(sequence.path("frames.mcap")) as reader:
        assert reader.label_table == tuple(table)
        for frame, (_, depth, pose) in zip(reader.frames(), recorded, strict=True):
            np.testing.assert_array_equal(frame.labels, np.where(depth > 2, 7, 300))
            np.testing.assert_allclose(frame.world_from_camera, pose, atol=1e-12)


@pytest.mark.parametrize(
    "options",
    [
        {"compression": CompressionType.NONE},
        {"compression": CompressionType.LZ4},
        {"use_chunking": False},
        {"chunk_size": 1000},
        {"index_types": IndexType.NONE, "repeat_channels": False, "repeat_schemas": False, "use_statistics": False},
    ],
    ids=["none", "lz4", "unchunked", "small-chunks", "no-summary"],
)
def test_every_kind_of_mcap_container(tmp_path: Path, options: dict) -> None:
    recorded = frames(3)
    log = write_simple_log(tmp_path / "log.mcap", recorded, **options)
    sequence = ingest(log, tmp_path / "out", gravity="none")
    assert sequence.info.drops == {}
    _check_frames(sequence, recorded)


def test_foreign_log_does_not_state_gravity(tmp_path: Path) -> None:
    sequence = ingest(write_simple_log(tmp_path / "log.mcap", frames(6)), tmp_path / "out")
    assert sequence.info.gravity.method == "floor_plane"
    assert "'map'" in sequence.info.rule and "/rgb/image" in sequence.info.rule


def test_poses_go_through_the_tree_and_are_interpolated(tmp_path: Path) -> None:
    """map -> base moves (samples between the images), base -> optical is static and off the base."""
    mount = transform_from_yaw(0.3, np.array([0.1, -0.2, 1.2]))
    recorded = frames(4)
    with LogWriter(tmp_path / "log.mcap") as log:
        log.write("/tf_static", transform(0, "base", "optical", mount), 0)
        for tenth in range(0, 11):
            moved = transform_from_yaw(0.05 * tenth, np.array([0.1 * tenth, 0, 0]))
            log.write("/tf", transform(tenth * SECOND // 10, "map", "base", moved), tenth * SECOND // 10)
        for index, (color, depth, _) in enumerate(recorded):
            stamp = SECOND // 20 + index * SECOND // 5
            log.write("/info", calibration(stamp), stamp)
            log.write("/color", compressed(stamp, jpeg(color)), stamp)
            log.write("/depth", raw(stamp, depth.astype("<f4"), "32FC1"), stamp)
    sequence = ingest(tmp_path / "log.mcap", tmp_path / "out", gravity="none")
    assert sequence.info.frame_count == 4
    with FrameReader(sequence.path("frames.mcap")) as reader:
        for index, frame in enumerate(reader.frames()):
            tenth = 0.5 + 2 * index
            moved = transform_from_yaw(0.05 * tenth, np.array([0.1 * tenth, 0, 0]))
            np.testing.assert_allclose(frame.world_from_camera, moved @ mount, atol=1e-9)
    base = ingest(tmp_path / "log.mcap", tmp_path / "out2", gravity="none", world_frame="base")
    with FrameReader(base.path("frames.mcap")) as reader:
        np.testing.assert_allclose(reader.read(2).world_from_camera, mount, atol=1e-9)
    with pytest.raises(BadInput, match="frames: base, map, optical"):
        ingest(tmp_path / "log.mcap", tmp_path / "out3", world_frame="odom")


def test_header_stamps_count_not_log_times(tmp_path: Path) -> None:
    """Depth arrives 100 s late in the log, 5 ms off by its header, and in another order."""
    recorded = frames(3)
    with LogWriter(tmp_path / "log.mcap") as log:
        for index, (color, _, pose) in enumerate(recorded):
            stamp = SECOND + index * SECOND // 10
            log.write("/tf", transform(stamp + 5_000_000, "map", "optical", pose), stamp)
            log.write("/color", compressed(stamp, jpeg(color)), stamp)
        for index in (2, 0, 1):
            stamp = SECOND + index * SECOND // 10 + 5_000_000
            log.write("/info", calibration(stamp), stamp + 100 * SECOND)
            log.write("/depth", raw(stamp, millimetres(recorded[index][1]), "16UC1"), stamp + 100 * SECOND)
    sequence = ingest(tmp_path / "log.mcap", tmp_path / "out", gravity="none")
    _check_frames(sequence, recorded)
    np.testing.assert_allclose(read_tum(sequence.path("trajectory.tum"))[0], [1.005, 1.105, 1.205], atol=1e-6)
    strict = ingest(tmp_path / "log.mcap", tmp_path / "out2", maximum_time_difference=0.004)
    assert strict.outcome == "empty" and strict.info.drops == {"no_depth_within_tolerance": 3}


def test_frames_without_partner_pose_or_of_their_own_stamp_are_counted(tmp_path: Path) -> None:
    recorded = frames(8)
    with LogWriter(tmp_path / "log.mcap") as log:
        for index, (color, depth, pose) in enumerate(recorded):
            stamp = SECOND + index * SECOND
            log.write("/info", calibration(stamp), stamp)
            log.write("/color", compressed(stamp, jpeg(color)), stamp)
            if index == 1:
                log.write("/color", compressed(stamp, jpeg(color)), stamp)
            if index != 2:
                log.write("/depth", raw(stamp, millimetres(depth), "16UC1"), stamp)
            if index == 3:
                continue  # a gap in the transforms around this frame
            log.write("/tf", transform(stamp, "map", "optical", pose), stamp)
        log.write("/depth", raw(60 * SECOND, millimetres(recorded[0][1]), "16UC1"), 60 * SECOND)
    sequence = ingest(tmp_path / "log.mcap", tmp_path / "out")
    assert sequence.info.drops == {"duplicate_stamp": 1, "missing_pose": 1, "no_depth_within_tolerance": 1}
    assert sequence.info.frames_in_log == 9 and sequence.info.frame_count == 6
    assert "1 depth images without a colour image" in " ".join(sequence.info.notes)
    wide = ingest(tmp_path / "log.mcap", tmp_path / "out2", maximum_transform_gap=3.0)
    assert "missing_pose" not in wide.info.drops


@pytest.mark.parametrize(
    ("encoding", "channels"),
    [("rgb8", [0, 1, 2]), ("bgr8", [2, 1, 0]), ("rgba8", [0, 1, 2, 0]), ("bgra8", [2, 1, 0, 0])],
)
def test_raw_colour_encodings_with_row_padding(tmp_path: Path, encoding: str, channels: list[int]) -> None:
    recorded = frames(1)
    with LogWriter(tmp_path / "log.mcap") as log:
        log.write("/info", calibration(SECOND), SECOND)
        log.write("/color", raw(SECOND, recorded[0][0][..., channels], encoding, padding=7), SECOND)
        log.write("/depth", raw(SECOND, millimetres(recorded[0][1]), "mono16", padding=6), SECOND)
        log.write("/pose", pose_in_frame(SECOND, "map", recorded[0][2]), SECOND)
    sequence = ingest(tmp_path / "log.mcap", tmp_path / "out", gravity="none")
    _check_frames(sequence, recorded)
    assert "PoseInFrame" in " ".join(sequence.info.notes)


def test_compressed_png_depth_and_colour(tmp_path: Path) -> None:
    recorded = frames(2)
    with LogWriter(tmp_path / "log.mcap") as log:
        for index, (color, depth, pose) in enumerate(recorded):
            stamp = SECOND * (index + 1)
            log.write("/info", calibration(stamp), stamp)
            log.write("/tf", transform(stamp, "map", "optical", pose), stamp)
            log.write("/cam/color", compressed(stamp, png(color), kind="png"), stamp)
            log.write("/cam/depth", compressed(stamp, png(millimetres(depth)), kind="png"), stamp)
    _check_frames(ingest(tmp_path / "log.mcap", tmp_path / "out", gravity="none"), recorded)


def test_lens_distortion_is_undone(tmp_path: Path) -> None:
    """A grid that is straight in the world and bent in the image becomes straight."""
    matrix = np.array([[CAMERA.fx, 0, CAMERA.cx], [0, CAMERA.fy, CAMERA.cy], [0, 0, 1]])
    coefficients = np.array([-0.3, 0.05, 0, 0, 0])
    v, u = np.mgrid[: CAMERA.height, : CAMERA.width].astype(np.float32)
    ideal = cv2.undistortPoints(np.stack([u, v], -1).reshape(-1, 1, 2), matrix, coefficients, P=matrix)
    column = ideal.reshape(CAMERA.height, CAMERA.width, 2)[..., 0]
    bent_color = np.repeat(np.where(column < 20, 250, 5).astype(np.uint8)[..., None], 3, axis=-1)
    bent_depth = np.where(column < 20, 1000, 3000).astype(np.uint16)
    with LogWriter(tmp_path / "log.mcap") as log:
        log.write("/info", calibration(SECOND, D=list(coefficients)), SECOND)
        log.write("/color", compressed(SECOND, jpeg(bent_color)), SECOND)
        log.write("/depth", raw(SECOND, bent_depth, "16UC1"), SECOND)
    sequence = ingest(tmp_path / "log.mcap", tmp_path / "out")
    assert "distortion (plumb_bob) undone" in " ".join(sequence.info.notes)
    with FrameReader(sequence.path("frames.mcap")) as reader:
        frame = reader.read(0)
    inner = slice(6, -6)
    assert set(np.unique(frame.depth[inner])) <= {np.float32(0), np.float32(1), np.float32(3)}
    edges = (frame.depth[inner] == 1).sum(axis=1)
    assert np.ptp(edges) <= 1 and abs(edges.mean() - 20) <= 1
    assert np.ptp((bent_depth[inner] == 1000).sum(axis=1)) >= 2  # it was bent before
    assert frame.color[36, 15].min() > 200 and frame.color[36, 25].max() < 60


def test_calibration_of_the_depth_frame_wins_and_is_scaled(tmp_path: Path) -> None:
    recorded = frames(1)
    with LogWriter(tmp_path / "log.mcap") as log:
        log.write("/a/info", calibration(SECOND, frame="other", K=[999, 0, 1, 0, 999, 1, 0, 0, 1]), SECOND)
        doubled = [2 * CAMERA.fx, 0, 2 * CAMERA.cx + 0.5, 0, 2 * CAMERA.fy, 2 * CAMERA.cy + 0.5, 0, 0, 1]
        log.write("/b/info", calibration(SECOND, width=192, height=144, K=doubled), SECOND)
        log.write("/color", compressed(SECOND, jpeg(recorded[0][0])), SECOND)
        log.write("/depth", raw(SECOND, millimetres(recorded[0][1]), "16UC1"), SECOND)
    info = ingest(tmp_path / "log.mcap", tmp_path / "out").info
    assert info.camera == CAMERA
    assert "scaled" in " ".join(info.notes) and "/b/info" in " ".join(info.notes)


def test_different_optical_frames_are_said_not_to_be_registered(tmp_path: Path) -> None:
    recorded = frames(1)
    offset = transform_from_yaw(0.0, np.array([0.05, 0, 0]))
    for name, mount, registered in (("apart", offset, False), ("same", np.eye(4), True)):
        with LogWriter(tmp_path / f"{name}.mcap") as log:
            log.write("/tf_static", transform(0, "depth_optical", "color_optical", mount), 0)
            log.write("/tf", transform(SECOND, "map", "depth_optical", recorded[0][2]), SECOND)
            log.write("/info", calibration(SECOND, frame="depth_optical"), SECOND)
            log.write("/color", compressed(SECOND, jpeg(recorded[0][0]), frame="color_optical"), SECOND)
            log.write("/depth", raw(SECOND, millimetres(recorded[0][1]), "16UC1", frame="depth_optical"), SECOND)
        sequence = ingest(tmp_path / f"{name}.mcap", tmp_path / name, gravity="none")
        assert sequence.info.color_depth_registered is registered
        _check_frames(sequence, recorded)


def test_topics_can_be_chosen(tmp_path: Path) -> None:
    color, depth, pose = frames(1)[0]
    with LogWriter(tmp_path / "log.mcap") as log:
        log.write("/info", calibration(SECOND), SECOND)
        log.write("/tf", transform(SECOND, "map", "optical", pose), SECOND)
        log.write("/a/rgb", compressed(SECOND, jpeg(color_image(20))), SECOND)
        log.write("/b/rgb", compressed(SECOND, jpeg(color)), SECOND)
        log.write("/depth", raw(SECOND, millimetres(depth), "16UC1"), SECOND)
    chosen = ingest(tmp_path / "log.mcap", tmp_path / "a", gravity="none", color_topic="/b/rgb")
    _check_frames(chosen, [(color, depth, pose)])
    assert "colour from /a/rgb" in ingest(tmp_path / "log.mcap", tmp_path / "b").info.rule
    with pytest.raises(BadInput, match="/c/rgb"):
        ingest(tmp_path / "log.mcap", tmp_path / "c", color_topic="/c/rgb")


def test_memory_stays_flat(tmp_path: Path) -> None:
    """The chunks kept unpacked do not grow with the log."""
    from scenewright.stages.ingest.messages.mcap_log import McapLog

    with McapLog(write_simple_log(tmp_path / "log.mcap", frames(12), chunk_size=1000)) as log:
        places = [message.location for message in log.messages()]
        for place in places:
            log.fetch(place)
        assert len(log._cache) <= 4 < len({place.chunk for place in places})


def test_inverse_of_a_chain_is_looked_up(tmp_path: Path) -> None:
    from scenewright.stages.ingest.transform_tree import TransformTree

    tree = TransformTree()
    first, second = transform_from_yaw(0.4, np.array([1.0, 2, 3])), transform_from_yaw(-1.0, np.array([0, 0, 1.0]))
    tree.add("a", "b", 0, first)
    tree.add("a", "c", 0, second)
    found = tree.lookup("c", "b", 5, gap=10, tolerance=10)
    np.testing.assert_allclose(found, inverse(second) @ first, atol=1e-12)
    with pytest.raises(BadInput, match="not connected"):
        tree.lookup("c", "z", 5, gap=10, tolerance=10)
