"""Colour of a second camera, resampled into the depth camera."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest.color_registration import color_in_depth_camera, filled_depth
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.geometry.transforms import transform_from

from tests.real_data import real_data
from tests.unit.ingest.running import ingest

DEPTH_CAMERA = Camera(width=160, height=120, fx=146.0, fy=146.0, cx=80.0, cy=60.0)
COLOR_CAMERA = Camera(width=160, height=120, fx=131.0, fy=131.0, cx=81.0, cy=59.0)
COLOR_FROM_DEPTH = transform_from(np.eye(3), np.array([-0.03, 0.0, 0.0]))


def _texture(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Colour of a point of a wall, by its coordinates in the depth camera [m]."""
    channels = [128 + 100 * np.sin(6 * x), 128 + 100 * np.sin(5 * y), 128 + 100 * np.cos(4 * (x + y))]
    return np.stack(channels, axis=-1).astype(np.uint8)


def _wall_seen_by(camera: Camera, offset: float, distance: float) -> np.ndarray:
    v, u = np.mgrid[: camera.height, : camera.width]
    return _texture((u - camera.cx) / camera.fx * distance + offset, (v - camera.cy) / camera.fy * distance)


def test_every_depth_pixel_gets_the_colour_of_its_point() -> None:
    for distance in (0.8, 2.0, 4.0):
        depth = np.full((120, 160), distance, np.float32)
        depth[40:44, 60:70] = 0  # a hole, seen all the same
        color = _wall_seen_by(COLOR_CAMERA, 0.03, distance)
        seen = color_in_depth_camera(color, depth, DEPTH_CAMERA, COLOR_CAMERA, COLOR_FROM_DEPTH)
        expected = _wall_seen_by(DEPTH_CAMERA, 0.0, distance)
        inner = (slice(8, -8), slice(16, -16))
        assert np.abs(seen[inner].astype(int) - expected[inner]).max() <= 6
        assert np.abs(color[inner].astype(int) - expected[inner]).max() > 20  # it was off before


def test_holes_take_the_nearest_depth() -> None:
    depth = np.zeros((5, 9), np.float32)
    depth[:, 0], depth[:, 8] = 1.0, 3.0
    np.testing.assert_array_equal(filled_depth(depth)[2], [1, 1, 1, 1, filled_depth(depth)[2, 4], 3, 3, 3, 3])
    assert (filled_depth(np.zeros((3, 3), np.float32)) == 1).all()


def test_edges_of_the_kitchen_picture_move_onto_its_depth_edges(tmp_path: Path) -> None:
    scores = {}
    for register in (False, True):
        sequence = ingest(
            real_data("7scenes_redkitchen"),
            tmp_path / str(register),
            every=100,
            gravity="none",
            register_color=register,
        )
        assert sequence.info.color_depth_registered is register
        with FrameReader(sequence.path("frames.mcap")) as reader:
            scores[register] = np.mean([_edge_agreement(frame.color, frame.depth) for frame in reader.frames()])
    assert scores[True] > scores[False] + 0.4


def _edge_agreement(color: np.ndarray, depth: np.ndarray) -> float:
    """Mean of the normalised colour gradient at depth jumps."""
    grey = cv2.GaussianBlur(cv2.cvtColor(color, cv2.COLOR_RGB2GRAY), (0, 0), 1.5).astype(np.float32)
    gradient = np.hypot(cv2.Sobel(grey, cv2.CV_32F, 1, 0), cv2.Sobel(grey, cv2.CV_32F, 0, 1))
    gradient = (gradient - gradient.mean()) / gradient.std()
    kernel = np.ones((3, 3), np.uint8)
    near, far = cv2.erode(depth, kernel), cv2.dilate(depth, kernel)
    return float(gradient[(near > 0) & (far - near > 0.06 * depth)].mean())
