"""The figures of `make bench-disparity`, on maps whose scores are plain."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.disparity.__main__ import scores, table
from benchmarks.disparity.arms import CLASSICAL
from stages.kit.stereo.disparity_map import DisparityMap


def test_scores_are_the_closed_form() -> None:
    truth = np.array([[10.0, 10.0, 10.0, 10.0, np.nan]], np.float32)
    found = np.array([[10.5, 13.0, np.nan, 9.0, 40.0]], np.float32)
    figures = scores(DisparityMap(found, np.ones_like(found)), truth)
    assert figures["coverage"] == pytest.approx(75) and figures["bad2"] == pytest.approx(100 / 3)
    assert figures["bad2_all"] == pytest.approx(50)  # one wrong, one hole, of four
    assert figures["epe"] == pytest.approx(1.5) and figures["median"] == pytest.approx(1.0)


def test_cases_that_were_not_run_have_no_table() -> None:
    metrics = {f"{arm}/motorcycle/{measure}": 1.0 for arm in CLASSICAL for measure in (
        "bad2", "bad2_all", "epe", "median", "coverage", "cpu_seconds"
    )}  # fmt: skip
    text = table(metrics | {"pairs/motorcycle/count": 1.0})
    assert "### motorcycle (1 pair)" in text and "rooms" not in text
