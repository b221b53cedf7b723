"""One answer of a network's runs on the whole frame and on tiles of it."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError
from scenewright.stages.segment.networks.decoding import Found
from scenewright.stages.segment.networks.tiles import Run, grid_windows, one_answer
from scenewright.stages.segment.parameters import SegmentParameters
from scenewright.stages.segment.same_things import BoxedMask, groups_of, mean_mask, not_nested

SHAPE = (480, 640)
CUP, CHAIR = 41, 56
WINDOWS = grid_windows(640, 480, 2)
RUNS = [Run(window, (320 / max(window[2] - window[0], 1)) ** 2, k == 0) for k, window in enumerate(WINDOWS)]


def rectangle(x: int, y: int, wide: int, high: int) -> np.ndarray:
    mask = np.zeros(SHAPE, dtype=bool)
    mask[y : y + high, x : x + wide] = True
    return mask


def answer(*found: tuple[int, np.ndarray, int, float], threshold: float = 0.3) -> list[tuple[int, float, int]]:
    """Class, score and pixels of what is left."""
    told = [(run, Found(mask, number, score)) for run, mask, number, score in found]
    things = one_answer(told, RUNS, SHAPE, score_threshold=threshold)
    return [(thing.number, round(thing.score, 3), int(thing.mask.sum())) for thing in things]


def test_tiles_have_six_tenths_of_a_side_and_cover_the_frame() -> None:
    assert WINDOWS == [(0, 0, 640, 480), (0, 0, 384, 288), (256, 0, 640, 288), (0, 192, 384, 480), (256, 192, 640, 480)]
    assert grid_windows(640, 480, 0) == grid_windows(640, 480, 1) == [(0, 0, 640, 480)]
    three = grid_windows(641, 479, 3)
    cover = np.zeros((479, 641), dtype=int)
    for x0, y0, x1, y1 in three[1:]:
        cover[y0:y1, x0:x1] += 1
    assert len(three) == 10 and cover.min() == 1 and three[-1][2:] == (641, 479)


def test_a_small_thing_needs_one_run_and_a_medium_one_the_mean_of_those_that_see_it() -> None:
    small, medium = rectangle(100, 100, 20, 20), rectangle(100, 100, 80, 80)
    assert answer((1, small, CUP, 0.4)) == [(CUP, 0.4, 400)], "the whole frame does not see it"
    assert answer((1, medium, CUP, 0.5)) == [], "the whole frame sees it and is silent"
    assert answer((1, medium, CUP, 0.5), (0, medium, CUP, 0.3)) == [(CUP, 0.4, 6400)]
    assert answer((0, medium, CUP, 0.7)) == [(CUP, 0.35, 6400)], "the tile sees it and is silent"


def test_a_tile_is_not_asked_about_what_is_large_in_it_or_cut_off_by_it() -> None:
    large, across = rectangle(10, 10, 200, 200), rectangle(240, 100, 160, 60)
    assert answer((0, large, CHAIR, 0.4)) == [(CHAIR, 0.4, 40000)]
    assert answer((0, across, CHAIR, 0.4)) == [(CHAIR, 0.4, 9600)]
    cut = rectangle(240, 100, 144, 60)
    assert answer((1, cut, CHAIR, 0.9), (0, across, CHAIR, 0.4)) == [(CHAIR, 0.4, 9600)]


def test_classes_of_one_thing_are_weighed_and_of_equals_the_first_number_leads() -> None:
    mask = rectangle(100, 100, 20, 20)
    assert answer((0, mask, CHAIR, 0.5), (1, mask, CUP, 0.8))[0][:2] == (CUP, 0.4)
    assert answer((0, mask, CHAIR, 0.5), (1, mask, CUP, 0.5), threshold=0.2)[0][:2] == (CUP, 0.25)
    assert answer((0, mask, CHAIR, 0.5), (0, mask, CUP, 0.5))[0][:2] == (CUP, 0.5)


def test_of_nested_masks_of_a_class_the_weaker_goes() -> None:
    chair, back = rectangle(10, 10, 200, 200), rectangle(10, 10, 200, 90)
    assert answer((0, chair, CHAIR, 0.6), (0, back, CHAIR, 0.5)) == [(CHAIR, 0.6, 40000)]
    assert answer((0, chair, CHAIR, 0.5), (0, back, CHAIR, 0.6)) == [(CHAIR, 0.6, 18000)]
    assert len(answer((0, chair, CHAIR, 0.6), (0, back, CUP, 0.5))) == 2
    assert answer((0, chair, CHAIR, 0.6), (0, rectangle(500, 10, 100, 100), CHAIR, 0.6))[1][2] == 10000


def test_masks_without_a_pixel_count_for_nothing() -> None:
    assert answer((0, np.zeros(SHAPE, dtype=bool), CHAIR, 0.9)) == [] and answer() == []


def test_grouping_does_not_hang_on_the_order_of_equal_scores() -> None:
    masks = [BoxedMask(rectangle(x, 10, 60, 60)) for x in (10, 20, 200, 30)]
    assert groups_of(masks, [0.5, 0.5, 0.5, 0.5]) == [[0, 1], [2], [3]]
    assert groups_of(masks, [0.5, 0.6, 0.5, 0.5]) == [[1, 0, 3], [2]]
    assert not_nested(masks, [0.5] * 4, [1] * 4) == [0, 2, 3]


@pytest.mark.parametrize(
    ("scores", "left", "right"), [((0.6, 0.3), 10, 70), ((0.3, 0.6), 20, 80), ((0.1, 0.1), 10, 80)]
)
def test_the_mean_mask_has_half_of_the_scores(scores: tuple[float, float], left: int, right: int) -> None:
    mean = mean_mask([BoxedMask(rectangle(x, 10, 60, 60)) for x in (10, 20)], scores)
    assert mean.box == (10, 70, left, right)


def test_one_tile_is_refused_as_is_a_switch() -> None:
    for value in (1, True, 5, -1):
        with pytest.raises(ValidationError, match="tiles"):
            SegmentParameters(tiles=value)
    assert [SegmentParameters(tiles=value).tiles for value in (None, 0, 2)] == [None, 0, 2]
