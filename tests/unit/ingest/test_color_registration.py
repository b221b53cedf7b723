"""Colour carried into the depth camera: exact for a plane, across focal lengths and a baseline."""

from __future__ import annotations

import numpy as np

from schemas.scene_parts import Camera
from stages.ingest.color_registration import color_in_depth_camera
from stages.kit.geometry.transforms import transform_from

DEPTH = Camera(width=80, height=60, fx=70, fy=70, cx=40, cy=30)
COLOR = Camera(width=80, height=60, fx=60, fy=60, cx=41, cy=30)
COLOR_FROM_DEPTH = transform_from(np.eye(3), np.array([-0.03, 0.0, 0.0]))


def picture_of_wall(distance: float) -> np.ndarray:
    """What the colour camera sees of a wall whose red is a ramp in the depth camera's x [m]."""
    u = np.arange(COLOR.width)
    x = (u - COLOR.cx) / COLOR.fx * distance + 0.03
    row = np.clip(128 + 100 * x, 0, 255)
    return np.repeat(np.stack([row] * 3, axis=-1)[None], COLOR.height, axis=0).astype(np.uint8)


def test_a_wall_gets_its_own_colour() -> None:
    for distance in (0.8, 1.6):
        depth = np.full((60, 80), distance, dtype=np.float32)
        depth[20:30, 20:30] = 0  # a hole takes the colour of its neighbourhood's depth
        seen = color_in_depth_camera(picture_of_wall(distance), depth, DEPTH, COLOR, COLOR_FROM_DEPTH)
        x = (np.arange(DEPTH.width) - DEPTH.cx) / DEPTH.fx * distance
        inner = slice(8, 72)
        assert np.abs(seen[:, inner, 0] - (128 + 100 * x)[None, inner]).max() < 2.5


def test_without_any_depth_there_is_still_a_picture() -> None:
    color = picture_of_wall(1.0)
    seen = color_in_depth_camera(color, np.zeros((60, 80), np.float32), DEPTH, COLOR, COLOR_FROM_DEPTH)
    assert seen.shape == color.shape and seen.any()
