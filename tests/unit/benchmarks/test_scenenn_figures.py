"""What SceneNN's tables are made of: arms, outcomes as files, pooling over scenes; and poses that drift."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import TypeAdapter
from scenewright.stages.kit.measurement.average_precision import Candidates, average_precision
from scenewright.stages.kit.measurement.panoptic_quality import ClassQuality

from benchmarks.drifting import TRANSLATION_PER_METRE, drifting_poses
from benchmarks.experiments.scenenn.arms import all_arms
from benchmarks.experiments.scenenn.figures_of_merit import MEASURES, class_figures, pooled_curve
from benchmarks.experiments.scenenn.outcomes import Outcome, ranked


def straight_walk(steps: int, length: float) -> np.ndarray:
    poses = np.tile(np.eye(4), (steps + 1, 1, 1))
    poses[:, 0, 3] = np.linspace(0, length, steps + 1)
    return poses


def outcome(found: int, missed: int) -> Outcome:
    quality = {"chair": ClassQuality(found, 0, missed, 0.8 * found), "floor": ClassQuality(1, 0, 0, 0.9)}
    boxes = Candidates(np.eye(found + missed)[:found], np.arange(found, 0.0, -1.0))
    candidates = ranked({"chair": boxes})
    return Outcome(quality, quality, candidates, candidates, candidates)


def test_drift_grows_with_the_square_root_of_the_way() -> None:
    ends = []
    for seed in range(200):
        poses = drifting_poses(straight_walk(20, 4.0), np.random.default_rng(seed))
        assert np.array_equal(poses[0], np.eye(4))
        ends.append(poses[-1][0, 3] - 4.0)
    # Along the walk only the translation errors add up: 20 steps of 0.2 m, each with 1 cm per root of a metre.
    assert np.std(ends) == pytest.approx(TRANSLATION_PER_METRE * 2.0, rel=0.2)


def test_arms_are_those_that_are_stated() -> None:
    by_name = {arm.name: arm for arm in all_arms(0.01)}
    assert {arm.fuse.voxel_size for arm in by_name.values()} == {0.01}
    assert by_name["thesis"].fuse.merging == "thesis" and by_name["thesis_separate"].fuse.merging == "separate"
    assert by_name["voxblox++"].segment.fusion == "voxblox++" and by_name["thesis"].graph.method == "thesis"


def test_outcomes_survive_the_file() -> None:
    adapter = TypeAdapter(Outcome)
    for made in (outcome(3, 1), outcome(0, 4)):
        assert adapter.validate_json(adapter.dump_json(made)) == made


def test_figures_are_pooled_before_they_are_divided() -> None:
    scenes = [outcome(3, 1), outcome(1, 5)]
    # Chairs: 4 of 10 found at IoU 0.8, SQ 0.8, RQ 4 / (4 + 3); floors 0.9.
    assert MEASURES["pq"].of(scenes) == pytest.approx((0.8 * 4 / 7 + 0.9) / 2)
    assert MEASURES["instance_ap"].of(scenes) == pytest.approx(0.4)
    assert MEASURES["instance_ap_thesis_code"].of(scenes) == pytest.approx(1.0), "recall that was not reached counts"
    assert class_figures(scenes)["pq_chair"] == pytest.approx(0.8 * 4 / 7)


def test_pooled_scenes_share_the_ranking_but_not_the_truth() -> None:
    # The sure miss of the second scene stands before the hit of the first one: precision 0, 1/2.
    first = Candidates(np.array([[0.9]]), np.array([5.0]))
    second = Candidates(np.array([[0.1, 0.2]]), np.array([9.0]))
    curve = pooled_curve([ranked({"": found})[""] for found in (first, second)])
    assert curve.true_count == 3 and curve.precision.tolist() == [0.0, 0.5]
    assert average_precision(curve) == pytest.approx(1 / 3 * 1 / 2)
    assert average_precision(pooled_curve([])) is None
