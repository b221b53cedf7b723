"""Stamps: partners within a tolerance, clocks that jump, go back or stand still, logs that are late; memory."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.association import fresh, mutual_nearest, partners
from scenewright.stages.ingest.detection import open_log
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.formats.trajectories import read_tum

from tests.unit.ingest.message_logs import FIRST, SECOND, compressed_depth, recorder
from tests.unit.ingest.running import ingest
from tests.unit.ingest.rvl_writing import encode_rvl
from tests.unit.ingest.tiny_room import CAMERA, frames, jpeg, millimetres, png

COLOR, DEPTH = "/cam/color/image_raw/compressed", "/cam/aligned_depth_to_color/image_raw"


def _frame(log: Any, index: int, recorded: tuple, *, color: int | None, depth: int | None, **options: Any) -> None:
    """Write one frame with the stamps of its colour and its depth (None: left out)."""
    picture, metres, pose = recorded
    if color is not None:
        log.info("/cam/color/camera_info", color, "optical", **options)
        log.compressed(COLOR, color, jpeg(picture), "jpeg", "optical", **options)
        log.transform("/tf", color, "map", "optical", pose, **options)
    if depth is not None:
        log.image(DEPTH, depth, millimetres(metres), "16UC1", "optical", **options)


def _record(folder: Path, stamps: list[tuple[int | None, int | None]], **options: Any) -> Path:
    with recorder(folder) as log:
        for index, ((color, depth), recorded) in enumerate(zip(stamps, frames(len(stamps)), strict=True)):
            _frame(log, index, recorded, color=color, depth=depth, **options)
    return log.path


TENTH = SECOND // 10


def test_depth_beyond_the_tolerance_is_no_partner(tmp_path: Path) -> None:
    late = [(FIRST + i * TENTH, FIRST + i * TENTH + 30_000_000) for i in range(5)]
    log = _record(tmp_path, late)
    assert ingest(log, tmp_path / "a").info.drops == {"no_depth_within_tolerance": 5}
    wide = ingest(log, tmp_path / "b", maximum_time_difference=0.035, gravity="none")
    assert wide.info.drops == {} and wide.info.frame_count == 5
    times, _ = read_tum(wide.path("trajectory.tum"))
    np.testing.assert_allclose(times, [stamp * 1e-9 for _, stamp in late], atol=1e-6)  # poses of the depth's time


def test_missing_and_repeated_images_are_counted(tmp_path: Path) -> None:
    at = [FIRST + i * TENTH for i in range(6)]
    log = _record(
        tmp_path, [(at[0], at[0]), (at[1], None), (None, at[2]), (at[3], at[3]), (at[3], at[3]), (at[5], at[5])]
    )
    info = ingest(log, tmp_path / "out", gravity="none").info
    assert info.drops == {"duplicate_stamp": 1, "no_depth_within_tolerance": 1} and info.frame_count == 3
    assert info.frames_in_log == 5


def test_log_times_do_not_matter(tmp_path: Path) -> None:
    stamps = [(FIRST + i * TENTH, FIRST + i * TENTH) for i in range(4)]
    prompt = ingest(_record(tmp_path / "a", stamps), tmp_path / "prompt", gravity="none")
    with recorder(tmp_path / "b") as log:
        for index, ((color, depth), recorded) in enumerate(zip(stamps, frames(4), strict=True)):
            _frame(log, index, recorded, color=color, depth=None, log_time=color - 100 * SECOND)
            _frame(log, index, recorded, color=None, depth=depth, log_time=depth + 100 * SECOND)
    late = ingest(log.path, tmp_path / "late", gravity="none")
    assert late.info.drops == prompt.info.drops == {}
    assert late.path("frames.mcap").read_bytes() == prompt.path("frames.mcap").read_bytes()
    source = open_log(log.path, IngestParameters())
    delays = {stream.name: stream.log_delay for stream in source.streams}
    source.close()
    assert delays[COLOR] == pytest.approx(-100) and delays[DEPTH] == pytest.approx(100)


def test_order_in_the_file_does_not_matter_and_is_noted(tmp_path: Path) -> None:
    stamps = [(FIRST + i * TENTH, FIRST + i * TENTH) for i in range(5)]
    with recorder(tmp_path) as log:
        for index in (3, 0, 4, 1, 2):
            color, depth = stamps[index]
            _frame(log, index, frames(5)[index], color=color, depth=depth)
    sequence = ingest(log.path, tmp_path / "out", gravity="none")
    assert sequence.info.drops == {} and any("go back 2 times" in note for note in sequence.info.notes)
    with FrameReader(sequence.path("frames.mcap")) as reader:
        for frame, (_, depth, pose) in zip(reader.frames(), frames(5), strict=True):
            np.testing.assert_array_equal(frame.depth, millimetres(depth) / np.float32(1000))
            np.testing.assert_allclose(frame.world_from_camera, pose, atol=1e-9)


def test_clock_that_jumps_is_two_recordings_in_order(tmp_path: Path) -> None:
    jump = [FIRST, FIRST + TENTH, FIRST + 2 * TENTH, FIRST + 1000 * SECOND, FIRST + 1000 * SECOND + TENTH]
    sequence = ingest(_record(tmp_path, [(stamp, stamp) for stamp in jump]), tmp_path / "out", gravity="none")
    assert sequence.info.drops == {} and sequence.info.frame_count == 5
    assert sequence.info.end_time - sequence.info.start_time == pytest.approx(1000.1)


def test_messages_without_stamps_take_their_log_time(tmp_path: Path) -> None:
    color, depth, _ = frames(1)[0]
    with recorder(tmp_path) as log:
        for index in range(3):
            now = FIRST + index * TENTH
            log.info("/cam/color/camera_info", 0, "optical", log_time=now)
            log.compressed(COLOR, 0, jpeg(color), "jpeg", "optical", log_time=now)
            log.image(DEPTH, 0, millimetres(depth), "16UC1", "optical", log_time=now)
    info = ingest(log.path, tmp_path / "out").info
    assert info.frame_count == 3 and info.start_time == pytest.approx(FIRST * 1e-9)
    assert any(f"3 messages of {COLOR} have no header stamp" in note for note in info.notes)


def test_log_of_images_without_messages_is_empty(tmp_path: Path) -> None:
    with recorder(tmp_path) as log:
        log.text("/chatter", FIRST, "nothing else")
    sequence = ingest(log.path, tmp_path / "out")
    assert sequence.outcome == "empty" and any("/chatter" in note for note in sequence.info.notes)


def test_images_that_do_not_decode_are_counted_by_reason(tmp_path: Path) -> None:
    """Broken within a whole message: dropped frames. A broken message: damage of the log."""
    recorded = frames(4)
    with recorder(tmp_path) as log:
        for index, frame in enumerate(recorded):
            stamp = FIRST + index * TENTH
            if index == 1:
                log.compressed(COLOR, stamp, jpeg(frame[0])[:300], "jpeg", "optical")
                _frame(log, index, frame, color=None, depth=stamp)
            elif index == 2:
                log.write_bytes(COLOR, "sensor_msgs/msg/CompressedImage", b"\x00\x01\x00\x00\xff\xff", stamp)
                _frame(log, index, frame, color=None, depth=stamp)
            else:
                _frame(log, index, frame, color=stamp, depth=stamp)
    info = ingest(log.path, tmp_path / "out", gravity="none").info
    assert info.drops == {"undecodable_color": 1} and info.frame_count == 2
    assert f"1 of 4 messages of {COLOR} do not decode" in info.damage[0]
    with pytest.raises(BadInput, match="1 of 4 messages of /cam/color"):
        ingest(log.path, tmp_path / "refused", damage="refuse")


def test_depth_in_every_dress_is_the_same_depth(tmp_path: Path) -> None:
    """Metres with NaN and infinity, big-endian millimetres, compressedDepth as PNG and as RVL."""
    _, depth, _ = frames(1)[0]
    hole = depth.copy()
    hole[3, 4], hole[5, 6], hole[7, 8] = np.nan, np.inf, -np.inf
    expected = np.where(np.isfinite(hole), millimetres(depth), 0) / np.float32(1000)
    whole = np.where(expected > 0, millimetres(depth), 0).astype(np.uint16)
    writers = {
        "metres": lambda log, stamp: log.image("/cam/depth/image_raw", stamp, hole, "32FC1", "optical"),
        "big": lambda log, stamp: log.image("/cam/depth/image_raw", stamp, whole, "16UC1", "optical", big_endian=True),
        "png": lambda log, stamp: log.compressed(
            "/cam/depth/image_raw/compressedDepth",
            stamp,
            compressed_depth(png(whole)),
            "16UC1; compressedDepth png",
            "optical",
        ),
    }
    writers["rvl"] = lambda log, stamp: log.compressed(
        "/cam/depth/image_raw/compressedDepth",
        stamp,
        compressed_depth(encode_rvl(whole)),
        "16UC1; compressedDepth rvl",
        "optical",
    )
    for name, write in writers.items():
        with recorder(tmp_path / name) as log:
            log.info("/cam/depth/camera_info", FIRST, "optical")
            write(log, FIRST)
        sequence = ingest(log.path, tmp_path / f"{name}_out")
        assert sequence.info.camera == CAMERA, name
        with FrameReader(sequence.path("frames.mcap")) as reader:
            np.testing.assert_array_equal(reader.read(0).depth, expected)


# --- association -----------------------------------------------------------------------------------------------

sorted_stamps = st.lists(st.integers(0, 2000), max_size=25).map(sorted)


@settings(max_examples=150, deadline=None)
@given(sorted_stamps, sorted_stamps, st.integers(0, 300))
def test_partners_are_mutual_near_and_used_once(first: list, second: list, tolerance: int) -> None:
    found = partners(np.array(first, np.int64), np.array(second, np.int64), tolerance)
    assert len(found) == len(first)
    used = [int(index) for index in found if index >= 0]
    assert len(used) == len(set(used)) and used == sorted(used)
    for position, index in enumerate(found):
        if index < 0:
            continue
        distance = abs(first[position] - second[index])
        assert distance <= tolerance
        assert distance == min(abs(first[position] - other) for other in second)
        assert distance == min(abs(second[index] - other) for other in first)
        assert position == 0 or first[position] != first[position - 1]
    for position, index in enumerate(found):  # who has no partner had no mutual one
        repeated = position > 0 and first[position] == first[position - 1]
        if index < 0 and not repeated and second:
            nearest = min(second, key=lambda other: abs(other - first[position]))
            nearer = min(abs(nearest - other) for other in first)
            distance = abs(nearest - first[position])
            ties = sum(abs(other - first[position]) == distance for other in set(second)) > 1
            assert distance > tolerance or nearer < distance or ties or nearer == distance


def test_identical_stamps_all_find_each_other() -> None:
    stamps = np.arange(100) * 33_333_333
    np.testing.assert_array_equal(mutual_nearest(stamps, stamps, 0), np.arange(100))
    np.testing.assert_array_equal(partners(np.array([1, 1, 2]), np.array([1, 2, 2]), 0), [0, -1, 1])
    np.testing.assert_array_equal(fresh(np.array([3, 3, 4])), [True, False, True])
    assert len(fresh(np.zeros(0, np.int64))) == 0


# --- memory ----------------------------------------------------------------------------------------------------

MEASURE = """
import resource, sys
from pathlib import Path
from tests.unit.ingest.running import ingest
sequence = ingest(Path(sys.argv[1]), Path(sys.argv[2]), gravity="none")
print(sequence.info.frame_count, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024)
"""


@pytest.mark.slow
def test_memory_does_not_grow_with_the_log(tmp_path: Path) -> None:
    """10,000 frames with 10 transforms and 10 inertial samples each against 500: at most 60 MB more."""
    peaks = []
    for count in (500, 10_000):
        with recorder(tmp_path / str(count), "ros1") as log:
            picture, depth = np.full((24, 32, 3), 90, np.uint8), np.full((24, 32), 1000, np.uint16)
            depth[::3, ::5] = 1200
            encoded = jpeg(picture)
            camera = CAMERA.model_copy(update={"width": 32, "height": 24})
            for index in range(count):
                stamp = FIRST + index * TENTH
                for tick in range(10):
                    now = stamp + tick * TENTH // 10
                    matrix = np.eye(4)
                    matrix[0, 3] = 1e-4 * (10 * index + tick)
                    log.transform("/tf", now, "map", "optical", matrix)
                    log.imu("/imu", now, "optical", np.array([0, 0, 9.81]))
                log.info("/cam/camera_info", stamp, "optical", camera)
                log.compressed("/cam/image_color/compressed", stamp, encoded, "jpeg", "optical")
                log.image("/cam/image_depth", stamp, depth, "16UC1", "optical")
        command = [sys.executable, "-c", MEASURE, str(log.path), str(tmp_path / f"out{count}")]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        frames_written, peak = map(int, done.stdout.split()[-2:])
        assert frames_written == count
        peaks.append(peak)
    assert peaks[1] - peaks[0] < 60, peaks
