"""Known curves seen by both eyes come back as curves in space, and doubtful ones say so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.stages.suture.thread.curve import fitted
from scenewright.stages.suture.thread.reconstruct import reconstruct_thread

from tests.unit.suture.thread_cases import RIG, distances, helix, length_of, line, masks_of


def test_a_straight_line_in_space():
    truth = line((-0.03, -0.05, 0.28), (0.02, 0.05, 0.34))
    curve = reconstruct_thread(*masks_of(truth), RIG, start=truth[0])
    assert curve.status == "ok", curve.remarks
    assert distances(curve.points, line((-0.03, -0.05, 0.28), (0.02, 0.05, 0.34))).max() < 0.001
    assert curve.length_m == pytest.approx(length_of(truth), rel=0.01)
    assert np.linalg.norm(curve.points[0] - truth[0]) < 0.001


def test_an_open_circle_in_space():
    angle = np.linspace(0.3, 2 * np.pi - 0.3, 600)
    truth = np.stack([0.03 * np.cos(angle), 0.03 * np.sin(angle), 0.3 + 0.01 * np.cos(angle)], axis=1)
    curve = reconstruct_thread(*masks_of(truth), RIG, start=truth[0])
    error = distances(curve.points, truth)
    assert error.mean() < 0.001 and np.quantile(error, 0.95) < 0.003
    assert curve.length_m == pytest.approx(length_of(truth), rel=0.03)


def test_a_helix_whose_picture_crosses_itself_is_gone_through_in_order():
    truth = helix()
    curve = reconstruct_thread(*masks_of(truth), RIG, start=truth[0])
    error = distances(curve.points, truth)
    assert error.mean() < 0.0015 and np.quantile(error, 0.95) < 0.005
    assert curve.length_m == pytest.approx(length_of(truth), rel=0.06)
    shares = np.linspace(0.0, 1.0, 9)
    there = curve.points[np.round(shares * (len(curve.points) - 1)).astype(int)]
    assert np.linalg.norm(there - truth[np.round(shares * (len(truth) - 1)).astype(int)], axis=1).max() < 0.012


def test_the_curve_begins_at_the_start_whichever_end_that_is():
    truth = line((-0.03, -0.05, 0.28), (0.02, 0.05, 0.34))
    masks = masks_of(truth)
    for end in (truth[0], truth[-1]):
        assert np.linalg.norm(reconstruct_thread(*masks, RIG, start=end).points[0] - end) < 0.002
    free = reconstruct_thread(*masks, RIG)
    assert free.length_m == pytest.approx(length_of(truth), rel=0.02)


def test_a_thread_along_the_rows_is_unsure():
    truth = line((-0.04, 0.0, 0.28), (0.04, 0.0, 0.34))
    curve = reconstruct_thread(*masks_of(truth), RIG, start=truth[0])
    assert curve.status == "unsure"
    assert any("rows" in remark for remark in curve.remarks)
    assert np.median(curve.standard_deviation) > 0.002


def test_a_gap_is_bridged_and_less_sure_than_the_rest():
    angle = np.linspace(-1.2, 1.2, 500)
    truth = np.stack([0.05 * np.cos(angle) - 0.03, 0.05 * np.sin(angle), 0.3 + 0.02 * np.sin(angle)], axis=1)
    masks = masks_of(truth)
    for mask in masks:
        mask[225:285] = False
    curve = reconstruct_thread(*masks, RIG, start=truth[0])
    assert curve.status == "unsure" and any("gaps" in remark for remark in curve.remarks)
    assert distances(curve.points, truth).max() < 0.004
    rows = RIG.left(curve.points)[:, 1]
    hidden = (rows > 240) & (rows < 270)
    elsewhere = (rows < 200) | (rows > 310)
    assert curve.standard_deviation[hidden].mean() > 1.5 * curve.standard_deviation[elsewhere].mean()


def test_what_only_one_eye_sees_is_left_out():
    truth = line((-0.03, -0.05, 0.28), (0.02, 0.05, 0.34))
    left, right = masks_of(truth)
    right[300:] = False
    curve = reconstruct_thread(left, right, RIG, start=truth[0])
    assert curve.status == "unsure" and any("right eye misses" in remark for remark in curve.remarks)
    assert distances(curve.points, truth).max() < 0.002
    assert curve.length_m < 0.9 * length_of(truth)


def test_no_curve_is_made_of_nothing():
    truth = line((-0.03, -0.05, 0.28), (0.02, 0.05, 0.34))
    left, right = masks_of(truth)
    nothing = np.zeros_like(left)
    for masks, word in (((nothing, right), "left eye sees no"), ((left, nothing), "right eye sees no")):
        curve = reconstruct_thread(*masks, RIG)
        assert curve.status == "none" and word in curve.remarks[0]
        assert len(curve.points) == 0 and curve.length_m == 0.0
    away = reconstruct_thread(left, right, RIG, start=np.array([0.1, 0.08, 0.3]))
    assert away.status == "none" and "near the start" in away.remarks[0]


def test_bad_input_is_said():
    left, right = masks_of(line((-0.03, -0.05, 0.28), (0.02, 0.05, 0.34)))
    with pytest.raises(BadInput, match="right thread mask"):
        reconstruct_thread(left, right[:-1], RIG)
    with pytest.raises(BadInput, match="left thread mask"):
        reconstruct_thread(left.astype(np.uint8), right, RIG)
    with pytest.raises(BadInput, match="baseline"):
        reconstruct_thread(left, right, replace(RIG, baseline=0.0))
    with pytest.raises(BadInput, match="start"):
        reconstruct_thread(left, right, RIG, start=np.array([0.0, 0.0, -0.3]))


def test_the_spline_goes_through_a_parabola_and_knows_how_sure_it_is():
    random = np.random.default_rng(2)
    places = np.sort(random.uniform(0.0, 100.0, 400))
    truth = 0.01 * (places - 40.0) ** 2
    inside = []
    for _ in range(12):
        found = fitted(places, truth + random.normal(0.0, 0.5, 400), np.full(400, 0.5), 100.0, 10.0, 0.02)
        at = np.linspace(5.0, 95.0, 40)
        inside.append(np.abs(found.spline(at) - 0.01 * (at - 40.0) ** 2) < 2.0 * found.deviation(at))
    assert 0.88 < np.mean(inside) <= 1.0


def test_outliers_lose_their_weight_and_a_hole_is_uncertain():
    places = np.concatenate([np.linspace(0.0, 40.0, 80), np.linspace(60.0, 100.0, 80)])
    values = 0.5 * places
    values[::20] += 30.0
    found = fitted(places, values, np.full(160, 0.3), 100.0, 8.0, 0.01, scale=2.5)
    assert np.abs(found.spline(places) - 0.5 * places).max() < 0.5
    assert found.deviation(np.array([50.0]))[0] > 2.0 * found.deviation(np.array([20.0]))[0]
