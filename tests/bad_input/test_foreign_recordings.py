"""Recordings of other tools are recognised by name, with the way to something that is read."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.detection import open_log
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.preflight.inspection import inspect_log
from scenewright.stages.kit.progress import SilentProgress

from tests.unit.ingest.folder_writers import write_image_folder
from tests.unit.ingest.tiny_room import CAMERA, frames, jpeg

GIVEN = {"fx": CAMERA.fx, "fy": CAMERA.fy, "cx": CAMERA.cx, "cy": CAMERA.cy}


def pictures(root: Path) -> Path:
    """Colour and depth as phones write them, without a calibration file."""
    write_image_folder(root, frames(3), poses=False)
    (root / "intrinsics.txt").unlink()
    return root


def stray_scanner(root: Path) -> None:
    pictures(root)
    (root / "camera_matrix.csv").write_text("80,0,47\n0,80,35\n0,0,1\n")
    (root / "odometry.csv").write_text("timestamp, frame, x, y, z, qx, qy, qz, qw\n0, 000000, 0,0,0,0,0,0,1\n")


def record3d(root: Path) -> None:
    pictures(root)
    (root / "metadata.json").write_text(
        json.dumps({"K": [80, 0, 0, 0, 80, 0, 47, 35, 1], "poses": [[0] * 7], "fps": 60})
    )


def polycam(root: Path) -> None:
    for name in ("images", "cameras", "depth"):
        (root / "keyframes" / name).mkdir(parents=True)
    (root / "keyframes" / "images" / "1.jpg").write_bytes(jpeg(np.zeros((8, 8, 3), np.uint8)))
    (root / "keyframes" / "cameras" / "1.json").write_text('{"fx": 80, "t_00": 1.0, "t_01": 0.0}')


def scanner_app(root: Path) -> None:
    root.mkdir()
    (root / "frame_00000.jpg").write_bytes(jpeg(np.zeros((8, 8, 3), np.uint8)))
    (root / "frame_00000.json").write_text("{}")


FOLDERS: dict[str, tuple[Callable[[Path], None], str]] = {
    "a Stray Scanner recording": (stray_scanner, "create_rosbag.py"),
    "a Record3D recording": (record3d, "ns-process-data record3d"),
    "a Polycam raw export": (polycam, "ns-process-data polycam"),
    "a recording of the 3D Scanner App": (scanner_app, "transforms.json"),
}


@pytest.mark.parametrize("command", ["ingest", "inspect"])
@pytest.mark.parametrize("name", FOLDERS)
def test_folders_of_phones_are_told_apart(tmp_path: Path, name: str, command: str) -> None:
    write, way = FOLDERS[name]
    write(tmp_path / "log")
    for options in ({}, GIVEN):  # intrinsics by option would make a log without poses of it
        with pytest.raises(BadInput) as caught:
            parameters = IngestParameters(**options)  # type: ignore[arg-type]
            if command == "ingest":
                open_log(tmp_path / "log", parameters)
            else:
                inspect_log(tmp_path / "log", parameters, 4, SilentProgress())
        assert name in str(caught.value) and way in str(caught.value) and "--fx" not in str(caught.value)


def test_who_adds_a_calibration_means_the_pictures(tmp_path: Path) -> None:
    record3d(tmp_path / "log")
    (tmp_path / "log" / "intrinsics.txt").write_text(f"{CAMERA.fx} {CAMERA.fy} {CAMERA.cx} {CAMERA.cy}\n")
    assert len(open_log(tmp_path / "log", IngestParameters()).entries) == 3


def rtabmap_database(path: Path) -> None:
    with sqlite3.connect(path) as base:
        base.execute("CREATE TABLE Node (id INTEGER)")


FILES = {
    "log.mkv": ("a video", b"\x1a\x45\xdf\xa3 webm"),
    "kinect.mkv": ("an Azure Kinect recording", b"\x1a\x45\xdf\xa3 K4A_DEPTH_MODE"),
    "log.r3d": ("a Record3D recording", b"PK\x03\x04"),
    "log.svo": ("a ZED recording", b"SVO"),
    "log.db": ("an RTAB-Map database", b""),
    "log.oni": ("an OpenNI recording", b"NI10"),
    "log.klg": ("a log of Kintinuous", bytes(64)),
    "log.usdz": ("a USDZ model", b"PK\x03\x04"),
    "log.zip": ("an archive", b"PK\x03\x04"),
    "log.tar.gz": ("an archive", b"\x1f\x8b"),
    "scan.glb": ("a scan", b"glTF"),
    "log.vrs": ("a Project Aria recording", b"VisionRe"),
    "log.rrd": ("a Rerun recording", b"RRF2"),
    "log.h5": ("a table of arrays", b"\x89HDF"),
    "own.tum": ("a trajectory, no recording", b"1.0 0 0 0 0 0 0 1"),
}


@pytest.mark.parametrize("in_a_folder", [False, True])
@pytest.mark.parametrize("name", FILES)
def test_files_of_other_tools_are_told_apart(tmp_path: Path, name: str, in_a_folder: bool) -> None:
    words, data = FILES[name]
    folder = tmp_path / "log"
    folder.mkdir()
    if name.endswith(".db"):
        rtabmap_database(folder / name)
    else:
        (folder / name).write_bytes(data)
    if in_a_folder and name.endswith(".mkv"):
        return  # a folder with one video is a log of images
    with pytest.raises(BadInput, match=f"{name}: is {words}"):
        open_log(folder if in_a_folder else folder / name, IngestParameters())


def test_tables_beside_images_are_named(tmp_path: Path) -> None:
    log = pictures(tmp_path / "log")
    (log / "cameras.csv").write_text("1,2,3\n")
    (log / "capture.json").write_text("{}")
    with pytest.raises(BadInput, match=r"no calibration file \(not read: cameras\.csv, capture\.json\)"):
        open_log(log, IngestParameters())
    notes = open_log(log, IngestParameters(**GIVEN)).notes  # type: ignore[arg-type]
    assert "not read: cameras.csv, capture.json, which may hold poses or intrinsics" in notes
