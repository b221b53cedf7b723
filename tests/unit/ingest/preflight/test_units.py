"""Depth and translations of different units: the pre-flight names the unit, and its advice gives the room its size."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from scenewright.stages.ingest.preflight.inspection import inspect_log
from scenewright.stages.ingest.preflight.report import InspectionReport
from scenewright.stages.ingest.preflight.settings import ingest_parameters
from scenewright.stages.ingest.preflight.units import known, plausible_units, readings
from scenewright.stages.kit.progress import SilentProgress

from tests.unit.ingest.preflight.textured_room import CAMERA, painted, walk
from tests.unit.ingest.running import ingest
from tests.unit.ingest.tiny_room import png, room_depth

COUNT = 14


def write_log(root: Path, units: float, lengths: float = 1.0, stored: str = "as-is") -> Path:
    """Write a 7-Scenes folder with `units` of depth a metre, translations of `lengths` a metre."""
    root.mkdir(parents=True)
    matrix = [[CAMERA.fx, 0, CAMERA.cx], [0, CAMERA.fy, CAMERA.cy], [0, 0, 1]]
    np.savetxt(root / "camera-intrinsics.txt", matrix)
    for index, pose in enumerate(walk(COUNT)):
        depth = room_depth(CAMERA, pose)
        image = np.rint(depth * units).astype(np.uint16)
        if stored == "swapped":
            image = image.byteswap()
        if stored == "rotated":
            image = (image << np.uint16(3)) | (image >> np.uint16(13))
        cv2.imwrite(str(root / f"frame-{index:06d}.color.jpg"), painted(depth, CAMERA, pose))
        (root / f"frame-{index:06d}.depth.png").write_bytes(png(image))
        scaled = pose.copy()
        scaled[:3, 3] *= lengths
        np.savetxt(root / f"frame-{index:06d}.pose.txt", scaled)
    return root


def inspected(log: Path, *settings: str) -> InspectionReport:
    return inspect_log(log, ingest_parameters(settings), 14, SilentProgress()).report


def advised(report: InspectionReport) -> list[str]:
    """Return the settings of the first option that a report advises."""
    words = report.fix.partition(" (")[0].removeprefix("ingest with ").split()
    return [f"{n.removeprefix('--').replace('-', '_')}={v}" for n, v in zip(words[::2], words[1::2], strict=True)]


@pytest.mark.parametrize(
    ("units", "lengths", "read_with", "option"),
    [
        (256.0, 1.0, None, ["depth_scale=256"]),
        (10000.0, 1.0, 5000.0, ["depth_scale=10000"]),
        (1000.0, 1.0, 5000.0, ["depth_scale=1000"]),
        (5000.0, 1.0, None, ["depth_scale=5000"]),
        (6553.5, 1.0, None, ["depth_scale=6553.5"]),
        (4000.0, 1.0, None, ["depth_scale=4000"]),
        (100.0, 1.0, None, ["depth_scale=100"]),
        (1000.0, 1000.0, None, ["pose_scale=0.001"]),
        (1000.0, 100.0, None, ["pose_scale=0.01"]),
        (10000.0, 1000.0, None, ["depth_scale=10000", "pose_scale=0.001"]),
        (100.0, 100.0, None, ["depth_scale=100", "pose_scale=0.01"]),
    ],
)
def test_the_unit_is_named_and_the_advice_makes_the_log_ready(
    tmp_path: Path, units: float, lengths: float, read_with: float | None, option: list[str]
) -> None:
    log = write_log(tmp_path / "log", units, lengths)
    settings = () if read_with is None else (f"depth_scale={read_with}",)
    report = inspected(log, *settings)
    assert report.verdict == "wasted" and advised(report) == option, report.fix
    assert "--pose-scale" in report.fix and "--depth-scale" in report.fix and "a room of " in report.fix
    size = float(report.fix.partition("a room of ")[2].partition(" m")[0])
    assert 2.5 < size < 4.5
    again = inspected(log, *option)
    assert again.verdict == "ready", again.reason
    assert again.cameras[0].depth is not None and 1.2 < again.cameras[0].depth.median < 2.7


@pytest.mark.parametrize("units", [1000.0, 5000.0])
def test_bytes_in_the_wrong_order_are_named(tmp_path: Path, units: float) -> None:
    log = write_log(tmp_path / "log", units, stored="swapped")
    settings = (f"depth_scale={units}",)
    report = inspected(log, *settings)
    assert report.verdict == "wasted" and "two bytes exchanged" in report.reason
    assert advised(report) == ["depth_bits=swapped"]
    assert inspected(log, *settings, *advised(report)).verdict == "ready"
    wrong = ingest(log, tmp_path / "wrong", depth_scale=units)
    assert any("--depth-bits" in note for note in wrong.info.notes)
    right = ingest(log, tmp_path / "right", depth_scale=units, depth_bits="swapped")
    straight = ingest(write_log(tmp_path / "straight", units), tmp_path / "out", depth_scale=units)
    assert right.summary == straight.summary and not any("--depth-bits" in note for note in straight.info.notes)


def test_bits_rotated_as_in_sun3d_are_read(tmp_path: Path) -> None:
    log = write_log(tmp_path / "log", 10000.0, stored="rotated")
    report = inspected(log, "depth_scale=10000")
    assert advised(report) == ["depth_bits=rotated"]
    assert inspected(log, "depth_scale=10000", "depth_bits=rotated").verdict == "ready"


def test_the_likeliest_reading_is_first() -> None:
    assert [way.changes for way in readings(0.001, 1000.0, 2.0, 4.0)] == [("pose_scale",), ("depth_scale",)]
    # A factor of no unit is that of a path without scale; a known unit is that of depth.
    assert readings(0.37, 1000.0, 2.0, 4.0)[0].changes == ("pose_scale",)
    first = readings(0.2564, 1000.0, 0.5, 1.0)[0]
    assert first.words() == "--depth-scale 256 (a room of 3.91 m)"
    assert readings(1.998, 5000.0, 4.0, 8.0)[1].words(0.5) == "--pose-scale 0.999 (a room of 8 m)"
    assert known(4014.0, (4000.0, 5000.0)) == 4000.0 and known(4400.0, (4000.0, 5000.0)) == 4400.0


def test_units_that_make_depth_plausible() -> None:
    assert plausible_units(20.0, 1000.0)[0] == 10000.0 and 5000.0 in plausible_units(20.0, 1000.0)
    assert plausible_units(10.0, 1000.0)[0] == 5000.0
    assert plausible_units(0.002, 1000.0) == [1.0]
    assert plausible_units(2000.0, 1.0)[0] == 1000.0
