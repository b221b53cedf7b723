"""The parts of the pre-flight against numbers made by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest.preflight.calibration import calibration_findings, calibration_report, other_size
from scenewright.stages.ingest.preflight.charts import ticks
from scenewright.stages.ingest.preflight.choice import RUN_LENGTH, choose, turn
from scenewright.stages.ingest.preflight.depth import depth_findings, depth_report, units_per_metre
from scenewright.stages.ingest.preflight.epipolar import Matches, epipolar_distances
from scenewright.stages.ingest.preflight.fits import relative_pose
from scenewright.stages.ingest.preflight.looking import Look, look_at_entry
from scenewright.stages.ingest.preflight.pictures import sharpness
from scenewright.stages.ingest.preflight.poses import round_scale
from scenewright.stages.ingest.preflight.registration import Edges, best_offset, lag_scores
from scenewright.stages.ingest.preflight.steps import step_reports
from scenewright.stages.ingest.preflight.streams import clock_lines, stream_findings, stream_report
from scenewright.stages.ingest.source import Entry, LoadedFrame, LogSource, SourceCamera, StreamInfo
from scenewright.stages.kit.geometry.cameras import project
from scenewright.stages.kit.geometry.transforms import apply, inverse, look_at, transform_from_yaw

from tests.unit.ingest.preflight.textured_room import CAMERA, walk

MILLION = 1_000_000


def stream(stamps: list[int], **changes) -> StreamInfo:
    return StreamInfo("/camera", "color", "raw", np.array(stamps, dtype=np.int64) * MILLION, **changes)


# ---- streams ----


def test_rate_gaps_duplicates_reversals() -> None:
    report = stream_report(stream([0, 100, 200, 200, 300, 1300, 1200, 1400]))
    assert (report.count, report.duplicates, report.reversals) == (8, 1, 1)
    assert report.rate == pytest.approx(10)
    assert (report.gaps.count, report.gaps.longest, report.gaps.longest_at) == (1, 0.9, 0.3)
    assert (report.first, report.last) == (0.0, 1.4)


@pytest.mark.parametrize("stamps", [[], [5], [5, 5, 5]])
def test_streams_with_hardly_any_stamps(stamps: list[int]) -> None:
    report = stream_report(stream(stamps, count=7))
    assert report.count == 7 and report.rate is None and report.gaps.count == 0


@settings(deadline=None)
@given(st.lists(st.integers(-(2**62), 2**62), max_size=40))
def test_any_stamps_make_a_report(stamps: list[int]) -> None:
    report = stream_report(StreamInfo("x", "depth", "", np.array(stamps, dtype=np.int64)))
    assert report.duplicates == len(stamps) - len(set(stamps))
    assert report.model_dump_json()


def test_long_gap_is_a_doubt_a_short_one_is_not() -> None:
    regular = [100 * k for k in range(200)]
    assert not stream_findings([stream_report(stream(regular))])
    one_short = regular[:100] + [t + 400 for t in regular[100:]]
    assert not stream_findings([stream_report(stream(one_short))])
    one_long = regular[:100] + [t + 5000 for t in regular[100:]]
    found = stream_findings([stream_report(stream(one_long))])
    assert [f.severity for f in found] == ["doubtful"] and "5.1 s" in found[0].message


def test_clocks_are_compared() -> None:
    color, depth = np.arange(0, 3000, 33) * MILLION, (np.arange(0, 3000, 33) + 5) * MILLION
    streams = (
        StreamInfo("/c", "color", "", color, len(color), log_delay=100.0),
        StreamInfo("/d", "depth", "", depth, len(depth), log_delay=0.01),
    )
    lines = clock_lines(LogSource("x", "x", (SourceCamera("camera", CAMERA),), (), streams=streams))
    assert len(lines) == 2 and "+100 s" in lines[0] and "/c" in lines[0]
    assert "+5.0 ms" in lines[1] and "+0 us/s" in lines[1]


# ---- calibration ----


def camera(**changes: float) -> Camera:
    return CAMERA.model_copy(update=changes)


def test_good_calibration_has_no_findings() -> None:
    report = calibration_report(CAMERA)
    assert report.plausible and report.field_of_view[0] == pytest.approx(63.2, abs=0.1)
    assert not calibration_findings(report, CAMERA, "camera")


@pytest.mark.parametrize("factor", [0.5, 2.0, 4.0])
def test_calibration_of_another_resolution(factor: float) -> None:
    there = camera(fx=130 * factor, fy=130 * factor, cx=80 * factor - 0.5, cy=60 * factor - 0.5)
    assert other_size(there) == pytest.approx(1 / factor)
    found = calibration_findings(calibration_report(there), there, "camera")
    assert found[0].severity == "wasted" and "--fx 130 --fy 130 --cx 79.5 --cy 59.5" in found[0].fix


def test_swapped_center_and_odd_pixels() -> None:
    swapped = Camera(width=640, height=400, fx=500, fy=500, cx=199.5, cy=319.5)
    found = calibration_findings(calibration_report(swapped), swapped, "camera")
    assert found[0].severity == "wasted" and "swapped" in found[0].message
    flat = camera(fy=60.0)
    assert "square" in calibration_findings(calibration_report(flat), flat, "camera")[0].message
    narrow = camera(fx=2000.0, fy=2000.0)
    assert "field of view" in calibration_findings(calibration_report(narrow), narrow, "camera")[0].message


# ---- depth ----


def look(depth: np.ndarray, color: np.ndarray | None = None) -> Look:
    shape = Camera(width=depth.shape[1], height=depth.shape[0], fx=100, fy=100, cx=50, cy=40)
    return look_at_entry(Entry("x", 0.0, None, lambda: LoadedFrame(color, depth)), 0, shape, keep_picture=True)


def test_depth_in_numbers() -> None:
    depth = np.full((80, 100), 1000, np.uint16)
    depth[:20], depth[20:30] = 0, 4000
    report = depth_report([look(depth)])
    assert report is not None
    assert (report.valid_share, report.median, report.step, report.distinct_values) == (0.75, 1.0, 3.0, 2)
    assert report.saturated_value == 4.0 and report.saturated_share == pytest.approx(1 / 6, abs=1e-4)
    assert sum(report.histogram) == pytest.approx(1, abs=0.01)
    assert depth_report([]) is None


def test_eight_bit_depth_and_cut_off() -> None:
    random = np.random.default_rng(0)
    stretched = (random.integers(5, 200, (80, 100)) * 20).astype(np.uint16)
    report = depth_report([look(stretched)])
    assert report is not None
    assert any("8-bit" in f.message for f in depth_findings(report, 1000, ""))
    cut = np.minimum(random.integers(1000, 6000, (80, 100)), 4000).astype(np.uint16)
    report = depth_report([look(cut)])
    assert report is not None
    found = depth_findings(report, 1000, "")
    assert any("exactly 4.000 m" in f.message and "--maximum-depth" in f.fix for f in found)


def test_where_the_unit_of_depth_is_from() -> None:
    assert units_per_metre(("depth unit assumed: 1/5000 m",), None) == 5000
    assert units_per_metre(("depth unit assumed: 1/5000 m",), 200.0) == 200
    assert units_per_metre((), None) == 1000


def test_measured_scales_are_those_of_units() -> None:
    assert round_scale(0.0985) == 0.1 and round_scale(4.9) == 5.0 and round_scale(0.37) == 0.37


# ---- choice ----


@settings(deadline=None)
@given(st.integers(0, 400), st.integers(1, 90), st.booleans())
def test_choice_is_bounded_and_within(total: int, count: int, posed: bool) -> None:
    times = np.arange(total) / 30
    choice = choose(times, walk(total) if posed and total else None, count)
    assert len(choice.frames) <= max(count, RUN_LENGTH) and list(choice.frames) == sorted(set(choice.frames))
    assert all(0 <= index < total for index in choice.frames)
    assert all(i < j and {i, j} <= set(choice.frames) for i, j in choice.pairs)
    assert all(list(run) == list(range(run[0], run[-1] + 1)) for run in choice.runs)


def test_pairs_turn_enough_where_the_camera_turns() -> None:
    poses = np.array([transform_from_yaw(np.radians(0.5 * k), np.zeros(3)) for k in range(300)])
    choice = choose(np.arange(300) / 30, poses, 60)
    inside = [(i, j) for i, j in choice.pairs if j < 299 and not any({i, j} <= set(run) for run in choice.runs)]
    apart = [j - i for i, j in inside]
    assert apart and all(gap in (16, 17) for gap in apart)  # 8 degrees
    assert turn(poses[0], poses[16]) == pytest.approx(np.radians(8))


# ---- geometry ----


def seen_twice(first: np.ndarray, second: np.ndarray) -> Matches:
    random = np.random.default_rng(2)
    points = random.uniform([-1, -1, 0], [1, 1, 1], (200, 3))
    return Matches(*(project(apply(inverse(pose), points), CAMERA)[0] for pose in (first, second)))


def test_epipolar_distance_is_zero_for_the_truth_alone() -> None:
    first, second = look_at(np.array([-3.0, 0, 1]), np.zeros(3)), look_at(np.array([-2.8, 0.5, 1.2]), np.zeros(3))
    found = seen_twice(first, second)
    true = relative_pose(second, first)
    np.testing.assert_allclose(true, inverse(second) @ first, atol=1e-12)
    assert epipolar_distances(found, true, CAMERA).max() < 1e-9
    longer = true.copy()
    longer[:3, 3] *= 7
    assert epipolar_distances(found, longer, CAMERA).max() < 1e-9  # the length of the translation is not seen
    assert np.median(epipolar_distances(found, inverse(true), CAMERA)) > 1


def test_epipolar_distance_of_a_pixel_off_the_line() -> None:
    first = look_at(np.array([-3.0, 0, 0.5]), np.array([0, 0, 0.5]))
    second = first.copy()
    second[:3, 3] += 0.3 * second[:3, 0]  # to the right: epipolar lines are rows
    found = seen_twice(first, second)
    moved = Matches(found.first, found.second + [0, 2.0])
    # Both pictures share the error: sqrt(1/2) of it in each.
    np.testing.assert_allclose(
        epipolar_distances(moved, relative_pose(second, first), CAMERA), 2 / np.sqrt(2), rtol=1e-6
    )


def test_epipolar_distance_without_translation_is_that_to_the_turned_point() -> None:
    first = look_at(np.array([-3.0, 0, 0.5]), np.array([0, 0, 0.5]))
    found = seen_twice(first, first)
    assert epipolar_distances(found, np.eye(4), CAMERA).max() < 1e-9
    shifted = Matches(found.first, found.second + [3.0, 4.0])
    np.testing.assert_allclose(epipolar_distances(shifted, np.eye(4), CAMERA), 5.0, rtol=1e-9)


# ---- registration ----


def test_offset_and_lag_of_a_moving_bar() -> None:
    def edges(place: int, colored: int) -> Edges:
        gradient, jumps = np.full((60, 80), 0.5, np.float32), np.zeros((60, 80), np.float32)
        gradient[10:50, colored], jumps[10:50, place] = 6.0, 1.0
        return Edges(gradient, jumps, 1)

    frames = {k: edges(20 + 3 * k, 20 + 3 * (k - 2)) for k in range(11)}  # colour shows where the bar was 2 frames ago
    scores = lag_scores(frames, [tuple(range(11))])
    assert max(scores, key=lambda lag: scores[lag]) == 2
    same = {k: edges(20 + k, 20 + k + 5) for k in range(6)}
    offset, score = best_offset([(e.gradient, e.jumps) for e in same.values()])
    assert offset == (5, 0) and score > 5


# ---- the rest ----


def test_blur_lowers_sharpness() -> None:
    import cv2

    random = np.random.default_rng(1)
    picture = random.integers(0, 255, (240, 320), dtype=np.uint8)
    assert sharpness(cv2.GaussianBlur(picture, (0, 0), 2)) < 0.05 * sharpness(picture)


def test_steps_name_what_is_missing() -> None:
    rows = {row.step: row for row in step_reports({"usable frames", "colour", "poses"})}
    assert rows["ingest"].ready and not rows["fuse"].ready and rows["fuse"].missing == ("depth",)
    rows = {row.step: row for row in step_reports({"usable frames", "colour", "a stereo pair with a baseline"})}
    assert "disparity" in rows["fuse"].missing[0] and not rows["segment"].ready
    assert not any(row.ready for row in step_reports(set()))


@settings(deadline=None)
@given(st.floats(-1e6, 1e6), st.floats(1e-3, 1e6))
def test_ticks_are_round_and_inside(low: float, size: float) -> None:
    found = ticks(low, low + size)
    assert len(found) <= 12 and all(low - 1e-6 * size <= tick <= low + size * (1 + 1e-6) for tick in found)
