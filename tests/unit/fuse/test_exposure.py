"""One wall in frames of different exposure: the map has the colours of one of them."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.fuse.exposure import KEPT, Exposure, seen_again
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
    _, color = seen_again(mapper.blocks, CAMERA, DEPTH, frame(np.ones(3)), np.eye(4), 4.0)
    return mapper, np.median(color, axis=0)


def test_a_darker_and_a_bluer_frame_do_not_change_the_colour():
    changes = [(1, 1, 1), (0.6, 0.6, 0.6), (0.7, 0.8, 1.2), (0.5, 0.6, 0.7)]
    mapper, color = fused(changes)
    assert color == pytest.approx(WALL, rel=0.04)
    assert mapper.exposure.changes[""] == pytest.approx(KEPT * np.log(changes[-1]), abs=0.04)
    assert np.abs(fused(changes, exposure=False)[1] / WALL - 1).max() > 0.1


@pytest.mark.parametrize("merging", ["thesis", "separate"])
def test_rivals_take_colours_as_they_come(merging):
    assert fused([(1, 1, 1)], merging=merging)[0].exposure is None


def test_an_even_exposure_leaves_every_byte():
    mapper, _ = fused([(1, 1, 1)])
    image = frame(np.full(3, 1.01))
    taken = mapper.exposure.corrected(mapper.blocks, CAMERA, "", DEPTH, image, np.eye(4), 4.0)
    assert taken is image


def test_what_nobody_saw_before_has_the_last_change_of_its_own_camera():
    mapper, _ = fused([(1, 1, 1)])
    away = np.diag([-1.0, 1.0, -1.0, 1.0])
    exposure = Exposure()
    exposure.changes["left"] = np.full(3, np.log(2.0))
    image = frame(np.ones(3))
    assert exposure.corrected(mapper.blocks, CAMERA, "right", DEPTH, image, away, 4.0) is image
    taken = exposure.corrected(mapper.blocks, CAMERA, "left", DEPTH, image, away, 4.0)
    assert taken[0, 0] == pytest.approx(WALL / 2, abs=1)


def test_pixels_tell_of_the_surface_that_they_see():
    mapper, _ = fused([(1, 1, 1)])
    painted = frame(np.ones(3))
    painted[:, :40] = 7
    now, before = seen_again(mapper.blocks, CAMERA, DEPTH, painted, np.eye(4), 4.0)
    assert len(now) == 70
    assert np.count_nonzero(now[:, 0] == 7) == 35
    assert before == pytest.approx(np.tile(WALL, (70, 1)), abs=1)


@pytest.mark.parametrize("change", ["nearer", "unknown", "too far"])
def test_what_stands_before_the_wall_tells_nothing(change):
    mapper, _ = fused([(1, 1, 1)])
    depth = {"nearer": DEPTH - 0.2, "unknown": DEPTH * 0, "too far": DEPTH}[change]
    far = 1.0 if change == "too far" else 4.0
    assert len(seen_again(mapper.blocks, CAMERA, depth, frame(np.ones(3)), np.eye(4), far)[0]) == 0
