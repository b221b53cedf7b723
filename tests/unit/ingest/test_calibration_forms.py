"""Calibration files of other tools, under their own names."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.detection import open_log
from scenewright.stages.ingest.folders.calibration_files import read_calibration
from scenewright.stages.ingest.parameters import IngestParameters

from tests.unit.ingest.calibrations import CAMODOCAL, ORB_SLAM
from tests.unit.ingest.folder_writers import write_image_folder, write_tum
from tests.unit.ingest.loading import loaded_frames
from tests.unit.ingest.tiny_room import CAMERA, frames, millimetres


@pytest.mark.parametrize("name", ["TUM1.yaml", "cam0_pinhole.yaml"])
def test_a_calibration_of_another_tool_beside_the_lists_of_tum(tmp_path: Path, name: str) -> None:
    log = write_tum(tmp_path / "log", frames(1))
    (log / "calibration.txt").unlink()
    (log / name).write_text(ORB_SLAM.replace("1000.0", "5000.0") if name == "TUM1.yaml" else CAMODOCAL)
    source, found = loaded_frames(log)
    assert source.camera == CAMERA
    np.testing.assert_allclose(found[0].depth, millimetres(frames(1)[0][1]), atol=1)


def test_settings_of_orb_slam_state_the_depth_unit(tmp_path: Path) -> None:
    log = write_image_folder(tmp_path / "log", frames(1))
    (log / "intrinsics.txt").unlink()
    (log / "TUM1.yaml").write_text(ORB_SLAM.replace("1000.0", "5000.0"))
    source, found = loaded_frames(log)
    assert "depth unit stated by the calibration: 1/5000 m" in source.notes
    np.testing.assert_allclose(found[0].depth * 5.0, millimetres(frames(1)[0][1]), atol=3)
    (log / "TUM1.yaml").write_text(ORB_SLAM.replace("1000.0", "0.0"))
    with pytest.raises(BadInput, match="DepthMapFactor 0.0"):
        read_calibration(log / "TUM1.yaml")


@pytest.mark.parametrize(
    "text",
    [
        ORB_SLAM.replace('"PinHole"', '"KannalaBrandt8"')
        .replace("p1", "k3")
        .replace("p2", "k4")
        .replace("k3: 0.0", "k3: 0.1"),
        CAMODOCAL.replace("PINHOLE", "KANNALA_BRANDT")
        .replace("k1", "x")
        .replace("p1: 0.0", "k4: 0.1")
        .replace("p2", "k5")
        .replace("k2: 0.0", "k2: 0.0\n   k3: 0.0")
        .replace("fx", "mu")
        .replace("fy", "mv")
        .replace("cx", "u0")
        .replace("cy", "v0"),
    ],
    ids=["ORB-SLAM", "camodocal"],
)
def test_fisheye_lenses_of_other_tools(tmp_path: Path, text: str) -> None:
    (tmp_path / "lens.yaml").write_text(text)
    left = read_calibration(tmp_path / "lens.yaml").left
    assert left.K[0] == 80.0 and left.distortion_model == "equidistant" and left.D == (0.0, 0.0, 0.1, 0.0)


def test_several_calibrations_of_unknown_names_are_named(tmp_path: Path) -> None:
    log = write_image_folder(tmp_path / "log", frames(1))
    (log / "intrinsics.txt").unlink()
    for name in ("cam0_pinhole.yaml", "cam1_pinhole.yaml"):
        (log / name).write_text(CAMODOCAL)
    with pytest.raises(BadInput, match="cam0_pinhole.yaml, cam1_pinhole.yaml hold a camera each") as caught:
        open_log(log, IngestParameters())
    assert "calibration.yaml" in str(caught.value.hint)
    (log / "cam0_pinhole.yaml").rename(log / "calibration.yaml")
    assert open_log(log, IngestParameters()).camera == CAMERA


def test_a_file_of_settings_that_is_not_understood_is_named(tmp_path: Path) -> None:
    log = write_image_folder(tmp_path / "log", frames(1))
    (log / "intrinsics.txt").unlink()
    (log / "lens.yaml").write_text(CAMODOCAL.replace("PINHOLE", "MEI"))
    (log / "rig.xml").write_text("<rig/>")
    with pytest.raises(BadInput, match="not read: lens.yaml, rig.xml"):
        open_log(log, IngestParameters())
