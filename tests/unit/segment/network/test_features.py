"""Inputs: geometry in closed form, what is unknown is zero with its flag down, and mirroring commutes."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.geometry.transforms import look_at
from scenewright.stages.segment.backends.network.features import (
    CHANNELS,
    Mount,
    features,
    input_camera,
    mount_of_pose,
    viewing_axes,
)

CAMERA = Camera(width=64, height=48, fx=60.0, fy=60.0, cx=31.5, cy=23.5)
POSE = look_at(np.array([0.3, -0.5, 1.4]), np.array([0.4, 1.0, 0.2]))
MOUNT = mount_of_pose(POSE, gravity_known=True, floor_is_zero=True)


def depth_of_floor(camera: Camera = CAMERA, pose: np.ndarray = POSE) -> np.ndarray:
    """z-depth of the plane z = 0 [m], 0 where it is not met."""
    v, u = np.mgrid[: camera.height, : camera.width]
    rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)], axis=-1)
    down = rays @ pose[2, :3]
    return np.where(down < -1e-3, -pose[2, 3] / np.minimum(down, -1e-3), 0.0).astype(np.float32)


def channel(inputs: np.ndarray, name: str) -> np.ndarray:
    return inputs[CHANNELS.index(name)]


def test_a_floor_has_height_zero_and_points_up() -> None:
    depth = depth_of_floor()
    inputs = features(depth, None, CAMERA, MOUNT)
    inner = np.zeros(depth.shape, dtype=bool)
    inner[6:-6, 6:-6] = True
    # Further away neighbouring pixels lie too far apart for a normal.
    inner &= (depth > 0) & (depth < 2)
    assert inner.sum() > 500
    assert np.abs(channel(inputs, "height_over_floor")[inner]).max() < 0.02
    assert channel(inputs, "height_over_camera")[inner] == pytest.approx(-1.4, abs=0.02)
    assert channel(inputs, "normal_up")[inner].min() > 0.99
    assert np.array_equal(channel(inputs, "has_gravity"), np.ones(depth.shape))


def test_what_is_not_known_is_zero() -> None:
    inputs = features(depth_of_floor(), None, CAMERA, Mount())
    for name in ("red", "green", "blue", "has_color", "has_gravity", "has_floor", "height_over_floor"):
        assert not channel(inputs, name).any()
    dark = features(np.zeros((48, 64), np.float32), None, CAMERA, MOUNT)
    for name in ("inverse_depth", "has_depth", "pixels_per_metre", "normal_up", "height_over_floor"):
        assert not channel(dark, name).any()
    assert np.isfinite(dark).all()


def test_the_mirrored_image_has_the_mirrored_inputs() -> None:
    depth = depth_of_floor()
    depth[10:30, 20:28] = 0.8
    color = np.random.default_rng(0).integers(0, 255, (48, 64, 3), dtype=np.uint8)
    plain = features(depth, color, CAMERA, MOUNT)
    assert MOUNT.up is not None
    mirrored = features(
        np.ascontiguousarray(depth[:, ::-1]),
        color[:, ::-1],
        CAMERA,
        Mount(MOUNT.up * np.array([-1.0, 1.0, 1.0]), MOUNT.height),
    )
    turned = mirrored[:, :, ::-1].copy()
    for name in ("normal_right", "ray_right"):
        turned[CHANNELS.index(name)] *= -1
    assert np.abs(turned - plain).max() < 2e-3


@pytest.mark.parametrize("up", [(0, -1, 0), (0.1, -0.9, 0.3), (1, 0, 0), (-1, 0, 0), (0, 0, -1), (0, 0, 1)])
def test_viewing_axes_are_orthogonal_with_the_given_up(up: tuple[float, float, float]) -> None:
    axes = viewing_axes(np.array(up))
    assert np.allclose(axes @ axes.T, np.eye(3), atol=1e-6)
    assert axes[1] == pytest.approx(np.array(up) / np.linalg.norm(up), abs=1e-6)
    # x right, y up, z forward is a left-handed frame.
    assert np.linalg.det(axes) == pytest.approx(-1.0, abs=1e-5)


def test_level_gravity_and_no_gravity_give_the_same_axes() -> None:
    assert np.allclose(viewing_axes(np.array([0.0, -1.0, 0.0])), viewing_axes(None))


def test_the_input_camera_sees_the_same_rays() -> None:
    camera = Camera(width=1280, height=720, fx=900.0, fy=910.0, cx=630.0, cy=371.0)
    small = input_camera(camera)
    assert (small.width, small.height) == (320, 180)
    # The middle of a small pixel is the middle of the 4x4 block.
    u, v = 4 * 17 + 1.5, 4 * 93 + 1.5
    assert (17 - small.cx) / small.fx == pytest.approx((u - camera.cx) / camera.fx)
    assert (93 - small.cy) / small.fy == pytest.approx((v - camera.cy) / camera.fy)
