"""The needle world's truth against plain projection, and its seeds."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.suture.rig import TWO_CAMERAS
from scenewright.stages.suture.world.corruption import noisy_disparity, spoiled_mask
from scenewright.stages.suture.world.render import ARC_ANGLES, render
from scenewright.stages.suture.world.scene import make_scene, moved_scene, random_motions
from scenewright.stages.suture.world.thread import THREAD_RADIUS, loose_thread
from scenewright.stages.suture.world.tubes import NEEDLE, WIRE_RADIUS, needle_radii


@pytest.fixture(scope="module")
def seen():
    scene = make_scene(10, holder="air")
    return scene, render(scene, pictures=False)


def test_the_masks_lie_on_the_projected_circle_and_depth_on_the_wire(seen):
    scene, view = seen
    for eye, project in ((view.left, TWO_CAMERAS.left), (view.right, TWO_CAMERAS.right)):
        pixels = project(scene.pose.points(ARC_ANGLES))
        rows, columns = np.nonzero(eye.mask(NEEDLE))
        gaps = np.hypot(pixels[:, 0] - columns[:, None], pixels[:, 1] - rows[:, None])
        thickest = WIRE_RADIUS * TWO_CAMERAS.focal / scene.pose.points(ARC_ANGLES)[:, 2].min()
        assert gaps.min(axis=1).max() < thickest + 1.0
        middle = scene.pose.points(ARC_ANGLES)[gaps.argmin(axis=1), 2]
        in_front = middle - eye.depth[rows, columns]
        assert in_front.min() > -1e-3 and in_front.max() < 1.5e-3


def test_disparity_agrees_with_the_rig(seen):
    _, view = seen
    mask = view.left.mask(NEEDLE)
    expected = TWO_CAMERAS.focal * TWO_CAMERAS.baseline / view.left.depth[mask]
    assert np.allclose(view.disparity[mask], expected, atol=1e-3)


def test_a_seed_gives_one_scene_and_another_seed_another():
    first, again, other = make_scene(7), make_scene(7), make_scene(8)
    assert np.array_equal(first.thread, again.thread)
    assert not np.allclose(first.pose.camera_from_needle, other.pose.camera_from_needle)


def test_calibration_error_moves_the_right_eye_by_what_it_says():
    turns = np.array([make_scene(seed, holder="air", calibration_error=0.3).right_eye_turn for seed in range(25)])
    assert np.std(turns[:, :2]) * TWO_CAMERAS.focal == pytest.approx(0.3, rel=0.3)


def test_the_wire_tapers_to_the_tip_only():
    radii = needle_radii(np.linspace(0.0, np.pi, 50))
    assert radii[0] < 0.1 * WIRE_RADIUS and radii[-1] > 0.9 * WIRE_RADIUS
    assert np.all(np.diff(radii[:10]) > 0)


def test_thread_has_its_length_and_stays_above_the_pad():
    thread = loose_thread(np.array([0.0, 0.02, 0.03]), np.array([0.0, 1.0, 0.0]), 0.2, np.random.default_rng(3), 1.0)
    steps = np.linalg.norm(np.diff(thread, axis=0), axis=1)
    assert steps.sum() == pytest.approx(0.2, rel=0.05)
    assert thread[:, 2].min() > -0.0005 + THREAD_RADIUS


def test_spoiled_masks_and_disparity_are_off_by_what_they_should(seen):
    _, view = seen
    random = np.random.default_rng(4)
    mask = view.left.mask(NEEDLE)
    spoiled = spoiled_mask(view.left, random)
    assert 0.3 < (spoiled & mask).sum() / mask.sum() < 1.0
    error = (noisy_disparity(view, 0.8, random) - view.disparity)[mask]
    assert np.median(np.abs(error)) / 0.6745 == pytest.approx(0.8, rel=0.5)


def test_the_gripping_driver_moves_with_the_needle():
    scene = make_scene(3, holder="left")
    motion = random_motions(scene, 4)[-1]
    after = moved_scene(scene, motion, 3)
    before_gap = np.linalg.inv(scene.camera_from_world) @ np.append(scene.pose.centre, 1.0)
    after_gap = np.linalg.inv(after.camera_from_world) @ np.append(after.pose.centre, 1.0)
    held = 3  # LEFT_DRIVER
    assert np.linalg.norm(scene.grips[held][0] - before_gap[:3]) == pytest.approx(
        np.linalg.norm(after.grips[held][0] - after_gap[:3])
    )
