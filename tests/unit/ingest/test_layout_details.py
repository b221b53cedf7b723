"""What is particular to each folder layout: defaults of data sets, conventions, several models, scale."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest.detection import open_log
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.kit.geometry.transforms import transform_from, transform_from_yaw
from scipy.spatial.transform import Rotation

from tests.unit.ingest.calibrations import CAMODOCAL, ORB_SLAM
from tests.unit.ingest.depth_array_writing import write_colmap_array
from tests.unit.ingest.folder_writers import (
    FIRST_STAMP,
    OPENGL_FROM_OPENCV,
    distorted,
    stamp_text,
    tum_line,
    write_colmap,
    write_image_folder,
    write_nerfstudio,
    write_replica,
    write_scannet,
    write_scenenn,
    write_tum,
)
from tests.unit.ingest.loading import loaded_frames
from tests.unit.ingest.tiny_room import CAMERA, color_image, frames, jpeg, millimetres, png, room_depth

DISTORTION = [0.3, -0.1, 0.006, -0.004]


def notes_of(log: Path, **options: object) -> str:
    """Return all notes of a log as one text."""
    return " | ".join(open_log(log, IngestParameters(**options)).notes)


# --- TUM -------------------------------------------------------------------------------------------------------


def test_tum_poses_are_interpolated_and_gaps_are_not(tmp_path: Path) -> None:
    recorded = frames(12)
    log = write_tum(tmp_path / "log", recorded, depth_shift=0.0)
    lines = (log / "groundtruth.txt").read_text().splitlines()
    (log / "groundtruth.txt").write_text("\n".join([lines[0], *lines[1:4], lines[5], *lines[8:]]))
    source = open_log(log, IngestParameters(maximum_transform_gap=0.07))
    poses = [entry.world_from_camera for entry in source.entries]
    assert [pose is None for pose in poses] == [index in (5, 6) for index in range(12)]  # the gap of three
    halfway = Rotation.from_matrix([recorded[2][2][:3, :3], recorded[4][2][:3, :3]]).mean().as_matrix()
    np.testing.assert_allclose(poses[3][:3, :3], halfway, atol=1e-6)
    np.testing.assert_allclose(poses[3][:3, 3], (recorded[2][2][:3, 3] + recorded[4][2][:3, 3]) / 2, atol=1e-6)


def test_tum_pairs_are_within_tolerance_and_counted(tmp_path: Path) -> None:
    log = write_tum(tmp_path / "log", frames(5))
    lines = (log / "depth.txt").read_text().splitlines()
    (log / "depth.txt").write_text("\n".join(lines[:2] + lines[3:]))  # the second depth image is not listed
    source = open_log(log, IngestParameters())
    assert [entry.problem for entry in source.entries] == [None, "no_depth_within_tolerance", None, None, None]
    source = open_log(log, IngestParameters(maximum_time_difference=0.001))
    assert {entry.problem for entry in source.entries} == {"no_depth_within_tolerance"}
    assert "4 depth images are paired with no colour image" in " | ".join(source.notes)


def test_tum_without_groundtruth_or_without_depth(tmp_path: Path) -> None:
    log = write_tum(tmp_path / "log", frames(3), groundtruth=False)
    source, found = loaded_frames(log)
    assert not source.has_poses and all(frame.depth is not None for frame in found)
    (log / "depth.txt").unlink()
    source, found = loaded_frames(log)
    assert "no depth" in source.rule and all(frame.depth is None for frame in found)
    assert source.entries[0].time == pytest.approx(FIRST_STAMP, abs=1e-6)


@pytest.mark.parametrize("depth_first", [False, True])
def test_tum_associations(tmp_path: Path, depth_first: bool) -> None:
    log = write_tum(tmp_path / "log", frames(3))
    pairs = []
    for color, depth in zip(*((log / f"{n}.txt").read_text().splitlines()[1:] for n in ("rgb", "depth")), strict=True):
        pairs.append(f"{depth} {color}" if depth_first else f"{color} {depth}")
    (log / "associations.txt").write_text("\n".join(pairs))
    expected = [entry.name for entry in open_log(log, IngestParameters()).entries]
    for name in ("rgb.txt", "depth.txt"):
        (log / name).unlink()
    source, found = loaded_frames(log)
    assert [entry.name for entry in source.entries] == expected and source.has_poses
    np.testing.assert_allclose(found[2].depth / 1000, frames(3)[2][1], atol=0.0007)


@pytest.mark.parametrize(
    ("name", "focal", "undone"),
    [
        ("rgbd_dataset_freiburg1_desk", 517.3, True),
        ("fr2_xyz", 520.9, True),
        ("rgbd_dataset_freiburg3_long_office_household", 535.4, False),
    ],
)
def test_tum_cameras_of_the_data_set(tmp_path: Path, name: str, focal: float, undone: bool) -> None:
    log = write_tum(tmp_path / name, frames(1))
    (log / "calibration.txt").unlink()
    with pytest.raises(BadInput, match="96x72"):
        open_log(log, IngestParameters())
    next((log / "rgb").iterdir()).write_bytes(png(np.full((480, 640, 3), 90, np.uint8)))
    next((log / "depth").iterdir()).write_bytes(png(np.full((480, 640), 9000, np.uint16)))
    source = open_log(log, IngestParameters())
    assert source.camera.fx == focal and ("distortion undone" in " ".join(source.notes)) == undone
    frame = source.entries[0].load()
    assert isinstance(frame.color, bytes) != undone
    plain = open_log(log, IngestParameters(fx=525.0, fy=525.0, cx=319.5, cy=239.5))
    assert plain.camera.fx == 525 and ("is not undone" in " ".join(plain.notes)) == undone
    assert (plain.entries[0].load().depth == 1800).all()


def test_icl_nuim_numbers_frames_and_mirrors_poses(tmp_path: Path) -> None:
    mirror = np.diag([1.0, -1.0, 1.0, 1.0])
    log, recorded = tmp_path / "living_room_traj2_frei_png", frames(4)
    (log / "rgb").mkdir(parents=True)
    (log / "depth").mkdir()
    lines, poses = [], []
    for index, (color, depth, pose) in enumerate(recorded):
        (log / "rgb" / f"{index}.png").write_bytes(png(cv2.resize(color, (640, 480))))
        deep = cv2.resize(depth, (640, 480), interpolation=cv2.INTER_NEAREST)
        (log / "depth" / f"{index}.png").write_bytes(png(np.rint(deep * 5000).astype(np.uint16)))
        lines.append(f"{index} depth/{index}.png {index} rgb/{index}.png")
        if index:  # its trajectories begin with frame 1
            poses.append(tum_line(str(index), mirror @ pose @ mirror))
    (log / "associations.txt").write_text("\n".join(lines))
    (log / "livingRoom2.gt.freiburg").write_text("\n".join(poses))
    source = open_log(log, IngestParameters())
    assert (source.camera.fx, source.camera.fy) == (481.2, 480.0)
    np.testing.assert_allclose([entry.time for entry in source.entries], np.arange(4) / 30, atol=1e-9)
    assert source.entries[0].world_from_camera is None
    np.testing.assert_allclose(source.entries[2].world_from_camera, recorded[2][2], atol=1e-6)
    assert "mirrored in y" in " ".join(source.notes)


def test_distortion_is_undone_in_colour_and_depth(tmp_path: Path) -> None:
    """A smooth picture and a smooth depth, taken through a lens, come out as the pinhole camera sees them."""
    v, u = np.mgrid[:72, :96].astype(np.float32)
    picture = np.stack([u * 2, v * 3, u + v], axis=-1).astype(np.uint8)
    slope = (1.0 + u / 200 + v / 150).astype(np.float32)
    recorded = [(distorted(picture, CAMERA, DISTORTION), distorted(slope, CAMERA, DISTORTION), np.eye(4))]
    log = write_tum(tmp_path / "log", recorded)
    with (log / "calibration.txt").open("a") as file:
        file.write(" ".join(map(str, DISTORTION)))
    _, (frame,) = loaded_frames(log)
    inner = np.s_[8:-8, 8:-8]
    assert np.abs(frame.color.astype(int) - picture)[inner].max() <= 2
    valid = frame.depth[inner] > 0
    assert valid.mean() > 0.95
    np.testing.assert_allclose(frame.depth[inner][valid] / 1000, slope[inner][valid], atol=0.008)  # the nearest pixel
    assert np.abs(recorded[0][0].astype(int) - picture)[inner].max() > 5  # the lens did matter


# --- SceneNN ---------------------------------------------------------------------------------------------------


def test_scenenn_entry_n_belongs_to_image_n_plus_1(tmp_path: Path) -> None:
    recorded = frames(4)
    log = write_scenenn(tmp_path / "log", recorded)
    for name in ("image/image00001.png", "depth/depth00001.png"):
        (log / name).unlink()
    source = open_log(log, IngestParameters())
    assert [entry.name for entry in source.entries] == ["frame 2", "frame 3", "frame 4"]
    np.testing.assert_allclose(source.entries[0].world_from_camera, recorded[1][2], atol=1e-9)
    assert "1 poses of trajectory.log belong to no image" in " ".join(source.notes)


def test_scenenn_default_camera_only_at_its_size(tmp_path: Path) -> None:
    log = write_scenenn(tmp_path / "log", frames(1))
    (log / "asus.ini").unlink()
    with pytest.raises(BadInput, match="--fx --fy --cx --cy"):
        open_log(log, IngestParameters())
    (log / "depth" / "depth00001.png").write_bytes(png(np.full((480, 640), 900, np.uint16)))
    assert open_log(log, IngestParameters()).camera.fx == pytest.approx(544.47329)


def test_scenenn_ini_without_a_centre(tmp_path: Path) -> None:
    log = write_scenenn(tmp_path / "scenes" / "231", frames(1))
    (tmp_path / "scenes" / "intrinsic").mkdir()
    (log / "asus.ini").unlink()
    (tmp_path / "scenes" / "intrinsic" / "asus.ini").write_text("depth_width 96\ndepth_height 72\nfx 80.0\nfy 80.0\n")
    camera = open_log(log, IngestParameters()).camera
    assert (camera.fx, camera.cx, camera.cy) == (80.0, 48.0, 36.0)


# --- ScanNet ---------------------------------------------------------------------------------------------------


def test_scannet_colour_is_resampled_into_the_depth_camera(tmp_path: Path) -> None:
    """Colour of twice the size and another shape and centre: a picture of ray directions stays one."""
    color_camera = Camera(width=200, height=150, fx=150.0, fy=151.0, cx=97.0, cy=76.0)

    def directions(camera: Camera) -> np.ndarray:
        v, u = np.mgrid[: camera.height, : camera.width]
        x, y = (u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy
        return np.clip(np.stack([128 + 150 * x, 128 + 150 * y, 60 + 0 * x], axis=-1), 0, 255).astype(np.uint8)

    recorded = [(directions(color_camera), room_depth(CAMERA, pose), pose) for _, _, pose in frames(2)]
    source, found = loaded_frames(write_scannet(tmp_path / "log", recorded, color_camera))
    assert source.camera == CAMERA and source.cameras[0].registered
    assert np.abs(found[0].color.astype(int) - directions(CAMERA)).max() <= 6
    assert "200x150 resampled into the depth camera 96x72" in " ".join(source.notes)


def test_scannet_info_file_and_endless_poses(tmp_path: Path) -> None:
    log = write_scannet(tmp_path / "log", frames(2))
    k = CAMERA
    intrinsic = f"{k.fx} 0 {k.cx} 0 0 {k.fy} {k.cy} 0 0 0 1 0 0 0 0 1"
    identity = "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"
    lines = [
        f"m_{n}Width = 96\nm_{n}Height = 72\nm_calibration{n.title()}Intrinsic = {intrinsic}"
        for n in ("color", "depth")
    ]
    lines += [f"m_calibration{n}Extrinsic = {identity}" for n in ("Color", "Depth")]
    (log / "_info.txt").write_text("\n".join([*lines, "m_depthShift = 500"]))
    shutil.rmtree(log / "intrinsic")
    np.savetxt(log / "pose" / "1.txt", np.full((4, 4), -np.inf))
    source, found = loaded_frames(log)
    assert source.camera == CAMERA
    np.testing.assert_allclose(found[0].depth / 1000, frames(1)[0][1] * 2, atol=0.0011)
    assert np.isinf(source.entries[1].world_from_camera).all()  # dropped as non_finite_pose by the step


def test_scannet_extrinsics_that_are_none(tmp_path: Path) -> None:
    log = write_scannet(tmp_path / "log", frames(1))
    np.savetxt(log / "intrinsic" / "extrinsic_color.txt", transform_from(np.eye(3), np.array([0.03, 0, 0])))
    source = open_log(log, IngestParameters())
    assert not source.cameras[0].registered and any(note.startswith("WARNING") for note in source.notes)


@pytest.mark.parametrize("inside", [True, False])
def test_scannet_containers_are_refused_in_words(tmp_path: Path, inside: bool) -> None:
    (tmp_path / "scene0000_00.sens").write_bytes(b"\x04\0\0\0")
    with pytest.raises(BadInput, match="SensReader"):
        open_log(tmp_path if inside else tmp_path / "scene0000_00.sens", IngestParameters())


# --- nerfstudio ------------------------------------------------------------------------------------------------


def test_nerfstudio_normalisation_is_undone(tmp_path: Path) -> None:
    recorded = frames(3)
    applied, scale = transform_from_yaw(0.7, np.array([1.0, -2.0, 0.5])), 0.25
    saved = []
    for color, depth, pose in recorded:
        moved = applied @ pose
        moved[:3, 3] *= scale
        saved.append((color, depth, moved))
    log = write_nerfstudio(tmp_path / "log", saved, applied_transform=applied[:3].tolist(), applied_scale=scale)
    source = open_log(log, IngestParameters())
    for entry, (_, _, pose) in zip(source.entries, recorded, strict=True):
        np.testing.assert_allclose(entry.world_from_camera, pose, atol=1e-9)
    text = " ".join(source.notes)
    assert "applied_transform undone" in text and "applied_scale 0.25 undone" in text


def test_nerfstudio_field_of_view_and_names_without_ending(tmp_path: Path) -> None:
    log = write_nerfstudio(
        tmp_path / "log", frames(2), depth=False, fl_x=None, fl_y=None, cx=None, cy=None, w=None, h=None
    )
    document = json.loads((log / "transforms.json").read_text())
    document["camera_angle_x"] = 2 * np.arctan(0.5 * 96 / 80.0)
    for frame in document["frames"]:
        frame["file_path"] = "./" + frame["file_path"].removesuffix(".png")
    (log / "transforms.json").write_text(json.dumps(document))
    source, found = loaded_frames(log)
    assert source.camera.fx == pytest.approx(80) and source.camera.cx == 47.5 and source.camera.cy == 35.5
    assert found[0].depth is None and found[0].color.shape == (72, 96, 3)
    assert "WARNING: scale unknown" in " ".join(source.notes)


def test_nerfstudio_depth_unit_and_smaller_depth(tmp_path: Path) -> None:
    log = write_nerfstudio(tmp_path / "log", frames(1), depth_unit_scale_factor=0.002)
    half = millimetres(frames(1)[0][1])[::2, ::2]
    (log / "depth" / "frame_1.png").write_bytes(png(half))
    source, found = loaded_frames(log)
    assert (source.camera.width, source.camera.height, source.camera.fx) == (48, 36, 40.0)
    assert source.camera.cx == pytest.approx((CAMERA.cx + 0.5) / 2 - 0.5)
    np.testing.assert_array_equal(found[0].depth, half * 2)
    assert found[0].color.shape == (36, 48, 3)


def test_nerfstudio_numpy_depth(tmp_path: Path) -> None:
    recorded = frames(2)
    log = write_nerfstudio(tmp_path / "log", recorded, depth_unit_scale_factor=1.0)
    document = json.loads((log / "transforms.json").read_text())
    for frame in document["frames"]:
        index = int(frame["file_path"].split("_")[1].split(".")[0]) - 1
        frame["depth_file_path"] = f"depth/{index}.npy"
        np.save(log / frame["depth_file_path"], recorded[index][1])
    (log / "transforms.json").write_text(json.dumps(document))
    _, found = loaded_frames(log)
    np.testing.assert_array_equal(found[1].depth, millimetres(recorded[1][1]))


@pytest.mark.parametrize("fisheye", [False, True])
def test_nerfstudio_lenses_are_undone(tmp_path: Path, fisheye: bool) -> None:
    picture = cv2.GaussianBlur(color_image(3), (0, 0), 2)
    coefficients = [0.05, -0.01, 0.002, 0.0] if fisheye else DISTORTION
    model = "OPENCV_FISHEYE" if fisheye else "OPENCV"
    names = ("k1", "k2", "k3", "k4") if fisheye else ("k1", "k2", "p1", "p2")
    recorded = [(distorted(picture, CAMERA, coefficients, fisheye=fisheye), *frames(1)[0][1:])]
    log = write_nerfstudio(
        tmp_path / "log", recorded, depth=False, camera_model=model, **dict(zip(names, coefficients, strict=True))
    )
    source, (frame,) = loaded_frames(log)
    assert np.abs(frame.color.astype(int) - picture)[8:-8, 8:-8].max() <= 2
    assert np.abs(recorded[0][0].astype(int) - picture)[8:-8, 8:-8].max() >= 4
    assert "lens distortion undone" in " ".join(source.notes)


def test_nerfstudio_cameras_of_their_own(tmp_path: Path) -> None:
    log = write_nerfstudio(tmp_path / "log", frames(5))
    document = json.loads((log / "transforms.json").read_text())
    document["frames"][0] |= {"fl_x": 90.0, "fl_y": 90.0}  # frame_5: the list is written backwards
    (log / "transforms.json").write_text(json.dumps(document))
    source = open_log(log, IngestParameters())
    assert [known.name for known in source.cameras] == ["camera_1"] and len(source.entries) == 4
    assert source.other_cameras == ("camera_2",)
    both = open_log(log, IngestParameters(camera=("all",)))
    assert [known.camera.fx for known in both.cameras] == [80.0, 90.0]
    assert [entry.camera_name for entry in both.entries] == ["camera_1"] * 4 + ["camera_2"]
    with pytest.raises(UsageError, match="camera_1, camera_2"):
        open_log(log, IngestParameters(camera=("left",)))
    for index, frame in enumerate(document["frames"]):
        frame |= {"camera_name": "tele" if index == 0 else "wide", "timestamp": 100.0 - index}
    (log / "transforms.json").write_text(json.dumps(document))
    named = open_log(log, IngestParameters(camera=("tele", "wide")))
    assert [entry.camera_name for entry in named.entries] == ["wide"] * 4 + ["tele"]
    assert [entry.time for entry in named.entries] == [96.0, 97.0, 98.0, 99.0, 100.0]


def test_nerfstudio_intrinsics_of_every_frame_become_one_camera(tmp_path: Path) -> None:
    count = 11
    log = write_nerfstudio(tmp_path / "log", frames(count))
    document = json.loads((log / "transforms.json").read_text())
    picture = np.clip(np.indices((72, 96)).sum(axis=0), 0, 255).astype(np.uint8)
    for index, frame in enumerate(document["frames"]):
        frame["fl_x"] = 75.0 + index
        (log / frame["file_path"]).write_bytes(png(np.repeat(picture[..., None], 3, axis=2)))
    (log / "transforms.json").write_text(json.dumps(document))
    source, found = loaded_frames(log)
    assert [known.name for known in source.cameras] == ["camera"] and source.camera.fx == 80.0
    assert len(source.entries) == count and "11 different intrinsics" in " ".join(source.notes)
    # The widest frame is the last in the list, the first by name: its column u is at 80 / 85 of the distance from cx.
    u = 80
    expected = 36 + CAMERA.cx + (u - CAMERA.cx) / 80 * 85
    assert found[0].color[36, u, 0] == pytest.approx(expected, abs=1.01)


def test_replica_camera_beside_or_by_default(tmp_path: Path) -> None:
    log = write_replica(tmp_path / "room0", frames(1))
    (tmp_path / "cam_params.json").unlink()
    with pytest.raises(BadInput, match="--fx"):
        open_log(log, IngestParameters())
    (log / "results" / "depth000000.png").write_bytes(png(np.full((680, 1200), 9000, np.uint16)))
    assert open_log(log, IngestParameters()).camera.cx == 599.5


# --- COLMAP ----------------------------------------------------------------------------------------------------


def test_colmap_takes_the_largest_model_and_says_so(tmp_path: Path) -> None:
    log = write_colmap(tmp_path / "log", frames(3))
    larger = write_colmap(tmp_path / "larger", frames(5))
    shutil.move(larger / "sparse" / "0", log / "sparse" / "1")
    for path in (larger / "images").iterdir():
        shutil.copy(path, log / "images")
    for path in (larger / "depth").iterdir():
        shutil.copy(path, log / "depth")
    source = open_log(log, IngestParameters())
    assert len(source.entries) == 5
    assert "largest of 2 models taken (sparse/0 3, sparse/1 5)" in " ".join(source.notes)


def test_colmap_images_outside_of_the_model_are_counted(tmp_path: Path) -> None:
    log = write_colmap(tmp_path / "log", frames(3))
    (log / "images" / "extra.png").write_bytes(png(color_image(0)))
    source = open_log(log, IngestParameters())
    assert [entry.problem for entry in source.entries].count("missing_pose") == 1 and len(source.entries) == 4


def test_colmap_scale_is_warned_about_unless_depth_says_it(tmp_path: Path) -> None:
    assert "WARNING: scale unknown" in notes_of(write_colmap(tmp_path / "a", frames(2), depth=False))
    assert "WARNING" not in notes_of(write_colmap(tmp_path / "b", frames(2)))


def test_colmap_dense_depth(tmp_path: Path) -> None:
    recorded = frames(3)
    log = write_colmap(tmp_path / "log", recorded, depth=False)
    (log / "stereo" / "depth_maps").mkdir(parents=True)
    for index, (_, depth, _) in enumerate(recorded):
        for ending, factor in (("photometric", 2.0), ("geometric", 1.0)):
            write_colmap_array(log / "stereo" / "depth_maps" / f"frame_{index + 1}.png.{ending}.bin", depth * factor)
    source, found = loaded_frames(log)
    np.testing.assert_array_equal(found[2].depth, millimetres(recorded[2][1]))
    assert "WARNING: scale unknown" in " ".join(source.notes)


def test_colmap_depth_maps_are_what_the_library_writes(tmp_path: Path) -> None:
    """A second implementation: the header and order of COLMAP's own arrays (column by column of a transposed image)."""
    image = np.arange(12, dtype=np.float32).reshape(3, 4)
    write_colmap_array(tmp_path / "a.bin", image)
    header, _, _ = (tmp_path / "a.bin").read_bytes().partition(b"\0")
    assert header.startswith(b"4&3&1&")
    numbers = np.frombuffer((tmp_path / "a.bin").read_bytes()[6:], np.float32).reshape((4, 3, 1), order="F")
    np.testing.assert_array_equal(np.transpose(numbers, (1, 0, 2)).squeeze(), image)


@pytest.mark.parametrize(
    ("model", "tail", "fisheye"),
    [
        ("SIMPLE_RADIAL", [0.1], False),
        ("RADIAL", [0.1, -0.02], False),
        ("OPENCV", DISTORTION, False),
        ("FULL_OPENCV", [0.1, -0.02, 0.001, 0.001, 0.003, 0.01, 0.0, 0.0], False),
        ("OPENCV_FISHEYE", [0.05, -0.01, 0.0, 0.0], True),
        ("SIMPLE_RADIAL_FISHEYE", [0.05], True),
    ],
)
def test_colmap_cameras_agree_with_the_library(tmp_path: Path, model: str, tail: list[float], fisheye: bool) -> None:
    """Points that the library projects into the distorted image lie where our undistorted camera sees them."""
    import pycolmap

    one = model.startswith(("SIMPLE", "RADIAL"))
    parameters = [80.0, 48.0, 36.0, *tail] if one else [80.0, 82.0, 48.0, 36.0, *tail]
    camera = pycolmap.Camera(model=model, width=96, height=72, params=parameters, camera_id=1)
    points = np.array([[-0.3, 0.2, 1.0], [0.1, -0.25, 1.0], [0.35, 0.3, 1.0]])
    picture = np.zeros((72, 96, 3), np.float32)
    v, u = np.mgrid[:72, :96]
    for point in points:  # a soft spot where the library says that the point is seen, with its pixel centres at .5
        x, y = np.asarray(camera.img_from_cam(point)).ravel() - 0.5
        picture += 255 * np.exp(-((u - x) ** 2 + (v - y) ** 2) / (2 * 1.5**2))[..., None]
    log = write_colmap(tmp_path / "log", [(np.clip(picture, 0, 255).astype(np.uint8), *frames(1)[0][1:])], depth=False)
    reconstruction = pycolmap.Reconstruction()
    reconstruction.add_camera_with_trivial_rig(camera)
    image = pycolmap.Image(name="frame_1.png", camera_id=1, image_id=1)
    reconstruction.add_image_with_trivial_frame(image, pycolmap.Rigid3d(np.eye(4)[:3]))
    reconstruction.write_binary(str(log / "sparse" / "0"))
    source, (frame,) = loaded_frames(log)
    k = source.camera
    for point in points:
        x, y = k.fx * point[0] + k.cx, k.fy * point[1] + k.cy
        near = np.exp(-((u - x) ** 2 + (v - y) ** 2) / (2 * 3.0**2)) * frame.color[..., 0]
        center = np.array([(near * u).sum(), (near * v).sum()]) / near.sum()
        np.testing.assert_allclose(center, [x, y], atol=0.25)


def test_colmap_reader_agrees_with_the_library(tmp_path: Path) -> None:
    import pycolmap
    from scenewright.stages.ingest.layouts.colmap.model import read_model

    for binary in (True, False):
        log = write_colmap(tmp_path / str(binary), frames(4), binary=binary)
        model = read_model(log / "sparse" / "0")
        reference = pycolmap.Reconstruction(str(log / "sparse" / "0"))
        assert {image.name for image in model.images} == {image.name for image in reference.images.values()}
        for image in model.images:
            other = reference.find_image_with_name(image.name)
            camera_from_world = np.vstack([other.cam_from_world().matrix(), [0, 0, 0, 1]])
            np.testing.assert_allclose(image.world_from_camera @ camera_from_world, np.eye(4), atol=1e-12)
            assert model.cameras[image.camera].parameters == tuple(reference.cameras[image.camera].params)


def test_colmap_several_cameras(tmp_path: Path) -> None:
    import pycolmap

    log = write_colmap(tmp_path / "log", frames(5), depth=False)
    model = pycolmap.Reconstruction(str(log / "sparse" / "0"))
    extra = pycolmap.Camera(model="PINHOLE", width=96, height=72, params=[90.0, 90.0, 48.0, 36.0], camera_id=7)
    model.add_camera_with_trivial_rig(extra)
    image = pycolmap.Image(name="other.png", camera_id=7, image_id=99)
    model.add_image_with_trivial_frame(image, pycolmap.Rigid3d(np.eye(4)[:3]))
    model.write_binary(str(log / "sparse" / "0"))
    (log / "images" / "other.png").write_bytes(png(color_image(0)))
    source = open_log(log, IngestParameters())
    assert [known.name for known in source.cameras] == ["camera_1"] and source.other_cameras == ("camera_7",)
    assert len(source.entries) == 5
    assert len(open_log(log, IngestParameters(camera=("camera_7",))).entries) == 1


# --- plain images ----------------------------------------------------------------------------------------------


def test_stamped_names_and_trajectory(tmp_path: Path) -> None:
    recorded = frames(4)
    log = write_image_folder(tmp_path / "log", recorded, poses=False)
    lines = []
    for index, (_, _, pose) in enumerate(recorded):
        for kind in ("rgb", "depth"):
            (log / kind / f"{kind}_{index}.png").rename(log / kind / f"{stamp_text(index)}.png")
        lines.append(tum_line(stamp_text(index), pose))
    (log / "groundtruth.txt").write_text("\n".join(lines))
    source = open_log(log, IngestParameters())
    assert source.format == "images"
    np.testing.assert_allclose([entry.time for entry in source.entries], FIRST_STAMP + np.arange(4) / 30, atol=1e-6)
    np.testing.assert_allclose(source.entries[3].world_from_camera, recorded[3][2], atol=1e-6)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("intrinsics.txt", "80 80 47.5 35.5"),
        ("intrinsics.txt", "fx: 80\nfy: 80\ncx: 47.5\ncy: 35.5\nwidth: 96\nheight: 72\n"),
        ("camera.json", '{"fx": 80, "fy": 80, "cx": 47.5, "cy": 35.5}'),
        ("camera.json", '{"width": 96, "height": 72, "intrinsic_matrix": [80, 0, 0, 0, 80, 0, 47.5, 35.5, 1]}'),
        ("camera.json", '{"camera_matrix": [[80, 0, 47.5], [0, 80, 35.5], [0, 0, 1]], "dist": [0, 0, 0, 0, 0]}'),
        (
            "camera_info.yaml",
            "image_width: 96\nimage_height: 72\ncamera_name: c\n"
            "camera_matrix:\n  rows: 3\n  cols: 3\n  data: [80, 0, 47.5, 0, 80, 35.5, 0, 0, 1]\n"
            "distortion_model: plumb_bob\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [0, 0, 0, 0, 0]\n",
        ),
        (
            "calibration.yaml",
            "%YAML:1.0\n---\nK: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
            "   data: [ 80., 0., 47.5, 0., 80., 35.5, 0., 0., 1. ]\n",
        ),
        ("sensor.yaml", "intrinsics: [80, 80, 47.5, 35.5]\nresolution: [96, 72]\ndistortion_model: radtan\n"),
        ("calib.txt", "P0: 80 0 47.5 0 0 80 35.5 0 0 0 1 0\n"),
        ("camera.json", '{"K": [80, 0, 0, 0, 80, 0, 47.5, 35.5, 1]}'),
        ("TUM1.yaml", ORB_SLAM),
        ("EuRoC.yaml", ORB_SLAM.replace("Camera.", "Camera1.").replace("Camera1.type", "Camera.type")),
        ("cam0_pinhole.yaml", CAMODOCAL),
        ("front.json", '{"fx": 80, "fy": 80, "cx": 47.5, "cy": 35.5}'),
        ("lens.txt", "fx: 80\nfy: 80\ncx: 47.5\ncy: 35.5\n"),
    ],
)
def test_calibration_files(tmp_path: Path, name: str, text: str) -> None:
    log = write_image_folder(tmp_path / "log", frames(1))
    (log / "intrinsics.txt").unlink()
    (log / name).write_text(text)
    source, found = loaded_frames(log)
    assert source.camera == CAMERA and f"intrinsics read from {name}" in source.notes
    np.testing.assert_array_equal(found[0].depth, millimetres(frames(1)[0][1]))


def test_calibration_for_another_size_is_scaled(tmp_path: Path) -> None:
    log = write_image_folder(tmp_path / "log", frames(1))
    (log / "intrinsics.txt").write_text("fx = 160\nfy = 160\ncx = 95.5\ncy = 71.5\nwidth = 192\nheight = 144\n")
    camera = open_log(log, IngestParameters()).camera
    assert (camera.width, camera.fx) == (96, 80.0) and camera.cx == pytest.approx(47.5)
    (log / "intrinsics.txt").write_text("fx = 160\nfy = 160\ncx = 95.5\ncy = 71.5\nwidth = 192\nheight = 192\n")
    with pytest.raises(BadInput, match="192x192"):
        open_log(log, IngestParameters())


@pytest.mark.parametrize("shape", ["7", "8", "12", "16", "log", "folder"])
def test_pose_files(tmp_path: Path, shape: str) -> None:
    recorded = frames(3)
    log = write_image_folder(tmp_path / "log", recorded, poses=False)
    poses = [pose for _, _, pose in recorded]
    if shape == "folder":
        (log / "pose").mkdir()
        for index, pose in enumerate(poses):
            np.savetxt(log / "pose" / f"{index}.txt", pose)
    elif shape == "log":
        rows = [f"0 0 1\n{' '.join(map(repr, map(float, pose.reshape(-1)[:4])))}" for pose in poses]
        rows = ["\n".join(["0 0 1", *(" ".join(map(str, row)) for row in pose)]) for pose in poses]
        (log / "trajectory.log").write_text("\n".join(rows))
    else:
        lines = {
            "7": [tum_line("", pose) for pose in poses],
            "8": [tum_line(f"{index / 30:.9f}", pose) for index, pose in enumerate(poses)],
            "12": [" ".join(map(str, pose[:3].reshape(-1))) for pose in poses],
            "16": [" ".join(map(str, pose.reshape(-1))) for pose in poses],
        }
        (log / "poses.txt").write_text("\n".join(lines[shape]))
    options = {"format": "images"} if shape in ("7", "log") else {}
    source = open_log(log, IngestParameters(**options))
    for entry, pose in zip(source.entries, poses, strict=True):
        np.testing.assert_allclose(entry.world_from_camera, pose, atol=1e-6)


def test_marked_names_in_one_folder(tmp_path: Path) -> None:
    for index, (color, depth, _) in enumerate(frames(2)):
        (tmp_path / f"test{index}.color.png").write_bytes(png(color))
        (tmp_path / f"test{index}.depth.png").write_bytes(png(millimetres(depth) * 10))
        (tmp_path / f"test{index}.label.png").write_bytes(png(color[..., 0]))
    k = CAMERA
    options = {"fx": k.fx, "fy": k.fy, "cx": k.cx, "cy": k.cy, "depth_scale": 10000.0}
    source, found = loaded_frames(tmp_path, **options)
    assert [entry.name for entry in source.entries] == ["test0", "test1"] and source.camera == CAMERA
    np.testing.assert_allclose(found[1].depth, millimetres(frames(2)[1][1]), atol=1)


def test_colour_may_be_what_is_not_marked_as_depth(tmp_path: Path) -> None:
    for index, (color, depth, _) in enumerate(frames(2)):
        (tmp_path / f"{index}.png").write_bytes(png(color))
        (tmp_path / f"{index}_depth.png").write_bytes(png(millimetres(depth)))
    (tmp_path / "map.png").write_bytes(png(frames(1)[0][0]))
    source, found = loaded_frames(tmp_path, fx=CAMERA.fx, fy=CAMERA.fy, cx=CAMERA.cx, cy=CAMERA.cy)
    assert [entry.name for entry in source.entries] == ["0", "1"]
    np.testing.assert_allclose(found[1].depth, millimetres(frames(2)[1][1]), atol=1)


def test_colour_alone(tmp_path: Path) -> None:
    (tmp_path / "images").mkdir()
    for index in range(12):
        (tmp_path / "images" / f"{index}.jpg").write_bytes(jpeg(color_image(index)))
    with pytest.raises(BadInput, match="--fx --fy --cx --cy"):
        open_log(tmp_path, IngestParameters())
    (tmp_path / "intrinsics.txt").write_text("80 80 47.5 35.5")
    source, found = loaded_frames(tmp_path)
    assert [entry.name for entry in source.entries] == [str(index) for index in range(12)]
    assert found[0].depth is None and not source.has_poses


def test_opengl_axes_are_the_opposite_of_ours() -> None:
    np.testing.assert_array_equal(OPENGL_FROM_OPENCV @ OPENGL_FROM_OPENCV, np.eye(4))
