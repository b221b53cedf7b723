"""Folder logs that are damaged, lie or lead out of their folder: refused in one line, counted, or read."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from PIL import Image
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.detection import open_log
from scenewright.stages.ingest.folders.depth_arrays import depth_array
from scenewright.stages.ingest.folders.files import images_by_number, images_by_stem, natural_key
from scenewright.stages.ingest.layouts.colmap.model import read_model
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.source import Unusable
from scenewright.stages.kit.formats.frames import FrameReader

from tests.bad_input.damages import replaced
from tests.fuzz.layouts import INTRINSICS, WRITERS
from tests.unit.ingest.depth_array_writing import write_colmap_array, write_pfm
from tests.unit.ingest.folder_writers import write_colmap, write_image_folder, write_tum
from tests.unit.ingest.running import ingest
from tests.unit.ingest.tiny_room import frames, png, write_posed_images

DEFAULTS = IngestParameters()


# --- what is done to a folder ------------------------------------------------------------------------------------


class Fields(NamedTuple):
    """Fields of a JSON document that are replaced."""

    values: dict[str, object]


class Bytes(NamedTuple):
    """Bytes of a file that are written over."""

    place: int
    content: bytes


Change = str | bytes | None | Fields | Bytes | Callable[[str], str]
"""Of a file: its new content, None to take it away, or how its text changes."""


def apply(change: Change, path: Path) -> None:
    """Change one file."""
    if change is None:
        path.unlink()
    elif isinstance(change, Fields):
        path.write_text(json.dumps(json.loads(path.read_text()) | change.values))
    elif isinstance(change, Bytes):
        path.write_bytes(replaced(path.read_bytes(), change.place, change.content))
    elif callable(change):
        path.write_text(change(path.read_text()))
    else:
        path.write_bytes(change.encode("latin-1") if isinstance(change, str) else change)


def in_frames(**fields: list) -> Callable[[str], str]:
    """Return a change of transforms.json: the first frames get these values of a field."""

    def changed(text: str) -> str:
        document = json.loads(text)
        for field, values in fields.items():
            for frame, value in zip(document["frames"], values, strict=False):
                frame[field] = value
        return json.dumps(document)

    return changed


def nothing(root: Path, recorded: list) -> Path:
    """Make an empty folder."""
    root.mkdir(parents=True)
    return root


def without_calibration(root: Path, recorded: list) -> Path:
    """Write plain images and no file that says how they were taken."""
    (write_image_folder(root, recorded) / "intrinsics.txt").unlink()
    return root


LAYOUTS = WRITERS | {"nothing": nothing, "images, no calibration": without_calibration}
OPTIONS = {"posed_images": INTRINSICS}


def damaged(tmp_path: Path, layout: str, count: int, changes: dict[str, Change]) -> Path:
    """Write the tiny room in a layout and change its files."""
    log = LAYOUTS[layout](tmp_path / "log", frames(count))
    for name, change in changes.items():
        apply(change, log / name)
    return log


# --- refused -----------------------------------------------------------------------------------------------------

ROW, UNIT = "0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n", "1 0 0 0 0 1 0 0 0 0 1 0\n"
MANY_ALIASES = "\n".join(
    ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    + [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 40)]
    + ["K: *a39"]
)
PAIR = "M1: [80,0,47,0,80,35,0,0,1]\nM2: [80,0,47,0,80,35,0,0,1]\n"
CAMERAS, IMAGES = "sparse/0/cameras.bin", "sparse/0/images.bin"
REPLICA = {"w": 96, "h": 72, "fx": 80, "fy": 80, "cx": 1, "cy": 1}

ONE_FILE: dict[str, list[tuple[str, Change, str]]] = {
    "tum": [
        ("rgb.txt", "abc rgb/1.png\n", "not a time stamp"),
        ("rgb.txt", "nan rgb/1.png\n", "between 0 and"),
        ("rgb.txt", "1e999999999 rgb/1.png\n", "between 0 and"),
        ("rgb.txt", "-1 rgb/1.png\n", "between 0 and"),
        ("rgb.txt", "1.0\n", "line 1: expected a time stamp and a file name"),
        ("rgb.txt", "\x00\xff", "rgb.txt"),
        ("depth.txt", "1.0 \n", "depth.txt: line 1"),
        ("groundtruth.txt", "1 2 3\n", "3 columns, expected 8"),
        ("groundtruth.txt", "1 2 3 x 0 0 0 1\n", "'x' is not a number"),
        ("calibration.txt", "80 80 47.5\n", "3 numbers"),
        ("calibration.txt", "80 80 47.5 nan\n", "those of no camera"),
        ("calibration.txt", "-80 80 47.5 35\n", "those of no camera"),
        ("calibration.txt", "fx = 80\n", "expected the numbers"),
        ("calibration.txt", "80 80 47.5 35.5 inf 0 0 0\n", "not finite"),
    ],
    "scenenn": [
        ("trajectory.log", "0 0 1\n1 0 0 0\n", "multiple of 5"),
        ("trajectory.log", ROW.replace("0", "9999999999999999999999", 1), "three integers"),
        ("trajectory.log", ROW * 2, "same frame number"),
        ("timestamp.txt", "1 2 3 4\n", "whole microseconds"),
        ("timestamp.txt", "1 -5\n", "whole microseconds"),
        ("asus.ini", "fx eighty\n", "a name and a number"),
        ("asus.ini", "fx\n", "a name and a number"),
        ("asus.ini", "depth_width 96\ndepth_height 72\nfy 80\n", "not numbers"),
        ("asus.ini", "depth_width 1e300\ndepth_height 72\nfx 80\nfy 80\n", "pixels"),
        ("asus.ini", "depth_width 96\ndepth_height 96\nfx 80\nfy 80\n", "96x96"),
    ],
    "scannet": [
        ("intrinsic/intrinsic_depth.txt", "1 2 3", "3 numbers, expected 4x4"),
        ("intrinsic/intrinsic_depth.txt", "nan " * 16, "those of no camera"),
        ("intrinsic/intrinsic_color.txt", "0 " * 16, "those of no camera"),
        ("intrinsic/extrinsic_color.txt", "x " * 16, "not a number"),
    ],
    "replica": [
        ("../cam_params.json", Fields({"camera": camera}), words)
        for camera, words in (
            ([1, 2], "no camera with|has no camera"),
            (REPLICA | {"w": 1e400}, "no camera|impossible"),
            (REPLICA | {"fx": "80 px"}, "not numbers"),
            (REPLICA | {"scale": 0}, "impossible"),
            (REPLICA | {"h": 96}, "96x96"),
        )
    ],
    "redwood": [
        ("trajectory.log", lambda text: text[:-30], "trajectory.log"),
        ("trajectory.log", "0 0 1\n", "trajectory.log"),
        ("trajectory.log", lambda text: text + text, "trajectory.log"),
        ("trajectory.log", lambda text: text.replace("0", "x", 1), "trajectory.log"),
        ("camera_intrinsic.json", "[" * 100_000, "camera_intrinsic.json"),
        ("camera_intrinsic.json", "{", "camera_intrinsic.json"),
        ("camera_intrinsic.json", "null", "camera_intrinsic.json"),
        ("camera_intrinsic.json", Fields({"intrinsic_matrix": [0.0] * 9}), "camera_intrinsic.json"),
        ("camera_intrinsic.json", Fields({"width": 640}), "camera_intrinsic.json"),
        ("camera_intrinsic.json", '{"intrinsic_matrix": [1], "width": 1, "height": 1}', "camera_intrinsic.json"),
        ("image/00001.jpg", None, "1 colour and 2 depth"),
    ],
    "posed_images": [
        ("pose.txt", lambda text: text.splitlines()[0], "1 poses for 2 images"),
        ("pose.txt", "1 2 3\n" * 2, "3 columns, expected 7"),
    ],
    "nerfstudio": [
        *[
            ("transforms.json", Fields(fields), words)
            for fields, words in (
                ({"frames": "all"}, "no list of frames"),
                ({"frames": []}, "has no frames"),
                ({"frames": [3]}, "frame 0: is not an object"),
                ({"frames": [{}]}, "not a file name"),
                ({"frames": [{"file_path": 7}]}, "not a file name"),
                ({"fl_x": "80"}, "is not a number"),
                ({"fl_x": 1e300}, "is not a number"),
                ({"fl_x": float("nan")}, "is not a number"),
                ({"fl_x": -80}, "those of no camera"),
                ({"fl_x": None}, "neither fl_x nor a camera_angle_x"),
                ({"fl_x": None, "camera_angle_x": 4.0}, "neither fl_x nor a camera_angle_x"),
                ({"w": 1e8}, "pixels"),
                ({"w": 72}, "72x72, the images are 96x72"),
                ({"k1": True}, "is not a number"),
                ({"camera_model": "EQUIRECTANGULAR"}, "'EQUIRECTANGULAR' are not read"),
                ({"camera_model": ["OPENCV"]}, "are not read"),
                ({"depth_unit_scale_factor": 0}, "not positive"),
                ({"depth_unit_scale_factor": 10**400}, "64 bits"),
                ({"applied_scale": 0}, "not positive"),
                ({"applied_transform": [[1, 0], [0, 1]]}, "not a rigid transform"),
                ({"applied_transform": [[-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]}, "not a rigid transform"),
                ({"applied_transform": [[float("nan")] * 4] * 3}, "not a rigid transform"),
            )
        ],
        ("transforms.json", '{"frames": ' + "9" * 5000 + "}", "transforms.json"),
    ],
    "colmap": [
        (CAMERAS, Bytes(0, struct.pack("<Q", 2**62)), "declares 4611686018427387904 cameras"),
        (IMAGES, Bytes(0, struct.pack("<Q", 2**40)), "declares 1099511627776 images"),
        (CAMERAS, Bytes(12, struct.pack("<i", 99)), "of model 99"),
        (CAMERAS, Bytes(16, struct.pack("<Q", 2**40)), "pixels"),
        (CAMERAS, Bytes(16, struct.pack("<Q", 0)), "0x72 pixels"),
        (CAMERAS, Bytes(32, struct.pack("<d", float("nan"))), "not finite"),
        (CAMERAS, Bytes(32, struct.pack("<d", -1.0)), "those of no camera"),
        (CAMERAS, Bytes(12, struct.pack("<i", 7)), "ends at byte"),
        (IMAGES, Bytes(8 + 4 + 56, struct.pack("<i", 5)), "of camera 5, which the model has not"),
        (IMAGES, Bytes(8 + 4 + 56 + 4 + 12, struct.pack("<Q", 2**60)), "observations"),
    ],
    "colmap_text": [
        ("sparse/0/cameras.txt", "1 PINHOLE 96 72 80 80 48\n", "PINHOLE has 4 parameters"),
        ("sparse/0/cameras.txt", "1 PINHOLE 96 x 80 80 48 36\n", "line 1"),
        ("sparse/0/cameras.txt", "1 FOV 96 72 80 80 48 36 0.9\n", "'FOV'"),
        ("sparse/0/cameras.txt", "1 NEW 96 72 80\n", "'NEW'"),
        ("sparse/0/images.txt", "1 1 0 0 0 0 0\n", "images.txt: line 1"),
        ("sparse/0/images.txt", "", "no image is registered"),
    ],
    "images": [
        ("poses.txt", "1 2 3\n", "no pose"),
        ("poses.txt", UNIT, "1 poses for 2 images"),
        ("poses.txt", UNIT + "1 2\n", "2 columns, expected 12"),
        ("times.txt", "0\n", "1 times for 2 images"),
        ("times.txt", "0\nnan\n", "not between"),
        ("times.txt", "0\nsoon\n", "is not a time stamp"),
    ],
    "images, no calibration": [
        ("intrinsics.txt", "80 80", "2 numbers"),
        ("intrinsics.txt", "eighty", "no calibration that is understood"),
        ("intrinsics.txt", "0 0 47.5 35.5", "no camera"),
        ("intrinsics.txt", "80 5 47.5 0 80 35.5 0 0 1", "skewed"),
        ("intrinsics.txt", " " * 300_000, "no calibration"),
        ("camera.json", "[]", "has no camera"),
        ("camera.json", '{"fx": 80}', "neither a camera matrix nor fx"),
        ("camera.json", '{"fx": 80, "fy": 80, "cx": 1, "cy": 1, "width": 1e9, "height": 1}', "impossible"),
        ("camera.json", '{"K": [[80, 0, NaN], [0, 80, 35], [0, 0, 1]]}', "neither|no camera|not finite"),
        ("camera.json", json.dumps({"K": [80, 0, 47.5, 0, 80, 35.5, 0, 0, 1], "D": [0.1] * 15}), "coefficients"),
        ("calibration.yaml", "%YAML:1.0", "has no camera"),
        ("calibration.yaml", "a: [", "no YAML"),
        ("calibration.yaml", "!!python/object/apply:os.system ['true']", "no YAML|has no camera"),
        ("calibration.yaml", "M1: [1]\nM2: [1]\n", "not a 3x3 matrix"),
        ("calibration.yaml", PAIR + "R: [2,0,0,0,1,0,0,0,1]\nT: [1,0,0]\n", "R and T are not extrinsics"),
        ("calibration.yaml", "cam0: {intrinsics: [80, 80, 9, 9]}\ncam1: {intrinsics: [80, 80, 9, 9]}\n", "T_cn_cnm1"),
        ("calibration.yaml", MANY_ALIASES, "calibration.yaml"),
        ("calib.txt", "P0: 80 0 47.5 0 0 80 35.5 0 0 0 x 0\n", "not a number"),
        ("calib.txt", "P1: 80 0 47.5 0 0 80 35.5 0 0 0 1 0\n", "has no P0"),
        ("calib.txt", "cam0=[80 0 47; 0 80 35; 0 0 1]\ncam1=[80 0 47; 0 80 35]\nbaseline=100\n", "cam1"),
        ("calib.txt", "cam0=[80 0 9; 0 80 9; 0 0 1]\ncam1=[80 0 60; 0 80 9; 0 0 1]\nbaseline=9\ndoffs=2\n", "doffs 2"),
    ],
    "nothing": [
        *[("transforms.json", text, "transforms.json") for text in ("", "{", "[1, 2]", "[" * 200_000)],
        *[(name, "something", "is not a log in a format") for name in ("notes.txt", ".hidden.png")],
        ("model.ply", "something", "is a scan"),
    ],
}
"""Layout -> (the file, what is done to it, the words of the refusal)."""

ELSEWHERE = ["../secret.png", "/etc/hostname", "rgb/../../secret.png", "link/secret.png", "a" * 5000]
NAMES: list[tuple[str, str, Callable[[str], Change]]] = [
    ("tum", "rgb.txt", lambda name: lambda text: "\n".join([*text.splitlines()[:2], f"1305031103.5 {name}"])),
    ("nerfstudio", "transforms.json", lambda name: in_frames(file_path=[name])),
    ("nerfstudio", "transforms.json", lambda name: in_frames(depth_file_path=[name])),
    ("colmap_text", "sparse/0/images.txt", lambda name: f"1 1 0 0 0 0 0 0 1 {name}\n\n"),
]
"""(layout, file, how an image in it gets another name)."""

UNPAIRED: dict[str, Change] = {
    "depth/depth_1.png": None,
    "depth/depth_2.png": None,
    "depth/last.png": png(np.zeros((72, 96), np.uint16)),
}
VIDEO = {"intrinsics.txt": "80 80 47.5 35.5"}
SEVERAL_FILES: list[tuple[str, int, dict[str, Change], str]] = [
    ("nothing", 0, {}, "is not a log in a format"),
    ("images", 3, UNPAIRED, "3 and 2 images have no names or numbers in common"),
    ("nothing", 0, {"video.mp4": b"", **VIDEO}, "not a video that can be read|declares frames"),
    ("nothing", 0, {"video.mp4": b"\0\0\0\x20ftypisom" + bytes(200), **VIDEO}, "not a video that can be read|declares"),
]

REFUSED = [
    *[(layout, 2, {file: change}, words) for layout, rows in ONE_FILE.items() for file, change, words in rows],
    *[
        (layout, 2, {file: renamed(name)}, "leads out of the folder|is not a file name")
        for layout, file, renamed in NAMES
        for name in ELSEWHERE
    ],
    *SEVERAL_FILES,
]


@pytest.mark.parametrize(
    ("layout", "count", "changes", "words"),
    REFUSED,
    ids=[f"{layout}-{'-'.join(changes)}-{words:.30}" for layout, _, changes, words in REFUSED],
)
def test_refused(tmp_path: Path, layout: str, count: int, changes: dict[str, Change], words: str) -> None:
    (tmp_path / "secret.png").write_bytes(png(np.zeros((72, 96), np.uint16)))
    log = damaged(tmp_path, layout, count, changes)
    for folder in (log, log / "images", log / "rgb"):
        if folder.is_dir():
            (folder / "link").symlink_to(tmp_path)
    with pytest.raises(BadInput, match=words) as caught:
        open_log(log, IngestParameters(**OPTIONS.get(layout, {})))
    assert "\n" not in str(caught.value)


def test_a_path_that_is_no_log_is_refused(tmp_path: Path) -> None:
    (tmp_path / "words.txt").write_text("hello")
    for name in ("missing", "words.txt"):
        with pytest.raises(BadInput, match=name):
            open_log(tmp_path / name, DEFAULTS)


def test_loops_of_links_end(tmp_path: Path) -> None:
    log = write_tum(tmp_path / "log", frames(1))
    (log / "rgb" / "loop.png").symlink_to(log / "rgb" / "loop.png")
    (log / "rgb.txt").write_text("1305031102.175304 rgb/loop.png\n")
    with pytest.raises(BadInput):
        open_log(log, DEFAULTS)


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


def test_colmap_damage_of_one_of_two_models_is_reported(tmp_path: Path) -> None:
    log = write_colmap(tmp_path / "log", frames(3))
    (log / "sparse" / "1").mkdir()
    for name in ("cameras.bin", "images.bin"):
        (log / "sparse" / "1" / name).write_bytes(b"\x05")
    source = open_log(log, DEFAULTS)
    assert len(source.entries) == 3 and len(source.damage) == 1 and "sparse/1" in source.damage[0]
    with pytest.raises(BadInput, match="sparse/1"):
        open_log(log, IngestParameters(damage="refuse"))


# --- counted -----------------------------------------------------------------------------------------------------


def colmap_poses(*poses: str) -> Callable[[str], str]:
    """Return a change of images.txt: the first images get these poses."""

    def changed(text: str) -> str:
        rows = text.splitlines()
        heads = [index for index, row in enumerate(rows) if row.endswith(".png")]
        for index, numbers in zip(heads, poses, strict=False):
            fields = rows[index].split()
            rows[index] = " ".join([fields[0], *numbers.split(), *fields[8:]])
        return "\n".join(rows)

    return changed


def redwood_poses(text: str) -> str:
    """Mirror the first pose and put the second nowhere."""
    rows = text.splitlines()
    for row in range(1, 4):
        numbers = rows[row].split()
        rows[row] = " ".join([str(-float(numbers[0])), *numbers[1:]])
    rows[6] = " ".join([*rows[6].split()[:3], "nan"])
    return "\n".join(rows)


COUNTED: dict[str, tuple[str, int, dict[str, Change], dict[str, int]]] = {
    "frames without a time": (
        "scenenn",
        3,
        {"timestamp.txt": lambda text: text.replace("2 33333\n", "")},
        {"missing_time": 1},
    ),
    "poses of ScanNet": (
        "scannet",
        5,
        {
            "pose/0.txt": "nan " * 16,
            "pose/1.txt": "lost",
            "pose/2.txt": None,
            "pose/3.txt": "2 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n",
        },
        {"non_finite_pose": 1, "unreadable_pose": 1, "missing_pose": 1, "non_rigid_pose": 1},
    ),
    "poses of nerfstudio": (
        "nerfstudio",
        6,
        {
            "transforms.json": in_frames(
                transform_matrix=["lost", [[1]], [[float("nan")] * 4] * 4, np.diag([1.0, 1, -1, 1]).tolist(), None]
            )
        },
        {"unreadable_pose": 3, "non_finite_pose": 1, "non_rigid_pose": 1},
    ),
    "poses of COLMAP": (
        "colmap_text",
        4,
        {"sparse/0/images.txt": colmap_poses("nan 0 0 0 0 0 0", "0 0 0 0 1 2 3", "1e308 1e308 0 0 0 0 0")},
        {"non_finite_pose": 1, "non_rigid_pose": 2},
    ),
    "poses of Redwood": ("redwood", 3, {"trajectory.log": redwood_poses}, {"non_finite_pose": 1, "non_rigid_pose": 1}),
    "poses of images": (
        "posed_images",
        3,
        {"pose.txt": lambda text: text.splitlines()[0] + "\n0 0 0 0 0 0 0\nnan 0 0 0 0 0 1\n"},
        {"non_finite_pose": 1, "non_rigid_pose": 1},
    ),
}
"""What is counted -> (layout, frames, changes, frames left out by their reason)."""


@pytest.mark.parametrize("case", COUNTED)
def test_counted(tmp_path: Path, case: str) -> None:
    layout, count, changes, drops = COUNTED[case]
    log = damaged(tmp_path, layout, count, changes)
    info = ingest(log, tmp_path / "out", gravity="none", **OPTIONS.get(layout, {})).info
    assert info.drops == drops and info.frame_count == count - sum(drops.values())


@pytest.mark.parametrize("layout", ["tum", "scannet", "nerfstudio", "colmap", "images"])
def test_a_folder_in_which_nothing_can_be_decoded_is_empty(tmp_path: Path, layout: str) -> None:
    log = LAYOUTS[layout](tmp_path / "log", frames(2))
    for path in log.rglob("*"):
        if path.suffix in (".png", ".jpg"):
            path.write_bytes(b"not an image")
    sequence = ingest(log, tmp_path / "out")
    assert sequence.outcome == "empty" and sequence.info.drops == {"undecodable_color": 2}


def test_missing_images_of_a_list_are_counted(tmp_path: Path) -> None:
    log = write_tum(tmp_path / "log", frames(4))
    colors, depths = (sorted((log / name).iterdir()) for name in ("rgb", "depth"))
    colors[0].unlink()
    depths[1].unlink()
    depths[2].unlink()
    depths[2].mkdir()
    info = ingest(log, tmp_path / "out", gravity="none").info
    assert info.drops == {"missing_color": 1, "missing_depth": 1, "unreadable_depth": 1} and info.frame_count == 1


def test_poses_of_tum_that_are_none_are_counted(tmp_path: Path) -> None:
    log = write_tum(tmp_path / "log", frames(6))
    rows = (log / "groundtruth.txt").read_text().splitlines()
    for index, numbers in ((2, "nan 0 0 0 0 0 1"), (3, "0 0 0 0 0 0 0"), (4, "0 0 0 0 0 0 5")):
        rows[index] = rows[index].split()[0] + " " + numbers
    rows[5] = "nan" + rows[5][17:]
    (log / "groundtruth.txt").write_text("\n".join(rows))
    source = open_log(log, IngestParameters(maximum_transform_gap=0.05, maximum_time_difference=0.005))
    warning = next(note for note in source.notes if note.startswith("WARNING"))
    assert warning == (
        "WARNING: 4 of 6 lines of groundtruth.txt are not poses "
        "(no time: 1, not finite: 1, quaternion not of length 1: 2)"
    )
    assert [entry.world_from_camera is None for entry in source.entries] == [False, True, True, True, True, False]


def test_stamps_out_of_order_and_twice(tmp_path: Path) -> None:
    log = write_tum(tmp_path / "log", frames(4))
    rows = (log / "rgb.txt").read_text().splitlines()
    (log / "rgb.txt").write_text("\n".join([rows[3], rows[0], rows[1], rows[4], rows[2], rows[2]]))
    info = ingest(log, tmp_path / "out", gravity="none").info
    assert info.frames_in_log == 5 and info.frame_count == 4 and sum(info.drops.values()) == 1


# --- read --------------------------------------------------------------------------------------------------------


def test_an_empty_trajectory_leaves_a_log_without_poses(tmp_path: Path) -> None:
    log = damaged(tmp_path, "redwood", 2, {"trajectory.log": ""})
    assert "pose" not in ingest(log, tmp_path / "out").info.streams


def test_sixteen_bit_colour_becomes_eight(tmp_path: Path) -> None:
    image = np.zeros((72, 96, 3), np.uint16)
    image[..., 0] = 200 * 257
    log = damaged(tmp_path, "images", 1, {"rgb/rgb_0.png": png(image)})
    frame = open_log(log, DEFAULTS).entries[0].load()
    assert frame.color.dtype == np.uint8 and frame.color[0, 0].tolist() == [200, 0, 0]


def test_palette_colour_is_read_and_palette_depth_refused(tmp_path: Path) -> None:
    log = write_posed_images(tmp_path / "log", frames(2))
    picture = Image.fromarray(frames(1)[0][0]).convert("P")
    picture.save(log / "color" / "1.png")
    (log / "depth" / "2.pgm").unlink()
    picture.save(log / "depth" / "2.png")
    sequence = ingest(log, tmp_path / "out", **INTRINSICS, gravity="none")
    assert sequence.info.drops == {"depth_not_16_bit": 1} and sequence.info.frame_count == 1
    with FrameReader(sequence.path("frames.mcap")) as reader:
        assert reader.read(0).color[..., 0].mean() > 150 > reader.read(0).color[..., 2].mean() + 50


# --- arrays of depth ---------------------------------------------------------------------------------------------


def npy(description: str) -> bytes:
    """Return the header of an array."""
    return b"\x93NUMPY\x01\x00\x76\x00" + description.encode().ljust(118)


ARRAYS = [
    (b"", ".npy"),
    (b"\x93NUMPY\x01\x00", ".npy"),
    (npy("{'descr': '|O', 'fortran_order': False, 'shape': (2, 2), }"), ".npy"),
    (npy("{'descr': '<f4', 'fortran_order': False, 'shape': (99999, 9999), }"), ".npy"),
    (npy("{'descr': '<f4', 'fortran_order': False, 'shape': (-1, 4), }"), ".npy"),
    (b"Pf\n99999 99999\n-1.0\n", ".pfm"),
    (b"Pf\n2 2\nnan--\n" + bytes(16), ".pfm"),
    (b"PF\n2 2\n-1.0\n" + bytes(48), ".pfm"),
    (b"Pf\n2 2\n-1.0\n" + bytes(15), ".pfm"),
    (b"99999&99999&1&", ".bin"),
    (b"2&2&3&" + bytes(48), ".bin"),
    (b"2&2&1&" + bytes(15), ".bin"),
    (b"0&0&1&", ".bin"),
]


@pytest.mark.parametrize(("data", "suffix"), ARRAYS)
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
