"""Errors that last: the same from one region of views, at the rates that are asked for, alike as asked."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pytest import MonkeyPatch
from scenewright.stages.kit.acting import errors
from scenewright.stages.kit.acting.errors import (
    Alike,
    Luck,
    SegmenterErrors,
    SegmenterRates,
    segmenter_rates,
    view_region,
)
from scenewright.stages.kit.acting.spoiled_masks import MaskView, spoiled

from benchmarks.segmenter_rates import Seen, rates_file, rates_of

CLASSES = ("cup", "chair", "book")
ALWAYS = Alike(1.0, 1.0)
NONE = SegmenterRates(0, 0, 0, 0, 0, 2.4, ALWAYS, ALWAYS, {"cup": {"book": 2}}, {"chair": 1})
HEIGHT, WIDTH = 60, 80
THINGS = {1: "cup", 2: "chair"}
FREE = 4


def scene(frame: int = 0, camera: tuple[float, float, float] = (0.0, -3.0, 1.0)) -> tuple[np.ndarray, MaskView]:
    """Two things side by side before a wall; the points lie in a plane that is two metres wide."""
    ids = np.full((HEIGHT, WIDTH), 3, np.int32)
    ids[20:40, 20:40], ids[20:40, 40:60] = 1, 2
    x, z = np.meshgrid(np.linspace(-1, 1, WIDTH), np.linspace(1.5, 0, HEIGHT))
    points = np.stack([x, np.zeros_like(x), z], axis=2)
    return ids, MaskView(points, np.ones(ids.shape, bool), ids == 3, np.array(camera), frame)


def told(rates: SegmenterRates, seed: int = 0, **where: object) -> dict[int, str]:
    """Classes of the masks of things."""
    ids, view = scene(**where)  # type: ignore[arg-type]
    return spoiled(ids, THINGS, view, SegmenterErrors(rates, Luck(seed), CLASSES), FREE)[1]


def test_without_errors_only_edges_move() -> None:
    ids, view = scene()
    found, names = spoiled(ids, THINGS, view, SegmenterErrors(NONE, Luck(0), CLASSES), FREE)
    assert names == THINGS and 0 < np.mean(found != ids) < 0.05
    exact, _ = spoiled(ids, THINGS, view, SegmenterErrors(NONE.times(0), Luck(0), CLASSES), FREE)
    assert np.array_equal(exact, ids)


def test_an_error_that_lasts_is_there_in_every_frame_and_from_everywhere() -> None:
    rates = replace(NONE, missed=0.5)
    for seed in range(8):
        seen = [set(told(rates, seed, frame=k, camera=(3.0 * (-1) ** k, -2.0, 1.0))) for k in range(4)]
        assert all(masks == seen[0] for masks in seen)
    assert len({frozenset(told(rates, seed)) for seed in range(20)}) > 2, "another draw in another room"


def test_a_thing_that_is_missed_merged_cut_or_misnamed() -> None:
    assert not told(replace(NONE, missed=1.0))
    assert len(told(replace(NONE, merged=1.0))) == 1, "the first takes the other's place; the last one has no neighbour"
    halves = told(replace(NONE, split=1.0))
    assert set(halves) == {1, 2, 5, 6} and halves[5] == halves[1]
    named = told(replace(NONE, wrong_name=1.0))
    assert named[1] == "book", "a cup is taken for what cups are taken for"
    assert named[2] == "book", "a chair, of which nothing is known, for what others are"
    uncounted = SegmenterErrors(replace(NONE, wrong_name=1.0, confusion={}), Luck(0), CLASSES)
    assert {uncounted.name_of(k, "cup", 0) for k in range(40)} == {"chair", "book"}, "for any that is asked for"
    assert SegmenterErrors(replace(NONE, wrong_name=1.0), Luck(0), ()).name_of(1, "cup", 0) == "cup"


def test_false_masks_lie_on_the_wall_in_one_place() -> None:
    rates = replace(NONE, false_masks=2.0)
    first, second = (told(rates, 3, frame=k) for k in range(2))
    false = set(first) - set(THINGS)
    assert false and false == set(second) - set(THINGS)
    assert all(first[k] == "chair" for k in false)
    again = [told(rates, seed) for seed in range(60)]
    assert np.mean([len(set(found) - set(THINGS)) for found in again]) == pytest.approx(2.0, abs=0.5)


def test_two_sights_are_as_alike_as_asked() -> None:
    alike, luck, rate = Alike(0.6, 0.3), Luck(1), 0.4

    def wrong(thing: int, region: int, frame: int) -> bool:
        return luck.happens(rate, *alike.key(luck, "missed", thing, region, frame))

    things = range(6000)
    first = np.array([wrong(k, 0, 0) for k in things], float)
    assert first.mean() == pytest.approx(rate, abs=0.02)
    same = np.corrcoef(first, [wrong(k, 0, 1) for k in things])[0, 1]
    other = np.corrcoef(first, [wrong(k, 1, 1) for k in things])[0, 1]
    assert (same, other) == (pytest.approx(0.6, abs=0.04), pytest.approx(0.3, abs=0.04))


def test_regions_are_eighths_of_a_turn_near_or_far() -> None:
    points = np.zeros((4, 3))
    turns = {view_region(3 * np.array([np.cos(a), np.sin(a), 0]), points) for a in np.linspace(0, 2 * np.pi, 64)}
    assert len(turns) == 8 and all(near == 0 for _, near in turns)
    assert view_region(np.array([0.5, 0.1, 0.0]), points)[1] == 1


@pytest.mark.parametrize("name", ["thesis", "detector", "network"])
def test_measured_rates_are_shares(name: str) -> None:
    rates = segmenter_rates(name)
    assert all(0 <= value <= 1 for value in (rates.missed, rates.merged, rates.split, rates.wrong_name))
    assert all(0 <= a.other_region <= a.same_region <= 1 for a in (rates.missed_alike, rates.name_alike))


def test_the_program_that_measures_rates_writes_the_file_that_is_read(tmp_path: Path, monkeypatch: MonkeyPatch) -> None:
    seen = [
        Seen("cup_1", "cup", (k % 2, 0), outcome, named)
        for k, (outcome, named) in enumerate(
            [("found", "cup"), ("found", "bowl"), ("missed", None), ("merged", None)] * 3
        )
    ]
    made = rates_of(seen, [0, 1], Counter({"plant": 1}))
    file = tmp_path / "segmenters.toml"
    file.write_text(rates_file({"detector": made}, 1))
    monkeypatch.setattr(errors, "RATES_FILE", file)
    rates = segmenter_rates("detector")
    assert (rates.missed, rates.wrong_name, rates.false_masks) == (0.25, 0.5, 0.5)
    assert rates.merged == pytest.approx(0.25 / 0.75), "of what was not missed"
    assert rates.confusion == {"cup": {"bowl": 3}} and rates.false_names == {"plant": 1}
    assert segmenter_rates("thesis").missed == pytest.approx(2 / 100.5, rel=0.01)
