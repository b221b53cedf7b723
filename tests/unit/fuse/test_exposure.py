"""One wall in frames of different exposure: the map has the colours of one of them."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.fuse.exposure import KEPT, Exposure, projected, seen_again
from scenewright.stages.fuse.parameters import FuseParameters
from scenewright.stages.fuse.stage import new_mapper

CAMERA = Camera(width=80, height=60, fx=70.0, fy=70.0, cx=39.5, cy=29.5)
DEPTH = np.full((60, 80), 1.5, np.float32)
WALL = np.array([120.0, 90.0, 60.0])


def frame(gain) -> np.ndarray:
    return np.tile(np.rint(WALL * gain).astype(np.uint8), (60, 80, 1))


def fused(gains, **options):
    mapper = new_mapper(FuseParameters(**options), load_vocabulary())
    for gain in gains:
        mapper.add_frame(CAMERA, DEPTH, frame(np.array(gain)), np.eye(4))
    _, color = seen_again(mapper.blocks, CAMERA, DEPTH, frame(np.ones(3)), np.eye(4), mapper.truncation_distance)
    return mapper, np.median(color, axis=0)


def test_a_darker_and_a_bluer_frame_do_not_change_the_colour():
    changes = [(1, 1, 1), (0.6, 0.6, 0.6), (0.7, 0.8, 1.2), (0.5, 0.6, 0.7)]
    mapper, color = fused(changes)
    assert color == pytest.approx(WALL, rel=0.04)
    assert mapper.exposure.change == pytest.approx(KEPT * np.log(changes[-1]), abs=0.04)
    assert np.abs(fused(changes, exposure=False)[1] / WALL - 1).max() > 0.1


@pytest.mark.parametrize("merging", ["thesis", "separate"])
def test_rivals_take_colours_as_they_come(merging):
    assert fused([(1, 1, 1)], merging=merging)[0].exposure is None


def test_an_even_exposure_leaves_every_byte():
    mapper, _ = fused([(1, 1, 1)])
    image = frame(np.full(3, 1.01))
    taken = mapper.exposure.corrected(mapper.blocks, CAMERA, DEPTH, image, np.eye(4), mapper.truncation_distance)
    assert taken is image


def test_what_nobody_saw_before_has_the_last_change():
    mapper, _ = fused([(1, 1, 1)])
    away = np.diag([-1.0, 1.0, -1.0, 1.0])
    exposure = Exposure(np.full(3, np.log(2.0)))
    image = frame(np.ones(3))
    taken = exposure.corrected(mapper.blocks, CAMERA, DEPTH, image, away, mapper.truncation_distance)
    assert taken[0, 0] == pytest.approx(WALL / 2, abs=1)


def test_points_land_in_the_pixels_that_show_them():
    right = 2.0 * (79.4 - CAMERA.cx) / CAMERA.fx
    points = np.array([[0.0, 0.0, 2.0], [right, 0.0, 2.0], [right + 0.01, 0.0, 2.0], [0.0, 0.0, -1.0]])
    rows, columns, depth = projected(points, CAMERA, np.eye(4))
    assert rows.tolist() == [30, 30, -1, -1] and columns.tolist() == [40, 79, -1, -1]
    assert depth.tolist() == [2.0, 2.0, 2.0, -1.0]
