"""Things that are put down stand level on what is there, and on each other."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest
import trimesh

from benchmarks.training.clutter import BLOCKED, HeightMap, Thing, primitives, put_down


def table(height: float = 0.7) -> HeightMap:
    """A table top of 1 m x 1 m over a floor of 2 m x 2 m, a centimetre a cell."""
    heights = np.zeros((201, 201))
    heights[50:151, 50:151] = height
    return HeightMap(np.array([-1.0, -1.0]), 0.01, heights)


def box(edge: float = 0.2, flat: bool = True) -> Thing:
    mesh = trimesh.creation.box(extents=(edge, edge, edge))
    mesh.apply_translation([0, 0, edge / 2])
    return Thing("box", mesh, flat)


def test_a_box_stands_on_the_table_and_another_on_it() -> None:
    heights, random = table(), np.random.default_rng(0)
    middle = np.zeros(2)
    first = put_down(box(0.4), heights, middle, middle, random)
    assert first is not None and first.bounds[:, 2] == pytest.approx([0.7, 1.1])
    second = put_down(box(0.1), heights, middle, middle, random)
    assert second is not None and second.bounds[0, 2] == pytest.approx(1.1)
    assert heights.height[100, 100] == pytest.approx(1.2)


def test_nothing_stands_on_a_ball_or_over_an_edge() -> None:
    heights, random = table(), np.random.default_rng(0)
    middle = np.zeros(2)
    assert put_down(box(0.4, flat=False), heights, middle, middle, random) is not None
    assert heights.height[100, 100] == BLOCKED
    assert put_down(box(0.1), heights, middle, middle, random) is None
    edge = np.array([0.505, 0.0])  # half over the edge
    assert put_down(box(0.2), table(), edge, edge, random) is None
    outside = np.array([0.99, 0.0])
    assert put_down(box(0.2), table(), outside, outside, random) is None


def test_primitives_stand_on_zero_and_are_named() -> None:
    found = list(islice(primitives(np.random.default_rng(1)), 60))
    assert {thing.class_name for thing in found} == {"box", "object"}
    for thing in found:
        assert thing.mesh.bounds[0, 2] == pytest.approx(0, abs=1e-9)
        assert 0.02 < np.ptp(thing.mesh.bounds, axis=0).max() < 0.5
