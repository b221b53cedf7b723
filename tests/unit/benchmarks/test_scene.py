"""The scene experiment's own parts: pooling over rooms, tables, which cases and files it takes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.cad_library import CadModel
from scenewright.schemas.contact_graph import ContactGraphFile, GraphNode
from scenewright.schemas.scene_parts import Relation
from scenewright.stages.segment.panoptic import PanopticFrame, PanopticMask
from scenewright.stages.urdf.scene_penetration import Overlap
from scenewright.stages.urdf.settle_report import BodyMotion, SettleReport

from benchmarks.experiment import Bench, Results, Trial
from benchmarks.experiments.scene import measuring
from benchmarks.experiments.scene.arms import ARMS, INDEPENDENT, MAPS, PERFECT, REAL, RECONSTRUCTED
from benchmarks.experiments.scene.experiment import EXPERIMENT
from benchmarks.experiments.scene.figures_of_merit import FIGURES
from benchmarks.experiments.scene.measuring import Outcome, SceneParameters, loose_by_truth, loose_things, physics_of
from benchmarks.experiments.scene.shown import shown_and_named
from benchmarks.experiments.scene.stand_ins import lacking, off_by, without_styles
from benchmarks.generated_rooms import INDEPENDENT_RECIPES, RoomFolder, recipe_of
from benchmarks.results import figures_of, table

GRAPH = {"edit_distance": 4.0, "wrong_support": 1.0, "missing_detection": 2.0, "wrong_detection": 0.0}


def outcome(agreed: int, objects: int, success: float) -> Outcome:
    cad: dict[str, float | None] = {"true_objects": objects, "detected": objects, "replaced": objects}
    cad |= {"scan2cad_success": success, "translation_error_m_mean": 0.02, "rotation_error_rad_mean": 0.1}
    physics = {"settled_rooms": 1.0, "collisions": 0.0, "settled_rooms_mujoco": 1.0, "loose": float(objects)}
    physics |= dict.fromkeys(("at_rest", "at_rest_both", "colliding", "held"), 0.0)
    return Outcome(GRAPH, {"support": (10, 10, agreed)}, cad, physics=physics)


def bench_in(folder: Path, **parameters: object) -> Bench:
    given = {"maps": folder / "maps", "real": folder / "real"} | parameters
    return Bench(folder / "out", SceneParameters.model_validate(given))


def test_counts_and_objects_are_pooled_over_rooms() -> None:
    rooms = [outcome(10, 30, 1.0), outcome(5, 10, 0.2)]
    assert FIGURES["support_f1"](rooms) == pytest.approx(15 / 20)
    assert FIGURES["contains_f1"](rooms) is None
    assert FIGURES["scan2cad_success"](rooms) == pytest.approx((30 * 1.0 + 10 * 0.2) / 40)


def test_tables_show_what_was_run(tmp_path: Path) -> None:
    records = {
        Trial("ours", PERFECT, "a"): outcome(10, 30, 1.0),
        Trial("ours", PERFECT, "b"): outcome(5, 10, 0.2),
        Trial("best_single", PERFECT, "a"): outcome(10, 30, 1.0),
        Trial("best_single", PERFECT, "b"): outcome(5, 10, 1.0),
    }
    results = Results(EXPERIMENT, bench_in(tmp_path), records)
    found = figures_of(results)["ours/perfect/support_f1"]
    assert (found.value, found.low, found.high, found.cases) == (0.75, 0.5, 1.0, 2)
    text = table(results, figures_of(results))
    assert f"| measure | {EXPERIMENT.arms['best_single']} | ours |" in text
    difference = results.difference("ours", "best_single", PERFECT, "scan2cad_success")
    assert difference is not None
    assert (difference.value, difference.low, difference.high) == pytest.approx((-0.2, -0.8, 0.0))


def test_real_logs_are_a_case_only_where_they_have_run(tmp_path: Path) -> None:
    bench = bench_in(tmp_path)
    assert EXPERIMENT.default_cases and EXPERIMENT.seeds_of
    assert REAL not in EXPERIMENT.default_cases(bench) and EXPERIMENT.seeds_of(bench, REAL) == []
    log = min(measuring.ANNOTATIONS.glob("*.json")).stem
    manifest = tmp_path / "real" / log / "panoptic_map" / "manifest.json"
    manifest.parent.mkdir(parents=True)
    manifest.write_text("{}")
    assert REAL in EXPERIMENT.default_cases(bench) and EXPERIMENT.seeds_of(bench, REAL) == [log]


def test_maps_that_are_missing_are_measured_by_the_mapping_experiment(tmp_path: Path, monkeypatch) -> None:
    asked: list[tuple[Path, list[Trial]]] = []

    def measure_missing(experiment, bench, trials, *, any_code):
        asked.append((bench.out, trials))
        return 3

    monkeypatch.setattr(measuring, "room_for", lambda root, name, parameters: RoomFolder(name, root / name))
    monkeypatch.setattr(measuring, "measure_missing", measure_missing)
    case = MAPS[RECONSTRUCTED]
    with pytest.raises(measuring.StepFailed) as failure:
        measuring.load_room(bench_in(tmp_path), "kitchen-1+0", {(case, arm.map_arm) for arm in ARMS})
    wanted = [Trial(arm, case, "kitchen-1+0") for arm in sorted({arm.map_arm for arm in ARMS})]
    assert asked == [(tmp_path / "maps", wanted)] and failure.value.exit_code == 3


def test_real_logs_begin_with_empty_folders(tmp_path: Path, monkeypatch) -> None:
    """A mesh that an earlier run left would stand in the scene as an obstacle."""
    stale = tmp_path / "kitchen" / ARMS[0].name / "cad_scene" / "meshes" / "book_1.ply"
    stale.parent.mkdir(parents=True)
    stale.write_text("")
    monkeypatch.setattr(measuring, "made", lambda words, out, *further: out)
    monkeypatch.setattr(measuring, "opened", lambda kind, path: kind(path))
    monkeypatch.setattr(measuring, "load_truth", lambda artifact, world_from_log, least: None)
    monkeypatch.setattr(measuring, "overlaps_of", lambda truth, panoptic_map: {})

    def build(*words: object, **inputs: object) -> None:
        assert not stale.exists()
        raise InterruptedError

    monkeypatch.setattr(measuring, "unrecorded", build)
    with pytest.raises(InterruptedError):
        next(measuring.run_real(tmp_path / "kitchen", tmp_path / "kitchen", ARMS))


def test_what_has_to_be_free_and_is_held_is_not_at_rest() -> None:
    stays, leaves = BodyMotion("cup_1", 0.0, 0.0, False), BodyMotion("chair_2", 0.2, 0.0, False)
    report = SettleReport(3.0, (stays, leaves), (), (Overlap("desk_3", "cup_1", "desk_3", "cup_1", 0.009),))
    there = {"cup_1": stays, "chair_2": BodyMotion("chair_2", 0.0, 0.0, False)}
    found = physics_of(report, there, {"": {"cup_1", "chair_2", "desk_3", "lamp_4"}, "_by_truth": {"cup_1", "chair_2"}})
    assert (found["loose"], found["at_rest"], found["at_rest_both"], found["held"]) == (4, 1, 1, 2)
    assert (found["colliding"], found["settled_rooms"], found["unsettled_mujoco"]) == (2, 0, 0)
    of_rooms = outcome(10, 4, 1.0)
    of_rooms.physics.update(found)
    assert FIGURES["at_rest_both_by_truth"]([of_rooms]) == 0.5 and FIGURES["held_by_truth"]([of_rooms]) == 0
    assert FIGURES["at_rest"]([of_rooms]) == 0.25 and FIGURES["colliding"]([of_rooms]) == 0.5


def test_what_is_truly_built_in_need_not_be_free_and_what_is_not_has_to_whatever_it_is_called() -> None:
    def graph(*things: tuple[str, int]) -> ContactGraphFile:
        nodes = [GraphNode(id="scene", instance=0, class_name="scene", node_type="scene")]
        floor = GraphNode(id="floor_9", instance=9, class_name="floor", node_type="layout")
        named = [GraphNode(id=f"{c}_{i}", instance=i, class_name=c, node_type="rigid") for c, i in things]
        links = [Relation(source="floor_9", target=node.id, relation="supports", confidence=1.0) for node in named]
        return ContactGraphFile(nodes=(*nodes, floor, *named), links=tuple(links))

    true = graph(("cabinet", 1), ("chair", 2))
    found = graph(("object", 5), ("fridge", 6), ("object", 7), ("shelf", 8))
    overlaps = {(1, 5): 0.8, (2, 5): 0.3, (2, 6): 0.5, (1, 8): 0.1, (9, 7): 0.9}
    assert loose_things(found) == {"object_5", "object_7"}
    assert loose_by_truth(found, true, overlaps) == {"fridge_6", "object_7"}


def test_arms_that_differ_by_their_map_run_where_there_is_one() -> None:
    assert EXPERIMENT.runs("thesis_on_ours", RECONSTRUCTED) and not EXPERIMENT.runs("thesis_on_ours", PERFECT)
    maps = {arm.name: (arm.map_arm, arm.graph.method, arm.cad.method) for arm in ARMS}
    assert maps["ours_on_thesis"] == ("thesis", "ours", "ours") and maps["thesis_on_ours"] == (
        "ours",
        "thesis",
        "thesis",
    )


def test_a_stand_in_is_as_far_off_as_its_worst_edge_at_the_best_scale() -> None:
    true = np.array([1.0, 2.0, 0.5])
    assert off_by(true, 0.7 * true) == pytest.approx(0.0, abs=1e-12), "one scale"
    worse = off_by(true, true * [1.0, 1.2, 0.9])
    assert worse == pytest.approx(
        min(np.abs(s * np.array([1.0, 1.2, 0.9]) - 1).max() for s in np.linspace(0.8, 1.2, 4001)), abs=1e-3
    )


def model(name: str, style: str | None = None) -> CadModel:
    recipe = {} if style is None else {"style": style}
    plain = {"articulated": False, "mass": 1.0, "states": (), "movable": True, "parts": ("body",), "recipe": recipe}
    return CadModel.model_validate({"id": name, "class_name": name.rsplit("_", 1)[0], **plain})


def test_a_library_without_the_styles_of_a_room_keeps_classes_that_have_no_other() -> None:
    library = [model("chair_0", "slats"), model("chair_1", "shell"), model("cup_0", "mug"), model("bed_0")]
    room = [model("chair_9", "shell"), model("cup_9", "mug"), model("bed_9")]
    left = without_styles(library, room)
    assert [entry.id for entry in left] == ["chair_0", "cup_0", "bed_0"]
    assert [lacking(entry, left) for entry in room] == [True, False, False]


def test_independent_rooms_are_of_other_recipes_and_rescaled(tmp_path: Path, monkeypatch) -> None:
    assert EXPERIMENT.seeds_of
    asked = {}
    for case in (RECONSTRUCTED, INDEPENDENT):
        (seed, *_) = EXPERIMENT.seeds_of(bench_in(tmp_path), case)
        made = []
        monkeypatch.setattr(measuring, "room_for", lambda root, name, parameters, made=made: made.append(parameters))
        with pytest.raises(AttributeError):
            measuring.load_room(bench_in(tmp_path), seed, ())
        asked[case] = recipe_of(seed) in INDEPENDENT_RECIPES, made[0].rescaled
    assert asked == {RECONSTRUCTED: (False, 0.0), INDEPENDENT: (True, measuring.RESCALED)}


def test_a_thing_is_shown_where_a_mask_of_its_class_is_mostly_it() -> None:
    thing, wall = PanopticMask(3, True), PanopticMask(1, False)
    ids = np.zeros((10, 40), dtype=np.int32)
    ids[:, :10], ids[:, 10:20], ids[:, 20:30], ids[0, 30:33], ids[5:, 30:] = 1, 2, 3, 4, 5
    true = PanopticFrame(ids, {1: thing, 2: thing, 3: thing, 4: thing, 5: wall})
    seen = np.zeros_like(ids)
    seen[:, :15], seen[:, 20:26] = 7, 8  # the first with half of the second, of the third a little more than half
    masks = PanopticFrame(seen, {7: thing, 8: thing})
    assert shown_and_named(true, masks, 10, 0.5) == {1: True, 2: False, 3: True}
    assert shown_and_named(true, masks, 10) == {1: True, 2: True, 3: True}, "a third is enough for a thing of a map"
    assert not any(shown_and_named(true, PanopticFrame(seen, {7: PanopticMask(4, True)}), 10).values())
