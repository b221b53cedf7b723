"""Lenses, registration of depth, rectified pairs, up from an IMU: against closed forms and second implementations."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest.depth_registration import registered_depth
from scenewright.stages.ingest.inertial import measured_up
from scenewright.stages.ingest.lenses import lens_of, same_rays
from scenewright.stages.ingest.messages.records import CalibrationRecord
from scenewright.stages.ingest.stereo import rectifying_rotation, stereo_lenses
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.geometry.cameras import intrinsic_matrix
from scenewright.stages.kit.geometry.transforms import inverse, transform_from
from scipy.spatial.transform import Rotation

from tests.unit.ingest.message_logs import FIRST, SECOND, recorder
from tests.unit.ingest.running import ingest
from tests.unit.ingest.tiny_room import CAMERA, camera_poses, frames, jpeg, millimetres, room_depth

WIDE = Camera(width=128, height=72, fx=110.0, fy=111.0, cx=64.5, cy=36.0)
FINE = Camera(width=240, height=180, fx=230.0, fy=230.0, cx=118.0, cy=91.0)
OFFSET = transform_from(Rotation.from_euler("xyz", [0.01, -0.015, 0.02]).as_matrix(), np.array([0.05, 0.01, -0.004]))


# --- depth of one camera in another ----------------------------------------------------------------------------


@pytest.mark.parametrize("target", [CAMERA, WIDE, FINE], ids=["same", "wide", "upsampled"])
def test_registered_depth_is_what_the_other_camera_would_measure(target: Camera) -> None:
    """Rendered from both cameras: right to a fraction of a pixel, nothing seen through what is in front, no holes."""
    kernel = np.ones((3, 3), np.uint8)
    for pose in camera_poses(3):
        seen = registered_depth(millimetres(room_depth(CAMERA, pose)), CAMERA, target, inverse(OFFSET)) / 1000
        truth = room_depth(target, pose @ OFFSET)
        nearest, farthest = cv2.erode(truth, kernel), cv2.dilate(truth, kernel)
        valid = seen > 0
        slope = np.maximum(farthest - nearest, 0.002)  # change of depth over a pixel
        assert np.median(np.abs(seen - truth)[valid] / slope[valid]) < 0.3
        assert np.median(np.abs(seen - truth)[valid]) < 0.001
        step = max(2.5 * target.fx / CAMERA.fx, 2.5)
        wide = np.ones((2 * int(step) + 1,) * 2, np.uint8)
        assert not (valid & (seen > cv2.dilate(truth, wide) + 0.03)).any()
        assert not (valid & (seen < cv2.erode(truth, wide) - 0.03)).any()
        covered = registered_depth(np.full((72, 96), 2000, np.uint16), CAMERA, target, inverse(OFFSET)) > 0
        assert valid[covered].mean() > 0.96


def test_what_is_in_front_hides_what_is_behind_at_any_resolution() -> None:
    """A plate 0.5 m before a wall 2 m away, upsampled ten times: no wall shows through the plate."""
    small = Camera(width=40, height=30, fx=35.0, fy=35.0, cx=19.5, cy=14.5)
    large = Camera(width=400, height=300, fx=350.0, fy=350.0, cx=199.5, cy=149.5)
    depth = np.full((30, 40), 2000, np.uint16)
    depth[8:22, 10:25] = 500
    offset = transform_from(np.eye(3), np.array([-0.03, 0, 0]))
    seen = registered_depth(depth, small, large, offset)
    # The plate spans columns 9.5 to 24.5 of the small image; in the large one, 10 times that, less the parallax.
    left = (9.5 - 19.5) / 35 * 350 + 199.5 - 350 * 0.03 / 0.5
    right = (24.5 - 19.5) / 35 * 350 + 199.5 - 350 * 0.03 / 0.5
    plate = seen[85:212, int(np.ceil(left)) + 1 : int(right)]
    assert (plate == 500).all()
    shadow = seen[85:212, int(right) + 2 : int(right) + 12]
    assert (shadow == 0).all()  # hidden from the depth camera: nothing is known, so nothing is made up


def test_registration_by_the_identity_changes_nothing() -> None:
    depth = millimetres(room_depth(CAMERA, camera_poses(1)[0]))
    depth[10:20, 30:40] = 0
    depth[5, 5] = 65535
    expected = np.where(depth == 65535, 0, depth)
    seen = registered_depth(depth, CAMERA, CAMERA, np.eye(4))
    inside = np.zeros(depth.shape, bool)
    inside[1:-1, 1:-1] = True
    assert (np.abs(seen.astype(int) - expected)[inside] <= 1).mean() > 0.99
    assert (seen[11:19, 31:39] == 0).all()


def test_nothing_behind_the_other_camera_is_drawn() -> None:
    turned = transform_from(Rotation.from_euler("y", np.pi).as_matrix(), np.zeros(3))
    assert not registered_depth(np.full((72, 96), 1000, np.uint16), CAMERA, CAMERA, turned).any()


def _two_cameras(log: Any, mount: np.ndarray, count: int = 3, connected: bool = True, color: Camera = WIDE) -> list:
    """Record a colour camera that hangs at `mount` in a depth camera."""
    recorded = frames(count)
    if connected:
        log.transform("/tf_static", FIRST, "depth_frame", "color_frame", mount)
    for index, (_, depth, pose) in enumerate(recorded):
        stamp = FIRST + index * SECOND
        picture = np.full((color.height, color.width, 3), 100 + 10 * index, np.uint8)
        log.transform("/tf", stamp, "map", "depth_frame", pose)
        log.info("/cam/color/camera_info", stamp, "color_frame", color)
        log.info("/cam/depth/camera_info", stamp, "depth_frame")
        log.compressed("/cam/color/image_raw/compressed", stamp, jpeg(picture), "jpeg", "color_frame")
        log.image("/cam/depth/image_rect_raw", stamp, millimetres(depth), "16UC1", "depth_frame")
    return recorded


def test_depth_is_carried_into_the_colour_camera_of_a_log(tmp_path: Path) -> None:
    with recorder(tmp_path) as log:
        recorded = _two_cameras(log, OFFSET)
    sequence = ingest(log.path, tmp_path / "out", gravity="none")
    info = sequence.info
    assert info.camera == WIDE and info.color_depth_registered and info.frame_count == 3
    assert any("carried into the colour camera, 51.1 mm" in note for note in info.notes)
    with FrameReader(sequence.path("frames.mcap")) as reader:
        for frame, (_, _, pose) in zip(reader.frames(), recorded, strict=True):
            np.testing.assert_allclose(frame.world_from_camera, pose @ OFFSET, atol=1e-6)
            truth = room_depth(WIDE, pose @ OFFSET)
            valid = frame.depth > 0
            assert valid.mean() > 0.6 and np.median(np.abs(frame.depth - truth)[valid]) < 0.001
    kept = ingest(log.path, tmp_path / "kept", gravity="none", register_depth=False)
    assert kept.info.camera == CAMERA
    assert kept.info.streams == ("depth", "pose")  # 16:9 colour does not fit a 4:3 depth camera
    assert any("of another shape" in note for note in kept.info.notes)


def test_colour_and_depth_that_nothing_connects(tmp_path: Path) -> None:
    narrow = Camera(width=48, height=36, fx=45.0, fy=45.0, cx=23.5, cy=17.5)
    with recorder(tmp_path) as log:
        _two_cameras(log, OFFSET, connected=False, color=narrow)
    info = ingest(log.path, tmp_path / "out", gravity="none").info
    assert info.camera == CAMERA and info.streams == ("color", "depth", "pose") and not info.color_depth_registered
    assert any(note.startswith("WARNING") and "nothing says how" in note for note in info.notes)


# --- lenses ----------------------------------------------------------------------------------------------------


def _record(camera: Camera, model: str, coefficients: tuple[float, ...], **changes: Any) -> CalibrationRecord:
    matrix = tuple(intrinsic_matrix(camera).ravel())
    projection = (camera.fx * 0.9, 0, camera.cx + 1, 0, 0, camera.fy * 0.9, camera.cy - 2, 0, 0, 0, 1, 0)
    fields: dict[str, Any] = {"K": matrix, "P": projection, "width": camera.width, "height": camera.height}
    return CalibrationRecord(
        **({"stamp": 0, "frame_id": "f", "distortion_model": model, "D": coefficients, "R": ()} | fields | changes)
    )


LENSES = {
    "plumb_bob": (-0.25, 0.06, 0.001, -0.002, 0.0),
    "rational_polynomial": (-0.2, 0.05, 0.0, 0.0, 0.01, 0.02, 0.0, 0.0),
    "thin_prism": (-0.2, 0.05, 0.0, 0.0, 0.01, 0.02, 0.0, 0.0, 0.01, 0.0, -0.01, 0.0),
    "equidistant": (-0.02, 0.01, 0.0, -0.003),
    "Kannala-Brandt4": (0.05, -0.01, 0.0, 0.0),
}


@pytest.mark.parametrize("model", LENSES)
def test_undistorted_pixels_come_from_where_the_lens_put_them(model: str) -> None:
    """A picture whose values are its own pixel coordinates: after undistortion each pixel names the place that OpenCV
    projects its ray to."""
    coefficients = LENSES[model]
    v, u = np.mgrid[: FINE.height, : FINE.width].astype(np.float32)
    lens = lens_of(_record(FINE, model, coefficients), (240, 180), False, "log", "images")
    assert lens.camera == FINE and any("undone" in note for note in lens.notes)
    rays = np.stack([(u - FINE.cx) / FINE.fx, (v - FINE.cy) / FINE.fy, np.ones_like(u)], axis=-1).reshape(-1, 1, 3)
    zero, matrix = np.zeros(3), intrinsic_matrix(FINE)
    if model in ("equidistant", "Kannala-Brandt4"):
        expected, _ = cv2.fisheye.projectPoints(rays.astype(float), zero, zero, matrix, np.array(coefficients))
    else:
        expected, _ = cv2.projectPoints(rays.astype(float), zero, zero, matrix, np.array(coefficients))
    expected = expected.reshape(FINE.height, FINE.width, 2)
    coordinates = lens.pixels((u + 256 * v).astype(np.float32), "depth")
    inside = (expected > 1).all(axis=-1) & (expected[..., 0] < 238) & (expected[..., 1] < 178)
    assert inside.mean() > 0.7 and np.abs(expected - np.stack([u, v], -1))[inside].max() > 3
    assert np.abs(coordinates % 256 - expected[..., 0])[inside].max() <= 0.51
    assert np.abs(coordinates // 256 - expected[..., 1])[inside].max() <= 0.51


def test_rectified_topics_are_not_undistorted_again() -> None:
    record = _record(CAMERA, "plumb_bob", (-0.25, 0.06, 0.0, 0.0, 0.0))
    lens = lens_of(record, (96, 72), True, "log", "images")
    assert lens.maps is None
    assert (lens.camera.fx, lens.camera.cx, lens.camera.cy) == (CAMERA.fx * 0.9, CAMERA.cx + 1, CAMERA.cy - 2)
    assert lens_of(_record(CAMERA, "plumb_bob", (0.1,) * 5, P=()), (96, 72), True, "log", "images").camera == CAMERA


def test_calibrations_of_scaled_binned_and_cut_out_images(tmp_path: Path) -> None:
    """All of them describe the same image of the tiny room's camera."""
    double = Camera(width=192, height=144, fx=160.0, fy=160.0, cx=95.5, cy=71.5)
    cut = {"x_offset": 20, "y_offset": 10, "width": 96, "height": 72}
    shifted = Camera(width=300, height=200, fx=80.0, fy=80.0, cx=67.5, cy=45.5)
    for name, options in (
        ("scaled", {"camera": double}),
        ("binned", {"camera": double, "binning": 2}),
        ("cut", {"camera": shifted, "roi": cut}),
    ):
        with recorder(tmp_path / name) as log:
            color, depth, _ = frames(1)[0]
            log.info("/cam/camera_info", FIRST, "f", **options)
            log.compressed("/cam/image_color/compressed", FIRST, jpeg(color), "jpeg", "f")
            log.image("/cam/image_depth", FIRST, millimetres(depth), "16UC1", "f")
        info = ingest(log.path, tmp_path / f"{name}_out").info
        np.testing.assert_allclose(
            [info.camera.fx, info.camera.fy, info.camera.cx, info.camera.cy], [80, 80, 47.5, 35.5], atol=1e-9
        )
        assert (info.camera.width, info.camera.height) == (96, 72)


def test_same_rays() -> None:
    assert same_rays(CAMERA, CAMERA)
    double = Camera(width=192, height=144, fx=160.0, fy=160.0, cx=95.5, cy=71.5)
    assert same_rays(double, CAMERA) and same_rays(CAMERA, double)
    assert not same_rays(CAMERA.model_copy(update={"fx": 82.0}), CAMERA)
    assert not same_rays(WIDE, CAMERA)


# --- stereo ----------------------------------------------------------------------------------------------------


def _corners(camera: Camera, frame_from_camera: np.ndarray, points: np.ndarray, coefficients: tuple) -> np.ndarray:
    rotation, translation = inverse(frame_from_camera)[:3, :3], inverse(frame_from_camera)[:3, 3]
    seen, _ = cv2.projectPoints(
        points, cv2.Rodrigues(rotation)[0], translation, intrinsic_matrix(camera), np.array(coefficients)
    )
    return seen.reshape(-1, 2)


def test_pair_known_by_transforms_is_rectified() -> None:
    """Points in space: in the rectified images both eyes see them in one row, at the disparity of their depth."""
    left_from_right = transform_from(
        Rotation.from_euler("xyz", [0.02, -0.03, 0.015]).as_matrix(), np.array([0.12, 0.004, -0.006])
    )
    coefficients = (-0.1, 0.02, 0.0, 0.0, 0.0)
    record = _record(FINE, "plumb_bob", coefficients, P=())
    left, right, baseline = stereo_lenses(
        (record, record), ((240, 180), (240, 180)), (False, False), left_from_right, ("/l", "/r"), "log"
    )
    assert abs(baseline - np.linalg.norm(left_from_right[:3, 3])) < 1e-12
    points = np.array([[x, y, z] for x in (-0.3, 0.0, 0.3) for y in (-0.2, 0.2) for z in (1.0, 2.0)])
    turn = rectifying_rotation(left_from_right)
    for point in points:
        in_common = turn @ point
        expected_left = FINE.fx * in_common[0] / in_common[2] + FINE.cx
        row = FINE.fy * in_common[1] / in_common[2] + FINE.cy
        disparity = FINE.fx * baseline / in_common[2]
        for lens, pose, column in (
            (left, np.eye(4), expected_left),
            (right, left_from_right, expected_left - disparity),
        ):
            if not (2 < column < 237 and 2 < row < 177):
                continue
            where = _corners(FINE, pose, point.reshape(1, 1, 3), coefficients)[0]
            assert lens.maps is not None
            found = [
                (cv2.remap(part, np.float32([[column]]), np.float32([[row]]), cv2.INTER_LINEAR).item())
                for part in lens.maps
            ]
            np.testing.assert_allclose(found, where, atol=0.05)
    assert left.camera == right.camera
    np.testing.assert_allclose(left.camera_from_frame, turn, atol=1e-12)


def _stereo_log(log: Any, baseline: float, names: tuple[str, str] = ("left", "right"), **options: Any) -> None:
    for index, (color, _, pose) in enumerate(frames(3)):
        stamp = FIRST + index * SECOND
        log.transform("/tf", stamp, "map", "eyes", pose)
        for name, x in zip(names, (0.0, baseline), strict=True):
            projection = [80.0, 0, 47.5, -80.0 * x, 0, 80.0, 35.5, 0, 0, 0, 1.0, 0]
            picture = np.roll(color, int(100 * x), axis=1)
            log.info(f"/stereo/{name}/camera_info", stamp, "eyes", P=projection, **options)
            shift = 1_000_000 if x else 0
            log.compressed(f"/stereo/{name}/image_rect/compressed", stamp + shift, jpeg(picture), "jpeg", "eyes")


@pytest.mark.parametrize("names", [("left", "right"), ("infra1", "infra2")])
def test_stereo_log_gives_pairs_and_their_baseline(tmp_path: Path, names: tuple[str, str]) -> None:
    with recorder(tmp_path) as log:
        _stereo_log(log, 0.1, names)
    sequence = ingest(log.path, tmp_path / "out", gravity="none")
    info = sequence.info
    assert info.streams == ("color", "right", "pose") and info.cameras[0].baseline == pytest.approx(0.1)
    assert f"left from /stereo/{names[0]}" in info.rule and f"right from /stereo/{names[1]}" in info.rule
    with FrameReader(sequence.path("frames.mcap")) as reader:
        for frame, (color, _, pose) in zip(reader.frames(("color", "right")), frames(3), strict=True):
            np.testing.assert_allclose(frame.world_from_camera, pose, atol=1e-6)
            assert np.abs(frame.color.astype(int) - color).max() < 12
            assert np.abs(frame.right[:, 12:].astype(int) - np.roll(color, 10, axis=1)[:, 12:]).max() < 12


def test_swapped_eyes_are_refused_by_name(tmp_path: Path) -> None:
    with recorder(tmp_path) as log:
        _stereo_log(log, 0.1, ("right", "left"))
    with pytest.raises(
        BadInput, match=r"swapped: by the calibration /stereo/right/\S+ stands 0.1 m to the left of /stereo/left"
    ):
        ingest(log.path, tmp_path / "out")
    fixed = {"color_topic": "/stereo/right/image_rect/compressed", "right_topic": "/stereo/left/image_rect/compressed"}
    assert ingest(log.path, tmp_path / "fixed", **fixed).info.cameras[0].baseline == pytest.approx(0.1)


def test_eyes_without_a_baseline_are_two_cameras_and_no_pair(tmp_path: Path) -> None:
    with recorder(tmp_path) as log:
        _stereo_log(log, 0.0)
    info = ingest(log.path, tmp_path / "out").info
    assert info.streams == ("color", "pose") and info.other_cameras == ("right",)
    assert any("look like a stereo pair" in note for note in info.notes)
    with pytest.raises(BadInput, match="nothing says how /stereo/left"):
        ingest(log.path, tmp_path / "asked", right_topic="/stereo/right/image_rect/compressed")


@pytest.mark.parametrize(
    ("offset", "complaint"), [([0.0, 0, 0], "no baseline"), ([0.0, 0.1, 0], "one above the other")]
)
def test_transforms_that_make_no_pair(offset: list[float], complaint: str) -> None:
    record = _record(CAMERA, "plumb_bob", (), P=())
    with pytest.raises(BadInput, match=complaint):
        stereo_lenses(
            (record, record),
            ((96, 72),) * 2,
            (False,) * 2,
            transform_from(np.eye(3), np.array(offset)),
            ("/l", "/r"),
            "log",
        )


# --- up --------------------------------------------------------------------------------------------------------


def test_up_is_what_the_mean_of_the_turned_accelerations_says() -> None:
    random = np.random.default_rng(0)
    up = np.array([0.3, -0.8, 0.5]) / np.linalg.norm([0.3, -0.8, 0.5])
    rotations = Rotation.random(200, random_state=1)
    samples = [(stamp, rotations[stamp].as_matrix().T @ (9.81 * up + random.normal(0, 0.3, 3))) for stamp in range(200)]
    found, note = measured_up(samples, lambda stamp: transform_from(rotations[stamp].as_matrix(), np.zeros(3)))
    assert found is not None and np.degrees(np.arccos(found @ up)) < 0.5 and "200 samples" in note
    halved = [(stamp, acceleration / 9.81) for stamp, acceleration in samples]
    found, note = measured_up(halved, lambda stamp: transform_from(rotations[stamp].as_matrix(), np.zeros(3)))
    assert found is None and "1.00 m/s^2, not 9.81" in note
    found, note = measured_up(samples, lambda stamp: np.eye(4) if stamp < 19 else None)
    assert found is None and "19 of its 200" in note


def test_up_of_a_log_with_an_imu(tmp_path: Path) -> None:
    """The world of the poses lies on its side; the IMU knows, through its mount on the camera."""
    lying = transform_from(Rotation.from_euler("x", np.pi / 2).as_matrix(), np.zeros(3))
    camera_from_imu = transform_from(Rotation.from_euler("xyz", [0.3, 0.1, -0.4]).as_matrix(), np.array([0.01, 0, 0]))
    with recorder(tmp_path) as log:
        log.transform("/tf_static", FIRST, "optical", "imu_link", camera_from_imu)
        for index, (color, _, pose) in enumerate(frames(24)):
            stamp = FIRST + index * SECOND // 10
            log.transform("/tf", stamp, "map", "optical", lying @ pose)
            log.info("/cam/camera_info", stamp, "optical")
            log.compressed("/cam/image_color/compressed", stamp, jpeg(color), "jpeg", "optical")
            gravity = (lying @ pose @ camera_from_imu)[:3, :3].T @ lying[:3, :3] @ np.array([0, 0, 9.81])
            log.imu("/imu/data", stamp, "imu_link", gravity)
    sequence = ingest(log.path, tmp_path / "out", gravity="imu")
    assert sequence.info.gravity.method == "imu"
    with FrameReader(sequence.path("frames.mcap")) as reader:
        for frame, (_, _, pose) in zip(reader.frames(()), frames(24), strict=True):
            np.testing.assert_allclose(frame.world_from_camera[2, :3], pose[2, :3], atol=1e-4)
