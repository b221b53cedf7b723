"""Stamps in seconds to nanoseconds, in lists and trajectories; poses that are of no frame are spoken of."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from scenewright.stages.ingest.detection import open_log
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.preflight.inspection import inspect_log
from scenewright.stages.ingest.source import LogSource
from scenewright.stages.kit.formats.stamps import read_column
from scenewright.stages.kit.progress import SilentProgress

from tests.unit.ingest.folder_writers import FIRST_STAMP, write_image_folder, write_nerfstudio, write_tum
from tests.unit.ingest.tiny_room import frames

COUNT = 12


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
@pytest.mark.parametrize("first", [1403636579.763555584, 0.0])
@pytest.mark.parametrize("step", [1 / 30, 0.8])
def test_a_column_is_of_the_unit_that_makes_its_stamps_times(unit: str, first: float, step: float) -> None:
    digits = {"s": 0, "ms": 3, "us": 6, "ns": 9}[unit]
    seconds = np.round(first + np.arange(COUNT) * step, 3)
    texts = [f"{value:.6f}" if unit == "s" else str(round(value * 10**digits)) for value in seconds]
    if unit == "ms" and first == 0:
        return  # 33, 67, 100: seconds as far as anybody can tell
    assert read_column(texts).unit == unit
    np.testing.assert_allclose(np.array(read_column(texts).stamps, float), seconds * 1e9, atol=1e3)


@pytest.mark.parametrize("text", ["1403636579763555584", "1403636579763555584.000000000", "1.403636579763555584e+18"])
def test_nanoseconds_are_exact_however_they_are_written(text: str) -> None:
    assert read_column([text]).stamps == (1403636579763555584,)


def test_what_is_no_time_is_none() -> None:
    assert read_column(["1.5", "-1", "nan", "x", "1e40", "inf"]).stamps == (1_500_000_000, *[None] * 5)


def restamped(path: Path, column: str) -> None:
    """Rewrite the first column of a list: `ns`, `+3600`, `rounded`, or every 6th line (`keys`)."""
    lines = path.read_text().splitlines()
    rows = [line.split(None, 1) for line in lines if not line.startswith("#")]
    if column == "keys":
        rows = rows[::11]
    change = {
        "ns": lambda text: text.replace(".", "") + "000",
        "+3600": lambda text: f"{float(text) + 3600:.6f}",
        "rounded": lambda text: str(round(float(text))),
    }.get(column, str)
    path.write_text("\n".join(f"{change(stamp)} {rest}" for stamp, rest in rows))


def opened(log: Path, **options: float) -> tuple[LogSource, int, str]:
    source = open_log(log, IngestParameters(**options))  # type: ignore[arg-type]
    return source, sum(entry.world_from_camera is not None for entry in source.entries), " | ".join(source.notes)


@pytest.mark.parametrize(
    "lists", [("groundtruth.txt",), ("rgb.txt", "depth.txt"), ("rgb.txt", "depth.txt", "groundtruth.txt")]
)
def test_a_tum_folder_may_have_nanoseconds(tmp_path: Path, lists: tuple[str, ...]) -> None:
    recorded = frames(COUNT)
    log = write_tum(tmp_path / "log", recorded)
    for name in lists:
        restamped(log / name, "ns")
    source, posed, notes = opened(log)
    assert posed == COUNT and "stamps in ns" in notes
    assert source.entries[0].time == pytest.approx(FIRST_STAMP + 0.004, abs=1e-6)
    for entry, (_, _, pose) in zip(source.entries, recorded, strict=True):
        np.testing.assert_allclose(entry.world_from_camera, pose, atol=1e-6)


def test_times_of_plain_images_may_be_nanoseconds(tmp_path: Path) -> None:
    log = write_image_folder(tmp_path / "log", frames(3))
    (log / "times.txt").write_text("1403636579763555584\n1403636579796888832\n1403636579830222080\n")
    source, _, notes = opened(log)
    assert [entry.stamp for entry in source.entries] == [1403636579763555584, 1403636579796888832, 1403636579830222080]
    assert "times from times.txt, ns" in notes


@pytest.mark.parametrize("digits", [0, 3, 9])
def test_timestamps_of_transforms_json(tmp_path: Path, digits: int) -> None:
    log = write_nerfstudio(tmp_path / "log", frames(3))
    document = json.loads((log / "transforms.json").read_text())
    for index, frame in enumerate(document["frames"]):
        frame["timestamp"] = round((1403636579.5 + index) * 10**digits, 3 if digits == 0 else None)
    (log / "transforms.json").write_text(json.dumps(document))
    source, _, _ = opened(log)
    assert [entry.stamp for entry in source.entries] == [1403636579_500_000_000 + k * 10**9 for k in range(3)]


def test_poses_of_another_clock_are_spoken_of_with_the_offset(tmp_path: Path) -> None:
    log = write_tum(tmp_path / "log", frames(COUNT))
    restamped(log / "groundtruth.txt", "+3600")
    _, posed, notes = opened(log)
    assert posed == 0 and "WARNING: none of the 12 poses of groundtruth.txt is of a frame" in notes
    assert "begin 3600 s after the frames" in notes and "in the clock of the images" in notes


def test_rounded_stamps_are_called_so_and_no_option_is_named(tmp_path: Path) -> None:
    log = write_tum(tmp_path / "log", frames(COUNT))
    restamped(log / "groundtruth.txt", "rounded")
    _, _, notes = opened(log)
    assert "stamps of groundtruth.txt are rounded" in notes and "--maximum" not in notes


def test_key_frames_far_apart_name_the_option_that_helps_and_it_does(tmp_path: Path) -> None:
    log = write_tum(tmp_path / "log", frames(COUNT))
    restamped(log / "groundtruth.txt", "keys")
    _, posed, notes = opened(log, maximum_transform_gap=0.2)
    assert posed == 2 and "10 of 12 frames have no pose" in notes
    advised = re.search(r"--maximum-transform-gap ([0-9.]+) interpolates", notes)
    assert advised is not None and opened(log, maximum_transform_gap=float(advised[1]))[1] == COUNT


def test_inspect_says_so_too(tmp_path: Path) -> None:
    log = write_tum(tmp_path / "log", frames(COUNT))
    restamped(log / "groundtruth.txt", "+3600")
    report = inspect_log(log, IngestParameters(), 4, SilentProgress()).report
    (finding,) = (finding for finding in report.findings if finding.check == "poses")
    assert "begin 3600 s after the frames" in finding.message
