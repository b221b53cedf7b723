"""Training frames as they are made: shapes, prints, sensors."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.segment.training.network.shards import HEIGHT, WIDTH

from benchmarks.training.data import papered
from benchmarks.training.sensors import coarse_depth, lose_things
from benchmarks.training.shapes import MAKERS, SMALL_MAKERS, Maker


@pytest.mark.parametrize("maker", {(m.class_name, m.make.__name__): m for m in (*MAKERS, *SMALL_MAKERS)}.values())
def test_every_shape_is_of_a_class_and_can_be_drawn(maker: Maker) -> None:
    assert load_vocabulary().by_name(maker.class_name)
    for seed in range(5):
        mesh = maker.make(np.random.default_rng(seed))
        assert np.isfinite(mesh.vertices).all() and 0.01 < np.ptp(mesh.bounds, axis=0).max() < 7.0
        again = maker.make(np.random.default_rng(seed))
        assert np.array_equal(mesh.vertices, again.vertices)


def test_prints_change_colours_of_things_alone() -> None:
    instance = np.zeros((HEIGHT, WIDTH), np.int32)
    instance[50:150, 60:200] = 4
    color = np.full((HEIGHT, WIDTH, 3), 120, np.uint8)
    printed = papered(color, instance, np.random.default_rng(2))
    assert np.array_equal(printed[instance == 0], color[instance == 0]) and printed[instance == 4].std() > 5


def test_other_sensors_lose_depth_and_never_invent_much() -> None:
    true = np.full((HEIGHT, WIDTH), 2.0, np.float32)
    true[:, 160:] = 1.2
    instance = np.where(true < 1.5, 2, 1)
    for seed in range(12):
        random = np.random.default_rng(seed)
        seen = coarse_depth(true, random)
        assert seen.shape == true.shape and np.all((seen == 0) | ((seen > 1.1) & (seen < 2.1)))
        lost = lose_things(true, instance, random)
        assert np.all((lost == 0) | (lost == true))
