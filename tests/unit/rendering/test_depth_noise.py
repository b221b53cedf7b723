"""The depth camera's statistics against the closed forms that it is made of."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.rendering.depth_noise import (
    DepthCamera,
    axial_sigma,
    disturb_depth,
    lateral_sigma,
    loss_probability,
    quantise,
)

CAMERA = Camera(width=320, height=240, fx=525.0, fy=525.0, cx=159.5, cy=119.5)
SENSOR = DepthCamera()
PERFECT = DepthCamera(disparity_levels=1e6, dark_signal=0.0, shine_loss=0.0)


def quantisation_step(z: float) -> float:
    """Distance of neighbouring depth values at z [m]: z^2 / (f b levels)."""
    return z * z / (CAMERA.fx * SENSOR.baseline * SENSOR.disparity_levels)


def wall(depth: float, angle: float = 0.0, reflectance: float = 0.6, gloss: float = 0.0) -> list[np.ndarray]:
    """A plane of one depth everywhere, seen at one angle (the images need not be consistent with each other)."""
    shape = (CAMERA.height, CAMERA.width)
    values = (depth, np.cos(angle), reflectance, gloss)
    return [np.full(shape, value, dtype=np.float32) for value in values]


def losses(depth: float, angle: float, reflectance: float, gloss: float) -> float:
    return loss_probability(depth, angle, reflectance, gloss, SENSOR)


def test_published_values() -> None:
    """Nguyen et al. 2012, equations 2 and 3, by hand."""
    assert axial_sigma(0.4, 0.0) == pytest.approx(0.0012)
    assert axial_sigma(2.4, 0.0) == pytest.approx(0.0012 + 0.0019 * 4)
    angle = np.deg2rad(60)
    assert axial_sigma(1.0, angle) - axial_sigma(1.0, 0.0) == pytest.approx(1e-4 * angle**2 / (np.pi / 2 - angle) ** 2)
    assert lateral_sigma(0.0) == pytest.approx(0.8)
    assert lateral_sigma(np.deg2rad(45)) == pytest.approx(0.835)


@pytest.mark.parametrize(("depth", "angle"), [(0.8, 0.0), (2.0, 0.3), (3.5, 0.9), (1.5, 1.15)])
def test_axial_noise_has_the_closed_form_spread(depth: float, angle: float) -> None:
    noisy = disturb_depth(*wall(depth, angle), CAMERA, np.random.default_rng(1), PERFECT)
    values = noisy[noisy > 0] - depth
    expected = axial_sigma(depth, angle)
    assert len(values) > 0.95 * noisy.size
    assert values.std() == pytest.approx(expected, rel=0.02)
    assert abs(values.mean()) < 4 * expected / np.sqrt(len(values)) + 1e-5


@pytest.mark.parametrize("depth", [0.7, 1.6, 3.2])
def test_quantisation_lies_on_the_disparity_grid(depth: float) -> None:
    noisy = disturb_depth(*wall(depth), CAMERA, np.random.default_rng(2), SENSOR)
    values = noisy[noisy > 0].astype(float)
    levels = CAMERA.fx * SENSOR.baseline / values * SENSOR.disparity_levels
    assert np.abs(levels - np.round(levels)).max() < 2e-3
    steps = np.diff(np.unique(np.round(levels).astype(int)))
    assert steps.min() == 1
    neighbours = np.abs(np.diff(np.unique(values.astype(np.float32))))
    step = quantisation_step(depth)
    assert np.median(neighbours) == pytest.approx(step, rel=0.15)
    variance = axial_sigma(depth, 0.0) ** 2 + step**2 / 12
    assert values.std() == pytest.approx(np.sqrt(variance), rel=0.05)


def test_quantise_is_idempotent_and_within_half_a_step() -> None:
    for z in np.linspace(0.4, 4.9, 200):
        once = quantise(z, 525.0, 0.075, 16.0)
        assert quantise(once, 525.0, 0.075, 16.0) == pytest.approx(once, abs=1e-12)
        assert abs(once - z) <= 0.51 * max(z, once) ** 2 / (525.0 * 0.075 * 16.0)


@pytest.mark.parametrize(
    ("depth", "angle", "reflectance", "gloss"),
    [(2.0, 0.2, 0.6, 0.0), (2.0, 1.4, 0.6, 0.0), (3.5, 0.3, 0.02, 0.0), (1.5, 0.8, 0.4, 0.8), (4.5, 1.3, 0.05, 0.3)],
)
def test_share_of_missing_pixels(depth: float, angle: float, reflectance: float, gloss: float) -> None:
    noisy = disturb_depth(*wall(depth, angle, reflectance, gloss), CAMERA, np.random.default_rng(3), SENSOR)
    expected = losses(depth, angle, reflectance, gloss)
    blocks = noisy.size / SENSOR.block**2
    spread = np.sqrt(max(expected * (1 - expected), 1e-4) / blocks)
    assert np.mean(noisy == 0) == pytest.approx(expected, abs=5 * spread + 1e-3)


def test_losses_grow_with_each_cause() -> None:
    assert losses(2, 0.2, 0.6, 0.0) < 0.01
    assert losses(2, 1.45, 0.6, 0.0) > 0.8
    assert losses(4, 0.2, 0.01, 0.0) > 0.6 > losses(1, 0.2, 0.01, 0.0)
    assert losses(2, 1.0, 0.6, 0.9) > 0.25


def test_out_of_range_is_missing() -> None:
    for depth in (0.2, 5.3):
        assert not disturb_depth(*wall(depth), CAMERA, np.random.default_rng(4), SENSOR).any()
    assert not disturb_depth(*wall(0.0), CAMERA, np.random.default_rng(4), SENSOR).any()


def test_edges_tremble_and_throw_a_shadow() -> None:
    images = wall(3.0)
    images[0][:, 100:200] = 1.0
    noisy = disturb_depth(*images, CAMERA, np.random.default_rng(5), PERFECT)
    # The projector on the left: the background right of the box is dark for f b (1/1 - 1/3) pixels.
    width = CAMERA.fx * PERFECT.baseline * (1.0 - 1.0 / 3.0)
    missing = np.mean(noisy[:, 200:] == 0, axis=0)
    assert np.all(missing[1 : int(width) - 3] > 0.95)
    assert np.all(missing[int(width) + 4 :] < 0.05)
    assert np.mean(noisy[:, 90:96] == 0) < 0.05
    # Left of the box, with no shadow, pixels take the depth of the other side, and some fly in between.
    border = noisy[:, 97:103]
    flying = (border > 1.1) & (border < 2.8)
    assert 0.01 < flying.mean() < 0.2
    swapped = np.mean(noisy[:, 99] < 1.1) + np.mean(noisy[:, 100] > 2.8)
    assert swapped > 0.1
    # Three pixels away from the edges nothing jumps.
    assert np.all(noisy[:, 108:190] < 1.1)


def test_slanted_surfaces_are_no_edges() -> None:
    """Depth that changes from pixel to pixel as a plane's does must not be taken for edges."""
    angle = np.deg2rad(65)
    columns = np.arange(CAMERA.width)
    depth = 2.0 / (1.0 - np.tan(angle) * (columns - CAMERA.cx) / CAMERA.fx)
    depth = np.clip(depth, 1.0, 4.8)
    images = wall(2.0, angle)
    images[0] = np.tile(depth.astype(np.float32), (CAMERA.height, 1))
    inside = (depth > 1.05) & (depth < 4.5)
    noisy = disturb_depth(*images, CAMERA, np.random.default_rng(6), PERFECT)[:, inside]
    assert np.mean(noisy == 0) < 0.02
    residual = (noisy - depth[inside])[noisy > 0]
    limit = 6 * axial_sigma(4.5, angle)
    assert np.abs(residual).max() < limit


def test_same_generator_same_noise() -> None:
    first = disturb_depth(*wall(2.0), CAMERA, np.random.default_rng(8), SENSOR)
    assert np.array_equal(first, disturb_depth(*wall(2.0), CAMERA, np.random.default_rng(8), SENSOR))
    assert not np.array_equal(first, disturb_depth(*wall(2.0), CAMERA, np.random.default_rng(9), SENSOR))
