"""Which way is up, wherever the cameras look: rooms seen from level to straight down, in worlds of every kind."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.sequence import Gravity
from scenewright.stages.ingest.preflight.report import GravityReport
from scenewright.stages.ingest.preflight.upright import gravity_findings
from scenewright.stages.kit.geometry.gravity import camera_up, on_their_side
from scenewright.stages.kit.geometry.surface_samples import surface_samples
from scenewright.stages.kit.geometry.transforms import transform_from
from scenewright.stages.kit.geometry.upright_world import make_upright
from scipy.spatial.transform import Rotation

from tests.unit.ingest.tiny_room import room_depth

CAMERA = Camera(width=128, height=96, fx=100.0, fy=100.0, cx=63.5, cy=47.5)
Y_UP = transform_from(np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]), np.array([0.3, 0.2, 0.1]))
TILTED = transform_from(Rotation.from_euler("xyz", [1.9, 0.4, -0.7]).as_matrix(), np.array([3.0, -2.0, 5.0]))
OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])
WALKS = ("stands", "pans", "turns", "orbits")


def held(eye: np.ndarray, yaw: float, pitch: float, roll: float = 0.0) -> np.ndarray:
    """Return world_from_camera (4, 4) at `eye` (3,), turned by `yaw`, looking down by `pitch`, rolled [deg]."""
    level = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])  # looks along x, z is up
    turn = Rotation.from_euler("ZYX", [yaw, pitch, 0], degrees=True).as_matrix()
    return transform_from(turn @ level @ Rotation.from_euler("z", roll, degrees=True).as_matrix(), eye)


def poses_of(walk: str, pitch: float, seed: int, roll: float = 2.0) -> np.ndarray:
    """Return world_from_camera (10, 4, 4) in the tiny room, as steady as a hand."""
    random = np.random.default_rng([seed, int(pitch) + 100])
    poses = []
    for part in np.linspace(0, 1, 10):
        angle = 2 * math.pi * part if walk == "turns" else math.pi * part
        eye, yaw = {
            "stands": (np.array([-1.4 + 0.1 * part, -1.1, 1.5]), 38.0),
            "pans": (np.array([-1.4, -1.1, 1.5]), 10 + 60 * part),
            "turns": (np.array([-1.2, -0.9, 1.5]), math.degrees(angle)),
            "orbits": (np.array([1.2 * math.cos(angle), 1.0 * math.sin(angle), 1.5]), math.degrees(angle) + 180),
        }[walk]
        shake = random.normal(0, [2, 2, roll])
        poses.append(held(eye, yaw + shake[0], pitch + shake[1], shake[2]))
    return np.array(poses)


def upright_of(
    poses: np.ndarray, log_from_world: np.ndarray, seed: int = 0, seen: float = 1.0, highest: float = 9.0
) -> Gravity:
    """Return how a log of these poses is made upright. Only every so many frames see the floor (`seen`); what is over
    `highest` [m] is not seen."""
    random, samples = np.random.default_rng(seed), []
    for index, pose in enumerate(poses):
        depth = room_depth(CAMERA, pose)
        depth = np.rint(1000 * (depth + random.normal(0, 0.0015, depth.shape) * depth**2)) / 1000
        points, normals = surface_samples(depth.astype(np.float32), CAMERA, pose)
        shown = points[:, 2] < highest
        if index >= seen * len(poses):
            shown &= points[:, 2] > 0.1
        samples.append((points[shown], normals[shown]))
    points, normals = (np.concatenate([sample[k] for sample in samples]) for k in (0, 1))
    turn = log_from_world[:3, :3]
    cloud = points @ turn.T + log_from_world[:3, 3], normals @ turn.T
    return make_upright("auto", "z", None, log_from_world @ poses, lambda: cloud, np.random.default_rng([0, 0]))


def tilt_of(gravity: Gravity, log_from_world: np.ndarray) -> float:
    """Return the angle between the true up and the one that was made [deg]."""
    world_from_true = np.array(gravity.world_from_log) @ log_from_world
    return math.degrees(math.acos(min(1.0, world_from_true[2, 2])))


@pytest.mark.parametrize("pitch", [10, 25, 36, 38, 42, 50, 60])
@pytest.mark.parametrize("walk", WALKS)
def test_a_log_that_is_upright_stays_as_it_is(walk: str, pitch: int) -> None:
    gravity = upright_of(poses_of(walk, pitch, pitch), np.eye(4))
    assert gravity.method in ("floor_plane", "level_plane") and "the log's z is up" in gravity.detail
    np.testing.assert_array_equal(np.array(gravity.world_from_log)[:3, :3], np.eye(3))
    if gravity.method == "floor_plane":
        np.testing.assert_array_equal(gravity.world_from_log, np.eye(4))


@pytest.mark.parametrize("pitch", [12, 38, 42, 50, 60])
@pytest.mark.parametrize("walk", WALKS)
@pytest.mark.parametrize("world", ["y", "tilted", "first camera"])
def test_a_log_of_another_world_becomes_upright(world: str, walk: str, pitch: int) -> None:
    poses = poses_of(walk, pitch, 3 * pitch)
    log_from_world = {"y": Y_UP, "tilted": TILTED}.get(world, np.linalg.inv(poses[0]))
    gravity = upright_of(poses, log_from_world)
    assert gravity.method in ("floor_plane", "level_plane")
    assert tilt_of(gravity, log_from_world) < (1e-6 if world == "y" else 0.7)


@pytest.mark.parametrize("world", [TILTED, OPENGL], ids=["tilted", "opengl"])
@pytest.mark.parametrize("walk", ["pans", "orbits"])
def test_a_table_says_which_way_is_up_where_the_floor_is_hardly_seen(walk: str, world: np.ndarray) -> None:
    poses = poses_of(walk, 45, 7)
    log_from_world = world @ np.linalg.inv(poses[0])
    gravity = upright_of(poses, log_from_world, seen=0.1)
    assert gravity.method in ("floor_plane", "level_plane") and tilt_of(gravity, log_from_world) < 0.7


@pytest.mark.parametrize(("pitch", "roll"), [(90, 0.0), (85, 180.0), (45, 180.0), (30, 180.0)])
def test_a_camera_that_looks_straight_down_or_hangs_upside_down_in_an_upright_log(pitch: int, roll: float) -> None:
    poses = np.array([held(np.array([-1.0 + 0.1 * k, -0.9, 1.5]), 40.0, pitch, roll + k % 2) for k in range(6)])
    gravity = upright_of(poses, np.eye(4))
    np.testing.assert_array_equal(np.array(gravity.world_from_log)[:3, :3], np.eye(3))


@pytest.mark.parametrize("log_from_world", [np.eye(4), Y_UP, TILTED], ids=["z", "y", "tilted"])
@pytest.mark.parametrize("pitch", [-20, -10, 0])
def test_a_wall_in_front_of_the_camera_is_no_floor(pitch: int, log_from_world: np.ndarray) -> None:
    poses = np.array([held(np.array([0.9, 0.2 + 0.02 * k, 1.3]), 0.5, pitch, 0.3 * k) for k in range(6)])
    gravity = upright_of(poses, log_from_world, seen=0.0, highest=2.4)
    assert gravity.method == "mean_camera_up" and "no floor was seen" in gravity.detail
    assert tilt_of(gravity, log_from_world) < abs(pitch) + 2
    report = GravityReport(method=gravity.method, detail=gravity.detail)
    assert "up is not sure" in gravity_findings(report, True)[0].message


def test_a_ceiling_is_no_floor() -> None:
    gravity = upright_of(poses_of("turns", -45, 1), TILTED, seen=0.0)
    assert gravity.method == "mean_camera_up" and tilt_of(gravity, TILTED) < 3


@pytest.mark.parametrize(("walk", "within"), [("pans", 6.0), ("turns", 3.0), ("orbits", 3.0)])
def test_cameras_that_turn_about_tell_up_wherever_they_look(walk: str, within: float) -> None:
    for pitch in (0, 45, 90):
        up = camera_up(poses_of(walk, pitch, 5))
        assert up is not None and math.degrees(math.acos(up[2])) < within


def test_a_poor_plane_that_turns_a_log_a_little_is_doubted() -> None:
    random = np.random.default_rng(0)
    floor = np.column_stack([random.uniform(-2, 2, (4000, 2)), random.uniform(-0.026, 0.026, 4000)])
    turn = Rotation.from_euler("x", 5, degrees=True).as_matrix()
    cloud = floor @ turn.T, np.tile(turn[:, 2], (4000, 1))
    poses = poses_of("pans", 20, 0)
    gravity = make_upright("auto", "z", None, poses, lambda: cloud, np.random.default_rng(0))
    report = GravityReport(method=gravity.method, detail=gravity.detail)
    finding = gravity_findings(report, True)[0]
    assert finding.severity == "doubtful" and "the log's z, which may be up, by 5.0 deg" in finding.message


SIDEWAYS = [Rotation.from_euler("z", degrees, degrees=True).as_matrix() for degrees in (90, -90)]


def on_side(poses: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Return the poses (N, 4, 4) of the same cameras, turned about their line of sight: a phone held upright."""
    return poses @ transform_from(turn, np.zeros(3))


def turned_by(degrees: float) -> np.ndarray:
    return transform_from(Rotation.from_euler("z", degrees, degrees=True).as_matrix(), np.zeros(3))


@pytest.mark.parametrize("log_from_world", [turned_by(23), Y_UP @ turned_by(23)], ids=["z is up", "y is up"])
@pytest.mark.parametrize("turn", SIDEWAYS, ids=["left", "right"])
@pytest.mark.parametrize("walk", ["pans", "turns", "orbits"])
def test_cameras_on_their_side_in_a_log_that_is_upright(
    walk: str, turn: np.ndarray, log_from_world: np.ndarray
) -> None:
    poses = on_side(poses_of(walk, 25, 0), turn)
    assert on_their_side(poses)
    gravity = upright_of(poses, log_from_world)
    assert tilt_of(gravity, log_from_world) < 1 and "doubtful" not in gravity.detail


def test_cameras_on_their_side_that_hardly_turn() -> None:
    poses, log_from_world = on_side(poses_of("stands", 25, 0), SIDEWAYS[0]), Y_UP @ turned_by(23)
    assert on_their_side(poses) is None
    assert tilt_of(upright_of(poses, log_from_world), log_from_world) < 1


@pytest.mark.parametrize("log_from_world", [np.eye(4), Y_UP, TILTED], ids=["along the walls", "y is up", "tilted"])
def test_a_wall_that_may_be_the_floor_of_cameras_on_their_side_is_doubted(log_from_world: np.ndarray) -> None:
    gravity = upright_of(on_side(poses_of("pans", 25, 0), SIDEWAYS[0]), log_from_world)
    assert tilt_of(gravity, log_from_world) < 1 or "doubtful: the cameras may lie on their side" in gravity.detail


@pytest.mark.parametrize("walk", ["pans", "turns", "orbits"])
@pytest.mark.parametrize("pitch", [0, 25, 45, 60])
def test_cameras_that_are_held_level_are_not_on_their_side(walk: str, pitch: int) -> None:
    assert not on_their_side(poses_of(walk, pitch, 0))
    assert "side" not in upright_of(poses_of(walk, pitch, 0), Y_UP).detail
