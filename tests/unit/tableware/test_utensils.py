"""Bars, outlines, tines and circles against what was drawn."""

from types import SimpleNamespace

import numpy as np
import pytest
from scenewright.stages.tableware.vision.bar_search import bar_candidates
from scenewright.stages.tableware.vision.dish_reading import dishes_of
from scenewright.stages.tableware.vision.rim_finding import Rim, overlapping
from scenewright.stages.tableware.vision.rim_fitting import RAYS, SoughtLip, _circle_shift, fit_circle
from scenewright.stages.tableware.vision.stack_reading import read_stacks
from scenewright.stages.tableware.vision.tines import tine_difference
from scenewright.stages.tableware.vision.utensil_finding import search_bars
from scenewright.stages.tableware.vision.utensil_kind import fork_chance
from scenewright.stages.tableware.vision.utensil_reading import SeenUtensil, as_detection
from scenewright.stages.tableware.world.dish_shapes import utensil_parts
from scenewright.stages.tableware.world.items import STANDARD

SCALE = 771.0


def drawn(kind, u, v, angle, size=240):
    """Return (size, size) bool: a utensil seen from above, its head along `angle` in the image."""
    columns, rows = np.meshgrid(np.arange(size), np.arange(size))
    x = ((columns - u) * np.cos(angle) + (rows - v) * np.sin(angle)) / SCALE
    y = ((columns - u) * np.sin(angle) - (rows - v) * np.cos(angle)) / SCALE
    mask = np.zeros((size, size), dtype=bool)
    for stations, low, high in utensil_parts(STANDARD[kind], kind == "fork"):
        within = (x >= stations[0]) & (x <= stations[-1])
        mask |= within & (y >= np.interp(x, stations, low)) & (y <= np.interp(x, stations, high))
    return mask


def test_two_crossing_utensils_are_found_where_they_lie():
    map_ = np.where(drawn("fork", 110, 125, 0.4) | drawn("spoon", 130, 115, -1.0), 1, -1).astype(np.int8)
    bars = sorted(search_bars(map_, SCALE, 3, STANDARD), key=lambda bar: bar.u)
    assert len(bars) == 2
    for bar, (u, v, angle) in zip(bars, ((110, 125, 0.4), (130, 115, -1.0)), strict=True):
        assert (bar.u, bar.v) == pytest.approx((u, v), abs=5.0)
        assert abs(np.angle(np.exp(2j * (bar.angle - angle)))) / 2 < 0.04


def test_a_utensil_that_is_half_unknown_is_no_longer_than_it_is():
    map_ = np.where(drawn("spoon", 120, 120, 0.0), 1, -1).astype(np.int8)
    map_[:, 120:170] = 0
    (bar,) = search_bars(map_, SCALE, 1, STANDARD)
    assert (bar.u, bar.v) == pytest.approx((120, 120), abs=4.0)
    assert bar.visible == pytest.approx(0.6, abs=0.15)


def test_a_patch_is_no_bar_and_nothing_has_no_candidates():
    map_ = np.full((200, 200), -1, dtype=np.int8)
    map_[60:140, 50:150] = 1
    assert search_bars(map_, SCALE, 3, STANDARD) == []
    nothing = np.zeros(0, dtype=np.int64)
    assert len(bar_candidates(nothing, nothing, 123.0, 4)) == 0


def test_tines_are_seen_on_a_fork_alone():
    heights = {
        kind: np.where(drawn(kind, 120, 120, 0.3), 0.009, 0.006).astype(np.float32) for kind in ("fork", "spoon")
    }
    fork = tine_difference(heights["fork"], (120.0, 120.0, 0.3), SCALE, STANDARD["fork"])
    spoon = tine_difference(heights["spoon"], (120.0, 120.0, 0.3), SCALE, STANDARD["fork"])
    assert fork > 0.0015 > 0.0005 > abs(spoon)
    assert np.isnan(
        tine_difference(np.full((240, 240), -1.0, np.float32), (120.0, 120.0, 0.3), SCALE, STANDARD["fork"])
    )


def test_an_unseen_head_leaves_the_kind_in_doubt():
    nan = float("nan")
    assert fork_chance((0.0, nan, nan), "table") == pytest.approx(0.5)
    assert fork_chance((0.1, 2.8, 0.9), "table") > 0.99
    assert fork_chance((-0.1, 0.1, 0.0), "dish") < 0.01


def flat(shape=(240, 240)):
    """Return a map of heights over a bare table, as far as reading a utensil goes."""
    return SimpleNamespace(
        smooth=np.zeros(shape, np.float32),
        raw=np.zeros(shape, np.float32),
        valid=np.ones(shape, bool),
        scale=lambda z: SCALE,
        world=lambda u, v, z: ((u - 120.0) / SCALE, -(v - 120.0) / SCALE),
    )


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({}, None),
        ({"chance": 0.6}, "fork or spoon"),
        ({"depth_share": 0.1}, "no depth"),
        ({"visible": 0.5}, "partly hidden"),
    ],
)
def test_a_utensils_doubts_have_reasons(change, reason):
    (bar,) = search_bars(np.where(drawn("spoon", 120, 120, 0.3), 1, -1).astype(np.int8), SCALE, 1, STANDARD)
    if "visible" in change:
        bar = type(bar)(bar.kind, bar.u, bar.v, bar.angle, bar.score, change["visible"], bar.poses)
    known = {"chance": 0.99, "relief": 0.003, "depth_share": 1.0}
    seen = SeenUtensil(bar, **(known | {name: value for name, value in change.items() if name in known}))
    one = as_detection(seen, flat(), 0.0, None, STANDARD)
    assert one.unsure == (() if reason is None else (reason,))
    assert (one.confidence > 0.99) == (reason != "fork or spoon")
    assert one.yaw == pytest.approx(-bar.angle)


def test_a_circle_is_shifted_as_least_squares_say():
    random = np.random.default_rng(1)
    edge = random.normal(0.0, 2.0, len(RAYS))
    kept = random.random(len(RAYS)) < 0.7
    system = np.column_stack([RAYS, np.ones(len(RAYS))])
    expected = np.linalg.lstsq(system[kept], edge[kept], rcond=None)[0]
    assert _circle_shift(edge, kept, RAYS) == pytest.approx(expected, abs=1e-6)


def test_a_lip_is_found_from_beside_it():
    columns, rows = np.meshgrid(np.arange(200), np.arange(200))
    distance = np.hypot(columns - 103.3, rows - 97.6)
    radius = 640.0 / (0.83 - 0.08) * 0.045
    ring = np.where(np.abs(distance - radius + 1.5) < 1.5, 0.08, 0.0).astype(np.float32)
    sought = SoughtLip(0.045, 0.066, 0.17, 640.0, 0.83)
    u, v, lip, support, fitted = fit_circle(ring, 99.0, 101.0, sought, RAYS)
    assert (u, v) == pytest.approx((103.3, 97.6), abs=0.3)
    assert lip == pytest.approx(0.08, abs=0.004) and support > 0.9 and fitted == pytest.approx(radius, abs=2.5)
    assert fit_circle(np.zeros_like(ring), 99.0, 101.0, sought, RAYS)[3] == 0.0


def heights_for_doubt(white=0.0):
    color = np.full((240, 240, 3), 120, np.uint8)
    color[120:, : int(240 * white)] = 255
    return SimpleNamespace(
        color=color, scale=lambda z: SCALE, pixel=lambda x, y, z: (120.0 + SCALE * x, 120.0 - SCALE * y)
    )


@pytest.mark.parametrize(
    ("lip", "depth_share", "white", "crossed", "reason"),
    [
        (0.080, 1.0, 0.0, False, None),
        (0.070, 1.0, 0.0, False, "a stack of unknown height"),
        (0.080, 0.2, 0.0, False, "no depth"),
        (0.080, 1.0, 0.6, False, "glare"),
        (0.080, 1.0, 0.0, True, "overlapping rims"),
    ],
)
def test_a_dishs_doubts_have_reasons_and_cost_confidence(lip, depth_share, white, crossed, reason):
    rim = Rim("cup", 0.0, 0.0, lip, 0.9, depth_share)
    (stack,) = read_stacks([rim], STANDARD)
    (cup,) = dishes_of(stack, heights_for_doubt(white), {id(rim)} if crossed else set(), 0)
    assert cup.unsure == (() if reason is None else (reason,))
    assert cup.confidence == pytest.approx(1.0) if reason is None else cup.confidence < 0.9


def test_rims_that_cross_at_one_height_cannot_both_be_there():
    cup = [Rim("cup", x, 0.0, 0.08, 0.9, 1.0) for x in (0.0, 0.06, 0.2)]
    assert overlapping(cup, STANDARD) == {0, 1}
    high = Rim("cup", 0.06, 0.0, 0.12, 0.9, 1.0)
    assert overlapping([cup[0], high], STANDARD) == set()
