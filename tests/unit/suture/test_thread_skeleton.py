"""Thinning, stretches, and going straight on at crossings."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.stages.suture.thread.path import followed
from scenewright.stages.suture.thread.skeleton import stretches, thinned
from scenewright.stages.suture.thread.strands import strands


def drawn(*lines: list[tuple[int, int]], size: tuple[int, int] = (120, 160), thickness: int = 3) -> np.ndarray:
    image = np.zeros(size, dtype=np.uint8)
    for line in lines:
        cv2.polylines(image, [np.array(line, dtype=np.int32)], False, 255, thickness)
    return image > 0


def pieces(mask: np.ndarray) -> int:
    return cv2.connectedComponents(mask.astype(np.uint8), connectivity=8)[0] - 1


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.2, 0.6))
def test_thinning_keeps_pieces_and_takes_only_away(seed, share):
    noise = np.random.default_rng(seed).random((24, 30)).astype(np.float32)
    mask = cv2.GaussianBlur(noise, (0, 0), 1.2) > np.quantile(cv2.GaussianBlur(noise, (0, 0), 1.2), 1 - share)
    skeleton = thinned(mask)
    assert not (skeleton & ~mask).any()
    assert pieces(skeleton) == pieces(mask)
    assert np.array_equal(thinned(skeleton), skeleton)


def test_a_thick_line_becomes_one_stretch_on_its_middle():
    mask = drawn([(10, 20), (140, 90)], thickness=5)
    (stretch,) = stretches(mask)
    assert (stretch.first, stretch.last) == (-1, -1)
    direction = np.array([130.0, 70.0]) / np.hypot(130.0, 70.0)
    across = np.array([direction[1], -direction[0]])
    off = (stretch.points - [10.0, 20.0]) @ across
    middle = ((np.argwhere(mask)[:, ::-1] - [10.0, 20.0]) @ across).mean()
    assert np.abs(off[4:-4] - middle).max() < 0.35 and abs(off.mean() - middle) < 0.2


def test_an_empty_mask_has_no_stretch_and_a_ring_is_one():
    assert stretches(np.zeros((20, 20), dtype=bool)) == []
    ring = np.zeros((80, 80), dtype=np.uint8)
    cv2.circle(ring, (40, 40), 25, 255, 2)
    (stretch,) = stretches(ring > 0)
    assert stretch.length == pytest.approx(2 * np.pi * 25, rel=0.05)


@pytest.mark.parametrize("angle", [30.0, 60.0, 90.0])
def test_threads_go_straight_on_at_a_crossing(angle):
    turn = np.radians(angle)
    far = (int(80 + 60 * np.cos(turn)), int(60 + 60 * np.sin(turn)))
    near = (int(80 - 60 * np.cos(turn)), int(60 - 60 * np.sin(turn)))
    found = strands(stretches(drawn([(20, 60), (140, 60)], [near, far])))
    assert len(found) == 2
    for strand in found:
        chord = np.linalg.norm(strand.points[-1] - strand.points[0])
        assert chord > 0.97 * strand.length > 90.0


def test_a_loop_is_gone_through_and_not_cut_off():
    angle = np.linspace(-0.5 * np.pi, 1.5 * np.pi, 60)
    loop = np.stack([80 + 25 * np.cos(angle), 55 - 25 * np.sin(angle)], axis=1).round().astype(int)
    line = [(15, 85), *map(tuple, loop.tolist()), (145, 75)]
    (strand,) = strands(stretches(drawn(line, thickness=2)))
    assert strand.length > 2 * np.pi * 25 + 100


def test_gaps_are_bridged_along_tangents_and_other_threads_are_left():
    mask = drawn([(10, 60), (150, 60)], [(75, 10), (75, 40)], thickness=2)
    mask[:, 60:90] &= np.arange(120)[:, None] < 50
    path = followed(strands(stretches(mask)), np.array([10.0, 60.0]))
    assert path is not None
    assert path.gaps == pytest.approx((31.0,), abs=3.0)
    assert path.points[-1] == pytest.approx([150.0, 60.0], abs=2.0)
    assert np.abs(path.points[:, 1] - 60.0).max() < 1.5
    assert path.left_over == pytest.approx(30.0, abs=4.0)
    assert not path.seen.all()


def test_a_thread_that_turns_back_on_itself_is_followed():
    # it comes from the left, runs to the tip on the right, and goes back down
    mask = drawn([(10, 40), (80, 60), (110, 60), (80, 60), (20, 110)], thickness=3)
    path = followed(strands(stretches(mask)), np.array([10.0, 40.0]))
    assert path is not None
    assert path.points[-1] == pytest.approx([20.0, 110.0], abs=3.0)
    assert path.points[:, 0].max() > 105.0


def test_nothing_begins_far_from_the_start():
    assert followed(strands(stretches(drawn([(10, 20), (40, 20)]))), np.array([150.0, 110.0])) is None
    assert followed([], None) is None
