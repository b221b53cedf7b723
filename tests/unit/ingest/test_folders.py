"""Folder logs: 7-Scenes, Redwood, posed images give the same frames; what was assumed is written down."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.folders.files import natural_key
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.formats.trajectories import read_tum

from tests.unit.ingest.running import ingest
from tests.unit.ingest.tiny_room import (
    CAMERA,
    frames,
    millimetres,
    png,
    write_posed_images,
    write_redwood,
    write_seven_scenes,
)

INTRINSICS = {"fx": CAMERA.fx, "fy": CAMERA.fy, "cx": CAMERA.cx, "cy": CAMERA.cy}
LAYOUTS = {
    "7scenes": (write_seven_scenes, {}),
    "redwood": (write_redwood, {}),
    "posed-images": (write_posed_images, INTRINSICS),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_frames_come_out_as_they_went_in(tmp_path: Path, layout: str) -> None:
    write, options = LAYOUTS[layout]
    recorded = frames(12)
    sequence = ingest(write(tmp_path / "log", recorded), tmp_path / "out", gravity="none", **options)
    assert sequence.outcome == "ok"
    info = sequence.info
    assert (info.source_format, info.frame_count, info.frames_in_log, info.drops) == (layout, 12, 12, {})
    assert info.camera == CAMERA
    assert info.streams == ("color", "depth", "pose")
    times, poses = read_tum(sequence.path("trajectory.tum"))
    np.testing.assert_allclose(times, np.arange(12) / 30, atol=1e-9)
    with FrameReader(sequence.path("frames.mcap")) as reader:
        assert reader.world_up == "unknown"
        for frame, (color, depth, pose) in zip(reader.frames(), recorded, strict=True):
            np.testing.assert_array_equal(frame.depth, millimetres(depth) / np.float32(1000))
            assert np.abs(frame.color.astype(int) - color).max() < 12  # JPEG; a swap of red and blue is > 100
            np.testing.assert_allclose(frame.world_from_camera, pose, atol=1e-6)
            np.testing.assert_allclose(frame.world_from_camera, poses[frame.index], atol=1e-8)


def test_without_colour_one_line_says_so(tmp_path: Path) -> None:
    log = write_posed_images(tmp_path / "log", frames(3))
    shutil.rmtree(log / "color")
    sequence = ingest(log, tmp_path / "out", **INTRINSICS)
    assert sequence.outcome == "ok" and sequence.info.streams == ("depth", "pose")
    (line,) = [note for note in sequence.info.notes if "no colour" in note]
    assert line.startswith("WARNING") and "shape" in line
    with FrameReader(sequence.path("frames.mcap")) as reader:
        assert reader.read(0).color is None and reader.read(0).depth is not None


def test_assumptions_are_recorded(tmp_path: Path) -> None:
    log = write_seven_scenes(tmp_path / "log", frames(2))
    notes = " | ".join(ingest(log, tmp_path / "a").info.notes)
    assert "depth unit assumed: 1/1000 m" in notes and "camera-intrinsics.txt" in notes
    notes = " | ".join(ingest(log, tmp_path / "b", depth_scale=2000.0, fx=70.0).info.notes)
    assert "depth unit given by option: 1/2000 m" in notes and "fx 70" in notes


def test_options_change_depth_and_intrinsics(tmp_path: Path) -> None:
    recorded = frames(2)
    log = write_seven_scenes(tmp_path / "log", recorded)
    sequence = ingest(log, tmp_path / "a", depth_scale=5000.0, fx=70.0, maximum_depth=0.5)
    assert sequence.info.camera == CAMERA.model_copy(update={"fx": 70.0})
    with FrameReader(sequence.path("frames.mcap")) as reader:
        depth = reader.read(0).depth
    expected = millimetres(recorded[0][1]) / 5000
    near = expected <= 0.499
    np.testing.assert_allclose(depth[near], expected[near], atol=0.00051)
    assert (depth[expected > 0.501] == 0).all() and (expected > 0.501).any() and near.any()


def test_missing_intrinsics_are_asked_for_not_guessed(tmp_path: Path) -> None:
    recorded = frames(2)
    with pytest.raises(BadInput, match="--fx --fy --cx --cy"):
        ingest(write_posed_images(tmp_path / "posed", recorded), tmp_path / "a")
    with pytest.raises(BadInput, match="--cy"):
        ingest(tmp_path / "posed", tmp_path / "a2", fx=1.0, fy=1.0, cx=1.0)
    (write_seven_scenes(tmp_path / "scenes", recorded) / "camera-intrinsics.txt").unlink()
    with pytest.raises(BadInput, match="96x72"):
        ingest(tmp_path / "scenes", tmp_path / "b")
    (write_redwood(tmp_path / "redwood", recorded) / "camera_intrinsic.json").unlink()
    with pytest.raises(BadInput, match="96x72"):
        ingest(tmp_path / "redwood", tmp_path / "c")
    for name in ("posed", "scenes", "redwood"):
        assert ingest(tmp_path / name, tmp_path / f"{name}_given", **INTRINSICS).info.camera == CAMERA


def test_selection_and_its_count(tmp_path: Path) -> None:
    log = write_seven_scenes(tmp_path / "log", frames(12))
    sequence = ingest(log, tmp_path / "a", start=1, stop=11, every=3, max_frames=3)
    assert sequence.info.drops == {"not_selected": 9}
    times, _ = read_tum(sequence.path("trajectory.tum"))
    np.testing.assert_allclose(times * 30, [1, 4, 7], atol=1e-6)


def test_every_frame_is_used_or_counted(tmp_path: Path) -> None:
    log = write_seven_scenes(tmp_path / "log", frames(12))
    (log / "frame-000000.pose.txt").unlink()
    np.savetxt(log / "frame-000001.pose.txt", np.full((4, 4), np.nan))
    np.savetxt(log / "frame-000002.pose.txt", np.diag([1, 1, -1, 1]))
    (log / "frame-000003.pose.txt").write_text("no pose at all")
    (log / "frame-000004.color.jpg").unlink()
    (log / "frame-000005.depth.png").unlink()
    jpeg = (log / "frame-000006.color.jpg").read_bytes()
    (log / "frame-000006.color.jpg").write_bytes(jpeg[: len(jpeg) // 2])
    depth = (log / "frame-000007.depth.png").read_bytes()
    (log / "frame-000007.depth.png").write_bytes(depth[: len(depth) // 2])
    (log / "frame-000008.depth.png").write_bytes(png(np.zeros((72, 96), np.uint16)))
    (log / "frame-000009.depth.png").write_bytes(png(np.full((72, 96), 100, np.uint8)))
    (log / "frame-000010.depth.png").write_bytes(png(np.full((36, 48), 1000, np.uint16)))
    sequence = ingest(log, tmp_path / "out")
    assert sequence.info.drops == {
        "missing_pose": 1,
        "non_finite_pose": 1,
        "non_rigid_pose": 1,
        "unreadable_pose": 1,
        "missing_color": 1,
        "missing_depth": 1,
        "undecodable_color": 1,
        "undecodable_depth": 1,
        "no_valid_depth": 1,
        "depth_not_16_bit": 1,
        "size_mismatch": 1,
    }
    assert sequence.info.frame_count == 1
    assert sequence.summary["dropped"] == 11


def test_depth_65535_is_invalid(tmp_path: Path) -> None:
    log = write_seven_scenes(tmp_path / "log", frames(1))
    image = np.full((72, 96), 1234, np.uint16)
    image[:, :10], image[:, 10:20] = 65535, 0
    (log / "frame-000000.depth.png").write_bytes(png(image))
    with FrameReader(ingest(log, tmp_path / "out", gravity="none").path("frames.mcap")) as reader:
        depth = reader.read(0).depth
    assert (depth[:, :20] == 0).all() and (depth[:, 20:] == np.float32(1.234)).all()


def test_poses_with_rounding_become_rigid(tmp_path: Path) -> None:
    log = write_seven_scenes(tmp_path / "log", frames(1))
    pose = np.loadtxt(log / "frame-000000.pose.txt")
    np.savetxt(log / "frame-000000.pose.txt", pose, fmt="%.3f")
    with FrameReader(ingest(log, tmp_path / "out", gravity="none").path("frames.mcap")) as reader:
        rotation = reader.read(0).world_from_camera[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(rotation, pose[:3, :3], atol=2e-3)


def test_log_without_poses_is_kept_and_says_so(tmp_path: Path) -> None:
    log = write_seven_scenes(tmp_path / "log", frames(3))
    for path in log.glob("*.pose.txt"):
        path.unlink()
    sequence = ingest(log, tmp_path / "out")
    assert sequence.outcome == "ok" and sequence.info.frame_count == 3
    assert "pose" not in sequence.info.streams
    assert sequence.info.gravity.method == "none"
    assert len(read_tum(sequence.path("trajectory.tum"))[0]) == 0


def test_no_usable_frame_is_an_empty_sequence_with_a_reason(tmp_path: Path) -> None:
    log = write_seven_scenes(tmp_path / "log", frames(3))
    for path in log.glob("*.depth.png"):
        path.write_bytes(png(np.zeros((72, 96), np.uint16)))
    sequence = ingest(log, tmp_path / "out")
    assert sequence.outcome == "empty"
    assert sequence.summary["reason"] == "no usable frame: no_valid_depth 3 (is the depth unit right (--depth-scale)?)"
    assert sequence.info.frame_count == 0 and sequence.info.drops == {"no_valid_depth": 3}
    with FrameReader(sequence.path("frames.mcap")) as reader:
        assert len(reader) == 0


def test_colour_of_the_same_shape_is_resized_to_the_depth(tmp_path: Path) -> None:
    import cv2

    log = write_seven_scenes(tmp_path / "log", frames(2))
    small = cv2.imread(str(log / "frame-000000.color.jpg"))
    cv2.imwrite(str(log / "frame-000000.color.jpg"), cv2.resize(small, (192, 144)))
    cv2.imwrite(str(log / "frame-000001.color.jpg"), cv2.resize(small, (96, 96)))
    sequence = ingest(log, tmp_path / "out", gravity="none")
    assert sequence.info.drops == {"size_mismatch": 1}
    with FrameReader(sequence.path("frames.mcap")) as reader:
        assert reader.read(0).color.shape == (72, 96, 3)


@pytest.mark.parametrize(("scale", "warned"), [(1000.0, False), (1.0, True), (50000.0, True)])
def test_implausible_depth_unit_is_pointed_out(tmp_path: Path, scale: float, warned: bool) -> None:
    log = write_seven_scenes(tmp_path / "log", frames(1))
    (log / "frame-000000.depth.png").write_bytes(
        png(np.full((72, 96), 40, np.uint16) if scale == 1 else millimetres(frames(1)[0][1]))
    )
    notes = ingest(log, tmp_path / "out", depth_scale=scale, gravity="none").info.notes
    assert any("median depth" in note for note in notes) == warned


def test_jump_of_the_camera_is_pointed_out(tmp_path: Path) -> None:
    recorded = frames(3)
    recorded[1][2][:3, 3] += 10
    log = write_seven_scenes(tmp_path / "log", recorded)
    assert any("jumps 18.1" in note for note in ingest(log, tmp_path / "out", gravity="none").info.notes)


def test_same_log_same_bytes(tmp_path: Path) -> None:
    log = write_seven_scenes(tmp_path / "log", frames(4))
    first, second = ingest(log, tmp_path / "a"), ingest(log, tmp_path / "b")
    for name in ("frames.mcap", "sequence.json", "trajectory.tum"):
        assert first.path(name).read_bytes() == second.path(name).read_bytes()


def test_file_numbers_are_sorted_as_numbers() -> None:
    assert sorted(["10", "9", "b2", "a10", "a9"], key=natural_key) == ["9", "10", "a9", "a10", "b2"]


def test_poses_may_be_named_by_their_image(tmp_path: Path) -> None:
    """A column of names before the numbers, in any order, as many tools write it."""
    recorded = frames(4)
    log = write_posed_images(tmp_path / "posed", recorded)
    images = sorted(path.name for path in (log / "depth").iterdir())
    lines = (log / "pose.txt").read_text().splitlines()
    rows = [line for line in lines if line and not line.startswith("#")]
    named = [f"images/{name} {row}" for name, row in zip(images, rows, strict=True)]
    (log / "pose.txt").write_text("\n".join(reversed(named)) + "\n")
    sequence = ingest(log, tmp_path / "a", **INTRINSICS)
    with FrameReader(sequence.path("frames.mcap")) as reader:
        for frame, (_, _, pose) in zip(reader.frames(), recorded, strict=True):
            np.testing.assert_allclose(frame.world_from_camera, pose, atol=1e-3)  # the floor decides what is up
    (log / "pose.txt").write_text("\n".join(f"other{index} {row}" for index, row in enumerate(rows)) + "\n")
    with pytest.raises(BadInput, match="name no image of the log"):
        ingest(log, tmp_path / "b", **INTRINSICS)
    (log / "pose.txt").write_text("\n".join([named[0], *named]) + "\n")
    with pytest.raises(BadInput, match="line 2: a second pose"):
        ingest(log, tmp_path / "c", **INTRINSICS)


def test_the_layout_of_7_scenes_does_not_make_a_log_unregistered(tmp_path: Path) -> None:
    """Other people's cameras in this layout: only the data set's own Kinect is known to be unregistered."""
    sequence = ingest(write_seven_scenes(tmp_path / "log", frames(2)), tmp_path / "a")
    assert sequence.info.color_depth_registered
    assert not any("not registered" in note for note in sequence.info.notes)
