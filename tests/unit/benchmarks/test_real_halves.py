"""Two halves of a log: which things are one, what they agree in; figures and lines out of records."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scenewright.stages.kit.geometry.transforms import transform_from_yaw
from scenewright.stages.truth import read_support_annotation

from benchmarks.board.real import ANNOTATED, ANNOTATIONS, LOGS
from benchmarks.board.real.annotated import WORLDS, moved
from benchmarks.board.real.figures import annotated_figures, counts, halves_figures, line, truth_figures
from benchmarks.board.real.halves import Scene, Thing, agreement, matches
from benchmarks.board.real.logs import Log
from benchmarks.board.real.records import (
    AnnotatedRecord,
    Edges,
    Half,
    HalvesRecord,
    Settling,
    Tally,
    Things,
    TruthRecord,
)


def thing(instance: int, name: str, x: float, parent: int | str = "floor", model: str = "") -> Thing:
    return Thing(instance, name, (x, 0.0, 0.0), parent, "supports", model)


def scene(things: tuple[Thing, ...], surfaces: dict[int, tuple[float, int]]) -> Scene:
    """Things whose surface is points 1 cm apart, from x on."""
    vertices = [np.column_stack([x + 0.01 * np.arange(n), np.zeros(n), np.zeros(n)]) for x, n in surfaces.values()]
    owner = [np.full(n, k) for k, (_, n) in surfaces.items()]
    return Scene(things, np.concatenate(vertices), np.concatenate(owner))


FIRST = scene(
    (thing(1, "table", 0, model="t1"), thing(2, "cup", 5, parent=1), thing(3, "object", 9)),
    {1: (0.0, 100), 2: (5.0, 20), 3: (9.0, 50), 0: (20.0, 30)},
)


def test_a_scene_agrees_with_itself_under_other_numbers() -> None:
    things = (thing(8, "table", 0, model="t1"), thing(7, "cup", 5, parent=8), thing(6, "object", 9))
    other = scene(things, {8: (0.0, 100), 7: (5.0, 20), 6: (9.0, 50), 0: (20.0, 30)})
    assert matches(FIRST, other) == {1: 8, 2: 7, 3: 6}
    told = agreement("room", FIRST, other)
    assert (told.matched, told.same_parent, told.with_name, told.same_class) == (3, 3, 2, 2)
    assert (told.with_model, told.same_model, told.apart_m) == (1, 1, (0.0, 0.0, 0.0))


def test_halves_of_a_thing_are_not_it_and_what_hangs_elsewhere_or_has_another_model_does_not_agree() -> None:
    things = (thing(1, "sofa", 0.1, model="t2"), thing(2, "cup", 5, parent="floor"), thing(4, "object", 9))
    other = scene(things, {1: (0.0, 90), 2: (5.0, 20), 4: (9.0, 8)})
    assert matches(FIRST, other) == {1: 1, 2: 2}, "of the third less than half is there"
    told = agreement("room", FIRST, other)
    assert (told.matched, told.same_parent, told.with_name, told.same_class) == (2, 1, 2, 1)
    assert (told.with_model, told.same_model, told.apart_m) == (1, 0, (0.1, 0.0))


def test_halves_are_even_and_odd_of_the_frames_that_are_used() -> None:
    even, odd = Log("room", Path("log"), every=4, start=2).halves()
    assert (even.every, even.start, odd.every, odd.start) == (8, 2, 8, 6)


def test_figures_of_halves_are_pooled_and_stand_beside_what_is_explained() -> None:
    half = Half(frames=10, things=4, surface=100, by_things=20, by_layout=60)
    record = HalvesRecord("room", half, half, 3, (0.01, 0.02, 0.03), 2, 2, 1, 0, 0, {"fuse": 60.0})
    nothing = HalvesRecord("hall", Half(surface=100), Half(surface=100), failed="fuse ended with 3")
    figures = halves_figures([record, nothing])
    assert figures["matched"] == pytest.approx(0.75) and figures["apart_mm"] == pytest.approx(20)
    assert figures["same_parent"] == pytest.approx(2 / 3) and figures["same_model"] is None
    assert figures["explained"] == pytest.approx(0.4) and figures["things_a_half"] == pytest.approx(2)
    assert figures["failed"] == 1 and figures["minutes"] == pytest.approx(1)
    assert "3 things are in both (4 and 4), 20 mm apart" in line(record) and "80 %" in line(record)
    assert "STOPPED: fuse ended with 3" in line(nothing)


def test_figures_of_annotated_logs_are_pooled_counts() -> None:
    large = Tally(true=10, found=6, named=4, stand=5, off_mm=(10.0, 20.0, 30.0))
    record = AnnotatedRecord(
        "kitchen",
        True,
        Things(large, Tally(true=4, found=1), 3),
        Edges(20, 16, 9),
        Settling(10, 9, 2, 0, 1),
        100,
        {"fuse": 30.0, "cad": 60.0},
    )
    bare = AnnotatedRecord("dining", False, settling=Settling(10, 10, 0, 0, 0))
    figures = annotated_figures([record, record, bare])
    assert figures["support_f1"] == pytest.approx(0.5) and figures["large_found"] == pytest.approx(0.6)
    assert figures["small_named"] == pytest.approx(0.0) and figures["stay"] == pytest.approx(28 / 30)
    assert figures["false_things"] == 6 and figures["large_off_mm"] == pytest.approx(20)
    expected = (
        "kitchen: of the room's large things 6 of 10 are found, 4 named right, 5 stand where they stood, 20 mm off; "
        "3 false; 1.5 minutes of one processor"
    )
    assert line(record) == expected
    assert annotated_figures([])["support_f1"] is None
    told = counts(record)
    assert (told["large_found"], told["large_off_mm"], told["supports_agreed"], told["false"]) == (6, 20, 9, 3)
    assert (
        told["settling_stay"] == 9 and told["annotated"] == 1 and "settling" not in counts(AnnotatedRecord("x", True))
    )


def test_of_a_truth_without_supports_no_f1_is_told() -> None:
    record = TruthRecord("room", Things(Tally(true=2, found=1), Tally(), 0), Edges(0, 3, 0))
    assert truth_figures(record)["support_f1"] is None
    assert counts(replace(record, unknown_words=("astrolabe", "orrery")))["unknown_words"] == 2
    assert truth_figures(replace(record, supports=Edges(4, 4, 2)))["support_f1"] == pytest.approx(0.5)


@pytest.mark.parametrize("name", ANNOTATED)
def test_every_annotation_knows_its_log_and_its_world(name: str) -> None:
    matrix = np.array(json.loads(WORLDS.read_text())[name])
    assert name in LOGS and np.allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-6)


def test_an_annotation_moves_into_another_world() -> None:
    told = read_support_annotation(ANNOTATIONS / "kitchen.json")
    motion = transform_from_yaw(np.pi / 2, np.array([1.0, 0.0, 0.5]))
    before, after = (next(n.find.box for n in each.nodes if n.name == "table") for each in (told, moved(told, motion)))
    assert before is not None and after is not None
    x, y, z = before.center
    assert after.center == pytest.approx((1 - y, x, z + 0.5))
    assert after.yaw_degrees == pytest.approx(before.yaw_degrees + 90) and after.size == before.size
