"""Both estimators on needles drawn from geometry, and what they say of bad input."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.geometry.transforms import transform_from
from scenewright.stages.suture.needle.estimate import estimate
from scenewright.stages.suture.needle.evidence import _crossings
from scenewright.stages.suture.needle.filter import difference, fuse
from scenewright.stages.suture.needle.filter import moved as moved_pose
from scenewright.stages.suture.needle.observation import NeedleEstimate, NeedleObservation, violet
from scenewright.stages.suture.needle.starts import _runs
from scenewright.stages.suture.needle.thesis import farthest_pair, ransac_circle, ransac_plane, thesis_estimate
from scenewright.stages.suture.rig import TWO_CAMERAS, NeedlePose
from scipy.spatial.transform import Rotation

from tests.unit.suture.needle_cases import drawn_mask, observed, pose_at


def _plane_degrees(pose, other):
    return np.degrees(np.arccos(min(1.0, abs(float(pose.normal @ other.normal)))))


@pytest.fixture(scope="module")
def clean():
    return pose_at(), observed(pose_at())


def test_the_thesis_finds_a_needle_of_exact_disparity(clean):
    truth, observation = clean
    found = thesis_estimate(observation).pose
    assert np.linalg.norm(found.centre - truth.centre) < 5e-4
    assert _plane_degrees(found, truth) < 3.0
    ends = sorted([np.linalg.norm(found.tip - truth.tip), np.linalg.norm(found.tip - truth.swage)])
    assert ends[0] < 1.5e-3


def test_ours_finds_it_without_any_disparity(clean):
    truth, observation = clean
    answer = estimate(replace(observation, disparity=None))
    assert answer.abstained == ""
    assert np.linalg.norm(answer.pose.centre - truth.centre) < 5e-4
    assert _plane_degrees(answer.pose, truth) < 1.0
    ends = sorted([np.linalg.norm(answer.pose.tip - truth.tip), np.linalg.norm(answer.pose.tip - truth.swage)])
    assert ends[0] < 1.5e-3
    assert np.all(np.linalg.eigvalsh(answer.covariance) > 0)


@pytest.mark.parametrize("roll", [0.0, 5.0])
def test_a_needle_that_lies_along_the_rows_is_found_by_the_ends_of_its_runs(roll):
    """Nearly edge-on, its rows are longer than any wire is wide: a middle of such a run is no place on the needle."""
    rotation = Rotation.from_euler("xz", [82.0, roll], degrees=True).as_matrix()
    truth = NeedlePose(transform_from(rotation, np.array([0.03, 0.004, 0.35])))
    answer = estimate(replace(observed(truth), disparity=None))
    assert not answer.abstained
    assert np.linalg.norm(answer.pose.centre - truth.centre) < 1e-3
    assert _plane_degrees(answer.pose, truth) < 5.0


def test_a_long_run_gives_its_two_ends_and_a_short_one_its_middle():
    mask = np.zeros((3, 60), dtype=bool)
    mask[0, 10:15] = mask[2, 20:50] = True
    np.testing.assert_array_equal(_runs(mask, 16), [[0, 12, 0], [2, 20, 1], [2, 49, 2]])


@pytest.mark.parametrize("at_swage", [True, False])
def test_thread_at_one_end_says_which_end_is_the_swage(clean, at_swage):
    truth, _ = clean
    shown = truth if at_swage else truth.swapped()
    observation = observed(shown)
    tangent = np.array([[0.0, -1.0, 0.0]]) @ shown.camera_from_needle[:3, :3].T
    beyond = shown.swage + np.linspace(0.0003, 0.008, 60)[:, None] * tangent
    threads = []
    for project in (TWO_CAMERAS.left, TWO_CAMERAS.right):
        thread = np.zeros((960, 1280), dtype=bool)
        columns, rows = np.round(project(beyond)).astype(int).T
        thread[rows, columns] = True
        threads.append(thread)
    answer = estimate(replace(observation, disparity=None, left_thread=threads[0], right_thread=threads[1]))
    assert np.linalg.norm(answer.pose.swage - shown.swage) < 2e-3
    assert answer.tip_probability > 0.9


def test_the_same_input_gives_the_same_answer(clean):
    _, observation = clean
    first, second = estimate(observation), estimate(observation)
    assert np.array_equal(first.pose.camera_from_needle, second.pose.camera_from_needle)


def test_exchanged_eyes_are_named(clean):
    _, observation = clean
    exchanged = NeedleObservation(TWO_CAMERAS, observation.right_mask, observation.left_mask)
    assert "exchanged" in estimate(exchanged).abstained


def test_zero_baseline_and_wrong_sizes_are_bad_input(clean):
    _, observation = clean
    with pytest.raises(BadInput, match="baseline"):
        estimate(replace(observation, rig=replace(TWO_CAMERAS, baseline=0.0)))
    with pytest.raises(BadInput, match="right needle mask"):
        estimate(replace(observation, right_mask=np.zeros((10, 10), dtype=bool)))


def test_too_few_points_abstain():
    empty = np.zeros((960, 1280), dtype=bool)
    nothing = NeedleObservation(TWO_CAMERAS, empty, empty, np.full((960, 1280), np.nan, dtype=np.float32))
    assert "0 points" in thesis_estimate(nothing).abstained
    assert "0 pixels" in estimate(nothing).abstained


def test_a_stub_of_needle_abstains():
    pose = pose_at()
    stub = NeedleObservation(TWO_CAMERAS, *(drawn_mask(TWO_CAMERAS, pose, eye, 1.4, 1.75) for eye in (0, 1)))
    assert estimate(stub).abstained != ""


def test_a_needle_seen_edge_on_is_known_by_its_outline():
    for tilt in (86.0, 90.0):
        truth = pose_at(tilt, 60.0)
        answer = estimate(replace(observed(truth), disparity=None))
        assert answer.pose is not None and truth.degrees_from_edge_on() < 15.0
        assert np.linalg.norm(answer.pose.centre - truth.centre) < 1e-3
        assert _plane_degrees(answer.pose, truth) < 3.0


def test_two_needles_are_not_taken_for_one(clean):
    truth, observation = clean
    step = np.array([-0.02, 0.012, 0.01, 0.5, 0.3, 0.0])
    other = observed(moved_pose(truth, step))
    both = NeedleObservation(
        TWO_CAMERAS, observation.left_mask | other.left_mask, observation.right_mask | other.right_mask
    )
    assert "Two needles" in estimate(both).abstained


def test_lost_stretches_and_lumps_do_not_move_the_outline(clean):
    truth, observation = clean
    masks = [observation.left_mask.copy(), observation.right_mask.copy()]
    for project, mask in zip((TWO_CAMERAS.left, TWO_CAMERAS.right), masks, strict=True):
        lost, lump = np.round(project(truth.points(np.array([1.2, 2.2])))).astype(int)
        mask[lost[1] - 9 : lost[1] + 10, lost[0] - 9 : lost[0] + 10] = False
        mask[lump[1] : lump[1] + 12, lump[0] : lump[0] + 4] = True
    answer = estimate(NeedleObservation(TWO_CAMERAS, masks[0], masks[1]))
    assert answer.abstained == ""
    assert np.linalg.norm(answer.pose.centre - truth.centre) < 6e-4 and _plane_degrees(answer.pose, truth) < 1.5


def test_ransac_finds_plane_and_circle_among_outliers():
    random = np.random.default_rng(1)
    flat = np.stack([random.uniform(-0.01, 0.01, 200), random.uniform(-0.01, 0.01, 200), np.full(200, 0.3)], axis=1)
    points = np.concatenate([flat, random.uniform([-0.01, -0.01, 0.28], [0.01, 0.01, 0.32], (60, 3))])
    _, normal, inliers = ransac_plane(points, 0.0005, 200, random)
    assert abs(normal[2]) > 0.999 and inliers[:200].all()
    angles = random.uniform(0.0, np.pi, 200)
    ring = np.stack([0.012 * np.cos(angles) + 0.001, 0.012 * np.sin(angles)], axis=1)
    centre, radius, _ = ransac_circle(np.concatenate([ring, random.uniform(-0.02, 0.02, (50, 2))]), 2e-4, 300, random)
    assert np.allclose(centre, [0.001, 0.0], atol=1e-4) and radius == pytest.approx(0.012, abs=1e-4)
    first, second = farthest_pair(ring)
    assert np.linalg.norm(first - second) == pytest.approx(
        max(np.linalg.norm(ring - end, axis=1).max() for end in ring)
    )


def test_the_filter_outvotes_wrong_frames_and_keeps_what_frames_share():
    truth, random = pose_at(), np.random.default_rng(2)
    covariance = np.diag([(4e-4) ** 2] * 3 + [np.radians(2.0) ** 2] * 3)
    frames = []
    for index in range(10):
        error = random.multivariate_normal(np.zeros(6), covariance)
        if index in (2, 7, 9):
            error = np.array([0.004, 0.0, 0.003, 0.9, 0.4, 0.0])
        pose = moved_pose(truth, error)
        pose = pose.swapped() if index in (1, 4) else pose
        frames.append((NeedleEstimate(pose, covariance, 0.55 if index in (1, 4) else 0.9, ""), np.eye(4)))
    fused = fuse(frames)
    step = difference(fused.pose, truth)
    assert np.linalg.norm(step[:3]) < 6e-4 and np.linalg.norm(step[3:]) < np.radians(3.0)
    assert np.trace(fused.covariance) > 0.2 * np.trace(covariance)


def test_difference_and_moved_are_inverse():
    pose, step = pose_at(), np.array([0.001, -0.002, 0.003, 0.1, 0.2, -0.3])
    assert np.allclose(difference(pose, moved_pose(pose, step)), step)


def test_violet_is_thread_and_steel_is_not():
    """Lines of three pixels over a pad: thread that took on half of the pad's colour, steel, and a red slit."""
    picture = np.full((60, 90, 3), (190, 150, 130), dtype=np.uint8)
    lines = {20: (147, 112, 115), 45: (128, 128, 130), 70: (215, 105, 95)}
    for column, colour in lines.items():
        picture[:, column - 1 : column + 2] = colour
    found = violet(picture)
    assert found[:, 20].all() and not found[:, 30:].any() and not found[:, :17].any()


@pytest.mark.parametrize(("to", "times"), [(None, 0), ((50, 50), 1), ((90, 62), 2)])
@pytest.mark.parametrize("radius", [7.0, 11.1, 20.5])
def test_thread_that_begins_at_a_place_crosses_a_circle_about_it_once_and_one_that_passes_twice(to, times, radius):
    thread = np.zeros((100, 100), np.uint8)
    if to is not None:
        cv2.line(thread, (5, 37), to, 1, 1)
    assert _crossings(thread > 0, np.array([50.0, 50.0]), radius) == times


def test_thread_that_crosses_the_tip_does_not_make_it_the_swage():
    """The thread leaves the swage askew, as one that hangs taut does, and runs over the wire near the tip."""
    truth = pose_at()
    observation = observed(truth)
    threads = []
    for project in (TWO_CAMERAS.left, TWO_CAMERAS.right):
        thread = np.zeros(observation.left_mask.shape, np.uint8)
        swage, near_tip = project(np.stack([truth.swage, truth.points(np.array([0.05]))[0]]))
        ends = np.stack([swage, near_tip + 0.8 * (near_tip - swage)])
        cv2.line(thread, *np.round(ends).astype(int).tolist(), 1, 2)
        threads.append(thread > 0)
    answer = estimate(replace(observation, disparity=None, left_thread=threads[0], right_thread=threads[1]))
    assert not answer.abstained and answer.tip_probability > 0.9
    assert np.linalg.norm(answer.pose.tip - truth.tip) < 0.002
