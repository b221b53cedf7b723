"""Recordings of other tools are recognised by name, with the way to something that is read."""

from __future__ import annotations

import sqlite3
from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.detection import open_log
from scenewright.stages.ingest.own_poses import with_own_poses
from scenewright.stages.ingest.parameters import IngestParameters

from tests.unit.ingest.folder_writers import stamp_text, tum_line, write_image_folder
from tests.unit.ingest.tiny_room import CAMERA, frames, jpeg, millimetres, png

GIVEN = {"fx": CAMERA.fx, "fy": CAMERA.fy, "cx": CAMERA.cx, "cy": CAMERA.cy}


def pictures(root: Path) -> Path:
    """Colour and depth as phones write them, without a calibration file."""
    write_image_folder(root, frames(3), poses=False)
    (root / "intrinsics.txt").unlink()
    return root


RTABMAP_CALIBRATION = f"""%YAML:1.0
---
camera_name: "1305031102.175304"
image_width: {CAMERA.width}
image_height: {CAMERA.height}
camera_matrix:
   rows: 3
   cols: 3
   data: [ {CAMERA.fx}, 0., {CAMERA.cx}, 0., {CAMERA.fy}, {CAMERA.cy}, 0., 0., 1. ]
distortion_coefficients:
   rows: 1
   cols: 5
   data: [ 0., 0., 0., 0., 0. ]
distortion_model: plumb_bob
local_transform:
   rows: 3
   cols: 4
   data: [ 0., 0., 1., 0., -1., 0., 0., 0., 0., -1., 0., 0. ]
"""


def rtabmap_database(path: Path) -> None:
    with sqlite3.connect(path) as base:
        base.execute("CREATE TABLE Node (id INTEGER)")


FILES = {
    "log.mkv": ("a video", b"\x1a\x45\xdf\xa3 webm"),
    "kinect.mkv": ("an Azure Kinect recording", b"\x1a\x45\xdf\xa3 K4A_DEPTH_MODE"),
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


def test_what_rtabmap_exports_is_read_as_the_advice_says(tmp_path: Path) -> None:
    """Pictures and depth by their stamps, a calibration in OpenCV's YAML, poses of the camera in TUM's form."""
    with pytest.raises(BadInput, match="rtabmap-export --images --poses_camera --poses_format 10"):
        rtabmap_database(tmp_path / "map.db")
        open_log(tmp_path / "map.db", IngestParameters())
    for name in ("rgb", "depth"):
        (tmp_path / "log" / name).mkdir(parents=True)
    lines = ["#timestamp x y z qx qy qz qw"]
    for index, (color, depth, pose) in enumerate(frames(3)):
        stem = stamp_text(index)
        (tmp_path / "log" / "rgb" / f"{stem}.jpg").write_bytes(jpeg(color))
        (tmp_path / "log" / "depth" / f"{stem}.png").write_bytes(png(millimetres(depth)))
        lines.append(tum_line(stem, pose))
    (tmp_path / "log" / "calibration.yaml").write_text(RTABMAP_CALIBRATION)
    (tmp_path / "map_camera_poses.txt").write_text("\n".join(lines) + "\n")
    source = open_log(tmp_path / "log", IngestParameters())
    source = with_own_poses(source, tmp_path / "map_camera_poses.txt", IngestParameters())
    assert source.camera == CAMERA and len(source.entries) == 3
    for entry, (_, _, pose) in zip(source.entries, frames(3), strict=True):
        assert np.abs(entry.world_from_camera - pose).max() < 1e-4
