"""Folder logs that are damaged, lie, or lead out of their folder: one clear sentence, never a crash."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.detection import open_log
from scenewright.stages.ingest.folders.depth_arrays import depth_array
from scenewright.stages.ingest.folders.files import images_by_number, images_by_stem, natural_key
from scenewright.stages.ingest.layouts.colmap.model import read_model
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.source import Unusable

from tests.unit.ingest.depth_array_writing import write_colmap_array, write_pfm
from tests.unit.ingest.folder_writers import (
    write_colmap,
    write_image_folder,
    write_nerfstudio,
    write_replica,
    write_scannet,
    write_scenenn,
    write_tum,
)
from tests.unit.ingest.running import ingest
from tests.unit.ingest.tiny_room import frames, png, write_redwood

DEFAULTS = IngestParameters()


def replace_in(path: Path, old: str, new: str) -> None:
    """Replace the first occurrence in a text file, which must be there."""
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def edited(path: Path, **fields: object) -> None:
    """Change fields of a JSON document."""
    path.write_text(json.dumps(json.loads(path.read_text()) | fields))


# --- names that lead elsewhere ---------------------------------------------------------------------------------

ELSEWHERE = ["../secret.png", "/etc/hostname", "rgb/../../secret.png", "link/secret.png", "a" * 5000]


@pytest.mark.parametrize("name", ELSEWHERE)
@pytest.mark.parametrize("layout", ["tum", "nerfstudio", "nerfstudio depth", "colmap"])
def test_names_that_leave_the_folder(tmp_path: Path, layout: str, name: str) -> None:
    (tmp_path / "secret.png").write_bytes(png(np.zeros((72, 96), np.uint16)))
    log = {"tum": write_tum, "colmap": write_colmap}.get(layout, write_nerfstudio)(tmp_path / "log", frames(2))
    for folder in (log, log / "images", log / "rgb"):
        if folder.is_dir():
            (folder / "link").symlink_to(tmp_path)
    if layout == "tum":
        lines = (log / "rgb.txt").read_text().splitlines()
        (log / "rgb.txt").write_text("\n".join([*lines[:2], f"1305031103.5 {name}"]))
    elif layout == "colmap":
        model = log / "sparse" / "0"
        for path in model.iterdir():
            path.unlink()
        (model / "cameras.txt").write_text("1 PINHOLE 96 72 80 80 48 36\n")
        (model / "images.txt").write_text(f"1 1 0 0 0 0 0 0 1 {name}\n\n")
    else:
        document = json.loads((log / "transforms.json").read_text())
        document["frames"][1]["depth_file_path" if "depth" in layout else "file_path"] = name
        edited(log / "transforms.json", frames=document["frames"])
    with pytest.raises(BadInput, match="leads out of the folder|is no file name"):
        open_log(log, DEFAULTS)


def test_loops_of_links_end(tmp_path: Path) -> None:
    log = write_tum(tmp_path / "log", frames(1))
    (log / "rgb" / "loop.png").symlink_to(log / "rgb" / "loop.png")
    (log / "rgb.txt").write_text("1305031102.175304 rgb/loop.png\n")
    with pytest.raises(BadInput):
        open_log(log, DEFAULTS)


# --- images ----------------------------------------------------------------------------------------------------


def test_names_that_differ_only_in_case_or_ending(tmp_path: Path) -> None:
    for name in ("Frame1.png", "frame1.png"):
        (tmp_path / name).write_bytes(b"x")
    with pytest.raises(BadInput, match="differs only in case"):
        images_by_stem(tmp_path, (".png",))
    (tmp_path / "Frame1.png").rename(tmp_path / "frame1.jpg")
    with pytest.raises(BadInput, match="has the same name"):
        images_by_stem(tmp_path, (".png", ".jpg"))
    with pytest.raises(BadInput, match="same frame number"):
        images_by_number(tmp_path, (".png", ".jpg"))
    (tmp_path / "nothing.png").write_bytes(b"x")
    with pytest.raises(BadInput, match="no frame number"):
        images_by_number(tmp_path, (".png",))


def test_odd_digits_in_names_have_an_order() -> None:
    names = ["a10", "a9", "a²", "a٣", "", "10", "b"]
    assert sorted(names, key=natural_key)[:2] == ["", "10"]
    assert sorted(["a10", "a9"], key=natural_key) == ["a9", "a10"]


def test_missing_images_of_a_list_are_counted(tmp_path: Path) -> None:
    log = write_tum(tmp_path / "log", frames(4))
    colors, depths = (sorted((log / name).iterdir()) for name in ("rgb", "depth"))
    colors[0].unlink()
    depths[1].unlink()
    depths[2].unlink()
    depths[2].mkdir()
    info = ingest(log, tmp_path / "out", gravity="none").info
    assert info.drops == {"missing_color": 1, "missing_depth": 1, "unreadable_depth": 1} and info.frame_count == 1


def test_depth_in_openexr_is_refused_in_words(tmp_path: Path) -> None:
    log = write_nerfstudio(tmp_path / "log", frames(1))
    document = json.loads((log / "transforms.json").read_text())
    document["frames"][0]["depth_file_path"] = "depth/1.exr"
    edited(log / "transforms.json", frames=document["frames"])
    with pytest.raises(BadInput, match="OpenEXR.*16-bit PNG"):
        open_log(log, DEFAULTS)


def test_sixteen_bit_colour_becomes_eight(tmp_path: Path) -> None:
    log = write_image_folder(tmp_path / "log", frames(1))
    image = np.zeros((72, 96, 3), np.uint16)
    image[..., 0] = 200 * 257
    (log / "rgb" / "rgb_0.png").write_bytes(png(image))
    frame = open_log(log, DEFAULTS).entries[0].load()
    assert frame.color.dtype == np.uint8 and frame.color[0, 0].tolist() == [200, 0, 0]


# --- arrays of depth -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("data", "suffix"),
    [
        (b"", ".npy"),
        (b"\x93NUMPY\x01\x00", ".npy"),
        (
            b"\x93NUMPY\x01\x00\x76\x00{'descr': '|O', 'fortran_order': False, 'shape': (2, 2), }" + b" " * 50 + b"\n",
            ".npy",
        ),
        (
            b"\x93NUMPY\x01\x00\x76\x00{'descr': '<f4', 'fortran_order': False, 'shape': (99999, 9999), }".ljust(128),
            ".npy",
        ),
        (b"\x93NUMPY\x01\x00\x76\x00{'descr': '<f4', 'fortran_order': False, 'shape': (-1, 4), }".ljust(128), ".npy"),
        (b"Pf\n99999 99999\n-1.0\n", ".pfm"),
        (b"Pf\n2 2\nnan--\n" + bytes(16), ".pfm"),
        (b"PF\n2 2\n-1.0\n" + bytes(48), ".pfm"),
        (b"Pf\n2 2\n-1.0\n" + bytes(15), ".pfm"),
        (b"99999&99999&1&", ".bin"),
        (b"2&2&3&" + bytes(48), ".bin"),
        (b"2&2&1&" + bytes(15), ".bin"),
        (b"0&0&1&", ".bin"),
    ],
)
def test_arrays_that_lie(data: bytes, suffix: str) -> None:
    with pytest.raises(Unusable):
        depth_array(data, suffix)


def test_arrays_come_back(tmp_path: Path) -> None:
    image = np.random.default_rng(0).uniform(0, 5, (7, 5)).astype(np.float32)
    write_pfm(tmp_path / "a.pfm", image)
    write_colmap_array(tmp_path / "a.bin", image)
    np.save(tmp_path / "a.npy", image)
    np.save(tmp_path / "b.npy", np.asfortranarray(image.astype(float)))
    for name in ("a.pfm", "a.bin", "a.npy", "b.npy"):
        np.testing.assert_array_equal(depth_array((tmp_path / name).read_bytes(), name[1:]), image)


# --- TUM -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "text", "complaint"),
    [
        ("rgb.txt", "abc rgb/1.png\n", "no time stamp"),
        ("rgb.txt", "nan rgb/1.png\n", "between 0 and"),
        ("rgb.txt", "1e999999999 rgb/1.png\n", "between 0 and"),
        ("rgb.txt", "-1 rgb/1.png\n", "between 0 and"),
        ("rgb.txt", "1.0\n", "line 1: expected a time stamp and a file name"),
        ("rgb.txt", "\x00\xff", None),
        ("depth.txt", "1.0 \n", "depth.txt: line 1"),
        ("groundtruth.txt", "1 2 3\n", "3 columns, expected 8"),
        ("groundtruth.txt", "1 2 3 x 0 0 0 1\n", "'x' is not a number"),
        ("calibration.txt", "80 80 47.5\n", "3 numbers"),
        ("calibration.txt", "80 80 47.5 nan\n", "those of no camera"),
        ("calibration.txt", "-80 80 47.5 35\n", "those of no camera"),
        ("calibration.txt", "fx = 80\n", "expected the numbers"),
        ("calibration.txt", "80 80 47.5 35.5 inf 0 0 0\n", "not finite"),
    ],
)
def test_damaged_lists_of_tum(tmp_path: Path, name: str, text: str, complaint: str | None) -> None:
    log = write_tum(tmp_path / "log", frames(2))
    (log / name).write_bytes(text.encode("latin-1"))
    with pytest.raises(BadInput, match=complaint or name):
        open_log(log, DEFAULTS)


def test_poses_of_tum_that_are_none_are_counted(tmp_path: Path) -> None:
    log = write_tum(tmp_path / "log", frames(6))
    lines = (log / "groundtruth.txt").read_text().splitlines()
    for index, numbers in ((2, "nan 0 0 0 0 0 1"), (3, "0 0 0 0 0 0 0"), (4, "0 0 0 0 0 0 5")):
        lines[index] = lines[index].split()[0] + " " + numbers
    lines[5] = "nan" + lines[5][17:]
    (log / "groundtruth.txt").write_text("\n".join(lines))
    source = open_log(log, IngestParameters(maximum_transform_gap=0.05, maximum_time_difference=0.005))
    warning = next(note for note in source.notes if note.startswith("WARNING"))
    assert warning == (
        "WARNING: 4 of 6 lines of groundtruth.txt are no poses "
        "(no time: 1, not finite: 1, quaternion not of length 1: 2)"
    )
    assert [entry.world_from_camera is None for entry in source.entries] == [False, True, True, True, True, False]


def test_stamps_out_of_order_and_twice(tmp_path: Path) -> None:
    log = write_tum(tmp_path / "log", frames(4))
    lines = (log / "rgb.txt").read_text().splitlines()
    (log / "rgb.txt").write_text("\n".join([lines[3], lines[0], lines[1], lines[4], lines[2], lines[2]]))
    info = ingest(log, tmp_path / "out", gravity="none").info
    assert info.frames_in_log == 5 and info.frame_count == 4 and sum(info.drops.values()) == 1


# --- SceneNN, ScanNet, Replica, Redwood ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "text", "complaint"),
    [
        ("trajectory.log", "0 0 1\n1 0 0 0\n", "multiple of 5"),
        ("trajectory.log", "9999999999999999999999 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n", "three integers"),
        ("trajectory.log", "0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n" * 2, "same frame number"),
        ("timestamp.txt", "1 2 3 4\n", "whole microseconds"),
        ("timestamp.txt", "1 -5\n", "whole microseconds"),
        ("asus.ini", "fx eighty\n", "a name and a number"),
        ("asus.ini", "fx\n", "a name and a number"),
        ("asus.ini", "depth_width 96\ndepth_height 72\nfy 80\n", "no numbers"),
        ("asus.ini", "depth_width 1e300\ndepth_height 72\nfx 80\nfy 80\n", "pixels"),
        ("asus.ini", "depth_width 96\ndepth_height 96\nfx 80\nfy 80\n", "96x96"),
    ],
)
def test_damaged_files_of_scenenn(tmp_path: Path, name: str, text: str, complaint: str) -> None:
    log = write_scenenn(tmp_path / "log", frames(2))
    (log / name).write_text(text)
    with pytest.raises(BadInput, match=complaint):
        open_log(log, DEFAULTS)


def test_frames_of_scenenn_without_a_time_are_counted(tmp_path: Path) -> None:
    log = write_scenenn(tmp_path / "log", frames(3))
    replace_in(log / "timestamp.txt", "2 33333\n", "")
    assert ingest(log, tmp_path / "out", gravity="none").info.drops == {"missing_time": 1}


@pytest.mark.parametrize(
    ("name", "text", "complaint"),
    [
        ("intrinsic_depth.txt", "1 2 3", "3 numbers, expected 4x4"),
        ("intrinsic_depth.txt", "nan " * 16, "those of no camera"),
        ("intrinsic_color.txt", "0 " * 16, "those of no camera"),
        ("extrinsic_color.txt", "x " * 16, "not a number"),
    ],
)
def test_damaged_files_of_scannet(tmp_path: Path, name: str, text: str, complaint: str) -> None:
    log = write_scannet(tmp_path / "log", frames(1))
    (log / "intrinsic" / name).write_text(text)
    with pytest.raises(BadInput, match=complaint):
        open_log(log, DEFAULTS)


def test_poses_of_scannet_that_are_none_are_counted(tmp_path: Path) -> None:
    log = write_scannet(tmp_path / "log", frames(5))
    np.savetxt(log / "pose" / "0.txt", np.full((4, 4), -np.inf))
    (log / "pose" / "1.txt").write_text("lost")
    (log / "pose" / "2.txt").unlink()
    np.savetxt(log / "pose" / "3.txt", np.diag([2.0, 1, 1, 1]))
    info = ingest(log, tmp_path / "out", gravity="none").info
    assert info.drops == {"non_finite_pose": 1, "unreadable_pose": 1, "missing_pose": 1, "non_rigid_pose": 1}


@pytest.mark.parametrize(
    ("fields", "complaint"),
    [
        ({"camera": [1, 2]}, "no camera with|has no camera"),
        ({"camera": {"w": 1e400, "h": 72, "fx": 80, "fy": 80, "cx": 1, "cy": 1}}, "no camera|impossible"),
        ({"camera": {"w": 96, "h": 72, "fx": "80 px", "fy": 80, "cx": 1, "cy": 1}}, "no numbers"),
        ({"camera": {"w": 96, "h": 72, "fx": 80, "fy": 80, "cx": 1, "cy": 1, "scale": 0}}, "impossible"),
        ({"camera": {"w": 96, "h": 96, "fx": 80, "fy": 80, "cx": 1, "cy": 1}}, "96x96"),
    ],
)
def test_damaged_cameras_of_replica(tmp_path: Path, fields: dict, complaint: str) -> None:
    log = write_replica(tmp_path / "room0", frames(1))
    edited(tmp_path / "cam_params.json", **fields)
    with pytest.raises(BadInput, match=complaint):
        open_log(log, DEFAULTS)


@pytest.mark.parametrize("text", ["[" * 100_000, "{", "null", '{"intrinsic_matrix": [1], "width": 1, "height": 1}'])
def test_damaged_intrinsics_of_redwood(tmp_path: Path, text: str) -> None:
    log = write_redwood(tmp_path / "log", frames(1))
    (log / "camera_intrinsic.json").write_text(text)
    with pytest.raises(BadInput, match="camera_intrinsic.json"):
        open_log(log, DEFAULTS)


# --- nerfstudio ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fields", "complaint"),
    [
        ({"frames": "all"}, "no list of frames"),
        ({"frames": []}, "has no frames"),
        ({"frames": [3]}, "frame 0: is no object"),
        ({"frames": [{}]}, "no file name"),
        ({"frames": [{"file_path": 7}]}, "no file name"),
        ({"fl_x": "80"}, "is no number"),
        ({"fl_x": 1e300}, "is no number"),
        ({"fl_x": float("nan")}, "is no number"),
        ({"fl_x": -80}, "those of no camera"),
        ({"fl_x": None}, "neither fl_x nor a camera_angle_x"),
        ({"fl_x": None, "camera_angle_x": 4.0}, "neither fl_x nor a camera_angle_x"),
        ({"w": 1e8}, "pixels"),
        ({"w": 72}, "72x72, the images are 96x72"),
        ({"k1": True}, "is no number"),
        ({"camera_model": "EQUIRECTANGULAR"}, "'EQUIRECTANGULAR' are not read"),
        ({"camera_model": ["OPENCV"]}, "are not read"),
        ({"depth_unit_scale_factor": 0}, "not positive"),
        ({"depth_unit_scale_factor": 10**400}, "64 bits"),
        ({"applied_scale": 0}, "not positive"),
        ({"applied_transform": [[1, 0], [0, 1]]}, "no rigid transform"),
        ({"applied_transform": [[-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]}, "no rigid transform"),
        ({"applied_transform": [[float("nan")] * 4] * 3}, "no rigid transform"),
    ],
)
def test_damaged_transforms(tmp_path: Path, fields: dict, complaint: str) -> None:
    log = write_nerfstudio(tmp_path / "log", frames(2))
    edited(log / "transforms.json", **fields)
    with pytest.raises(BadInput, match=complaint):
        open_log(log, DEFAULTS)


@pytest.mark.parametrize("text", ["", "{", "[1, 2]", "[" * 200_000, '{"frames": ' + "9" * 5000 + "}"])
def test_transforms_that_are_no_document(tmp_path: Path, text: str) -> None:
    (tmp_path / "transforms.json").write_text(text)
    with pytest.raises(BadInput, match="transforms.json"):
        open_log(tmp_path, DEFAULTS)


def test_poses_of_transforms_that_are_none_are_counted(tmp_path: Path) -> None:
    log = write_nerfstudio(tmp_path / "log", frames(6))
    document = json.loads((log / "transforms.json").read_text())
    bad = ["lost", [[1]], [[float("nan")] * 4] * 4, np.diag([1.0, 1, -1, 1]).tolist(), None]
    for frame, matrix in zip(document["frames"], bad, strict=False):
        frame["transform_matrix"] = matrix
    edited(log / "transforms.json", frames=document["frames"])
    info = ingest(log, tmp_path / "out", gravity="none").info
    assert info.drops == {"unreadable_pose": 3, "non_finite_pose": 1, "non_rigid_pose": 1} and info.frame_count == 1


# --- COLMAP ----------------------------------------------------------------------------------------------------


def test_colmap_files_cut_anywhere(tmp_path: Path) -> None:
    folder = write_colmap(tmp_path / "log", frames(2)) / "sparse" / "0"
    whole = {name: (folder / name).read_bytes() for name in ("cameras.bin", "images.bin")}
    for name, data in whole.items():
        for end in range(len(data)):
            (folder / name).write_bytes(data[:end])
            with pytest.raises(BadInput, match=name):
                read_model(folder)
        (folder / name).write_bytes(data)
    assert len(read_model(folder).images) == 2


@pytest.mark.parametrize(
    ("name", "place", "value", "complaint"),
    [
        ("cameras.bin", 0, struct.pack("<Q", 2**62), "declares 4611686018427387904 cameras"),
        ("images.bin", 0, struct.pack("<Q", 2**40), "declares 1099511627776 images"),
        ("cameras.bin", 12, struct.pack("<i", 99), "of model 99"),
        ("cameras.bin", 16, struct.pack("<Q", 2**40), "pixels"),
        ("cameras.bin", 16, struct.pack("<Q", 0), "0x72 pixels"),
        ("cameras.bin", 32, struct.pack("<d", float("nan")), "not finite"),
        ("cameras.bin", 32, struct.pack("<d", -1.0), "those of no camera"),
        ("cameras.bin", 12, struct.pack("<i", 7), "ends at byte"),
        ("images.bin", 8 + 4 + 56, struct.pack("<i", 5), "of camera 5, which the model has not"),
        ("images.bin", 8 + 4 + 56 + 4 + 12, struct.pack("<Q", 2**60), "observations"),
    ],
)
def test_colmap_files_that_lie(tmp_path: Path, name: str, place: int, value: bytes, complaint: str) -> None:
    log = write_colmap(tmp_path / "log", frames(2))
    path = log / "sparse" / "0" / name
    data = bytearray(path.read_bytes())
    data[place : place + len(value)] = value
    path.write_bytes(data)
    with pytest.raises(BadInput, match=complaint):
        open_log(log, DEFAULTS)


def test_colmap_damage_of_one_of_two_models_is_reported(tmp_path: Path) -> None:
    log = write_colmap(tmp_path / "log", frames(3))
    (log / "sparse" / "1").mkdir()
    for name in ("cameras.bin", "images.bin"):
        (log / "sparse" / "1" / name).write_bytes(b"\x05")
    source = open_log(log, DEFAULTS)
    assert len(source.entries) == 3 and len(source.damage) == 1 and "sparse/1" in source.damage[0]
    with pytest.raises(BadInput, match="sparse/1"):
        open_log(log, IngestParameters(damage="refuse"))


@pytest.mark.parametrize(
    ("cameras", "images", "complaint"),
    [
        ("1 PINHOLE 96 72 80 80 48\n", "", "PINHOLE has 4 parameters"),
        ("1 PINHOLE 96 x 80 80 48 36\n", "", "line 1"),
        ("1 FOV 96 72 80 80 48 36 0.9\n", "1 1 0 0 0 0 0 0 1 a.png\n\n", "'FOV'"),
        ("1 NEW 96 72 80\n", "1 1 0 0 0 0 0 0 1 a.png\n\n", "'NEW'"),
        ("1 PINHOLE 96 72 80 80 48 36\n", "1 1 0 0 0 0 0\n", "images.txt: line 1"),
        ("1 PINHOLE 96 72 80 80 48 36\n", "", "no image is registered"),
    ],
)
def test_colmap_text_that_is_damaged(tmp_path: Path, cameras: str, images: str, complaint: str) -> None:
    (tmp_path / "images").mkdir()
    (tmp_path / "sparse").mkdir()
    (tmp_path / "sparse" / "cameras.txt").write_text(cameras)
    (tmp_path / "sparse" / "images.txt").write_text(images)
    with pytest.raises(BadInput, match=complaint):
        open_log(tmp_path, DEFAULTS)


def test_poses_of_colmap_that_are_none_are_counted(tmp_path: Path) -> None:
    log = write_colmap(tmp_path / "log", frames(4), binary=False)
    path = log / "sparse" / "0" / "images.txt"
    lines = path.read_text().splitlines()
    heads = [index for index, line in enumerate(lines) if line.endswith(".png")]
    for index, numbers in zip(heads, ("nan 0 0 0 0 0 0", "0 0 0 0 1 2 3", "1e308 1e308 0 0 0 0 0"), strict=False):
        fields = lines[index].split()
        lines[index] = " ".join([fields[0], *numbers.split(), *fields[8:]])
    path.write_text("\n".join(lines))
    info = ingest(log, tmp_path / "out", gravity="none").info
    assert info.drops == {"non_finite_pose": 1, "non_rigid_pose": 2} and info.frame_count == 1


# --- plain images ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "text", "complaint"),
    [
        ("intrinsics.txt", "80 80", "2 numbers"),
        ("intrinsics.txt", "eighty", "no calibration that is understood"),
        ("intrinsics.txt", "0 0 47.5 35.5", "no camera"),
        ("intrinsics.txt", "80 5 47.5 0 80 35.5 0 0 1", "skewed"),
        ("camera.json", "[]", "has no camera"),
        ("camera.json", '{"fx": 80}', "neither a camera matrix nor fx"),
        ("camera.json", '{"fx": 80, "fy": 80, "cx": 1, "cy": 1, "width": 1e9, "height": 1}', "impossible"),
        ("camera.json", '{"K": [[80, 0, NaN], [0, 80, 35], [0, 0, 1]]}', "neither|no camera|not finite"),
        ("camera.json", json.dumps({"K": [80, 0, 47.5, 0, 80, 35.5, 0, 0, 1], "D": [0.1] * 15}), "coefficients"),
        ("calibration.yaml", "%YAML:1.0", "has no camera"),
        ("calibration.yaml", "a: [", "no YAML"),
        ("calibration.yaml", "!!python/object/apply:os.system ['true']", "no YAML|has no camera"),
        ("calibration.yaml", "M1: [1]\nM2: [1]\n", "no 3x3 matrix"),
        (
            "calibration.yaml",
            "M1: [80,0,47,0,80,35,0,0,1]\nM2: [80,0,47,0,80,35,0,0,1]\nR: [2,0,0,0,1,0,0,0,1]\nT: [1,0,0]\n",
            "R and T do not say",
        ),
        ("calibration.yaml", "cam0: {intrinsics: [80, 80, 9, 9]}\ncam1: {intrinsics: [80, 80, 9, 9]}\n", "T_cn_cnm1"),
        ("calib.txt", "P0: 80 0 47.5 0 0 80 35.5 0 0 0 x 0\n", "no number"),
        ("calib.txt", "P1: 80 0 47.5 0 0 80 35.5 0 0 0 1 0\n", "has no P0"),
        ("calib.txt", "cam0=[80 0 47; 0 80 35; 0 0 1]\ncam1=[80 0 47; 0 80 35]\nbaseline=100\n", "cam1"),
        ("calib.txt", "cam0=[80 0 9; 0 80 9; 0 0 1]\ncam1=[80 0 60; 0 80 9; 0 0 1]\nbaseline=9\ndoffs=2\n", "doffs 2"),
        ("intrinsics.txt", " " * 300_000, "no calibration"),
    ],
)
def test_calibration_files_that_are_none(tmp_path: Path, name: str, text: str, complaint: str) -> None:
    log = write_image_folder(tmp_path / "log", frames(1))
    (log / "intrinsics.txt").unlink()
    (log / name).write_text(text)
    with pytest.raises(BadInput, match=complaint):
        open_log(log, DEFAULTS)


def test_yaml_that_multiplies_itself_ends(tmp_path: Path) -> None:
    log = write_image_folder(tmp_path / "log", frames(1))
    (log / "intrinsics.txt").unlink()
    lines = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 40)]
    (log / "calibration.yaml").write_text("\n".join([*lines, "K: *a39"]))
    with pytest.raises(BadInput):
        open_log(log, DEFAULTS)


@pytest.mark.parametrize(
    ("name", "text", "complaint"),
    [
        ("poses.txt", "1 2 3\n", "no pose"),
        ("poses.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n", "1 poses for 2 images"),
        ("poses.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n1 2\n", "2 columns, expected 12"),
        ("times.txt", "0\n", "1 times for 2 images"),
        ("times.txt", "0\nnan\n", "not between"),
        ("times.txt", "0\nsoon\n", "not a number"),
    ],
)
def test_poses_and_times_of_plain_images(tmp_path: Path, name: str, text: str, complaint: str) -> None:
    log = write_image_folder(tmp_path / "log", frames(2))
    (log / name).write_text(text)
    with pytest.raises(BadInput, match=complaint):
        open_log(log, DEFAULTS)


def test_images_that_cannot_be_paired(tmp_path: Path) -> None:
    log = write_image_folder(tmp_path / "log", frames(3))
    (log / "depth" / "depth_1.png").rename(log / "depth" / "last.png")
    (log / "depth" / "depth_2.png").unlink()
    with pytest.raises(BadInput, match="3 and 2 images have no names or numbers in common"):
        open_log(log, DEFAULTS)


def test_videos_that_are_none(tmp_path: Path) -> None:
    (tmp_path / "intrinsics.txt").write_text("80 80 47.5 35.5")
    for data in (b"", b"\0\0\0\x20ftypisom" + bytes(200)):
        (tmp_path / "video.mp4").write_bytes(data)
        with pytest.raises(BadInput, match="no video that can be read|declares frames"):
            open_log(tmp_path, DEFAULTS)


@pytest.mark.parametrize("name", ["notes.txt", "model.ply", ".hidden.png"])
def test_folders_without_any_images(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("something")
    with pytest.raises(BadInput, match="is not a log in a format that is known"):
        open_log(tmp_path, DEFAULTS)


def test_folders_in_which_nothing_can_be_decoded_are_empty_with_reasons(tmp_path: Path) -> None:
    writers = [write_tum, write_scannet, write_nerfstudio, write_colmap, write_image_folder]
    for number, write in enumerate(writers):
        log = write(tmp_path / str(number), frames(2))
        for path in log.rglob("*"):
            if path.suffix in (".png", ".jpg"):
                path.write_bytes(b"not an image")
        sequence = ingest(log, tmp_path / f"out{number}")
        assert sequence.outcome == "empty", write
        assert sequence.info.drops == {"undecodable_color": 2}, write
