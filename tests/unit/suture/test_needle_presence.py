"""Where there is no needle none is answered: masks of thread and of jaws' rims, scattered blobs, rings of glints."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenewright.stages.suture.masks import spoiled_masks
from scenewright.stages.suture.needle.estimate import estimate
from scenewright.stages.suture.needle.observation import NeedleObservation
from scenewright.stages.suture.needle.presence import FEATURES, presence_probability
from scenewright.stages.suture.rig import TWO_CAMERAS, NeedlePose, StereoRig
from scenewright.stages.suture.world.clutter import cluttered, false_masks
from scenewright.stages.suture.world.draping import draped
from scenewright.stages.suture.world.render import Eye, StereoView, render
from scenewright.stages.suture.world.sampling import seen_scene
from scenewright.stages.suture.world.tubes import NEEDLE

from tests.unit.suture.needle_cases import observed, pose_at


def dots(rng: np.random.Generator, pose: NeedlePose, around_circle: bool) -> tuple[np.ndarray, np.ndarray]:
    """Blobs of 3 px: anywhere, or along the true arc with two gaps for each blob; the same ones in both eyes."""
    rig = TWO_CAMERAS
    points = pose.points(np.linspace(0.0, np.pi, 9)) + rng.normal(0.0, 0.0002, (9, 3))
    if not around_circle:
        points = pose.centre + rng.normal(0.0, 0.012, (25, 3))
    rows, columns = np.mgrid[: rig.height, : rig.width]
    masks = []
    for pixels in (rig.left(points), rig.right(points)):
        near = [(columns - x) ** 2 + (rows - y) ** 2 < 9.0 for x, y in pixels]
        masks.append(np.any(near, axis=0))
    return masks[0], masks[1]


@pytest.mark.parametrize("seed", [31, 32, 34, 35])
def test_thread_and_jaws_are_no_needle(seed: int) -> None:
    scene, _ = seen_scene(seed, TWO_CAMERAS)
    view = render(replace(scene, without_needle=True), pictures=False)
    assert not view.left.mask(NEEDLE).any() and not view.right.mask(NEEDLE).any()
    masks = false_masks(view, np.random.default_rng(seed))
    others = spoiled_masks(view.left, view.right, seed)[0]
    assert estimate(replace(others, needle=masks).observation(TWO_CAMERAS, None)).abstained


@pytest.mark.parametrize("around_circle", [False, True])
def test_glints_are_no_needle_not_even_in_a_ring(around_circle: bool) -> None:
    masks = dots(np.random.default_rng(3), pose_at(), around_circle)
    assert estimate(NeedleObservation(TWO_CAMERAS, *masks)).abstained


def test_features_are_kept_beside_the_answer() -> None:
    answer = estimate(observed(pose_at()))
    assert not answer.abstained and len(answer.presence_features) == len(FEATURES)
    assert presence_probability(np.array(answer.presence_features)) > 0.9


def test_clutter_stands_at_one_place_for_both_eyes() -> None:
    scene, _ = seen_scene(31, TWO_CAMERAS)
    plain = render(scene)
    messy = cluttered(plain, np.random.default_rng(1))
    changed = [
        np.flatnonzero((eye.image != before.image).any(axis=(1, 2)))
        for eye, before in ((messy.left, plain.left), (messy.right, plain.right))
    ]
    assert len(changed[0]) > 0 and abs(changed[0][0] - changed[1][0]) <= 1 and abs(changed[0][-1] - changed[1][-1]) <= 1
    np.testing.assert_array_equal(messy.left.bodies, plain.left.bodies)
    with pytest.raises(ValueError, match="images"):
        cluttered(render(scene, pictures=False), np.random.default_rng(1))


def flat_view(pictures: bool = True) -> StereoView:
    """A small view of an even pad 120 mm away."""
    rig = StereoRig(240, 180, 300.0, (119.5, 89.5), 0.006)
    image = np.full((180, 240, 3), 120, np.uint8) if pictures else None
    eye = Eye(image, np.zeros((180, 240), np.uint8), np.full((180, 240), 0.12, np.float32), np.zeros(121, bool))
    return StereoView(rig, eye, eye, np.full((180, 240), np.nan, np.float32), pose_at(), "air", "wound")


def test_drapes_lie_before_the_pad_in_both_eyes_and_are_the_same_each_time() -> None:
    plain = flat_view()
    views = [draped(plain, np.random.default_rng(seed)) for seed in (1, 1, 2)]
    left, again, other = (view.left.image.astype(int) for view in views)
    np.testing.assert_array_equal(left, again)
    assert (np.abs(left - 120).max(axis=2) > 30).mean() > 0.01 and (left != other).any()
    right, shift = views[0].right.image.astype(int), round(300.0 * 0.006 / 0.12)
    moved = np.abs(left[:, shift:] - right[:, :-shift]).mean()
    assert moved < np.abs(left - right).mean(), "what lies near the pad is as far to the left in the right eye"
    np.testing.assert_array_equal(views[0].left.bodies, plain.left.bodies)
    with pytest.raises(ValueError, match="images"):
        draped(flat_view(pictures=False), np.random.default_rng(1))
