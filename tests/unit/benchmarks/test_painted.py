"""Maps against a painted surface: what is counted of things and names, and the masks that such a surface makes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scenewright.schemas.sequence import Sequence
from scenewright.stages.truth.parameters import SupportsParameters
from scenewright.stages.truth.supports import run

from benchmarks.experiments.painted.experiment import OUTLINES, PAINTED, halved
from benchmarks.experiments.painted.judging import judge_map
from benchmarks.experiments.painted.masks import write_masks
from tests.unit.benchmarks.test_real_truth import line_of_points, made, room
from tests.unit.truth.test_supports import BY_BOXES, context, sequence, written

__all__ = ["sequence"]
TABLE, CHAIR, CUP, HIDDEN = (line_of_points(x) for x in (0.0, 1.0, 2.0, 3.0))
TRUTH = {1: ("table", TABLE), 2: ("chair", CHAIR), 3: ("cup", CUP), 4: ("chair", HIDDEN)}


def test_things_and_names_are_counted():
    """A table found under its name, a chair called a box, half a cup twice, and a right name where none counts."""
    truth = room(TRUTH, frozenset({4}))
    judged = judge_map(
        truth,
        made(
            {
                11: ("table", TABLE),
                12: ("box", CHAIR),
                13: ("cup", CUP[:24]),
                14: ("cup", CUP[24:44]),
                15: ("chair", HIDDEN),
                16: ("lamp", line_of_points(9.0)),
            }
        ),
    )
    assert (judged.large, judged.found, judged.named) == (2, 2, 1)
    assert (judged.things, judged.matched, judged.false) == (3, 2, 2)
    assert (judged.names, judged.false_names) == (5, 2), (
        "the box, and the lesser half of the cup; nobody knows the lamp"
    )
    assert judged.overlap == 2.0
    assert judged.quality == pytest.approx(2 / (2 + 0.5 * (1 + 2)))


def test_what_the_truth_says_nothing_of_counts_for_nothing():
    """An entity that goes on where nobody painted is as good as one that ends there."""
    beyond = np.concatenate([TABLE, line_of_points(0.2, 50)])
    truth = room({**TRUTH, 0: ("object", line_of_points(0.2, 50))})
    assert judge_map(truth, made({11: ("table", beyond)})).overlap == 1.0


def test_masks_hold_what_lies_at_each_pixel_of_every_frame(sequence: Sequence, tmp_path: Path):
    truth = run(
        written(tmp_path, BY_BOXES), sequence, parameters=SupportsParameters(), context=context(tmp_path / "truth")
    )
    assert write_masks(truth, sequence, tmp_path / "masks") == 4
    for index in range(4):
        values = np.unique(np.asarray(Image.open(tmp_path / "masks" / f"{index:06d}.png")))
        told = json.loads((tmp_path / "masks" / f"{index:06d}.json").read_text())
        assert {1, 2, 3} == set(values.tolist()) - {0}
        assert told == {"1": {"class": "floor"}, "2": {"class": "table"}, "3": {"class": "tray"}}


def test_the_painted_logs_are_found():
    assert PAINTED == ("kitchen", "office")


def test_halves_share_no_frame_and_lose_none(tmp_path: Path):
    halves = [json.loads(path.read_text()) for path in halved(OUTLINES / "kitchen.json", tmp_path)]
    times = [[frame["time"] for frame in half["frames"]] for half in halves]
    whole = json.loads((OUTLINES / "kitchen.json").read_text())
    assert not set(times[0]) & set(times[1])
    assert sorted(times[0] + times[1]) == [frame["time"] for frame in whole["frames"]]
    assert halves[0]["made"] == whole["made"]
