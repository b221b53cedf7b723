"""Gravity: a tilted room is made upright again, the floor found under the table, and how is recorded."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.kit.geometry.gravity import camera_up, find_floor, upright_from_direction, wall_yaw
from scenewright.stages.kit.geometry.surface_samples import surface_samples
from scenewright.stages.kit.geometry.transforms import apply, look_at, rotation_between, transform_from
from scenewright.stages.kit.geometry.upright_world import make_upright
from scipy.spatial.transform import Rotation

from tests.real_data import real_data
from tests.unit.ingest.running import ingest
from tests.unit.ingest.tiny_room import CAMERA, TABLE, camera_poses, frames, room_depth, write_seven_scenes

TILT = transform_from(Rotation.from_euler("xyz", [1.9, 0.4, -0.7]).as_matrix(), np.array([3.0, -2.0, 5.0]))


def _cloud(poses: np.ndarray, tilt: np.ndarray = TILT) -> tuple[np.ndarray, np.ndarray]:
    samples = [surface_samples(room_depth(CAMERA, pose), CAMERA, tilt @ pose) for pose in poses]
    return np.concatenate([p for p, _ in samples]), np.concatenate([n for _, n in samples])


def test_tilted_room_becomes_upright(tmp_path: Path) -> None:
    recorded = frames(12, TILT)
    sequence = ingest(write_seven_scenes(tmp_path / "log", recorded), tmp_path / "out")
    gravity = sequence.info.gravity
    assert gravity.method == "floor_plane" and gravity.inlier_count > 100
    assert "rms" in gravity.detail and "walls" in gravity.detail
    world_from_true = np.array(gravity.world_from_log) @ TILT
    np.testing.assert_allclose(world_from_true[:3, 2], [0, 0, 1], atol=0.01)  # up is up
    assert abs(world_from_true[2, 3]) < 0.01  # the floor is z = 0
    yaw = math.atan2(world_from_true[1, 0], world_from_true[0, 0])
    assert abs((yaw + math.pi / 4) % (math.pi / 2) - math.pi / 4) < 0.01  # walls along the axes
    with FrameReader(sequence.path("frames.mcap")) as reader:
        assert reader.world_up == "z"
        for frame, (_, _, pose) in zip(reader.frames(("depth",)), recorded, strict=True):
            np.testing.assert_allclose(frame.world_from_camera, np.array(gravity.world_from_log) @ pose, atol=1e-9)
            heights = apply(frame.world_from_camera, back_project(frame.depth, CAMERA))[..., 2]
            assert heights.min() > -0.02
            assert (np.abs(heights) < 0.02).mean() > 0.05
            assert (np.abs(heights - TABLE[1][2]) < 0.02).mean() > 0.05


def test_table_is_not_taken_for_the_floor() -> None:
    points, normals = _cloud(camera_poses(8), np.eye(4))
    on_table = np.abs(points[:, 2] - TABLE[1][2]) < 0.01
    floor = np.abs(points[:, 2]) < 0.01
    few = np.flatnonzero(floor)[: on_table.sum() // 4]  # most of what is seen of the horizontal is the table
    kept = np.concatenate([np.flatnonzero(~floor), few])
    found = find_floor(points[kept], normals[kept], np.array([0, 0, 1.0]), np.random.default_rng(0))
    assert found is not None and abs(found.offset) < 0.02


def test_without_a_floor_the_camera_decides() -> None:
    poses = np.array([look_at(np.zeros(3), np.array([1.0, 0.1 * k, -0.1])) for k in range(5)])
    random = np.random.default_rng(0)
    wall = np.column_stack([np.full(900, 2.0), *(g.ravel() for g in np.mgrid[-1:1:30j, -1:1:30j])])
    normals = np.tile([-1.0, 0, 0], (900, 1))
    logged = np.array([TILT @ pose for pose in poses])
    cloud = (apply(TILT, wall), normals @ TILT[:3, :3].T)
    gravity = make_upright("auto", "z", None, logged, lambda: cloud, random)
    assert gravity.method == "mean_camera_up" and "no floor was seen" in gravity.detail
    world_from_true = np.array(gravity.world_from_log) @ TILT
    assert world_from_true[2, 2] > math.cos(math.radians(15))
    heights = apply(np.array(gravity.world_from_log), cloud[0])[:, 2]
    assert abs(np.percentile(heights, 1)) < 0.01
    with pytest.raises(BadInput, match="no floor"):
        make_upright("floor", "z", None, logged, lambda: cloud, random)


def test_what_the_log_states_wins_over_the_floor() -> None:
    gravity = make_upright("auto", "z", "the log says so", camera_poses(3), lambda: pytest.fail("not looked at"), None)
    assert (gravity.method, gravity.detail) == ("given", "the log says so")
    np.testing.assert_array_equal(gravity.world_from_log, np.eye(4))


@pytest.mark.parametrize("axis", ["x", "-x", "y", "-y", "z", "-z"])
def test_given_axis_becomes_z(axis: str) -> None:
    gravity = make_upright("given", axis, None, camera_poses(1), lambda: pytest.fail("not looked at"), None)
    direction = np.eye(3)["xyz".index(axis[-1])] * (-1 if axis[0] == "-" else 1)
    np.testing.assert_allclose(np.array(gravity.world_from_log)[:3, :3] @ direction, [0, 0, 1], atol=1e-12)


def test_cameras_that_look_everywhere_have_no_mean_up() -> None:
    down = look_at(np.zeros(3), np.array([1.0, 0, 0]))
    flipped = look_at(np.zeros(3), np.array([1.0, 0, 0]), np.array([0, 0, -1.0]))
    assert camera_up(np.array([down, flipped])) is None
    gravity = make_upright("auto", "z", None, np.array([down, flipped]), lambda: pytest.fail("not looked at"), None)
    assert gravity.method == "none"


@settings(max_examples=30, deadline=None)
@given(st.floats(-44, 44), st.integers(0, 1000))
def test_wall_direction_is_found(degrees: float, seed: int) -> None:
    random = np.random.default_rng(seed)
    quarter = random.integers(0, 4, 400) * math.pi / 2
    angles = math.radians(degrees) + quarter + random.normal(0, 0.02, 400)
    clutter = random.uniform(0, 2 * math.pi, 200)
    angles = np.concatenate([angles, clutter])
    normals = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(600)])
    assert wall_yaw(normals) == pytest.approx(math.radians(degrees), abs=0.01)


def test_round_rooms_keep_their_yaw() -> None:
    angles = np.linspace(0, 2 * math.pi, 1000)
    assert wall_yaw(np.column_stack([np.cos(angles), np.sin(angles), np.zeros(1000)])) is None


@settings(max_examples=50, deadline=None)
@given(st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 1e-3))
def test_any_direction_becomes_up(direction: tuple[float, float, float]) -> None:
    up = np.array(direction) / np.linalg.norm(direction)
    matrix = upright_from_direction(up)
    np.testing.assert_allclose(matrix[:3, :3] @ up, [0, 0, 1], atol=1e-9)
    np.testing.assert_allclose(matrix[:3, :3], rotation_between(up, np.array([0, 0, 1.0])), atol=1e-12)


@pytest.mark.parametrize(
    ("name", "options", "camera_height", "surfaces"),
    [
        ("7scenes_redkitchen", {"every": 20}, (1.1, 1.7), {"table": (0.65, 0.78)}),
        ("redwood_livingroom1", {"every": 20}, (0.2, 1.4), {}),
        ("slambook2_rgbd/diningroom", {"fx": 518.0, "fy": 519.0, "cx": 325.5, "cy": 253.5}, (1.2, 1.6), {}),
    ],
)
def test_real_floors_are_flat_at_zero(
    tmp_path: Path,
    name: str,
    options: dict,
    camera_height: tuple[float, float],
    surfaces: dict[str, tuple[float, float]],
) -> None:
    """Heights are those of the rooms that the pictures show: floor 0, the kitchen's table 0.7 m, camera in hand."""
    sequence = ingest(real_data(name), tmp_path / "out", **options)
    assert sequence.outcome == "ok" and sequence.info.gravity.method == "floor_plane"
    points = []
    with FrameReader(sequence.path("frames.mcap")) as reader:
        for frame in reader.frames(("depth",)):
            assert camera_height[0] < frame.world_from_camera[2, 3] < camera_height[1]
            seen = back_project(frame.depth, reader.camera)[::4, ::4].reshape(-1, 3)
            seen = seen[(seen[:, 2] > 0) & (seen[:, 2] < 4)]
            points.append(apply(frame.world_from_camera, seen))
    cloud = np.concatenate(points)
    assert np.percentile(cloud[:, 2], 0.5) > -0.10  # nothing below the floor
    floor = cloud[np.abs(cloud[:, 2]) < 0.06]
    assert len(floor) > 0.02 * len(cloud)
    assert abs(np.median(floor[:, 2])) < 0.015
    design = np.column_stack([floor[:, :2], np.ones(len(floor))])
    slope = np.linalg.lstsq(design, floor[:, 2], rcond=None)[0][:2]
    assert math.degrees(np.hypot(*slope)) < 1.0
    for low, high in surfaces.values():
        assert ((cloud[:, 2] > low) & (cloud[:, 2] < high)).mean() > 0.1
