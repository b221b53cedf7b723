"""The mapping benchmark's own parts: drifting poses, pooling over rooms, outcomes as files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pydantic import TypeAdapter
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.measurement.average_precision import Candidates, average_precision
from scenewright.stages.kit.measurement.panoptic_quality import ClassQuality
from scenewright.stages.synthesize.recipes import load_recipe

from benchmarks.experiment import Bench, Results, Trial
from benchmarks.experiments.mapping.arms import EVERYWHERE, SHOWN, all_arms
from benchmarks.experiments.mapping.depth_faults import BENDING, BIAS, SHIFT, DepthFaults, drawn_faults
from benchmarks.experiments.mapping.drift import TRANSLATION_PER_METRE, drifting_poses
from benchmarks.experiments.mapping.estimated import poses_at
from benchmarks.experiments.mapping.experiment import EXPERIMENT
from benchmarks.experiments.mapping.figures_of_merit import MEASURES, pooled_curve
from benchmarks.experiments.mapping.measuring import MappingParameters, Outcome, ranked
from benchmarks.generated_rooms import DRAWS, REPORTING, TUNING, error_seed, room_of, with_draws
from benchmarks.results import figures_of, table


def straight_walk(steps: int, length: float) -> np.ndarray:
    poses = np.tile(np.eye(4), (steps + 1, 1, 1))
    poses[:, 0, 3] = np.linspace(0, length, steps + 1)
    return poses


def outcome(found: int, missed: int) -> Outcome:
    quality = {"chair": ClassQuality(found, 0, missed, 0.8 * found), "floor": ClassQuality(1, 0, 0, 0.9)}
    total = found + missed
    boxes = Candidates(np.eye(total)[:found], np.arange(found, 0.0, -1.0))
    candidates = ranked({"chair": boxes, "any": Candidates(np.eye(total)[:found], np.ones(found))})
    return Outcome(quality, quality, candidates, candidates, candidates, 10, 2.0)


def results_of(outcomes: dict[tuple[str, str], Outcome]) -> Results:
    bench = Bench(Path("nowhere"), MappingParameters.model_validate({}))
    return Results(EXPERIMENT, bench, {Trial(arm, SHOWN, room): made for (arm, room), made in outcomes.items()})


def test_drift_grows_with_the_square_root_of_the_way() -> None:
    ends = []
    for seed in range(200):
        poses = drifting_poses(straight_walk(20, 4.0), np.random.default_rng(seed))
        assert np.array_equal(poses[0], np.eye(4))
        ends.append(poses[-1][0, 3] - 4.0)
    # Along the walk only the translation errors add up: 20 steps of 0.2 m, each with 1 cm per root of a metre.
    assert np.std(ends) == pytest.approx(TRANSLATION_PER_METRE * 2.0, rel=0.2)


def test_errors_are_drawn_by_recipe_seed_and_draw() -> None:
    seeds = with_draws(REPORTING)
    assert len(seeds) == DRAWS * len(REPORTING) and len({error_seed(seed) for seed in seeds}) == len(seeds)
    assert [room_of(seed) for seed in seeds[: len(REPORTING)]] == list(REPORTING)
    assert EXPERIMENT.cluster(seeds[0]) == EXPERIMENT.cluster(seeds[len(REPORTING)]) == REPORTING[0]


def test_depth_is_scaled_bent_and_beside_the_picture() -> None:
    camera = Camera(width=65, height=49, fx=60, fy=60, cx=32, cy=24)
    depth = np.full((49, 65), 2.0, np.float32)
    depth[0, 0] = 0
    bent = DepthFaults(0.01, 0.005, (0, 0)).depth(depth, camera)
    assert (
        bent[24, 32] == pytest.approx(2.02)
        and bent[48, 64] == pytest.approx(1.01 / (1 / 2 - 0.005))
        and bent[0, 0] == 0
    )
    ids = np.zeros((48, 640), np.int32)
    ids[20:30, 100:120] = 7
    moved = DepthFaults(0, 0, (4.0, -3.0)).shifted(ids)
    assert np.array_equal(moved[17:27, 104:124], ids[20:30, 100:120]) and (moved == 7).sum() == 200
    ids[:] = 7
    assert (DepthFaults(0, 0, (4.0, -3.0)).shifted(ids) == 7).sum() == 636 * 45, "nothing comes in over the border"
    drawn = [drawn_faults(np.random.default_rng(k)) for k in range(50)]
    assert max(abs(f.bias) for f in drawn) <= BIAS and max(abs(f.bending) for f in drawn) <= BENDING
    assert max(abs(v) for f in drawn for v in f.shift) <= SHIFT and min(f.bias for f in drawn) < 0


def test_rooms_and_arms_are_those_that_are_stated() -> None:
    assert (len(TUNING), len(REPORTING), len(set(REPORTING))) == (10, 20, 20)
    for name in TUNING + REPORTING:
        recipe, seed = name.split("-")
        seeds = load_recipe(recipe).seeds
        first, last = seeds.reporting if name in REPORTING else seeds.tuning
        assert first <= int(seed) <= last
    assert {arm.name for arm in all_arms(0.02)} >= EVERYWHERE
    by_name = {arm.name: arm for arm in all_arms(0.01)}
    assert {arm.fuse.voxel_size for arm in by_name.values()} == {0.01}
    assert by_name["thesis"].fuse.merging == "thesis" and by_name["thesis_separate"].fuse.merging == "separate"
    assert by_name["voxblox++"].segment.fusion == "voxblox++" and by_name["thesis"].graph.method == "thesis"


def test_outcomes_survive_the_file() -> None:
    adapter = TypeAdapter(Outcome)
    for made in (outcome(3, 1), outcome(0, 4)):
        assert adapter.validate_json(adapter.dump_json(made)) == made


def test_figures_are_pooled_before_they_are_divided() -> None:
    rooms = [outcome(3, 1), outcome(1, 5)]
    # Chairs: 4 of 10 found at IoU 0.8, SQ 0.8, RQ 4 / (4 + 3); floors 0.9.
    assert MEASURES["pq"].of(rooms) == pytest.approx((0.8 * 4 / 7 + 0.9) / 2)
    # By room: (0.8 * 3 / 3.5 + 0.9) / 2 and (0.8 * 1 / 3.5 + 0.9) / 2.
    assert MEASURES["pq_rooms"].of(rooms) == pytest.approx((0.8 * 2 / 3.5 + 0.9) / 2)
    assert (
        MEASURES["pq_fixed"].of(rooms) == pytest.approx(MEASURES["pq"].of(rooms)) and MEASURES["ghosts"].of(rooms) == 0
    )
    assert MEASURES["instance_ap"].of(rooms) == pytest.approx(0.4)
    assert MEASURES["instance_ap_thesis_code"].of(rooms) == pytest.approx(1.0), "recall that was not reached counts"
    assert MEASURES["frames_per_second"].of(rooms) == pytest.approx(5.0)


def test_a_class_of_false_finds_alone_counts_where_it_is_said_to() -> None:
    room = outcome(3, 1)
    haunted = replace(room, qualities={**room.qualities, "door": ClassQuality(0, 2, 0, 0.0)})
    whole = MEASURES["pq_rooms"].of([room])
    assert whole is not None
    assert MEASURES["pq_rooms"].of([haunted]) == whole and MEASURES["pq_fixed"].of([haunted]) == pytest.approx(whole)
    assert MEASURES["ghosts"].of([haunted]) == 2 and MEASURES["pq"].of([haunted]) == pytest.approx(whole * 2 / 3)


def test_pooled_rooms_share_the_ranking_but_not_the_truth() -> None:
    # The sure miss of the second room stands before the hit of the first one: precision 0, 1/2.
    first = Candidates(np.array([[0.9]]), np.array([5.0]))
    second = Candidates(np.array([[0.1, 0.2]]), np.array([9.0]))
    curve = pooled_curve([ranked({"": found})[""] for found in (first, second)])
    assert curve.true_count == 3 and curve.precision.tolist() == [0.0, 0.5]
    assert average_precision(curve) == pytest.approx(1 / 3 * 1 / 2)
    assert average_precision(pooled_curve([])) is None


def test_figures_are_there_for_every_arm_and_class_and_the_thesis_beside() -> None:
    found = {("ours", "a"): (3, 1), ("ours", "b"): (4, 0), ("thesis", "a"): (1, 3), ("thesis", "b"): (2, 2)}
    results = results_of({key: outcome(*counts) for key, counts in found.items()})
    figures = figures_of(results)
    # Chairs of both rooms: 7 of 8 found, PQ 0.8 * 7 / 7.5.
    assert figures[f"ours/{SHOWN}/pq_chair"].value == pytest.approx(0.8 * 7 / 7.5)
    assert figures[f"ours/{SHOWN}/pq_rooms"].low is not None and figures[f"ours/{SHOWN}/sq"].low is None
    text = table(results, figures)
    assert f"| {SHOWN}: ours – thesis |" in text and f"| {SHOWN}, b |" in text
    assert "| Han 2024: ours | 35.4 | 80.5 | 43.1 | 58.1 | 45.3 |" in text


def test_pictures_where_tracking_was_lost_have_no_pose() -> None:
    path = np.repeat(np.eye(4)[None], 3, axis=0)
    path[:, 0, 3] = (1, 2, 3)
    poses = poses_at(np.array([0.0, 1.0, 2.0]), np.array([0.01, 0.5, 2.0]), path)
    assert poses[[0, 2], 0, 3].tolist() == [1, 3] and np.isnan(poses[1]).all()
