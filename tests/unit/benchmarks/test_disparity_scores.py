"""The figures of `make bench-disparity`, on maps whose scores are plain."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.engine.pipelines import resolve_variables, step_arguments
from scenewright.stages.kit.formats.frames import FrameWriter
from scenewright.stages.kit.stereo.disparity_map import DisparityMap

from benchmarks.experiment import Bench, Results, Trial
from benchmarks.experiments.disparity.arms import CLASSICAL, DERIVED, WORDS, arms_of
from benchmarks.experiments.disparity.cases import Pair
from benchmarks.experiments.disparity.experiment import EXPERIMENT, DisparityParameters, measured, scores
from benchmarks.experiments.stereo_rooms import depth_figures, pipeline_of
from benchmarks.results import write_results


def test_scores_are_the_closed_form() -> None:
    truth = np.array([[10.0, 10.0, 10.0, 10.0, np.nan]], np.float32)
    found = np.array([[10.5, 13.0, np.nan, 9.0, 40.0]], np.float32)
    figures = scores(DisparityMap(found, np.ones_like(found)), truth)
    assert figures["coverage"] == pytest.approx(75) and figures["bad2"] == pytest.approx(100 / 3)
    assert figures["bad2_all"] == pytest.approx(50)  # one wrong, one hole, of four
    assert figures["epe"] == pytest.approx(1.5) and figures["median"] == pytest.approx(1.0)


def test_parts_of_cases_have_figures_and_a_table(tmp_path: Path) -> None:
    values = {"bad2": 1.0, "bad2_all": 2.0, "epe": 3.0, "median": 4.0, "coverage": 5.0, "cpu_seconds": 6.0}
    records = {Trial("ours", "needles", "3100"): {"": values, "needle": {"coverage": 50.0}}}
    results = Results(EXPERIMENT, Bench(tmp_path, DisparityParameters.model_validate({})), records)
    text = write_results(results, ["python"], [])
    assert "| ours/needles_needle |" in text and "rooms" not in text
    metrics = json.loads((tmp_path / "metrics.json").read_text())
    assert metrics["ours/needles/epe"] == 3.0 and metrics["pairs/needles/count"] == 1.0
    assert metrics["ours/needles_needle/coverage"] == 50.0 and "ours/needles_needle/epe" not in metrics


def test_parts_of_a_picture_are_scored_by_themselves() -> None:
    picture = np.zeros((4, 40, 3), np.uint8)
    truth = np.full((4, 40), 7.0, np.float32)
    needle = np.zeros(truth.shape, bool)
    needle[:, :10] = True
    pair = Pair("one", picture, picture, truth, {"needle": needle, "none": np.zeros_like(needle)})

    def arm(left: np.ndarray, right: np.ndarray, limits: tuple[int, int]) -> DisparityMap:
        return DisparityMap(np.where(needle, 20.0, 7.5).astype(np.float32), np.ones(truth.shape, np.float32))

    maps, figures = measured(pair, {"ours": arm})
    found = figures["ours"]
    assert found[""]["bad2"] == pytest.approx(25) and found["needle"]["bad2"] == pytest.approx(100)
    assert "bad2" not in found["none"] and found["none"]["cpu_seconds"] >= 0
    assert set(maps) == {"ours", "ours_trusted", "constant"}  # the network did not run
    assert (maps["constant"].disparity == 7.5).all() and figures["constant"]["needle"]["bad2"] == 0


def test_holes_of_ours_are_filled_by_the_network() -> None:
    sure = DisparityMap(np.array([[3.0, np.nan, np.nan]], np.float32), np.array([[1.0, 0.0, 0.0]], np.float32))
    other = DisparityMap(np.array([[5.0, 6.0, np.nan]], np.float32), np.array([[0.5, 0.5, 0.0]], np.float32))
    found = DERIVED["filled"][2]({"ours": sure, "small": other})
    np.testing.assert_array_equal(found.disparity, [[3.0, 6.0, np.nan]])
    np.testing.assert_array_equal(found.confidence, [[1.0, 0.5, 0.0]])


def test_arms_of_the_network_need_a_checkpoint() -> None:
    assert set(arms_of(None, 8)) == set(CLASSICAL) and "small" in WORDS


def test_rooms_from_two_eyes_and_from_a_depth_camera_differ_in_the_log_alone() -> None:
    two, depth = (
        {
            step.name: step_arguments(step, "run", resolve_variables(pipeline_of(arm), {}))
            for step in pipeline_of(arm).step
        }
        for arm in ("two_eyes", "depth_camera")
    )
    assert "--stereo-baseline" in two["ground_truth"] and "--stereo-baseline" not in depth["ground_truth"]
    assert "--no-depth" not in depth["ground_truth"] and depth["sequence"][0] == "ingest"
    same = [name for name in depth if two[name] == depth[name]]
    assert set(two) - set(depth) == {"stereo_pairs"} and set(depth) - set(same) == {"ground_truth", "sequence"}


def test_depth_is_compared_frame_by_frame(tmp_path: Path) -> None:
    camera = Camera(width=8, height=6, fx=10.0, fy=10.0, cx=3.5, cy=2.5)
    color = np.zeros((6, 8, 3), np.uint8)
    for name, shift in (("exact", 0.0), ("found", 0.01)):
        (tmp_path / name).mkdir()
        with FrameWriter(tmp_path / name / "frames.mcap", camera) as writer:
            for number in range(6):
                depth = np.full((6, 8), 2.0 + shift, np.float32)
                depth[0] = 5.0  # too far to be compared
                if name == "found":
                    depth[1] = 0.0
                writer.write(0.1 * number, color, depth)
    found = depth_figures(tmp_path / "found", tmp_path / "exact")
    assert found["depth_share"] == pytest.approx(80)
    assert found["depth_median_mm"] == pytest.approx(10, abs=1e-3)
