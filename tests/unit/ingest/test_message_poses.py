"""Where poses come from: chains of transforms, odometry, poses; which world, and what is not taken for one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.preflight.inspection import inspect_log
from scenewright.stages.ingest.transform_tree import SAME, Track, TransformTree, interpolated
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.geometry.transforms import inverse, transform_from, transform_from_yaw
from scenewright.stages.kit.progress import SilentProgress
from scipy.spatial.transform import Rotation

from tests.unit.ingest.message_logs import FIRST, SECOND, recorder
from tests.unit.ingest.running import ingest
from tests.unit.ingest.tiny_room import frames, jpeg

ANYWHERE = 1 << 62


def _images(log: Any, count: int = 4, frame: str = "optical", step: int = SECOND // 5, offset: int = 0) -> list:
    recorded = frames(count)
    for index, (color, _, _) in enumerate(recorded):
        stamp = FIRST + offset + index * step
        log.info("/cam/camera_info", stamp, frame)
        log.compressed("/cam/image_raw/compressed", stamp, jpeg(color), "jpeg", frame)
    return recorded


def _poses(sequence: Any) -> np.ndarray:
    with FrameReader(sequence.path("frames.mcap")) as reader:
        return reader.poses()[1]


def _moved(seconds: float) -> np.ndarray:
    return transform_from_yaw(0.3 * seconds, np.array([0.5 * seconds, 0, 0]))


def test_chain_from_map_over_odom_and_base_is_interpolated(tmp_path: Path) -> None:
    """map -> odom once in a second, odom -> base 20 times a second, images in between; earth above it all."""
    mount = transform_from(Rotation.from_euler("xyz", [-1.5, 0, -1.5]).as_matrix(), np.array([0.2, 0, 0.8]))
    drift = [transform_from_yaw(0.01 * second, np.array([0, 0.1 * second, 0])) for second in range(3)]
    with recorder(tmp_path) as log:
        log.transform("/tf_static", FIRST, "base", "mast", mount)
        log.transform("/tf_static", FIRST, "mast", "optical", np.eye(4))
        log.transform("/tf_static", FIRST, "earth", "map", transform_from_yaw(1, np.array([1e5, 2e5, 0])))
        for second, matrix in enumerate(drift):
            log.transform("/tf", FIRST + second * SECOND, "map", "odom", matrix)
        for tick in range(41):
            log.transform("/tf", FIRST + tick * SECOND // 20, "odom", "base", _moved(tick / 20))
        _images(log, 8, offset=SECOND // 40)
    sequence = ingest(log.path, tmp_path / "out", gravity="none", maximum_transform_gap=1.5)
    assert "poses of 'optical' in 'map' from /tf, /tf_static" in sequence.info.rule
    for index, pose in enumerate(_poses(sequence)):
        seconds = 0.025 + 0.2 * index
        between = interpolated(drift[int(seconds)], drift[int(seconds) + 1], seconds % 1)
        np.testing.assert_allclose(pose, between @ _moved(seconds) @ mount, atol=2e-6)
    strict = ingest(log.path, tmp_path / "strict", gravity="none")  # a gap of 1 s is too large by default
    assert "pose" not in strict.info.streams
    assert any(
        "8 of 8 frames have no pose" in n and "'map' -> 'odom' has samples 1 s apart" in n for n in strict.info.notes
    )
    local = ingest(log.path, tmp_path / "local", gravity="none", world_frame="odom")
    np.testing.assert_allclose(_poses(local)[0], _moved(0.025) @ mount, atol=2e-6)


def test_gap_in_the_transforms_costs_the_frames_within_it(tmp_path: Path) -> None:
    with recorder(tmp_path) as log:
        for tick in [*range(0, 10), *range(30, 41)]:
            log.transform("/tf", FIRST + tick * SECOND // 10, "odom", "optical", _moved(tick / 10))
        _images(log, 20)
    info = ingest(log.path, tmp_path / "out", gravity="none").info
    assert info.drops == {"missing_pose": 10} and info.frame_count == 10
    (note,) = (note for note in info.notes if "10 of 20 frames have no pose" in note)
    assert "2.1 s apart there (--maximum-transform-gap 2.1 interpolates)" in note
    assert ingest(log.path, tmp_path / "advised", gravity="none", maximum_transform_gap=2.1).info.drops == {}


def test_static_transforms_alone_are_no_poses(tmp_path: Path) -> None:
    """A camera in a hand: its driver publishes where its parts are, nobody where the camera is."""
    with recorder(tmp_path) as log:
        log.transform("/tf_static", FIRST, "camera_link", "optical", _moved(1))
        _images(log)
    info = ingest(log.path, tmp_path / "out").info
    assert "pose" not in info.streams and any("--world-frame camera_link" in note for note in info.notes)
    fixed = ingest(log.path, tmp_path / "fixed", gravity="none", world_frame="camera_link")
    np.testing.assert_allclose(_poses(fixed), np.stack([_moved(1)] * 4), atol=1e-9)
    with recorder(tmp_path / "wall") as log:
        log.transform("/tf_static", FIRST, "world", "optical", _moved(1))
        _images(log)
    assert ingest(log.path, tmp_path / "wall_out", gravity="none").info.streams == ("color", "pose")


def test_odometry_that_leads_nowhere_is_not_used_for_the_camera(tmp_path: Path) -> None:
    with recorder(tmp_path) as log:
        _images(log)
        for tick in range(10):
            log.odometry("/odom", FIRST + tick * SECOND // 10, "odom", "base", _moved(tick / 10))
    info = ingest(log.path, tmp_path / "out").info
    assert "pose" not in info.streams
    assert any("/odom says where 'base' is, and no transforms lead" in note for note in info.notes)
    with pytest.raises(BadInput, match="/odom says where 'base' is.*record tf_static"):
        ingest(log.path, tmp_path / "asked", pose_topic="/odom")
    with pytest.raises(BadInput, match="no poses on topic '/pose'.*topics with poses: /odom"):
        ingest(log.path, tmp_path / "other", pose_topic="/pose")


def test_pose_topic_comes_before_the_tree_when_asked_for(tmp_path: Path) -> None:
    mount = transform_from_yaw(0.5, np.array([0.1, 0.2, 0.3]))
    truth = [transform_from_yaw(0.1 * i, np.array([0, 0.3 * i, 1.0])) for i in range(4)]
    with recorder(tmp_path) as log:
        log.transform("/tf_static", FIRST, "base", "optical", mount)
        _images(log)
        for index in range(4):
            stamp = FIRST + index * SECOND // 5
            log.transform("/tf", stamp, "odom", "base", _moved(index))
            log.odometry("/vio", stamp, "global", "base", truth[index])
            log.odometry("/tracker", stamp, "lab", "", truth[index])
    tree = _poses(ingest(log.path, tmp_path / "tree", gravity="none"))
    np.testing.assert_allclose(tree[2], _moved(2) @ mount, atol=1e-9)
    vio = ingest(log.path, tmp_path / "vio", gravity="none", pose_topic="/vio")
    np.testing.assert_allclose(_poses(vio), [pose @ mount for pose in truth], atol=1e-9)
    tracker = ingest(log.path, tmp_path / "tracker", gravity="none", pose_topic="/tracker")
    np.testing.assert_allclose(_poses(tracker), truth, atol=1e-9)
    assert any("does not say whose they are" in note for note in tracker.info.notes)


def test_transforms_that_point_from_the_camera_to_the_world(tmp_path: Path) -> None:
    """A tracker that publishes where the world is, seen from the camera, is read the other way round."""
    with recorder(tmp_path) as log:
        _images(log)
        for index in range(4):
            log.transform("/tf", FIRST + index * SECOND // 5, "optical", "marker", inverse(_moved(index)))
    assert "pose" not in ingest(log.path, tmp_path / "out").info.streams
    asked = ingest(log.path, tmp_path / "asked", gravity="none", world_frame="marker")
    np.testing.assert_allclose(_poses(asked), [_moved(index) for index in range(4)], atol=1e-9)
    with pytest.raises(BadInput, match="no frame 'map'.*frames: marker, optical"):
        ingest(log.path, tmp_path / "wrong", world_frame="map")


def test_world_that_nothing_connects_with_the_camera(tmp_path: Path) -> None:
    with recorder(tmp_path) as log:
        _images(log)
        log.transform("/tf", FIRST, "map", "other", np.eye(4))
    with pytest.raises(BadInput, match="nothing leads from 'map' to the camera frame 'optical'"):
        ingest(log.path, tmp_path / "out", world_frame="map")


def test_goals_are_not_taken_for_poses(tmp_path: Path) -> None:
    with recorder(tmp_path) as log:
        _images(log)
        for tick in range(5):
            log.odometry("/move_base_simple/goal", FIRST + tick * SECOND, "map", "", _moved(tick))
    assert "pose" not in ingest(log.path, tmp_path / "out").info.streams


def test_loop_above_the_camera_is_refused_and_elsewhere_ignored(tmp_path: Path) -> None:
    for name, last in (("above", "optical"), ("elsewhere", "gripper")):
        with recorder(tmp_path / name) as log:
            _images(log)
            log.transform("/tf", FIRST, "a", last, np.eye(4))
            log.transform("/tf", FIRST, last, "a", np.eye(4))
    with pytest.raises(BadInput, match="loop"):
        ingest(tmp_path / "above" / "bag", tmp_path / "refused")
    assert ingest(tmp_path / "elsewhere" / "bag", tmp_path / "used").info.frame_count == 4


# --- tracks and trees ------------------------------------------------------------------------------------------

stamps = st.lists(st.integers(0, 10**10), min_size=1, max_size=30)


@settings(max_examples=60, deadline=None)
@given(stamps, st.integers(0, 10**10), st.integers(0, 10**9), st.integers(0, 10**9))
def test_a_track_agrees_with_a_search_through_all_samples(
    given_stamps: list, query: int, gap: int, tolerance: int
) -> None:
    """x of the track is its time: interpolation gives the time back, and refusals are those of the rule."""
    track = Track()
    for stamp in given_stamps:
        track.add(stamp, transform_from_yaw(stamp / 10**10, np.array([stamp / 10**9, 0, 0])))
    found = track.at(query, gap=gap, tolerance=tolerance)
    before = max((stamp for stamp in given_stamps if stamp <= query), default=None)
    after = min((stamp for stamp in given_stamps if stamp >= query), default=None)
    if before is None:
        expected = after if after - query <= tolerance else None
    elif after is None:
        expected = before if query - before <= tolerance else None
    else:
        expected = query if after - before <= gap or before == query or after == query else None
    assert (found is None) == (expected is None)
    if found is not None:
        assert abs(found[0, 3] - expected / 10**9) < 1e-9
        np.testing.assert_allclose(found[:3, :3], transform_from_yaw(expected / 10**10, np.zeros(3))[:3, :3], atol=1e-9)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0, 1))
def test_interpolation_is_the_constant_turn_between_two_poses(seed: int, share: float) -> None:
    random = np.random.default_rng(seed)
    first, second = (
        transform_from(Rotation.random(random_state=int(random.integers(2**31))).as_matrix(), random.normal(size=3))
        for _ in range(2)
    )
    between = interpolated(first, second, share)
    turn = Rotation.from_matrix(first[:3, :3].T @ second[:3, :3]).as_rotvec()
    expected = first[:3, :3] @ Rotation.from_rotvec(share * turn).as_matrix()
    np.testing.assert_allclose(between[:3, :3], expected, atol=1e-9)
    np.testing.assert_allclose(between[:3, 3], first[:3, 3] + share * (second[:3, 3] - first[:3, 3]), atol=1e-12)


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(st.integers(1, SAME // 3), st.booleans()), min_size=1, max_size=60))
def test_standing_still_is_stored_thinly_and_read_the_same(steps: list) -> None:
    track, all_samples, stamp, position = Track(), [], 0, 0.0
    for step, moves in steps:
        stamp, position = stamp + step, position + moves
        track.add(stamp, transform_from_yaw(0, np.array([position, 0, 0])))
        all_samples.append((stamp, position))
    times, places = zip(*all_samples, strict=True)
    for query in np.linspace(times[0], times[-1], 25).astype(int):
        found = track.at(int(query), gap=SAME, tolerance=0)
        assert found is not None and abs(found[0, 3] - np.interp(query, times, places)) < 1e-6
    assert track.count == len(steps)


def test_a_joint_that_stands_still_takes_little_memory() -> None:
    track = Track()
    for tick in range(10_000):
        track.add(tick * 1_000_000, np.eye(4))
    assert len(track) < 250 and track.is_constant


def test_the_parent_that_leads_to_the_wanted_world_counts() -> None:
    tree = TransformTree()
    first, second = transform_from_yaw(0.4, np.ones(3)), transform_from_yaw(-1.0, np.zeros(3))
    tree.add("truth", "base", 0, first)
    tree.add("odom", "base", 0, second)
    tree.add("map", "odom", 0, np.eye(4))
    assert tree.parents("base") == ("truth", "odom") and tree.chain("base") == ["base", "truth"]
    tree.prefer("map")
    assert tree.chain("base") == ["base", "odom", "map"] and tree.is_preferred("base")
    np.testing.assert_allclose(tree.lookup("map", "base", 5, gap=ANYWHERE, tolerance=ANYWHERE), second)
    np.testing.assert_allclose(tree.lookup("base", "map", 5, gap=1, tolerance=ANYWHERE), inverse(second), atol=1e-12)


def test_missing_static_transforms_are_named_with_the_frames_that_the_log_knows(tmp_path: Path) -> None:
    with recorder(tmp_path) as log:
        for tick in range(10):
            log.transform("/tf", FIRST + tick * SECOND // 10, "map", "base_link", _moved(tick / 10))
        _images(log)
    info = ingest(log.path, tmp_path / "out").info
    (note,) = (note for note in info.notes if note.startswith("frames have no poses: "))
    assert "no transforms lead to the camera frame 'optical'" in note and "'base_link', 'map'" in note
    assert "/tf_static is not among its topics" in note
    inspected = inspect_log(log.path, IngestParameters(), 4, SilentProgress()).report
    (finding,) = (finding for finding in inspected.findings if finding.check == "poses")
    assert "'base_link', 'map'" in finding.message and "/tf_static" in finding.message


def test_depth_that_is_a_jpeg_is_named_with_the_reason(tmp_path: Path) -> None:
    topic = "/cam/depth/image_raw/compressed"
    with recorder(tmp_path) as log:
        _images(log)
        for index in range(4):
            picture = np.full((30, 40, 3), 60, np.uint8)
            log.compressed(topic, FIRST + index * SECOND // 5, jpeg(picture), "16UC1; jpeg compressed ", "optical")
    info = ingest(log.path, tmp_path / "out").info
    (note,) = (note for note in info.notes if note.startswith("frames have no depth: "))
    assert f"{topic}: " in note and "JPEG" in note
    with pytest.raises(BadInput, match="no depth images on topic .*JPEG"):
        ingest(log.path, tmp_path / "asked", depth_topic=topic)
