"""Errors that last: the same from one region of views, at the rates that are asked for, alike as asked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenewright.stages.kit.rendering.segmenter_errors import Alike, Luck, view_region
from scenewright.stages.segment.backends.ground_truth.lasting import LastingErrors, LastingRates, View, measured_rates
from scenewright.stages.segment.panoptic import PanopticFrame, PanopticMask

CLASSES = {"cup": 1, "chair": 2, "book": 3}
WALL = 9
ALWAYS = Alike(1.0, 1.0)
NONE = LastingRates(0, 0, 0, 0, 0, ALWAYS, ALWAYS, {"cup": {"book": 2}}, {"chair": 1})
HEIGHT, WIDTH = 60, 80


def scene(frame: int = 0, camera: tuple[float, float, float] = (0.0, -3.0, 1.0)) -> tuple[PanopticFrame, View]:
    """Two things side by side before a wall; the points lie in a plane that is two metres wide."""
    ids = np.full((HEIGHT, WIDTH), 3, np.int32)
    ids[20:40, 20:40], ids[20:40, 40:60] = 1, 2
    x, z = np.meshgrid(np.linspace(-1, 1, WIDTH), np.linspace(1.5, 0, HEIGHT))
    points = np.stack([x, np.zeros_like(x), z], axis=2)
    masks = {1: PanopticMask(1, True), 2: PanopticMask(2, True), 3: PanopticMask(WALL, False)}
    return PanopticFrame(ids, masks), View(points, np.ones(ids.shape, bool), np.array(camera), frame)


def spoiled(rates: LastingRates, seed: int = 0, **where: object) -> PanopticFrame:
    true, view = scene(**where)  # type: ignore[arg-type]
    return LastingErrors(rates, seed, CLASSES, 4).spoil(true, view)


def test_without_errors_only_edges_move() -> None:
    found = spoiled(NONE)
    assert found.masks == scene()[0].masks and np.mean(found.ids != scene()[0].ids) < 0.05


def test_an_error_that_lasts_is_there_in_every_frame_and_from_everywhere() -> None:
    rates = replace(NONE, missed=0.5)
    for seed in range(8):
        seen = [set(spoiled(rates, seed, frame=k, camera=(3.0 * (-1) ** k, -2.0, 1.0)).masks) for k in range(4)]
        assert all(masks == seen[0] for masks in seen)
    assert len({frozenset(spoiled(rates, seed).masks) for seed in range(20)}) > 2, "another draw in another room"


def test_a_thing_that_is_missed_merged_cut_or_misnamed() -> None:
    assert set(spoiled(replace(NONE, missed=1.0)).masks) == {3}
    merged = spoiled(replace(NONE, merged=1.0))
    assert len(merged.masks) == 2, "the first takes the other's place; the last one left has no neighbour"
    halves = spoiled(replace(NONE, split=1.0))
    assert {1, 2, 5, 6} <= set(halves.masks) and halves.masks[5] == halves.masks[1]
    named = spoiled(replace(NONE, wrong_name=1.0))
    assert named.masks[1].class_id == CLASSES["book"], "a cup is taken for what cups are taken for"
    assert named.masks[2].class_id == CLASSES["book"], "a chair, of which nothing is known, for what others are"
    assert named.masks[3].class_id == WALL


def test_false_masks_lie_on_the_wall_in_one_place() -> None:
    rates = replace(NONE, false_masks=2.0)
    first, second = (spoiled(rates, 3, frame=k) for k in range(2))
    false = set(first.masks) - {1, 2, 3}
    assert false and false == set(second.masks) - {1, 2, 3}
    assert all(first.masks[k].class_id == CLASSES["chair"] for k in false)
    again = [spoiled(rates, seed) for seed in range(60)]
    assert np.mean([len(set(found.masks) - {1, 2, 3}) for found in again]) == pytest.approx(2.0, abs=0.5)


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


@pytest.mark.parametrize("name", ["detector", "network"])
def test_measured_rates_are_shares(name: str) -> None:
    rates = measured_rates(name)
    assert all(0 <= value <= 1 for value in (rates.missed, rates.merged, rates.split, rates.wrong_name))
    assert all(0 <= a.other_region <= a.same_region <= 1 for a in (rates.missed_alike, rates.name_alike))
