"""Object results and room figures of a hand-made room with known errors."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scenewright.schemas.base import as_transform
from scenewright.schemas.cad_scene import CadCandidate, Replacement
from scenewright.stages.evaluate.functional_equivalence import (
    affordance_agreement,
    affordance_of,
    look_of,
    same_relation,
    similar_size,
)
from scenewright.stages.evaluate.model_shapes import PlacedShape
from scenewright.stages.evaluate.replacement_measures import (
    measure_replacements,
    retrieval_rank,
    room_summary,
    with_best_single,
)
from scenewright.stages.evaluate.shape_loading import true_shapes
from scenewright.stages.evaluate.truth import load_truth

from tests.unit.evaluate.handmade import ROOM, Thing, graph_of, make_cad_scene, make_ground_truth, model_pose
from tests.unit.evaluate.shapes import box_model, cupboard

FLOOR, WALL, TABLE, CUP, CHAIR, CABINET, BOTTLE = ROOM


def shape_of(thing: Thing):
    size = np.subtract(thing.high, thing.low)
    if thing.joints:
        shape = cupboard(thing.model_id, tuple(size))
        joint = shape.joints[0].model_copy(update={"name": "door"})
        return replace(shape, joints=(joint,))
    return box_model(thing.model_id, thing.class_name, size, movable=thing.class_name in ("cup", "bottle"))


SHAPES = {thing.model_id: shape_of(thing) for thing in ROOM if thing.model_id}
TRUE = {t.name: PlacedShape(SHAPES[t.model_id], model_pose(t), 1.0, t.joints) for t in ROOM if t.model_id}


@pytest.fixture(scope="module")
def truth(tmp_path_factory):
    artifact = make_ground_truth(tmp_path_factory.mktemp("truth") / "ground_truth")
    return load_truth(artifact, np.eye(4), 40)


def candidate(model_id: str, pose=None, scale=1.0) -> CadCandidate:
    return CadCandidate(
        model_id=model_id,
        scale=scale,
        world_from_model=as_transform(np.eye(4) if pose is None else pose),
        matching_error=0.1,
        alignment_error=0.01,
    )


def results_of(truth, scene, graph, models=SHAPES):
    return {r.name: r for r in measure_replacements(truth, TRUE, scene, graph, models)}


def test_a_perfect_room(tmp_path, truth):
    cad = make_cad_scene(tmp_path / "cad")
    results = results_of(truth, cad.info, cad.graph)
    assert sorted(results) == sorted(TRUE)
    for result in results.values():
        assert result.success and result.functional and result.rank == 1, result.name
    summary = room_summary(list(results.values()))
    for name in ("scan2cad_success", "functional", "class_right", "true_model_first", "joints_found"):
        assert summary[name] == 1.0, name
    assert summary["translation_error_m_mean"] == pytest.approx(0.0)
    assert summary["joint_value_error_revolute_rad_mean"] == pytest.approx(0.1)
    assert summary["collisions"] == 0.0
    json.dumps(summary, allow_nan=False)


def test_missed_objects_are_failures_and_named_apart(tmp_path, truth):
    found = tuple(thing for thing in ROOM if thing not in (CHAIR,))
    cad = make_cad_scene(tmp_path / "cad", found)
    summary = room_summary(list(results_of(truth, cad.info, cad.graph).values()))
    assert summary["scan2cad_success"] == pytest.approx(4 / 5) and summary["scan2cad_success_detected"] == 1.0
    assert summary["functional"] == pytest.approx(4 / 5) and summary["detected"] == 4.0


def test_a_held_out_shape_can_succeed_by_its_extents(tmp_path, truth):
    """Another model of the class, 10 % wider: no rank, but success; a model of another class never succeeds."""
    size = np.subtract(TABLE.high, TABLE.low)
    models = {
        **SHAPES,
        "table_b": box_model("table_b", "table", size * [1.1, 1, 1]),
        "desk_b": box_model("desk_b", "desk", size),
    }
    cad = make_cad_scene(tmp_path / "cad")
    for model_id, right in (("table_b", True), ("desk_b", False)):
        replacements = tuple(
            r.model_copy(update={"chosen": candidate(model_id, model_pose(TABLE))}) if r.node == TABLE.name else r
            for r in cad.info.replacements
        )
        scene = cad.info.model_copy(update={"replacements": replacements})
        result = results_of(truth, scene, cad.graph, models)[TABLE.name]
        assert result.rank is None and result.success is right and result.class_right is right
        assert result.equivalence is not None and result.equivalence.same_class is right


def test_what_each_criterion_of_equivalence_asks(tmp_path, truth):
    cad = make_cad_scene(tmp_path / "cad")
    red = [
        r.model_copy(update={"part_colors": {"body": (20, 20, 200)}}) if r.node == CUP.name else r
        for r in cad.info.replacements
    ]
    moved = graph_of(tuple(replace(t, parent=1) if t is BOTTLE else t for t in ROOM))
    locked = replace(SHAPES["chair_a"], joints=SHAPES["cabinet_a"].joints, parts=SHAPES["cabinet_a"].parts)
    scene = cad.info.model_copy(update={"replacements": tuple(red)})
    results = results_of(truth, scene, moved, {**SHAPES, "chair_a": locked})
    cup, bottle, chair = (results[t.name].equivalence for t in (CUP, BOTTLE, CHAIR))
    assert not cup.appearance and cup.affordance and cup.size_and_shape and cup.class_and_relations
    assert bottle.same_class and not bottle.same_relation and bottle.appearance
    assert not chair.affordance and chair.affordance_share == pytest.approx(4 / 5)
    assert not chair.shape and not chair.functional
    summary = room_summary(list(results.values()))
    assert summary["functional_appearance"] == pytest.approx(4 / 5)
    assert summary["functional_class_and_relations"] == pytest.approx(4 / 5)
    assert summary["functional"] == pytest.approx(2 / 5)


def test_the_scene_before_the_global_check(tmp_path, truth):
    cad = make_cad_scene(tmp_path / "cad")
    pose = model_pose(CUP)
    pose[0, 3] += 0.5
    before = tuple(
        r.model_copy(update={"best_single": candidate("cup_a", pose)}) if r.node == CUP.name else r
        for r in cad.info.replacements
    )
    scene = with_best_single(cad.info.model_copy(update={"replacements": before}))
    results = results_of(truth, scene, cad.graph)
    assert results[CUP.name].alignment.translation == pytest.approx(0.5) and not results[CUP.name].success
    assert results[TABLE.name].success  # no best_single recorded: it keeps its choice


def test_rank_counts_models_in_the_order_in_which_they_fitted():
    record = Replacement(
        node="cup_1",
        decision="cad",
        best_single=candidate("a"),
        chosen=candidate("b"),
        alternatives=(candidate("a"), candidate("c")),
    )
    assert [retrieval_rank(record, model) for model in ("a", "b", "c", "d")] == [1, 2, 3, None]


def test_small_judgements():
    assert similar_size((1.2, 0.8, 1.0), np.array([1.0, 1.0, 1.0]))
    assert not similar_size((1.25, 1.0, 1.0), np.array([1.0, 1.0, 1.0]))
    assert similar_size((1.25, 1.0, 1.0), np.array([0.08, 1.0, 1.0]))  # 2 cm
    cup, table = (affordance_of(PlacedShape(SHAPES[name], np.eye(4))) for name in ("cup_a", "table_a"))
    assert affordance_agreement(cup, table) == pytest.approx(0.8)
    graph = graph_of(ROOM)
    same = {t.name: t.name for t in ROOM}
    assert all(same_relation(graph, graph, same, t.name) for t in ROOM)
    assert not same_relation(graph, graph, {k: v for k, v in same.items() if k != TABLE.name}, CUP.name)
    assert look_of(SHAPES["cup_a"], {"lid": (0, 0, 0)}) == pytest.approx(look_of(SHAPES["cup_a"]))  # no such part


def test_a_truth_without_a_room_has_no_shapes(tmp_path):
    assert true_shapes(make_ground_truth(tmp_path / "truth"), np.eye(4)) == {}  # its room has no URDF
