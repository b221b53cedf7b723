"""Rates of real segmenters and errors of real depth are written in the form that pages take them in."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from benchmarks import depth_errors, segmenter_rates
from benchmarks.figures.content import load_experiment
from benchmarks.results import write_figures
from benchmarks.segmenter_rates import Seen, rates_of

RESULTS = Path(__file__).resolve().parents[3] / "docs" / "results"


def test_rates_are_written_as_they_are_published(tmp_path: Path) -> None:
    seen = [
        Seen("kitchen/cup", "cup", (0, 0), "found", "cup"),
        Seen("kitchen/cup", "cup", (0, 1), "missed", None),
        Seen("kitchen/desk", "desk", (0, 0), "found", "table"),
        Seen("kitchen/lamp", "lamp", (0, 0), "merged", None),
    ]
    rates = rates_of(seen, [1, 0], Counter({"object": 1})) | {"missed_of_all_classes": 0.25}
    write_figures(tmp_path, "segmenter_rates", segmenter_rates.ABOUT, segmenter_rates.figures_of({"detector": rates}))
    made = load_experiment(tmp_path / "segmenter_rates.json", {})
    assert made.figure("detector/real frames/missed").value == 25 and made.figure("all/rule/found_iou").value == 0.3
    assert made.figure("detector/real frames/wrong_name").value == 50
    published = load_experiment(RESULTS / "segmenter_rates.json", {})
    assert set(made.figures) <= set(published.figures)


def test_depth_errors_are_written_as_they_are_published(tmp_path: Path) -> None:
    told = {"bias_per_metre": 0.0124, "bending_per_square_metre": None, "registration_pixels": [1.0, 2.0], "frames": 7}
    write_figures(tmp_path, "depth_errors", depth_errors.ABOUT, depth_errors.figures_of({"kitchen": told}))
    made = load_experiment(tmp_path / "depth_errors.json", {})
    assert made.figure("depth/kitchen/bias").value == pytest.approx(1.24) and len(made.figures) == 3
    assert set(made.figures) <= set(load_experiment(RESULTS / "depth_errors.json", {}).figures)
